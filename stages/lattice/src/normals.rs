//! Normals of a linked raster: cross products of differences between window means, computed in
//! constant time a pixel for any window by summed-area tables.

use crate::Settings;
use crate::links::{BROKEN, linked};
use crate::raster::TileRaster;

/// Integer units per metre, a tenth of a millimetre each. Window sums are exact modulo 2³², and no
/// window spans 200 km.
const UNIT: f32 = 1e4;
/// Mask of [`BROKEN`] in any of the four links of a pixel.
const ANY_BROKEN: u32 = u32::from_ne_bytes([BROKEN; 4]);
/// Reach from which on neighbours may share a normal, pixels: their windows are nearly the same.
const SHARED_REACH: u8 = 2;
/// Cosine of the largest angle between the normals at the ends of four pixels that share one (2°);
/// a pipe of 50 mm radius turns more.
const SHARED_COSINE: f32 = 0.999_39;
/// Largest reach that is measured, pixels.
const MOST_REACH: u8 = 127;

/// Normals of one tile and the windows that they come from; buffers are reused.
#[derive(Debug, Default)]
pub(crate) struct Normals {
    /// Unit normal towards the scanner, scan frame; zero where there is none.
    pub(crate) normal: Vec<[f32; 3]>,
    /// Expected error of a normal, radians; 0 where there is no normal.
    pub(crate) error: Vec<f32>,
    /// Half-widths of the windows along columns and rows, pixels.
    pub(crate) half: Vec<u8>,
    /// Distance of each pixel to the next border of a surface, pixels.
    reach: Vec<u8>,
    /// Sums over all pixels below and left of each pixel: x, y, z and number of points.
    table: Vec<[i32; 4]>,
}

impl Normals {
    /// Computes the normals of `raster`.
    pub(crate) fn fill(&mut self, raster: &TileRaster, settings: &Settings) {
        self.measure_reach(raster);
        self.sum(raster);
        let (side, n_pixels) = (raster.side, raster.n_pixels());
        self.normal.clear();
        self.normal.resize(n_pixels, [0.0; 3]);
        self.error.clear();
        self.error.resize(n_pixels, 0.0);
        self.half.clear();
        self.half.resize(n_pixels, 0);
        for row in (0..side).step_by(2) {
            for col in (0..side).step_by(2) {
                self.compute_four(raster, row, col, settings);
            }
        }
        self.borrow_at_borders(raster);
    }

    /// The normals of a pixel and of its right, upper and upper right neighbour. Where those of the
    /// first and the last agree, the surface is flat, and the two between share that of the first.
    #[inline]
    fn compute_four(&mut self, raster: &TileRaster, row: usize, col: usize, settings: &Settings) {
        let first = row * raster.side + col;
        let four = [(0, 0), (1, 1), (0, 1), (1, 0)];
        let mut is_flat = raster.holds(first) && self.reach[first] >= SHARED_REACH;
        for (k, (dr, dc)) in four.into_iter().enumerate() {
            let at = first + dr * raster.side + dc;
            if !raster.holds(at) || self.reach[at] == 0 {
                continue;
            }
            if k > 1 && is_flat {
                self.normal[at] = self.normal[first];
                self.error[at] = self.error[first];
                self.half[at] = self.half[first];
                continue;
            }
            self.compute(raster, row + dr, col + dc, settings);
            let (a, b) = (self.normal[first], self.normal[at]);
            is_flat &= k != 1 || a[0] * b[0] + a[1] * b[1] + a[2] * b[2] > SHARED_COSINE;
        }
    }

    /// Chessboard distance of each pixel to the next broken link or unbridged gap.
    fn measure_reach(&mut self, raster: &TileRaster) {
        let side = raster.side;
        self.reach.clear();
        self.reach.extend((0..raster.n_pixels()).map(|at| {
            let whole = if raster.holds(at) {
                u32::from_ne_bytes(raster.links[at]) & ANY_BROKEN == 0
            } else {
                raster.bridged[at]
            };
            if whole { MOST_REACH } else { 0 }
        }));
        let reach = &mut self.reach;
        for row in 0..side {
            for col in 0..side {
                let at = row * side + col;
                let mut least = reach[at];
                if col > 0 {
                    least = least.min(reach[at - 1] + 1);
                }
                if row > 0 {
                    least = least.min(reach[at - side] + 1);
                    if col > 0 {
                        least = least.min(reach[at - side - 1] + 1);
                    }
                    if col + 1 < side {
                        least = least.min(reach[at - side + 1] + 1);
                    }
                }
                reach[at] = least;
            }
        }
        for row in (0..side).rev() {
            for col in (0..side).rev() {
                let at = row * side + col;
                let mut least = reach[at];
                if col + 1 < side {
                    least = least.min(reach[at + 1] + 1);
                }
                if row + 1 < side {
                    least = least.min(reach[at + side] + 1);
                    if col > 0 {
                        least = least.min(reach[at + side - 1] + 1);
                    }
                    if col + 1 < side {
                        least = least.min(reach[at + side + 1] + 1);
                    }
                }
                reach[at] = least;
            }
        }
    }

    fn sum(&mut self, raster: &TileRaster) {
        let (side, wide) = (raster.side, raster.side + 1);
        self.table.clear();
        self.table.resize(wide * wide, [0; 4]);
        for row in 0..side {
            let mut line = [0_i32; 4];
            let (below, here) = self.table.split_at_mut((row + 1) * wide);
            let below = &below[row * wide + 1..];
            let from = &raster.xyzr[row * side..(row + 1) * side];
            for ((p, to), low) in from.iter().zip(&mut here[1..wide]).zip(below) {
                // Empty pixels are all zero; `as` saturates beyond 200 km.
                let n = i32::from(p[3] > 0.0);
                let q = [(p[0] * UNIT) as i32, (p[1] * UNIT) as i32, (p[2] * UNIT) as i32, n];
                for i in 0..4 {
                    line[i] = line[i].wrapping_add(q[i]);
                    to[i] = line[i].wrapping_add(low[i]);
                }
            }
        }
    }

    /// Mean of the points of a window relative to `centre` (units of [`UNIT`]), from the table's
    /// entries at its corners: low left, low right, high left, high right. `None` where the window
    /// is empty.
    #[inline]
    fn mean(corners: [[i32; 4]; 4], centre: [i32; 3]) -> Option<[f32; 3]> {
        let [a, b, c, d] = corners;
        let s: [i32; 4] =
            std::array::from_fn(|i| d[i].wrapping_sub(b[i]).wrapping_sub(c[i]).wrapping_add(a[i]));
        let n = s[3];
        if n <= 0 {
            return None;
        }
        let scale = 1.0 / n as f32;
        Some(std::array::from_fn(|i| s[i].wrapping_sub(n.wrapping_mul(centre[i])) as f32 * scale))
    }

    #[inline]
    fn compute(&mut self, raster: &TileRaster, row: usize, col: usize, settings: &Settings) {
        let (side, wide) = (raster.side, raster.side + 1);
        let at = row * side + col;
        let [x, y, z, range] = raster.xyzr[at];
        let sigma = raster.noise.sigma(range);
        let window = (settings.window as f32).max(6.0 * sigma) / range;
        let reach = usize::from(self.reach[at]);
        let most = settings.max_window_pixels.max(1) as f32;
        let pixels =
            |step: f32, most: f32| ((window / step + 0.5).min(most) as usize).clamp(1, reach);
        // Columns converge towards the poles, where a window of the same width holds more of them.
        let squeeze = raster.row_step / raster.col_step[row].min(raster.row_step);
        let (h, v) = (pixels(raster.col_step[row], most * squeeze), pixels(raster.row_step, most));
        let (r0, r1) = (row.saturating_sub(v), (row + v + 1).min(side));
        let (c0, c1) = (col.saturating_sub(h), (col + h + 1).min(side));
        // Both halves include the middle line, so that neither is empty at the tile's border.
        let t = |r: usize, c: usize| self.table[r * wide + c];
        let [low0, low1, high0, high1] = [t(r0, c0), t(r0, c1), t(r1, c0), t(r1, c1)];
        let centre = [x, y, z].map(|v| (v * UNIT) as i32);
        let means = (
            Self::mean([low0, t(r0, col + 1), high0, t(r1, col + 1)], centre),
            Self::mean([t(r0, col), low1, t(r1, col), high1], centre),
            Self::mean([low0, low1, t(row + 1, c0), t(row + 1, c1)], centre),
            Self::mean([t(row, c0), t(row, c1), high0, high1], centre),
        );
        let (Some(left), Some(right), Some(low), Some(high)) = means else {
            return;
        };
        let a: [f32; 3] = std::array::from_fn(|i| right[i] - left[i]);
        let b: [f32; 3] = std::array::from_fn(|i| high[i] - low[i]);
        let n = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        let length2 = n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
        if length2 <= 1e-6 {
            return;
        }
        let towards = n[0] * x + n[1] * y + n[2] * z;
        let scale = if towards > 0.0 { -1.0 } else { 1.0 } / length2.sqrt();
        self.normal[at] = n.map(|v| v * scale);
        // Two half windows of h·(2v+1) points, about h steps apart; the narrower direction counts.
        let spacing = range * (raster.col_step[row] * h as f32).min(raster.row_step * v as f32);
        let n_half = (h.min(v) * (2 * h.max(v) + 1)) as f32;
        self.error[at] = sigma * (2.0 / n_half).sqrt() / spacing.max(1e-6);
        self.half[at] = h.min(v) as u8;
    }

    /// Gives border pixels the normal of a linked neighbour whose tangent plane they lie on.
    fn borrow_at_borders(&mut self, raster: &TileRaster) {
        for at in 0..raster.n_pixels() {
            if !raster.holds(at) || self.reach[at] > 0 {
                continue;
            }
            let [x, y, z, range] = raster.xyzr[at];
            let limit = 3.0 * raster.noise.sigma(range) + 1e-3;
            let mut best: Option<(f32, usize)> = None;
            for direction in 0..4 {
                let Some(other) = linked(raster, at, direction) else {
                    continue;
                };
                // Neighbours that are at the border themselves have no normal to share.
                let other = match self.reach[other] {
                    0 => linked(raster, other, direction).filter(|&o| self.reach[o] > 0),
                    _ => Some(other),
                };
                let Some(other) = other.filter(|&o| self.error[o] > 0.0) else {
                    continue;
                };
                let (n, q) = (self.normal[other], raster.xyzr[other]);
                let off = (n[0] * (x - q[0]) + n[1] * (y - q[1]) + n[2] * (z - q[2])).abs();
                if off <= limit && best.is_none_or(|b| off < b.0) {
                    best = Some((off, other));
                }
            }
            if let Some((_, other)) = best {
                self.normal[at] = self.normal[other];
                self.error[at] = self.error[other];
                self.half[at] = 1;
            }
        }
    }
}
