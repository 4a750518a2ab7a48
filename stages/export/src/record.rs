//! The content of LAS records: classes of kinds, coordinates in steps, and the settings of a file.

use contract::{Error, Kind, PointKind};
use geometry::Aabb;
use serde::{Deserialize, Serialize};

/// Kind, LAS class (2 is the standard's ground, 64 and up are user-defined) and name.
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
    /// Length of one step on each axis, metres.
    pub scale: [f64; 3],
    /// Coordinate of step zero on each axis, metres.
    pub offset: [f64; 3],
}

impl Quantum {
    /// Steps of 0.1 mm about the middle of `bounds`. The offset is rounded to whole kilometres
    /// where the middle is more than one away from zero, so that all tiles of a plant share it.
    #[must_use]
    pub fn around(bounds: &Aabb) -> Self {
        let middle = bounds.center();
        let offset = [0, 1, 2].map(|i| {
            let at: f64 = middle[i];
            if at.is_finite() { (at / 1000.0).trunc() * 1000.0 } else { 0.0 }
        });
        Self { scale: [FINE; 3], offset }
    }

    /// The quantum `wanted`, that of an input, if its steps can hold `bounds` with some margin.
    /// Else the finest steps of a power of ten that can, not finer than the wanted ones, or than
    /// 0.1 mm if none are wanted.
    #[must_use]
    pub fn holding(bounds: &Aabb, wanted: Option<Self>) -> Self {
        if let Some(wanted) = wanted
            && (bounds.is_empty() || wanted.holds(&bounds.grown(ROOM)))
            && wanted.scale.iter().all(|step| *step > 0.0)
        {
            return wanted;
        }
        let mut own = Self::around(bounds);
        for axis in 0..3 {
            let far = |at: f64| (at - own.offset[axis]).abs() + ROOM;
            let most = far(bounds.min[axis]).max(far(bounds.max[axis]));
            let asked = wanted.map_or(FINE, |wanted| wanted.scale[axis].abs());
            let holds = |step: &&f64| **step >= asked && most / **step < MOST_STEPS;
            own.scale[axis] = STEPS.iter().find(holds).copied().unwrap_or(own.scale[axis]);
        }
        own
    }

    /// Whether its range of steps covers these bounds.
    fn holds(&self, bounds: &Aabb) -> bool {
        (0..3).all(|axis| {
            let steps = |at: f64| ((at - self.offset[axis]) / self.scale[axis]).abs();
            steps(bounds.min[axis]) < MOST_STEPS && steps(bounds.max[axis]) < MOST_STEPS
        })
    }
}

/// Steps where no input has a scale, metres: a tenth of the resolution of scanners.
const FINE: f64 = 1e-4;
/// Margin around the bounds, metres: a later session may add points beside them in the same steps.
const ROOM: f64 = 1_000.0;
/// Largest number of steps of a LAS coordinate from its offset.
const MOST_STEPS: f64 = i32::MAX as f64;
/// Steps that are tried, metres.
const STEPS: [f64; 12] = [1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0, 1e1, 1e2];

/// A variable length record that is copied, such as the reference system of an input.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RawVlr {
    /// Organisation that defined it.
    pub user_id: String,
    /// Number among that organisation's records.
    pub record_id: u16,
    /// Description in words.
    pub description: String,
    /// Its content.
    pub data: Vec<u8>,
}

/// Organisation that defines the records of reference systems, and numbers of the records of
/// GeoTIFF keys and well-known text.
pub const PROJECTION: &str = "LASF_Projection";
const GEOTIFF: u16 = 34_735;
const WELL_KNOWN_TEXT: u16 = 2112;

/// The format of a LAS file.
#[derive(Debug, Clone, PartialEq)]
pub struct LasSettings {
    /// Scale and offset of coordinates.
    pub quantum: Quantum,
    /// Whether points have colour (format 7) or not (format 6).
    pub with_color: bool,
    /// Whether points have classes and the extra fields `RobotId` and `LinkId`.
    pub with_labels: bool,
    /// Whether points have the extra field `BodyId`.
    pub with_bodies: bool,
    /// Whether format 0 is written instead, with 20 bytes a point for coordinates, intensity and
    /// source, and none of the above.
    pub short: bool,
    /// Whether the file is compressed (LAZ).
    pub compress: bool,
    /// Whether GPS times are adjusted standard time, as in the input's header.
    pub standard_gps_time: bool,
    /// Variable length records that are copied.
    pub vlrs: Vec<RawVlr>,
}

impl LasSettings {
    /// Settings for labelled points without colour and without compression.
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

    /// Whether the reference system is stated as GeoTIFF keys and not as well-known text. The
    /// format asks for text with records of format 6 and up, but only its source could translate
    /// the keys; readers follow the bit of the header.
    pub(crate) fn has_geotiff(&self) -> bool {
        let has = |id: u16| self.vlrs.iter().any(|v| v.user_id == PROJECTION && v.record_id == id);
        has(GEOTIFF) && !has(WELL_KNOWN_TEXT)
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

    /// File name extension.
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

    /// Length of the extra fields, bytes: two u16 for robot and link, a u32 for the body.
    pub(crate) fn extra_len(&self) -> usize {
        if self.short {
            return 0;
        }
        4 * (usize::from(self.with_labels) + usize::from(self.with_bodies))
    }
}

/// Count and bounds of points, as a header states them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RecordExtent {
    pub(crate) n: u64,
    /// Smallest coordinates, in steps.
    pub(crate) min: [i32; 3],
    pub(crate) max: [i32; 3],
}

impl Default for RecordExtent {
    fn default() -> Self {
        Self { n: 0, min: [i32::MAX; 3], max: [i32::MIN; 3] }
    }
}

impl RecordExtent {
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
        .hint("it lies too far from the plant for the steps of its clouds: bring the scans into the plant's frame")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quantum(scale: f64, offset: [f64; 3]) -> Quantum {
        Quantum { scale: [scale; 3], offset }
    }

    #[test]
    fn steps_of_an_input_stay_where_they_hold() {
        let bounds = Aabb { min: [-5.0, -4.0, 0.0], max: [5.0, 4.0, 3.0] };
        let of_input = quantum(1e-3, [0.5, 0.0, 0.0]);
        assert_eq!(Quantum::holding(&bounds, Some(of_input)), of_input);
        assert_eq!(Quantum::holding(&Aabb::EMPTY, Some(of_input)), of_input);
        assert_eq!(Quantum::holding(&bounds, None), Quantum::around(&bounds));
    }

    #[test]
    fn steps_of_the_whole_range_leave_room_and_stay_fine() {
        // Scale = extent / (2³¹ − 1) and offset = least coordinate put the last point on the edge.
        let bounds = Aabb { min: [100.0, 200.0, 0.0], max: [160.0, 230.0, 8.0] };
        let scale = bounds.size().map(|side| side / f64::from(i32::MAX));
        let own = Quantum::holding(&bounds, Some(Quantum { scale, offset: bounds.min }));
        assert_eq!(own.scale, [1e-6; 3], "as fine as there is room for");
        assert!(own.holds(&bounds.grown(ROOM)));
        // A negative step is legal, but would reverse the bounds of a header.
        let own = Quantum::holding(&bounds, Some(quantum(-1e-3, [0.0; 3])));
        assert_eq!(own.scale, [1e-3; 3]);
    }

    #[test]
    fn what_spreads_over_a_country_has_coarser_steps() {
        let bounds = Aabb { min: [0.0; 3], max: [500_000.0, 10.0, 10.0] };
        let own = Quantum::holding(&bounds, None);
        assert_eq!(own.scale, [1e-3, 1e-4, 1e-4]);
        assert!(own.holds(&bounds));
        // No step can hold that; the result is finite all the same.
        let own = Quantum::holding(&Aabb { min: [-1e300; 3], max: [1e300; 3] }, None);
        assert!(own.scale.iter().chain(&own.offset).all(|v| v.is_finite()));
    }
}
