//! Estimates the angular raster of a scan from a sample of its points: from native rows and columns
//! where these are regular, else from the directions of the points. It is never finer than about
//! one point a pixel.

use crate::picture::is_picture;
use crate::raster_free;
use crate::raster_native;
use crate::reader::Sampled;
use crate::settings::Settings;
use contract::Lattice;
use nalgebra::{UnitQuaternion, Vector3};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Source of the steps of a lattice.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Steps {
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
#[derive(Debug, Clone, Copy)]
pub(crate) struct Raster {
    pub(crate) lattice: Lattice,
    pub(crate) steps: Steps,
}

/// Number of points below which no raster is estimated.
const MIN_POINTS: usize = 64;
/// Residual of native rows and columns above which they are not used at all, pixels RMS.
const MAX_IRREGULAR: f64 = 2.5;

/// The raster of a scan from a sample of it, as runs of neighbours in the order of the file;
/// `n_total` is the number of points of the scan. `None` where there are too few points to tell.
pub(crate) fn estimate(
    sample: &[Sampled],
    n_total: Option<u64>,
    settings: &Settings,
) -> Option<Raster> {
    let sample: Vec<Sampled> =
        sample.iter().copied().filter(|s| s.xyz.iter().any(|v| *v != 0.0)).collect();
    if sample.len() < MIN_POINTS {
        return None;
    }
    let is_camera = is_picture(&sample);
    let with = |grid: &Grid, steps| {
        let lattice = Lattice { is_camera, ..lattice(grid, settings) };
        Some(Raster { lattice, steps })
    };
    let native = raster_native::fit(&sample);
    if let Some(native) = native.filter(|n| n.rms < MAX_IRREGULAR) {
        let regular = native.rms < settings.max_native_rms;
        let steps = if regular { Steps::Native } else { Steps::Irregular };
        return with(&native.grid, steps);
    }
    let grid = raster_free::fit(&sample, n_total)?;
    with(&grid, Steps::Directions)
}

/// Steps about one axis and the middle of one pixel, radians.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Grid {
    pub(crate) axis: Axis,
    pub(crate) row_step: f64,
    pub(crate) col_step: f64,
    pub(crate) elevation: f64,
    pub(crate) azimuth: f64,
}

fn lattice(grid: &Grid, settings: &Settings) -> Lattice {
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

/// The axis of the scan frame about which the scanner spins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Axis {
    X,
    Y,
    Z,
}

impl Axis {
    /// All axes, the usual one first: it is preferred where several fit.
    pub(crate) const ALL: [Self; 3] = [Self::Z, Self::Y, Self::X];

    /// The rotation `lattice_from_scan` that turns this axis into z.
    pub(crate) fn lattice_from_scan(self) -> UnitQuaternion<f64> {
        match self {
            Self::Z => UnitQuaternion::identity(),
            Self::Y => UnitQuaternion::from_axis_angle(&Vector3::x_axis(), FRAC_PI_2),
            Self::X => UnitQuaternion::from_axis_angle(&Vector3::y_axis(), -FRAC_PI_2),
        }
    }

    /// Azimuth and elevation about this axis, radians.
    pub(crate) fn angles(self, p: [f32; 3]) -> [f64; 2] {
        let [x, y, z] = p.map(f64::from);
        let [x, y, z] = match self {
            Self::Z => [x, y, z],
            Self::Y => [x, -z, y],
            Self::X => [-z, y, x],
        };
        [y.atan2(x), z.atan2(x.hypot(y))]
    }
}

/// An angle wrapped to [−π, π).
pub(crate) fn wrap(angle: f64) -> f64 {
    (angle + PI).rem_euclid(TAU) - PI
}

/// The median; of an even number of values the upper of the middle two.
pub(crate) fn median(values: &mut [f64]) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
#[path = "raster_tests.rs"]
mod tests;
