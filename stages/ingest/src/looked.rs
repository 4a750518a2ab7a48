//! Examines a sample of a scan's points: its raster, the place of most of its points, and whether
//! the scanner can have stood at its stated position.

use crate::file::{OpenFile, moved};
use crate::position;
use crate::raster::{self, ScanRaster, StepSource};
use crate::reader::SampledPoint;
use crate::settings::Settings;
use crate::source_census::SourceCensus;
use contract::{Result, Scan};
use geometry::{Aabb, Point, Pose};
use serde::{Deserialize, Serialize};

/// Note on a scan from a depth camera.
const CAMERA: &str = "taken by a depth camera: its ranges have errors of about half a percent, correlated over about 0.1 m";
/// Note on a scan whose scanner is known, but not its raster.
const NO_RASTER: &str =
    "too few points to estimate the raster: no free-space evidence from this scan";
/// Number of points of a scan that are sampled if nothing else needs a larger sample.
const N_LOOKED: usize = 4096;
/// Fewest points that give a spread.
const LEAST_POINTS: usize = 100;
/// Share of the points at either end of each axis that are ignored: stray points, and points seen
/// through openings.
const TAIL: f64 = 0.05;

/// The result of sampling a scan.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(crate) struct ScanLook {
    /// The raster, where the scanner is known and the points suffice.
    pub(crate) raster: Option<ScanRaster>,
    /// Message about an odd or missing raster.
    pub(crate) note: Option<String>,
    /// Bounds of most of its points in the world, metres.
    pub(crate) spread: Option<Aabb>,
    /// Whether the scanner cannot have stood at its stated position.
    pub(crate) is_misplaced: bool,
}

/// What samples of an input have told, for others that open the same input.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct InputLooks {
    /// Of each scan.
    pub(crate) scans: Vec<ScanLook>,
    /// The source ids of its points, where its scans are told apart by them.
    pub(crate) census: Option<SourceCensus>,
}

/// Keeps what samples have told. Each of many processes that open the same inputs would otherwise
/// sample all of them.
pub trait KeepLooks: Sync {
    /// What is known of the input at this position among those that are opened.
    fn known(&self, at: usize) -> Option<InputLooks>;

    /// Keeps what was learnt of that input. What cannot be kept is learnt again.
    fn keep(&self, at: usize, looks: &InputLooks);
}

/// Keeps nothing.
pub(crate) struct KeepNone;

impl KeepLooks for KeepNone {
    fn known(&self, _: usize) -> Option<InputLooks> {
        None
    }

    fn keep(&self, _: usize, _: &InputLooks) {}
}

impl OpenFile {
    /// Samples a scan.
    pub(crate) fn look(&self, i: usize, scan: &Scan, settings: &Settings) -> Result<ScanLook> {
        if scan.stated_points == Some(0) {
            return Ok(ScanLook::default());
        }
        let n = if self.known[i] { settings.sample_points } else { N_LOOKED };
        let mut sample: Vec<SampledPoint> = self.reader.sample(i, n)?;
        if let Some(new_from_file) = &self.moved[i] {
            sample.iter_mut().for_each(|s| s.xyz = moved(new_from_file, s.xyz));
        }
        let spread = spread(sample.iter().map(|s| s.xyz), &scan.world_from_scan);
        if !self.known[i] {
            return Ok(ScanLook { spread, ..ScanLook::default() });
        }
        let n_points = self.reader.scans()[i].likely_points.or(scan.stated_points);
        let raster = raster::estimate(&sample, n_points, settings);
        // Rows and columns that are regular in angle prove the scanner's position. So do points
        // that are its own because they lie on its raster; only a part of each cell is known as
        // such.
        let is_proven = scan.raster.is_some()
            || raster.is_some_and(|raster| raster.steps == StepSource::Native);
        if !is_proven && let Some(note) = self.misplaced(i)? {
            let note = Some(note);
            return Ok(ScanLook { raster: None, note, spread, is_misplaced: true });
        }
        let note = match &raster {
            None if !sample.is_empty() => Some(NO_RASTER.into()),
            Some(raster) if raster.lattice.is_camera => Some(CAMERA.into()),
            _ => None,
        };
        Ok(ScanLook { raster, note, spread, is_misplaced: false })
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

/// Bounds of most points of a scan along the world's axes, metres; `None` for too few points.
fn spread(xyz: impl Iterator<Item = [f32; 3]>, world_from_scan: &Pose) -> Option<Aabb> {
    let world = xyz.map(|p| world_from_scan * Point::from(p.map(f64::from)));
    let world: Vec<Point> = world.collect();
    if world.len() < LEAST_POINTS {
        return None;
    }
    let last = (world.len() - 1) as f64;
    let (low, high) = ((last * TAIL) as usize, (last * (1.0 - TAIL)) as usize);
    let mut out = Aabb::EMPTY;
    for axis in 0..3 {
        let mut along: Vec<f64> = world.iter().map(|p| p[axis]).collect();
        along.sort_unstable_by(f64::total_cmp);
        (out.min[axis], out.max[axis]) = (along[low], along[high]);
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spread_is_of_most_points_and_along_the_worlds_axes() {
        let points = || (0..1000).map(|i| [i as f32 * 0.01, 0.0, 0.5]);
        let stray = points().chain([[9e5, 9e5, -9e5]]);
        let box_of = |points: &mut dyn Iterator<Item = [f32; 3]>, pose: &Pose| spread(points, pose);
        let found = box_of(&mut stray.into_iter(), &Pose::identity()).expect("points");
        assert!((found.size()[0] - 9.0).abs() < 0.05, "{found:?}");
        assert_eq!((found.size()[1], found.min[2]), (0.0, 0.5));
        let upright = Pose::rotation(geometry::Vector::new(0.0, -std::f64::consts::FRAC_PI_2, 0.0));
        let found = box_of(&mut points(), &upright).expect("points");
        assert!((found.size()[2] - 9.0).abs() < 0.05 && found.size()[0] < 1e-6, "{found:?}");
        assert_eq!(box_of(&mut points().take(99), &Pose::identity()), None);
    }
}
