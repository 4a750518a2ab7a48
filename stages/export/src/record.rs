//! What LAS records hold: kinds in, classes out; coordinates in, whole steps out; the settings of a file.

use contract::{Error, Kind, PointKind};
use geometry::Aabb;

/// Kind, LAS class (2 is the standard's ground, 64 and up are the user's) and name.
pub(crate) const CLASSES: [(PointKind, u8, &str); 5] = [
    (PointKind::Floor, 2, "floor"),
    (PointKind::Fixed, 64, "fixed"),
    (PointKind::Link, 65, "robot link"),
    (PointKind::Attachment, 66, "attachment, effector or carried part"),
    (PointKind::Uncertain, 69, "uncertain, counts as fixed"),
];

/// The LAS class of a kind of point.
#[must_use]
pub fn class_of(kind: PointKind) -> u8 {
    CLASSES.iter().find(|entry| entry.0 == kind).map_or(1, |entry| entry.1)
}

/// Scale and offset of LAS coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantum {
    /// Metres of one step on each axis.
    pub scale: [f64; 3],
    /// Metres of step zero.
    pub offset: [f64; 3],
}

impl Quantum {
    /// Steps of 0.1 mm about the middle of `bounds`, rounded to whole kilometres where the middle is farther than one
    /// from zero, so that tiles of one plant share it.
    #[must_use]
    pub fn around(bounds: &Aabb) -> Self {
        let middle = bounds.center();
        let offset = [0, 1, 2].map(|i| {
            let at: f64 = middle[i];
            if at.is_finite() { (at / 1000.0).trunc() * 1000.0 } else { 0.0 }
        });
        Self { scale: [1e-4; 3], offset }
    }
}

/// A variable length record to pass on, such as the reference system of an input.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RawVlr {
    /// Who defined it.
    pub user_id: String,
    /// Its number there.
    pub record_id: u16,
    /// In words.
    pub description: String,
    /// Its content.
    pub data: Vec<u8>,
}

/// What a LAS file holds and how.
#[derive(Debug, Clone, PartialEq)]
pub struct LasSettings {
    /// Scale and offset.
    pub quantum: Quantum,
    /// With colour (format 7) or without (format 6).
    pub with_color: bool,
    /// With classes and the extra fields `RobotId` and `LinkId`.
    pub with_labels: bool,
    /// With the extra field `BodyId`.
    pub with_bodies: bool,
    /// Format 0 instead: 20 bytes a point with place, intensity and source, and nothing else of all this.
    pub short: bool,
    /// Compressed (LAZ).
    pub compress: bool,
    /// GPS times are adjusted standard time, as in the input's header.
    pub standard_gps_time: bool,
    /// Records to pass on.
    pub vlrs: Vec<RawVlr>,
}

impl LasSettings {
    /// Labelled, without colour, not compressed.
    #[must_use]
    pub fn new(quantum: Quantum) -> Self {
        Self {
            quantum,
            with_color: false,
            with_labels: true,
            with_bodies: false,
            short: false,
            compress: false,
            standard_gps_time: false,
            vlrs: Vec::new(),
        }
    }

    /// LAS point format.
    #[must_use]
    pub fn format(&self) -> u8 {
        match self {
            Self { short: true, .. } => 0,
            Self { with_color: true, .. } => 7,
            _ => 6,
        }
    }

    /// How names of its files end.
    #[must_use]
    pub fn ending(&self) -> &'static str {
        if self.compress { "laz" } else { "las" }
    }

    /// Length of a record, bytes.
    #[must_use]
    pub fn record_len(&self) -> usize {
        match self.format() {
            0 => 20,
            7 => 36 + self.extra_len(),
            _ => 30 + self.extra_len(),
        }
    }

    /// Length of our extra fields, bytes: two u16 for robot and link, a u32 for the body.
    pub(crate) fn extra_len(&self) -> usize {
        if self.short {
            return 0;
        }
        4 * (usize::from(self.with_labels) + usize::from(self.with_bodies))
    }
}

/// What a header must say of its points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Extent {
    pub(crate) n: u64,
    /// In steps.
    pub(crate) min: [i32; 3],
    pub(crate) max: [i32; 3],
}

impl Default for Extent {
    fn default() -> Self {
        Self { n: 0, min: [i32::MAX; 3], max: [i32::MIN; 3] }
    }
}

impl Extent {
    #[inline]
    pub(crate) fn add(&mut self, steps: [i32; 3]) {
        self.n += 1;
        for i in 0..3 {
            self.min[i] = self.min[i].min(steps[i]);
            self.max[i] = self.max[i].max(steps[i]);
        }
    }

    pub(crate) fn join(&mut self, other: &Self) {
        self.n += other.n;
        for i in 0..3 {
            self.min[i] = self.min[i].min(other.min[i]);
            self.max[i] = self.max[i].max(other.max[i]);
        }
    }
}

#[cold]
pub(crate) fn too_far(xyz: [f64; 3]) -> Error {
    Error::new(Kind::BadInput, format!("point does not fit into LAS coordinates: \"{xyz:?}\""))
        .hint("choose a larger scale or an offset near the points")
}
