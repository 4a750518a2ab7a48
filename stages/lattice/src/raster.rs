//! A tile as a dense raster: for each pixel the nearest return, its range, its links to neighbours,
//! and whether it is a veil.

use crate::Settings;
use crate::links;
use crate::noise::Noise;
use contract::{Lattice, TILE_SIDE, Tile};

/// Largest level of subsampling of a dense tile: every fourth row and column is read, a sixteenth
/// of the pixels.
const MAX_SKIP: u32 = 2;
/// Marks a pixel without a return.
pub(crate) const NONE: u32 = u32::MAX;

/// The dense raster of one tile; buffers are reused from tile to tile.
#[derive(Debug, Default)]
pub(crate) struct Raster {
    /// Number of pixels along a side.
    pub(crate) side: usize,
    /// Level of subsampling: each 2^skip-th row and column is read.
    pub(crate) skip: u32,
    /// Index of the nearest return in the tile's points, [`NONE`] where the pixel is empty or a
    /// veil.
    pub(crate) point: Vec<u32>,
    /// Coordinates in the scan frame and range, metres; range 0 where the pixel is empty.
    pub(crate) xyzr: Vec<[f32; 4]>,
    /// Links to the left, right, lower and upper neighbour, see [`links`].
    pub(crate) links: Vec<[u8; 4]>,
    /// Whether a link leads across an empty pixel.
    pub(crate) bridged: Vec<bool>,
    /// Range noise of this tile.
    pub(crate) noise: Noise,
    /// Angle between rows, radians.
    pub(crate) row_step: f32,
    /// Angle between columns on the sphere, radians, for each row of the tile.
    pub(crate) col_step: Vec<f32>,
    /// Pixels of veils, ascending.
    pub(crate) veils: Vec<u16>,
}

impl Raster {
    /// Fills the raster with the nearest returns of `tile`, links them, and removes the veils. Each
    /// 2^`skip` rows and columns of the lattice become one; the first of their pixels with a return
    /// represents them.
    pub(crate) fn fill(&mut self, tile: &Tile, lattice: &Lattice, skip: u32, settings: &Settings) {
        self.skip = skip;
        self.side = TILE_SIDE as usize >> skip;
        let n_pixels = self.n_pixels();
        self.point.clear();
        self.point.resize(n_pixels, NONE);
        self.xyzr.clear();
        self.xyzr.resize(n_pixels, [0.0; 4]);
        for (i, (pixel, p)) in tile.pixel.iter().zip(&tile.xyz).enumerate() {
            let at = self.pixel(*pixel);
            // Points are sorted by pixel, so this cell may hold another one already.
            let old = self.point[at];
            if old != NONE && tile.pixel[old as usize] != *pixel {
                continue;
            }
            let range = (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt();
            // A return at the scanner itself has no direction and is no surface.
            if range > 1e-3 && (old == NONE || range < self.xyzr[at][3]) {
                self.point[at] = i as u32;
                self.xyzr[at] = [p[0], p[1], p[2], range];
            }
        }
        let step = f64::from(1 << skip);
        self.row_step = (lattice.row_step * step) as f32;
        self.col_step.clear();
        self.col_step.extend((0..self.side as u32).map(|row| {
            let row = f64::from(tile.at.row * TILE_SIDE + (row << skip));
            let elevation = lattice.first_elevation + row * lattice.row_step;
            (lattice.col_step * step * elevation.cos().max(0.01)) as f32
        }));
        self.noise.measure(&self.xyzr, self.side, settings);
        links::link(self, settings);
        self.take_veils();
    }

    /// Number of pixels.
    pub(crate) fn n_pixels(&self) -> usize {
        self.side * self.side
    }

    /// Number of points of the tile that each point of the raster represents.
    pub(crate) fn weight(&self) -> u32 {
        1 << (2 * self.skip)
    }

    /// Index in the raster of a pixel of the tile.
    #[inline]
    fn pixel(&self, pixel: u16) -> usize {
        let (row, col) = (usize::from(pixel) >> 8, usize::from(pixel) & 255);
        (row >> self.skip) * self.side + (col >> self.skip)
    }

    /// Largest level of subsampling that leaves points up to `range` metres away no farther than
    /// `spacing` metres from each other. A scan ten times as dense adds nothing to floors and
    /// clusters, but takes ten times as long.
    pub(crate) fn skip(range: f32, lattice: &Lattice, spacing: f64) -> u32 {
        let across = f64::from(range) * lattice.row_step.max(lattice.col_step);
        let is_dense = |skip: &u32| across > 0.0 && across * f64::from(1 << skip) <= spacing;
        (0..=MAX_SKIP).rfind(is_dense).unwrap_or(0)
    }

    /// Finds the veils and empties their pixels.
    fn take_veils(&mut self) {
        links::veils(self);
        let veils = std::mem::take(&mut self.veils);
        for &at in &veils {
            self.point[usize::from(at)] = NONE;
            self.xyzr[usize::from(at)] = [0.0; 4];
        }
        self.veils = veils;
    }

    /// Whether pixel `at` holds a return that is not a veil.
    #[inline]
    pub(crate) fn holds(&self, at: usize) -> bool {
        self.point[at] != NONE
    }
}

/// For each point of `tile` whether it is a veil point (a mixed pixel between a near edge and the
/// surface behind it). All are `false` where the scan has no lattice, since veils cannot be found
/// then.
#[must_use]
pub fn veils(tile: &Tile, scan: &contract::Scan, settings: &Settings) -> Vec<bool> {
    let mut out = vec![false; tile.len()];
    let Some(lattice) = &scan.lattice else {
        return out;
    };
    let mut raster = Raster::default();
    raster.fill(tile, lattice, 0, settings);
    raster.flag_veils(tile, &mut out);
    out
}

impl Raster {
    /// Sets the flag of each veil point of the tile that filled this raster without subsampling.
    pub(crate) fn flag_veils(&self, tile: &Tile, flags: &mut [bool]) {
        // Points and veils are both sorted by pixel. Of several returns in a pixel only the nearest
        // was judged.
        let mut at = 0;
        for &pixel in &self.veils {
            while at < tile.len() && tile.pixel[at] < pixel {
                at += 1;
            }
            let first = at;
            while at < tile.len() && tile.pixel[at] == pixel {
                at += 1;
            }
            let range = |i: usize| tile.xyz[i].map(|v| v * v).iter().sum::<f32>();
            if let Some(nearest) = (first..at).min_by(|a, b| range(*a).total_cmp(&range(*b))) {
                flags[nearest] = true;
            }
        }
    }
}
