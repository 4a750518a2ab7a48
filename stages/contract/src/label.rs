//! Labels: what a point belongs to.

/// What kind of thing a point belongs to; the numbers are those of `labels/N.kind.npy`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum PointKind {
    /// Stands still.
    Fixed = 0,
    /// A robot's link, its foot too.
    Link = 1,
    /// Attachment, effector or carried part.
    Attachment = 2,
    /// Floor.
    Floor = 3,
    /// In doubt, dropped or never seen: counts as fixed for planning.
    Uncertain = 255,
}

impl PointKind {
    /// All of them.
    pub const ALL: [Self; 5] =
        [Self::Fixed, Self::Link, Self::Attachment, Self::Floor, Self::Uncertain];

    /// The one of that number; `None` for a number that is none's.
    #[inline]
    #[must_use]
    pub fn of(number: u8) -> Option<Self> {
        match number {
            0 => Some(Self::Fixed),
            1 => Some(Self::Link),
            2 => Some(Self::Attachment),
            3 => Some(Self::Floor),
            255 => Some(Self::Uncertain),
            _ => None,
        }
    }
}

/// The label of one point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Label {
    /// What kind of thing.
    pub kind: PointKind,
    /// Index into the result's robots, −1 for none.
    pub robot: i16,
    /// Index into that robot's links, −1 for none.
    pub link: i16,
}

impl Label {
    /// Stands still.
    pub const FIXED: Self = Self { kind: PointKind::Fixed, robot: -1, link: -1 };
    /// Floor.
    pub const FLOOR: Self = Self { kind: PointKind::Floor, robot: -1, link: -1 };
    /// In doubt.
    pub const UNCERTAIN: Self = Self { kind: PointKind::Uncertain, robot: -1, link: -1 };

    /// Whether it belongs to a robot, or to what hangs on one.
    #[inline]
    #[must_use]
    pub fn moves(&self) -> bool {
        matches!(self.kind, PointKind::Link | PointKind::Attachment)
    }
}
