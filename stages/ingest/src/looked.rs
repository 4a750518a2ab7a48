//! What a sample of a scan's points tells: its raster, where most points lie, and whether the
//! scanner can have stood at its stated position.

use crate::position;
use crate::raster::{self, Raster, Steps};
use crate::reader::Sampled;
use crate::settings::Settings;
use crate::size::{self, N_LOOKED};
use crate::sources::File;
use contract::{Result, Scan};
use geometry::{Aabb, Pose};

/// Note on a scan from a depth camera.
const CAMERA: &str = "taken by a depth camera: its points err by half a percent of their range, alike over a hand's width";
/// Note on a scan whose scanner is known, but not its raster.
const NO_RASTER: &str = "too few points to tell the raster: no free-space evidence from this scan";

/// The result of sampling a scan.
#[derive(Default)]
pub(crate) struct Looked {
    /// The raster, where the scanner is known and the points suffice.
    pub(crate) raster: Option<Raster>,
    /// Message about an odd or missing raster.
    pub(crate) note: Option<String>,
    /// Bounds of most of its points in the world, metres.
    pub(crate) spread: Option<Aabb>,
    /// Whether the scanner cannot have stood at its stated position.
    pub(crate) is_misplaced: bool,
}

impl File {
    /// Samples a scan.
    pub(crate) fn look(&self, i: usize, scan: &Scan, settings: &Settings) -> Result<Looked> {
        if scan.stated_points == Some(0) {
            return Ok(Looked::default());
        }
        let n = if self.known[i] { settings.sample_points } else { N_LOOKED };
        let mut sample: Vec<Sampled> = self.reader.sample(i, n)?;
        if let Some(new_from_file) = &self.moved[i] {
            sample.iter_mut().for_each(|s| s.xyz = moved(new_from_file, s.xyz));
        }
        let spread = size::spread(sample.iter().map(|s| s.xyz), &scan.world_from_scan);
        if !self.known[i] {
            return Ok(Looked { spread, ..Looked::default() });
        }
        let n_points = self.reader.scans()[i].likely_points.or(scan.stated_points);
        let raster = raster::estimate(&sample, n_points, settings);
        // Rows and columns that are regular in angle prove the scanner's position.
        if !raster.is_some_and(|raster| raster.steps == Steps::Native)
            && let Some(note) = self.misplaced(i)?
        {
            let note = Some(note);
            return Ok(Looked { raster: None, note, spread, is_misplaced: true });
        }
        let note = match &raster {
            None if !sample.is_empty() => Some(NO_RASTER.into()),
            Some(raster) if raster.lattice.is_camera => Some(CAMERA.into()),
            _ => None,
        };
        Ok(Looked { raster, note, spread, is_misplaced: false })
    }

    /// The message for a scan whose scanner cannot have stood at its stated position.
    fn misplaced(&self, i: usize) -> Result<Option<String>> {
        let mut points = self.reader.spread(i, position::N_POINTS, position::N_READ)?;
        if let Some(new_from_file) = &self.moved[i] {
            points.iter_mut().for_each(|p| *p = moved(new_from_file, *p));
        }
        let seen = position::look(&points);
        Ok(seen.is_wrong().then(|| seen.note()))
    }
}

/// Converts a point of a scan whose pose the user replaced to its new scan frame, metres.
pub(crate) fn moved(pose: &Pose, p: [f32; 3]) -> [f32; 3] {
    let q = pose * nalgebra::Point3::from(p.map(f64::from));
    [q.x as f32, q.y as f32, q.z as f32]
}
