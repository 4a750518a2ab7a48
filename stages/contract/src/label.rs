//! Labels of points: fixed, part of a robot, attachment, floor or uncertain.

use serde::{Deserialize, Serialize};

/// What a point belongs to; the numbers are those of `labels/N.kind.npy`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[repr(u8)]
pub enum PointKind {
    /// An object that does not move.
    Fixed = 0,
    /// A link of a robot, its foot included.
    Link = 1,
    /// An object that moves with a robot and is not in its model: attachment, tool or carried part.
    Attachment = 2,
    /// Floor.
    Floor = 3,
    /// Unknown: in doubt, dropped, or never measured. Path planning treats it as fixed.
    Uncertain = 255,
}

impl PointKind {
    /// All kinds.
    pub const ALL: [Self; 5] =
        [Self::Fixed, Self::Link, Self::Attachment, Self::Floor, Self::Uncertain];

    /// The kind with this number; `None` where no kind has it.
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
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Label {
    /// What the point belongs to.
    pub kind: PointKind,
    /// Index into the robots of the result; −1 for none.
    pub robot: i16,
    /// Index into the links of that robot; −1 for none.
    pub link: i16,
}

impl Label {
    /// The label of fixed points.
    pub const FIXED: Self = Self { kind: PointKind::Fixed, robot: -1, link: -1 };
    /// The label of floor points.
    pub const FLOOR: Self = Self { kind: PointKind::Floor, robot: -1, link: -1 };
    /// The label of uncertain points.
    pub const UNCERTAIN: Self = Self { kind: PointKind::Uncertain, robot: -1, link: -1 };

    /// Whether the point moves with a robot: a link, or something attached to one.
    #[inline]
    #[must_use]
    pub fn moves(&self) -> bool {
        matches!(self.kind, PointKind::Link | PointKind::Attachment)
    }
}
