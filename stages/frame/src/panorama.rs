//! The range of the beams of one scan in each direction, as a coarse raster.

use geometry::direction::spherical;
use geometry::{Pose, Vector};
use nalgebra::Point3;
use std::f32::consts::{FRAC_PI_2, PI};

/// Angle of a cell, radians: 0.5°, two beams of a scan that was thinned to 0.25°.
const CELL: f32 = 0.008_726_646;
const N_ROWS: usize = 360;
const N_COLS: usize = 720;
/// Distance behind a place at which a beam must end to have passed
/// through the place, metres: noise, the voxel of a surfel, and the error of a rough pose.
const BEYOND: f32 = 0.15;
/// Share of the range that is added to [`BEYOND`].
const BEYOND_SHARE: f32 = 0.01;
/// Largest range of places that are tested, metres: there a cell with its neighbours is half a
/// metre wide.
const FARTHEST: f32 = 20.0;
/// Smallest range of places that are tested, metres: nearer there are tripods and people.
const NEAREST: f32 = 0.5;
/// Number of a cell and its eight neighbours that must have beams: a single row of them may pass
/// just above a flat top.
const MIN_SEEN: usize = 6;

/// The ranges of the beams of one scanner.
#[derive(Debug, Clone)]
pub struct Panorama {
    /// Pose `scan_from_local`; the local frame is the session's world about its origin.
    scan_from_local: Pose,
    at: Vector,
    /// Nearest range of each cell, rows upwards, metres; infinite where there is none. After
    /// [`Panorama::finish`] the nearest range of the cell and its neighbours, 0 where too few of
    /// them have beams.
    near: Vec<f32>,
}

impl Panorama {
    /// An empty panorama for a scan with this pose in the session's world; coordinates are relative
    /// to `origin`.
    #[must_use]
    pub fn new(world_from_scan: &Pose, origin: &Vector) -> Self {
        let mut local_from_scan = *world_from_scan;
        local_from_scan.translation.vector -= origin;
        Self {
            scan_from_local: local_from_scan.inverse(),
            at: local_from_scan.translation.vector,
            near: vec![f32::INFINITY; N_ROWS * N_COLS],
        }
    }

    /// Adds a point, scan frame, metres.
    pub fn add(&mut self, scan: [f32; 3]) {
        let (cell, range) = cell(scan);
        if let Some(near) = cell.and_then(|[row, col]| self.near.get_mut(row * N_COLS + col)) {
            *near = near.min(range);
        }
    }

    /// Gives each cell the nearest range of its neighbourhood; to be called after the last point.
    #[must_use]
    pub fn finish(mut self) -> Self {
        let raw = std::mem::take(&mut self.near);
        let around = |row: usize, col: usize| {
            let rows = row.saturating_sub(1)..(row + 2).min(N_ROWS);
            let (mut n, mut near) = (0, f32::INFINITY);
            for r in rows {
                for step in [N_COLS - 1, 0, 1] {
                    let range = raw[r * N_COLS + (col + step) % N_COLS];
                    n += usize::from(range.is_finite());
                    near = near.min(range);
                }
            }
            if n >= MIN_SEEN && raw[row * N_COLS + col].is_finite() { near } else { 0.0 }
        };
        self.near = (0..N_ROWS * N_COLS).map(|i| around(i / N_COLS, i % N_COLS)).collect();
        self
    }

    /// Whether all beams about a place (the session's world about its origin, metres) went on
    /// beyond it.
    #[inline]
    #[must_use]
    pub fn sees_through(&self, local: &Vector) -> bool {
        if (local - self.at).norm_squared() > f64::from(FARTHEST * FARTHEST) {
            return false;
        }
        let p = (self.scan_from_local * Point3::from(*local)).coords.map(|v| v as f32);
        let (Some([row, col]), range) = cell(p.into()) else { return false };
        (NEAREST..FARTHEST).contains(&range)
            && self.near[row * N_COLS + col] > range + BEYOND + BEYOND_SHARE * range
    }

    /// Position of the scanner in the session's world about its origin, metres.
    #[must_use]
    pub fn at(&self) -> Vector {
        self.at
    }
}

/// Row and column of a point in the scan frame and its range; no cell for a point without
/// direction.
#[inline]
fn cell(scan: [f32; 3]) -> (Option<[usize; 2]>, f32) {
    let (azimuth, elevation, range) = spherical(scan);
    if !(range > 0.0 && range.is_finite()) {
        return (None, range);
    }
    let row = (((elevation + FRAC_PI_2) / CELL) as usize).min(N_ROWS - 1);
    let col = (((azimuth + PI) / CELL) as usize) % N_COLS;
    (Some([row, col]), range)
}
