//! An open list of points, and which of its records are points.

use super::body::RecordBody;
use super::fields::CloudFields;
use crate::frame::FileFrame;
use crate::map::Mapped;
use crate::oddities::Oddities;
use crate::reader::{MaskSeed, ScanSeed};
use crate::units::Units;
use contract::Format;

/// One scan of the file.
pub(super) struct CloudPart {
    pub(super) body: RecordBody,
    pub(super) fields: CloudFields,
    pub(super) n_records: u64,
    pub(super) frame: FileFrame,
    pub(super) oddities: Oddities,
}

/// An open file.
pub(super) struct CloudFile {
    pub(super) format: Format,
    pub(super) map: Mapped,
    pub(super) parts: Vec<CloudPart>,
    pub(super) masks: Vec<MaskSeed>,
    pub(super) scans: Vec<ScanSeed>,
    pub(super) units: Units,
    pub(super) metres: [f64; 3],
    pub(super) strip_points: usize,
    pub(super) max_range: f64,
}

impl CloudFile {
    /// Coordinates of the file in metres.
    #[inline]
    pub(super) fn in_metres(&self, p: [f64; 3]) -> [f64; 3] {
        [p[0] * self.metres[0], p[1] * self.metres[1], p[2] * self.metres[2]]
    }

    /// The world and scan coordinates of a record, metres; `None` where it is out of range or a
    /// beam without return.
    #[inline]
    pub(super) fn valid(&self, part: &CloudPart, xyz: [f64; 3]) -> Option<([f64; 3], [f64; 3])> {
        let world = self.in_metres(xyz);
        let p = part.frame.scan_from_file(world);
        let is_good = p.iter().all(|v| v.abs() <= self.max_range) && !part.frame.is_no_return(p);
        is_good.then_some((world, p))
    }
}
