//! The dense raster of a tile: nearest return of each pixel, its range, its links to neighbours,
//! and whether it is a veil point.

use crate::noise::RangeNoise;
use contract::{Lattice, Tile};

/// Largest level of subsampling of a dense tile: every fourth row and column is read, a sixteenth
/// of the pixels.
const MAX_SKIP: u32 = 2;
/// Marks a pixel without a return.
pub(crate) const NONE: u32 = u32::MAX;

/// The dense raster of one tile; buffers are reused from tile to tile.
#[derive(Debug, Default)]
pub(crate) struct TileRaster {
    /// Number of pixels along a side.
    pub(crate) side: usize,
    /// Level of subsampling: each 2^skip-th row and column is read.
    pub(crate) skip: u32,
    /// Index of the nearest return in the tile's points, [`NONE`] where the pixel is empty or a
    /// veil.
    pub(crate) point: Vec<u32>,
    /// Coordinates in the scan frame and range, metres; range 0 where the pixel is empty.
    pub(crate) xyzr: Vec<[f32; 4]>,
    /// Links to the left, right, lower and upper neighbour, see [`crate::links`].
    pub(crate) links: Vec<[u8; 4]>,
    /// Whether a link leads across an empty pixel.
    pub(crate) bridged: Vec<bool>,
    /// Range noise of this tile.
    pub(crate) noise: RangeNoise,
    /// Angle between rows, radians.
    pub(crate) row_step: f32,
    /// Angle between columns on the sphere, radians, for each row of the tile.
    pub(crate) col_step: Vec<f32>,
    /// Pixels of veils, ascending.
    pub(crate) veils: Vec<u16>,
}

impl TileRaster {
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
    pub(crate) fn pixel(&self, pixel: u16) -> usize {
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

    /// Whether pixel `at` holds a return that is not a veil.
    #[inline]
    pub(crate) fn holds(&self, at: usize) -> bool {
        self.point[at] != NONE
    }
}

impl TileRaster {
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
