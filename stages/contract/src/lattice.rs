//! The angular raster of a scan: converts directions to rows and columns and back.

use geometry::direction::{spherical, unit};
use nalgebra::UnitQuaternion;
use serde::{Deserialize, Serialize};

/// A regular raster of elevation (rows, upwards) and azimuth (columns, counter-clockwise) about the
/// z axis of the lattice frame. It covers the whole sphere; tiles hold only the pixels that a scan
/// has points in.
///
/// A file's native rows and columns choose its steps and phase where they are regular to 0.3
/// pixels; otherwise the steps come from the directions of the points. A pixel may then hold two
/// returns or none: consumers must not rely on one each.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Lattice {
    /// Rotation from the scan frame to the lattice frame, whose z is the scanner's spin axis;
    /// identity for most scanners.
    pub lattice_from_scan: UnitQuaternion<f64>,
    /// Elevation step between rows, radians.
    pub row_step: f64,
    /// Azimuth step between columns, radians; a full turn is a whole number of columns.
    pub col_step: f64,
    /// Elevation of the middle of row 0, radians, at or below −π/2 + `row_step`.
    pub first_elevation: f64,
    /// Azimuth of the middle of column 0, radians, at or below −π + `col_step`.
    pub first_azimuth: f64,
    /// Number of rows.
    pub n_rows: u32,
    /// Number of columns of a full turn.
    pub n_cols: u32,
    /// Whether the points come from a depth camera. Its pixels are only nearly regular in angles,
    /// and its depth errors are correlated over about 0.1 m.
    pub is_camera: bool,
}

/// A pixel of a lattice.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Pixel {
    /// Row, counted from the lowest elevation upwards.
    pub row: u32,
    /// Column, counted counter-clockwise.
    pub col: u32,
}

impl Lattice {
    /// A lattice with these steps (radians). The column step is rounded so that a full turn is a
    /// whole number of columns; the middle of a pixel lies at (`elevation`, `azimuth`), radians.
    #[must_use]
    pub fn new(row_step: f64, col_step: f64, elevation: f64, azimuth: f64) -> Self {
        use std::f64::consts::{FRAC_PI_2, PI, TAU};
        let n_cols = (TAU / col_step).round().max(1.0);
        let col_step = TAU / n_cols;
        let first_elevation = elevation - ((elevation + FRAC_PI_2) / row_step).floor() * row_step;
        let first_azimuth = azimuth - ((azimuth + PI) / col_step).floor() * col_step;
        let n_rows = ((FRAC_PI_2 - first_elevation) / row_step).floor().max(0.0) + 2.0;
        Self {
            lattice_from_scan: UnitQuaternion::identity(),
            row_step,
            col_step,
            first_elevation: first_elevation - row_step,
            first_azimuth,
            n_rows: n_rows as u32 + 1,
            n_cols: n_cols as u32,
            is_camera: false,
        }
    }

    /// The pixel and range (metres) of a point in the scan frame.
    #[inline]
    #[must_use]
    pub fn pixel(&self, scan: [f32; 3]) -> (Pixel, f32) {
        let (row, col, range) = self.place(scan);
        (self.nearest(row, col), range)
    }

    /// The pixel nearest to a fractional row and column (see [`Lattice::place`]); columns wrap
    /// around, rows are clamped.
    #[inline]
    #[must_use]
    pub fn nearest(&self, row: f64, col: f64) -> Pixel {
        let row = nearest(row).clamp(0, i64::from(self.n_rows) - 1);
        let n_cols = i64::from(self.n_cols);
        let mut col = nearest(col);
        // The column is nearly always in range already; a remainder for each point would take
        // longer than the rest of this function.
        if col < 0 || col >= n_cols {
            col = col.rem_euclid(n_cols);
        }
        Pixel { row: row as u32, col: col as u32 }
    }

    /// Fractional row, fractional column (not wrapped) and range (metres) of a point in the scan
    /// frame, metres.
    #[inline]
    #[must_use]
    pub fn place(&self, scan: [f32; 3]) -> (f64, f64, f32) {
        let p = if self.lattice_from_scan == UnitQuaternion::identity() {
            scan
        } else {
            let q = self.lattice_from_scan * nalgebra::Vector3::from(scan.map(f64::from));
            [q.x as f32, q.y as f32, q.z as f32]
        };
        let (azimuth, elevation, range) = spherical(p);
        (
            (f64::from(elevation) - self.first_elevation) / self.row_step,
            (f64::from(azimuth) - self.first_azimuth) / self.col_step,
            range,
        )
    }

    /// Unit direction through the middle of a pixel, scan frame.
    #[must_use]
    pub fn direction(&self, pixel: Pixel) -> [f64; 3] {
        let lattice = unit(
            self.first_azimuth + f64::from(pixel.col) * self.col_step,
            self.first_elevation + f64::from(pixel.row) * self.row_step,
        );
        let scan = self.lattice_from_scan.inverse() * nalgebra::Vector3::from(lattice);
        [scan.x, scan.y, scan.z]
    }

    /// The solid angle of a rectangle of pixels: `[first row, last row, first column,
    /// last column]`, all included.
    #[must_use]
    pub fn window(&self, [first_row, last_row, first_col, last_col]: [u32; 4]) -> Window {
        use std::f64::consts::{FRAC_PI_2, PI};
        let elevation = |row: f64| self.first_elevation + row * self.row_step;
        let azimuth = |col: f64| self.first_azimuth + col * self.col_step;
        let low = elevation(f64::from(first_row) - 0.5);
        let high = elevation(f64::from(last_row) + 0.5);
        let sides = [azimuth(f64::from(first_col) - 0.5), azimuth(f64::from(last_col) + 0.5)];
        let turn = self.lattice_from_scan.to_rotation_matrix();
        let row = |i: usize| [0, 1, 2].map(|k| turn.matrix()[(i, k)] as f32);
        Window {
            lattice_from_scan: [row(0), row(1), row(2)],
            sines: [
                if low <= -FRAC_PI_2 { f32::NEG_INFINITY } else { low.sin() as f32 },
                if high >= FRAC_PI_2 { f32::INFINITY } else { high.sin() as f32 },
            ],
            sides: sides.map(|a| [a.cos() as f32, a.sin() as f32]),
            is_wide: sides[1] - sides[0] > PI,
            is_round: last_col - first_col + 1 >= self.n_cols,
        }
    }
}

/// The directions that fall into a rectangle of pixels, tested without computing an angle.
#[derive(Debug, Clone, Copy)]
pub struct Window {
    lattice_from_scan: [[f32; 3]; 3],
    /// Sines of the lowest and the highest elevation.
    sines: [f32; 2],
    /// Unit vectors in the lattice's xy plane where the columns begin and end.
    sides: [[f32; 2]; 2],
    /// Whether the columns span more than half a turn, and whether they span a whole turn.
    is_wide: bool,
    is_round: bool,
}

impl Window {
    /// Whether a direction of any length, scan frame, falls into the rectangle.
    #[inline]
    #[must_use]
    pub fn holds(&self, scan: [f32; 3]) -> bool {
        let [x, y, z] =
            self.lattice_from_scan.map(|r| r[0] * scan[0] + r[1] * scan[1] + r[2] * scan[2]);
        let range = (x * x + y * y + z * z).sqrt();
        let is_at_height = (z >= self.sines[0] * range) & (z < self.sines[1] * range);
        let [first, last] = self.sides.map(|[cos, sin]| cos * y - sin * x);
        let (is_past_first, is_before_last) = (first >= 0.0, last < 0.0);
        // Without branches, so that the compiler can vectorise a loop over many directions.
        let is_between = is_past_first & is_before_last;
        let is_either = (is_past_first | is_before_last) & self.is_wide;
        is_at_height & (self.is_round | is_either | is_between)
    }
}

/// `floor(value + ½)` without `f64::floor`, which is a library call on x86-64 without SSE4.1.
#[inline]
fn nearest(value: f64) -> i64 {
    let value = value + 0.5;
    let truncated = value as i64;
    truncated - i64::from(value < truncated as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_direction_has_its_pixel() {
        let lattice = Lattice::new(0.01, 0.007, 0.003, 0.1);
        for row in 0..lattice.n_rows {
            let elevation = lattice.first_elevation + f64::from(row) * lattice.row_step;
            if elevation.abs() > std::f64::consts::FRAC_PI_2 - 0.01 {
                continue;
            }
            for col in 0..lattice.n_cols {
                let at = Pixel { row, col };
                let d = lattice.direction(at).map(|v| (v * 7.0) as f32);
                assert_eq!(lattice.pixel(d).0, at);
            }
        }
        for up in [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [-1.0, -1e-9, 0.0]] {
            let (at, _) = lattice.pixel(up);
            assert!(at.row < lattice.n_rows && at.col < lattice.n_cols);
        }
    }

    #[test]
    fn a_window_holds_the_directions_of_its_pixels() {
        let lattice = Lattice {
            lattice_from_scan: UnitQuaternion::from_euler_angles(0.3, -0.2, 1.1),
            ..Lattice::new(0.01, 0.007, 0.003, 0.1)
        };
        let (rows, cols) = (lattice.n_rows, lattice.n_cols);
        let windows = [
            [100, 200, 30, 90],
            [100, 200, 30, 700],
            [0, rows - 1, 5, 6],
            [40, rows - 1, 0, cols - 1],
            [0, 30, 500, cols - 1],
        ];
        for extent in windows {
            let [r0, r1, c0, c1] = extent;
            let window = lattice.window(extent);
            for (row, col) in (0..rows).flat_map(|row| (0..cols).map(move |col| (row, col))) {
                let at = Pixel { row, col };
                let d = lattice.direction(at).map(|v| (v * 7.0) as f32);
                // Near the poles rounding may put a pixel's middle into another pixel.
                if lattice.pixel(d).0 != at {
                    continue;
                }
                let is_in = (r0..=r1).contains(&row) && (c0..=c1).contains(&col);
                assert_eq!(window.holds(d), is_in, "{at:?} in {extent:?}");
            }
        }
    }
}
