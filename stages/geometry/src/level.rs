//! One resolution level of a depth image: the nearest and the farthest hit of each cell and its
//! neighbours, and how the next coarser level is made.

use crate::lanes::{LANES, Lanes};

/// A raster of nearest and farthest ranges at one resolution.
#[derive(Debug, Clone)]
pub(crate) struct DepthLevel {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// `[near, far, around]` in metres, row-major; NaN where unknown, +∞ where no beam returned.
    /// `around` is the smallest `near` of the cell and its eight neighbours: at a silhouette all
    /// beams of one cell may have missed a body that those of the next cell hit.
    pub(crate) cells: Vec<[f32; 3]>,
}

impl DepthLevel {
    /// Index of the cell of a hit and its range, metres, from the hit in the camera frame; `None`
    /// outside of the raster.
    #[inline]
    pub(crate) fn find(&self, focal: f32, p: [f32; 3]) -> Option<(usize, f32)> {
        if p[2] <= 1e-3 {
            return None;
        }
        let inverse = focal / p[2];
        let u = p[0] * inverse + 0.5 * self.width as f32;
        let v = p[1] * inverse + 0.5 * self.height as f32;
        let inside = u >= 0.0 && v >= 0.0 && u < self.width as f32 && v < self.height as f32;
        let range = (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt();
        inside.then(|| (v as usize * self.width + u as usize, range))
    }

    /// Indices and ranges of several hits; the index is `u32::MAX` outside of the raster.
    #[inline]
    pub(crate) fn find_lanes(&self, focal: f32, [x, y, z]: &Lanes) -> ([u32; LANES], [f32; LANES]) {
        let (width, height) = (self.width as f32, self.height as f32);
        let (mut at, mut range) = ([u32::MAX; LANES], [0.0; LANES]);
        for i in 0..LANES {
            let inverse = focal / z[i];
            let (u, v) = (x[i] * inverse + 0.5 * width, y[i] * inverse + 0.5 * height);
            let is_in = z[i] > 1e-3 && u >= 0.0 && v >= 0.0 && u < width && v < height;
            let cell =
                (v as i32 as u32).wrapping_mul(self.width as u32).wrapping_add(u as i32 as u32);
            at[i] = if is_in { cell } else { u32::MAX };
            range[i] = (x[i] * x[i] + y[i] * y[i] + z[i] * z[i]).sqrt();
        }
        (at, range)
    }

    /// Marks cells as "no return": those that are empty with all neighbours within `window` cells
    /// and for whose column and row `is_silent` holds. The neighbourhood is a separable running
    /// maximum, so that only as many rows are kept as it needs.
    pub(crate) fn each_open(&mut self, window: i32, is_silent: impl Fn(usize, usize) -> bool) {
        let (window, width) = (usize::try_from(window).unwrap_or(0), self.width);
        let n_kept = 2 * window + 1;
        let mut near_hit = vec![vec![false; width]; n_kept];
        let [mut hit, mut is_near, mut silent] = [0; 3].map(|_| vec![false; width]);
        let mut n_read = 0;
        for v in 0..self.height {
            let rows = v.saturating_sub(window)..(v + window + 1).min(self.height);
            // These rows must be read before any of their own cells is marked.
            for v in n_read..rows.end {
                let near = &mut near_hit[v % n_kept];
                near.fill(false);
                let row = &self.cells[v * width..(v + 1) * width];
                hit.iter_mut().zip(row).for_each(|(hit, cell)| *hit = !cell[0].is_nan());
                for by in 0..=window.min(width) {
                    near[by..].iter_mut().zip(&hit).for_each(|(near, hit)| *near |= *hit);
                    near.iter_mut().zip(&hit[by..]).for_each(|(near, hit)| *near |= *hit);
                }
            }
            n_read = rows.end;
            is_near.fill(false);
            for v in rows {
                let near = is_near.iter_mut().zip(&near_hit[v % n_kept]);
                near.for_each(|(own, near)| *own |= *near);
            }
            // `is_silent` is evaluated for all cells of the row, so that the loop is vectorised.
            let open = silent.iter_mut().zip(&is_near).enumerate();
            open.for_each(|(u, (silent, is_near))| *silent = !*is_near & is_silent(u, v));
            let row = self.cells[v * width..(v + 1) * width].iter_mut().zip(&silent);
            row.filter(|own| *own.1).for_each(|(cell, _)| *cell = [f32::INFINITY; 3]);
        }
    }

    /// The next coarser level; its `around` is not yet filled.
    pub(crate) fn halved(&self) -> Self {
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let mut cells = vec![[f32::NAN; 3]; width * height];
        for (v, row) in self.cells.chunks(self.width).enumerate() {
            let out = &mut cells[v / 2 * width..(v / 2 + 1) * width];
            for (pair, to) in row.chunks(2).zip(out) {
                for from in pair {
                    to[0] = to[0].min(from[0]);
                    // "No return" must not hide a hit from `far`; it stays only where the whole
                    // cell is empty.
                    to[1] = match (to[1].is_finite(), from[1].is_finite()) {
                        (true, false) => to[1],
                        (false, true) => from[1],
                        _ => to[1].max(from[1]),
                    };
                }
            }
        }
        Self { width, height, cells }
    }

    /// Fills the `around` values of all cells.
    pub(crate) fn look_around(&mut self) {
        let width = self.width;
        // For each of three rows: the nearest hit of each cell and those beside it. `f32::min`
        // ignores NaN, so unknown neighbours have no effect.
        let mut across = vec![vec![f32::NAN; width]; 3];
        let mut near = vec![f32::NAN; width];
        let mut n_read = 0;
        for v in 0..self.height {
            let rows = v.saturating_sub(1)..(v + 2).min(self.height);
            for v in n_read..rows.end {
                let (row, out) = (&self.cells[v * width..(v + 1) * width], &mut across[v % 3]);
                near.iter_mut().zip(row).for_each(|(near, cell)| *near = cell[0]);
                out.copy_from_slice(&near);
                out[1..].iter_mut().zip(&near).for_each(|(least, near)| *least = least.min(*near));
                out.iter_mut().zip(&near[1..]).for_each(|(least, near)| *least = least.min(*near));
            }
            n_read = rows.end;
            near.fill(f32::NAN);
            for v in rows {
                let own = near.iter_mut().zip(&across[v % 3]);
                own.for_each(|(least, own)| *least = least.min(*own));
            }
            let row = &mut self.cells[v * width..(v + 1) * width];
            row.iter_mut().zip(&near).for_each(|(cell, least)| cell[2] = *least);
        }
    }
}
