//! The pixels of one tile: which neighbours are connected, which points are veils, and normals.

use contract::{Lattice, TILE_SIDE, Tile};

const SIDE: i32 = TILE_SIDE as i32;
const EMPTY: u32 = u32::MAX;
/// Tangent of the steepest incidence at which neighbours belong to one surface: 80° (METHOD.md §2).
const MAX_SLOPE: f32 = 5.67;
/// Half-width over which a normal is computed, metres: 2 mm of noise tilt it by about 5°.
const NORMAL_SPAN: f32 = 0.015;

/// The point of each pixel of a tile, and the ranges of the points.
#[derive(Debug, Default)]
pub(crate) struct PixelRaster {
    /// Index of the first point of each pixel, or `EMPTY`.
    first: Vec<u32>,
    ranges: Vec<f32>,
    /// Angle between neighbouring pixels, radians.
    step: f32,
    /// Largest step in range that noise alone causes, metres.
    noise: f32,
}

impl PixelRaster {
    /// Fills the raster of a tile; memory is reused.
    pub(crate) fn fill(&mut self, tile: &Tile, lattice: &Lattice, sigma_range: f64) {
        self.first.clear();
        self.first.resize((SIDE * SIDE) as usize, EMPTY);
        self.ranges.clear();
        for (i, p) in tile.xyz.iter().enumerate() {
            self.ranges.push((p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt());
            let slot = &mut self.first[usize::from(tile.pixel[i])];
            if *slot == EMPTY {
                *slot = i as u32;
            }
        }
        self.step = lattice.row_step.max(lattice.col_step) as f32;
        self.noise = (3.0 * std::f64::consts::SQRT_2 * sigma_range) as f32;
    }

    /// Index of the point in the pixel at offset `by` from that of point `i`, inside the tile.
    #[inline]
    pub(crate) fn beside(&self, tile: &Tile, i: usize, by: [i32; 2]) -> Option<usize> {
        let pixel = i32::from(tile.pixel[i]);
        let (row, col) = (pixel / SIDE + by[0], pixel % SIDE + by[1]);
        if row < 0 || col < 0 || row >= SIDE || col >= SIDE {
            return None;
        }
        let at = self.first[(row * SIDE + col) as usize];
        (at != EMPTY).then_some(at as usize)
    }

    /// Whether two points `pixels` apart may lie on one surface.
    #[inline]
    pub(crate) fn connected(&self, a: usize, b: usize, pixels: i32) -> bool {
        let (ra, rb) = (self.ranges[a], self.ranges[b]);
        let limit = 0.5 * (ra + rb) * self.step * pixels as f32 * MAX_SLOPE + self.noise;
        (ra - rb).abs() <= limit
    }

    /// Whether a point hangs between an edge and the surface behind it: along a row or column it is
    /// disconnected on both sides.
    pub(crate) fn is_veil(&self, tile: &Tile, i: usize) -> bool {
        let cut = |by: [i32; 2]| self.beside(tile, i, by).map(|other| !self.connected(i, other, 1));
        [[0, 1], [1, 0]].into_iter().any(|by| {
            match (cut(by), cut([-by[0], -by[1]])) {
                (Some(a), Some(b)) => a && b,
                // No return on the other side: a single disconnected side is enough.
                (Some(a), None) | (None, Some(a)) => a,
                (None, None) => false,
            }
        })
    }

    /// Unit normal at a point from its neighbours on both sides, scan frame, with arbitrary sign;
    /// `None` near edges.
    pub(crate) fn normal(&self, tile: &Tile, i: usize) -> Option<[f32; 3]> {
        let pixels =
            ((NORMAL_SPAN / (self.ranges[i] * self.step).max(1e-6)).round() as i32).clamp(1, 12);
        let across = |by: [i32; 2]| -> Option<[f32; 3]> {
            let a = self.beside(tile, i, by)?;
            let b = self.beside(tile, i, [-by[0], -by[1]])?;
            if !self.connected(i, a, pixels) || !self.connected(i, b, pixels) {
                return None;
            }
            let (p, q) = (tile.xyz[a], tile.xyz[b]);
            Some([p[0] - q[0], p[1] - q[1], p[2] - q[2]])
        };
        let (u, v) = (across([0, pixels])?, across([pixels, 0])?);
        let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
        (length > 1e-9).then(|| n.map(|c| c / length))
    }
}
