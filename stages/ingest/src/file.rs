//! One open input: its reader, what is known of its scans, and the numbers that its masks and scans
//! have among those of all inputs.

use crate::raster::StepSource;
use crate::reader::{RawStrip, Reader, ScanSeed};
use contract::{MaskId, Result, ScanId, Strip};
use geometry::{Aabb, Pose};

/// One open file.
pub(crate) struct OpenFile {
    pub(crate) reader: Box<dyn Reader>,
    pub(crate) first_scan: u32,
    pub(crate) first_mask: u32,
    /// For each scan whose pose the user replaced: its new scan frame from that of the file.
    pub(crate) moved: Vec<Option<Pose>>,
    /// For each scan: whether its scanner's position is known.
    pub(crate) known: Vec<bool>,
    /// For each scan: where the steps of its lattice come from.
    pub(crate) steps: Vec<StepSource>,
    /// For each scan: bounds of most of its points in the world, metres; `None` if they are not
    /// known.
    pub(crate) spreads: Vec<Option<Aabb>>,
}

impl OpenFile {
    /// Returns the result of a read, or the error that the file was truncated meanwhile. A
    /// truncated file reads as zeros, so that its error goes before that of the reader.
    pub(crate) fn whole<T>(&self, read: Result<T>) -> Result<T> {
        self.reader.check().and(read)
    }

    pub(crate) fn number(&self, mut raw: RawStrip) -> Strip {
        let seed: &ScanSeed = &self.reader.scans()[raw.scan];
        if let Some(new_from_file) = &self.moved[raw.scan] {
            raw.xyz.iter_mut().for_each(|p| *p = moved(new_from_file, *p));
        }
        Strip {
            scan: ScanId(self.first_scan + raw.scan as u32),
            mask: MaskId(self.first_mask + seed.mask as u32),
            first_place: raw.first_place,
            place: raw.place,
            xyz: raw.xyz,
            attributes: raw.attributes,
        }
    }
}

/// A place in the frame of a scan whose pose the user replaced.
pub(crate) fn moved(pose: &Pose, p: [f32; 3]) -> [f32; 3] {
    let q = pose * nalgebra::Point3::from(p.map(f64::from));
    [q.x as f32, q.y as f32, q.z as f32]
}
