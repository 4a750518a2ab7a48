//! A scan of an open file in; what a sample of its points tells out: its raster, where most of it
//! lies, and whether its scanner can have stood where it is said to.

use crate::position;
use crate::raster::{self, Raster, Steps};
use crate::reader::Sampled;
use crate::settings::Settings;
use crate::size::{self, N_LOOKED};
use crate::sources::File;
use contract::{Result, Scan};
use geometry::{Aabb, Pose};

/// Said of a scan that a camera took.
const CAMERA: &str = "taken by a depth camera: its points err by half a percent of their range, alike over a hand's width";
/// Said of a scan whose scanner is known and whose raster is not.
const NO_RASTER: &str = "too few points to tell the raster: no free-space evidence from this scan";

/// What a look at a scan tells.
#[derive(Default)]
pub(crate) struct Looked {
    /// The raster, where the scanner is known and its points tell it.
    pub(crate) raster: Option<Raster>,
    /// What is odd about the raster, or worse for the lack of one.
    pub(crate) note: Option<String>,
    /// Where most of its points lie in the world, metres.
    pub(crate) spread: Option<Aabb>,
    /// Whether its scanner cannot have stood where it is said to.
    pub(crate) is_misplaced: bool,
}

impl File {
    /// What a sample of a scan tells.
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
        // Rows and columns are regular about the scanner and nowhere else.
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

    /// What is said of a scan whose scanner cannot have stood where it is said to.
    fn misplaced(&self, i: usize) -> Result<Option<String>> {
        let mut points = self.reader.spread(i, position::N_POINTS, position::N_READ)?;
        if let Some(new_from_file) = &self.moved[i] {
            points.iter_mut().for_each(|p| *p = moved(new_from_file, *p));
        }
        let seen = position::look(&points);
        Ok(seen.is_wrong().then(|| seen.note()))
    }
}

/// A place in the frame of a scan whose pose the user replaced.
pub(crate) fn moved(pose: &Pose, p: [f32; 3]) -> [f32; 3] {
    let q = pose * nalgebra::Point3::from(p.map(f64::from));
    [q.x as f32, q.y as f32, q.z as f32]
}
