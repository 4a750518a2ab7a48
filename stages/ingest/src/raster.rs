//! Estimates the angular raster of a scan from a sample of its points: from native rows and columns
//! if they are regular, otherwise from the directions of the points. The raster is at most so fine
//! that a pixel holds about one point.

use crate::angular_grid::{AngularGrid, wrap};

use crate::picture::is_picture;
use crate::raster_free;
use crate::raster_native;
use crate::reader::SampledPoint;
use crate::settings::Settings;
use contract::Lattice;
use serde::{Deserialize, Serialize};

/// Source of the steps of a lattice.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum StepSource {
    /// Native rows and columns: they map to pixels one to one.
    Native,
    /// Native rows and columns, but they are not regular: a pixel may hold two returns or none.
    Irregular,
    /// The directions of the points.
    Directions,
    /// There is no lattice.
    None,
}

/// A lattice and the source of its steps.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(crate) struct ScanRaster {
    pub(crate) lattice: Lattice,
    pub(crate) steps: StepSource,
}

/// Number of points below which no raster is estimated.
const MIN_POINTS: usize = 64;
/// Residual of native rows and columns above which they are not used at all, pixels RMS.
const MAX_IRREGULAR: f64 = 2.5;

/// The raster of a scan from a sample of it, as runs of neighbours in the order of the file;
/// `n_total` is the number of points of the scan. `None` where there are too few points to tell.
pub(crate) fn estimate(
    sample: &[SampledPoint],
    n_total: Option<u64>,
    settings: &Settings,
) -> Option<ScanRaster> {
    let sample: Vec<SampledPoint> =
        sample.iter().copied().filter(|s| s.xyz.iter().any(|v| *v != 0.0)).collect();
    if sample.len() < MIN_POINTS {
        return None;
    }
    let is_camera = is_picture(&sample);
    let with = |grid: &AngularGrid, steps| {
        let lattice = Lattice { is_camera, ..lattice(grid, settings) };
        Some(ScanRaster { lattice, steps })
    };
    let native = raster_native::fit(&sample);
    if let Some(native) = native.filter(|n| n.rms < MAX_IRREGULAR) {
        let regular = native.rms < settings.max_native_rms;
        let steps = if regular { StepSource::Native } else { StepSource::Irregular };
        return with(&native.grid, steps);
    }
    let grid = raster_free::fit(&sample, n_total)?;
    with(&grid, StepSource::Directions)
}

fn lattice(grid: &AngularGrid, settings: &Settings) -> Lattice {
    let clamp = |step: f64| step.abs().clamp(settings.min_step, settings.max_step);
    let mut lattice = Lattice::new(
        clamp(grid.row_step),
        clamp(grid.col_step),
        grid.elevation,
        wrap(grid.azimuth),
    );
    lattice.lattice_from_scan = grid.axis.lattice_from_scan();
    lattice
}

#[cfg(test)]
#[path = "raster_tests.rs"]
mod tests;
