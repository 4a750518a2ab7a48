//! The record of a point on its way into a tile (20 bytes, also in the spill file), and the order
//! of records within a tile.

use bytemuck::{Pod, Zeroable};
use contract::{MAX_SKIP, TILE_SIDE, TileAt, Weigh};

/// Coordinates, place in the mask (48 bits) and pixel within the tile.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub(super) struct Record {
    /// Coordinates in the scan frame, metres.
    pub(super) xyz: [f32; 3],
    place_low: u32,
    place_high: u16,
    /// Pixel within the tile: row · 256 + column.
    pub(super) pixel: u16,
}

impl Record {
    /// Length of a record, bytes.
    pub(super) const BYTES: usize = size_of::<Self>();

    /// A record; `place` must be less than 2⁴⁸ (281 000 billion points: no mask is that long).
    #[inline]
    pub(super) fn new(xyz: [f32; 3], place: u64, pixel: u16) -> Self {
        Self { xyz, place_low: place as u32, place_high: (place >> 32) as u16, pixel }
    }

    /// Place in the mask.
    #[inline]
    pub(super) fn place(&self) -> u64 {
        u64::from(self.place_high) << 32 | u64::from(self.place_low)
    }
}

/// Number of levels of a tile, coarsest first. A level and all before it together hold the points
/// of the first occupied pixel of each square of 2ⁿ × 2ⁿ pixels, n being the number of levels after
/// it.
pub(super) const N_LEVELS: usize = MAX_SKIP as usize + 1;
/// Number of pixels of a tile.
pub(super) const N_PIXELS: usize = (TILE_SIDE * TILE_SIDE) as usize;

/// The position of each record in its tile: the block of its level, sorted by pixel in a counting
/// sort, which keeps records of a pixel in the order of their places.
pub(super) struct PixelOrder {
    /// Level of each pixel, and the position of its next record there.
    level: Vec<u8>,
    next: Vec<u32>,
    /// For each square size and square: whether an occupied pixel was met in it.
    taken: [Vec<bool>; MAX_SKIP as usize],
}

impl Default for PixelOrder {
    fn default() -> Self {
        let squares = |step: usize| vec![false; N_PIXELS >> (2 * (step + 1))];
        let taken = std::array::from_fn(squares);
        Self { level: vec![0; N_PIXELS], next: vec![0; N_PIXELS], taken }
    }
}

impl PixelOrder {
    /// Counts the records of one tile and returns the number of records of each level.
    pub(super) fn begin(&mut self, records: &[Record]) -> [u32; N_LEVELS] {
        self.next.fill(0);
        self.taken.iter_mut().for_each(|taken| taken.fill(false));
        for r in records {
            self.next[usize::from(r.pixel)] += 1;
        }
        let mut n_of = [0; N_LEVELS];
        for pixel in 0..N_PIXELS {
            let n = self.next[pixel];
            if n == 0 {
                continue;
            }
            let level = MAX_SKIP as usize - self.n_first(pixel);
            self.level[pixel] = level as u8;
            self.next[pixel] = n_of[level];
            n_of[level] += n;
        }
        n_of
    }

    /// Number of square sizes, from 2 × 2 pixels upwards, for which this pixel is the first
    /// occupied one of its square.
    fn n_first(&mut self, pixel: usize) -> usize {
        let side = TILE_SIDE as usize;
        let (row, col) = (pixel / side, pixel % side);
        let is_first = |(step, taken): (usize, &mut Vec<bool>)| {
            let step = step + 1;
            let square = (row >> step) * (side >> step) + (col >> step);
            !std::mem::replace(&mut taken[square], true)
        };
        // A square that was met lies within larger squares that were met as well.
        self.taken.iter_mut().enumerate().map(is_first).take_while(|first| *first).count()
    }

    /// Level of the next record and its position there; call it once for each record, in order.
    #[inline]
    pub(super) fn next(&mut self, record: &Record) -> (usize, usize) {
        let pixel = usize::from(record.pixel);
        let at = &mut self.next[pixel];
        *at += 1;
        (usize::from(self.level[pixel]), *at as usize - 1)
    }
}

/// The records of a tile, or of a part of a tile with too many points.
pub(super) struct TilePart {
    pub(super) at: TileAt,
    pub(super) records: Vec<Record>,
}

impl Weigh for TilePart {
    fn weight_bytes(&self) -> usize {
        size_of::<Self>() + self.records.len() * Record::BYTES
    }

    fn n_points(&self) -> u64 {
        self.records.len() as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::{BTreeMap, BTreeSet};

    /// The level of each of these pixels, found by asking each square for its first pixel.
    fn levels(pixels: &BTreeSet<u16>) -> BTreeMap<u16, usize> {
        let square = |pixel: u16, step: u32| ((pixel >> 8) >> step, (pixel & 255) >> step);
        let is_first = |pixel: u16, step: u32| {
            pixels.iter().find(|p| square(**p, step) == square(pixel, step)) == Some(&pixel)
        };
        let n_first = |pixel: u16| (1..=MAX_SKIP).filter(|step| is_first(pixel, *step)).count();
        pixels.iter().map(|&pixel| (pixel, MAX_SKIP as usize - n_first(pixel))).collect()
    }

    #[test]
    fn records_are_sorted_by_level_pixel_and_place() {
        let random = |i: u64| i.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 20;
        let records: Vec<Record> = (0..5000_u64)
            .map(|i| {
                let (x, row, col) = (random(i), random(i + 7777) % 40, random(i + 99_999) % 50);
                Record::new([x as f32, 0.0, 1.0], i << 21, (row * 256 + col) as u16)
            })
            .collect();
        let level = levels(&records.iter().map(|r| r.pixel).collect());
        let mut expected = records.clone();
        expected.sort_by_key(|r| (level[&r.pixel], r.pixel, r.place()));
        let n_of: [u32; N_LEVELS] =
            std::array::from_fn(|l| records.iter().filter(|r| level[&r.pixel] == l).count() as u32);
        let mut order = PixelOrder::default();
        for _ in 0..2 {
            assert_eq!(order.begin(&records), n_of);
            let start = |level: usize| n_of[..level].iter().sum::<u32>() as usize;
            let mut sorted = vec![Record::zeroed(); records.len()];
            for r in &records {
                let (level, at) = order.next(r);
                sorted[start(level) + at] = *r;
            }
            assert!(sorted == expected);
        }
    }
}
