//! A tile: the points of a rectangle of one lattice. Tiles are the unit of disk layout, of parallel
//! work and of reuse between runs.

use crate::{Pixel, ScanId, Weigh};
use geometry::Aabb;
use std::collections::BTreeMap;

/// Pixels along each side of a tile.
pub const TILE_SIDE: u32 = 256;
/// Largest level of subsampling: of each 8 × 8 pixels one is kept.
pub const MAX_SKIP: u32 = 3;

/// Position of a tile. With a lattice: which 256 × 256 pixels of it. For a scan without lattice:
/// which square of the ground, 256 × 256 cells of 0.05 m about the scan's origin, with the row from
/// y and the column from x, both offset by 2²⁰ tiles so that they are never negative.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TileAt {
    /// The scan of the points.
    pub scan: ScanId,
    /// Row of the tile: pixel row / 256.
    pub row: u32,
    /// Column of the tile: pixel column / 256.
    pub col: u32,
}

/// The points of one tile, sorted by pixel, then by place in the mask: all of them, or a subsample
/// with one pixel of each square of pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct Tile {
    /// Position of the tile.
    pub at: TileAt,
    /// Smallest place in the mask of the points of this tile.
    pub first_place: u64,
    /// Place in the mask of each point, less `first_place`.
    pub place: Vec<u32>,
    /// Pixel within the tile: row·256 + column.
    pub pixel: Vec<u16>,
    /// Coordinates in the scan frame, metres.
    pub xyz: Vec<[f32; 3]>,
    /// Bounds of all points of the tile in the world, metres; those left out count too.
    pub bounds: Aabb,
    /// Level of subsampling: of each square of 2^`skip` by 2^`skip` pixels only the points of the
    /// first pixel that has any are kept.
    pub skip: u32,
    /// Number of points of the tile before subsampling.
    pub n_all: u64,
}

/// The points of a tile that one level of subsampling adds, borrowed where they lie. They belong to
/// pixels that are the first ones with points in their squares of 2^`skip` by 2^`skip` pixels, and
/// not in larger squares, up to 2^[`MAX_SKIP`].
#[derive(Debug, Clone, Copy)]
pub struct TilePoints<'a> {
    /// As in [`Tile`].
    pub at: TileAt,
    /// As in [`Tile`].
    pub first_place: u64,
    /// As in [`Tile`].
    pub place: &'a [u32],
    /// As in [`Tile`].
    pub pixel: &'a [u16],
    /// As in [`Tile`].
    pub xyz: &'a [[f32; 3]],
    /// Level of subsampling that adds these points.
    pub skip: u32,
}

impl Tile {
    /// Edge of a ground cell of a scan without lattice, metres.
    pub const GROUND_CELL: f32 = 0.05;
    /// Offset of ground tiles, so that their row and column stay positive.
    pub const GROUND_OFFSET: i64 = 1 << 20;

    /// Number of points.
    #[must_use]
    pub fn len(&self) -> usize {
        self.xyz.len()
    }

    /// Whether the tile has no points.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.xyz.is_empty()
    }

    /// The tile subsampled to level `skip`.
    #[must_use]
    pub fn thinned(&self, skip: u32) -> Self {
        let square = |pixel: u16| ((pixel >> 8) >> skip, (pixel & 255) >> skip);
        let mut first = BTreeMap::new();
        for &pixel in &self.pixel {
            first.entry(square(pixel)).or_insert(pixel);
        }
        let stays = |i: &usize| first[&square(self.pixel[*i])] == self.pixel[*i];
        let stays: Vec<usize> = (0..self.len()).filter(stays).collect();
        Self {
            place: stays.iter().map(|&i| self.place[i]).collect(),
            pixel: stays.iter().map(|&i| self.pixel[i]).collect(),
            xyz: stays.iter().map(|&i| self.xyz[i]).collect(),
            skip: self.skip.max(skip),
            ..*self
        }
    }

    /// Pixel of point `i` in the whole lattice.
    #[must_use]
    pub fn pixel_at(&self, i: usize) -> Pixel {
        let pixel = u32::from(self.pixel[i]);
        Pixel {
            row: self.at.row * TILE_SIDE + pixel / TILE_SIDE,
            col: self.at.col * TILE_SIDE + pixel % TILE_SIDE,
        }
    }
}

impl Weigh for Tile {
    fn weight_bytes(&self) -> usize {
        size_of::<Self>() + self.xyz.len() * 12 + self.place.len() * 4 + self.pixel.len() * 2
    }

    fn n_points(&self) -> u64 {
        self.n_all
    }
}
