//! Encoding of the points of one tile to bytes and a catalogue entry, and decoding.
//!
//! Each level, coarsest first, has three little-endian arrays, each padded with zeros to 64 bytes:
//! xyz (f32 × 3, scan frame, metres), place (u32, less the tile's first place), pixel (u16). A
//! reader that needs only part of a dense tile reads its first levels.

use super::catalogue::TileEntry;
use super::layout::{blocks, layout};
use super::record::{N_LEVELS, N_PIXELS, PixelOrder, Record, TilePart};
use contract::{Map, Result, Scan, Tile, TilePoints, Weigh};
use geometry::{Aabb, Pose};

#[cfg(target_endian = "big")]
compile_error!("the store casts little-endian arrays");

/// Sorts, bounds and encodes tiles.
pub(super) struct Encode {
    world_from_scan: Vec<Pose>,
}

/// An encoded tile; the offset of its entry is set when it is written.
pub(super) struct Encoded {
    pub(super) entry: TileEntry,
    pub(super) bytes: Vec<u8>,
}

impl Weigh for Encoded {
    fn weight_bytes(&self) -> usize {
        size_of::<Self>() + self.bytes.len()
    }

    fn n_points(&self) -> u64 {
        self.entry.n_points
    }
}

impl Encode {
    pub(super) fn new(scans: &[Scan]) -> Self {
        Self { world_from_scan: scans.iter().map(|s| s.world_from_scan).collect() }
    }

    fn bounds(&self, scan: u32, records: &[Record]) -> Aabb {
        let world_from_scan = self.world_from_scan.get(scan as usize).copied().unwrap_or_default();
        let r = world_from_scan.rotation.to_rotation_matrix();
        let (m, t) = (r.matrix(), world_from_scan.translation.vector);
        let mut bounds = Aabb::EMPTY;
        for record in records {
            let p = record.xyz.map(f64::from);
            bounds.add(std::array::from_fn(|i| {
                m[(i, 0)] * p[0] + m[(i, 1)] * p[1] + m[(i, 2)] * p[2] + t[i]
            }));
        }
        bounds
    }
}

impl Map for Encode {
    type In = TilePart;
    type Out = Encoded;
    type Scratch = PixelOrder;

    fn apply(&self, mut part: TilePart, order: &mut PixelOrder) -> Result<Encoded> {
        Ok(self.encode(&mut part, order, Vec::new()))
    }
}

impl Encode {
    /// Encodes the points of a part into `bytes`, memory that is used again.
    pub(super) fn encode(
        &self,
        part: &mut TilePart,
        order: &mut PixelOrder,
        mut bytes: Vec<u8>,
    ) -> Encoded {
        let records = &mut part.records;
        if !records.is_sorted_by_key(Record::place) {
            records.sort_unstable_by_key(Record::place);
        }
        let bounds = self.bounds(part.at.scan.0, records);
        let first_place = records.first().map_or(0, Record::place);
        let n_of = order.begin(records);
        let blocks = blocks(&n_of);
        bytes.clear();
        bytes.resize(blocks[N_LEVELS - 1].end, 0);
        let arrays: [[usize; 3]; N_LEVELS] = std::array::from_fn(|level| {
            let [xyz, place, pixel, _] = layout(u64::from(n_of[level]));
            [xyz, place, pixel].map(|at| blocks[level].start + at as usize)
        });
        for r in &*records {
            let (level, at) = order.next(r);
            let [xyz, place, pixel] = arrays[level];
            let mut put = |at: usize, of: &[u8]| bytes[at..at + of.len()].copy_from_slice(of);
            put(xyz + 12 * at, bytemuck::bytes_of(&r.xyz));
            put(place + 4 * at, &((r.place() - first_place) as u32).to_le_bytes());
            put(pixel + 2 * at, &r.pixel.to_le_bytes());
        }
        let entry = TileEntry {
            at: part.at,
            n_points: records.len() as u64,
            first_place,
            bounds,
            range: range(records),
            offset: 0,
            n_of,
            checksums: blocks.map(|block| crc32c::crc32c(&bytes[block])),
        };
        Encoded { entry, bytes }
    }
}

/// Number of points whose range is looked at to estimate the range of a tile.
const PROBES: usize = 64;
/// Share of the points that lie within the range of a tile.
const NEARER: f64 = 0.8;

/// Distance from the origin of the scan within which [`NEARER`] of the records lie, metres; 0 for
/// few records.
fn range(records: &[Record]) -> f32 {
    let step = (records.len() / PROBES).max(1);
    let range = |r: &Record| r.xyz.iter().map(|v| v * v).sum::<f32>().sqrt();
    let mut ranges: Vec<f32> = records.iter().step_by(step).map(range).collect();
    if ranges.len() < PROBES / 2 {
        return 0.0;
    }
    let at = ((ranges.len() - 1) as f64 * NEARER) as usize;
    *ranges.select_nth_unstable_by(at, f32::total_cmp).1
}

/// The points of a level of a tile, borrowed from its aligned bytes, whose length is that of
/// [`layout`].
pub(super) fn points<'a>(entry: &TileEntry, level: usize, bytes: &'a [u8]) -> TilePoints<'a> {
    let n = entry.n_of[level] as usize;
    let [_, place, pixel, _] = layout(n as u64).map(|v| v as usize);
    TilePoints {
        at: entry.at,
        first_place: entry.first_place,
        xyz: bytemuck::cast_slice(&bytes[..12 * n]),
        place: bytemuck::cast_slice(&bytes[place..place + 4 * n]),
        pixel: bytemuck::cast_slice(&bytes[pixel..pixel + 2 * n]),
        skip: (N_LEVELS - 1 - level) as u32,
    }
}

/// Copies the coarsest levels of a tile, as many as `bytes` (aligned) holds, and sorts their points
/// by pixel.
pub(super) fn decode(entry: &TileEntry, n_levels: usize, bytes: &[u8]) -> Tile {
    let blocks = blocks(&entry.n_of);
    let levels: Vec<TilePoints<'_>> =
        (0..n_levels).map(|l| points(entry, l, &bytes[blocks[l].clone()])).collect();
    let n = levels.iter().map(|level| level.pixel.len()).sum();
    let mut tile = Tile {
        at: entry.at,
        first_place: entry.first_place,
        place: vec![0; n],
        pixel: vec![0; n],
        xyz: vec![[0.0; 3]; n],
        bounds: entry.bounds,
        skip: (N_LEVELS - n_levels) as u32,
        n_all: entry.n_points,
    };
    // A counting sort. All points of a pixel are in one level, in the order of their places.
    let mut next = vec![0_u32; N_PIXELS];
    levels.iter().flat_map(|level| level.pixel).for_each(|pixel| next[usize::from(*pixel)] += 1);
    let mut sum = 0;
    next.iter_mut().for_each(|n| sum += std::mem::replace(n, sum));
    for level in levels {
        for ((pixel, place), xyz) in level.pixel.iter().zip(level.place).zip(level.xyz) {
            let next = &mut next[usize::from(*pixel)];
            let at = *next as usize;
            *next += 1;
            (tile.pixel[at], tile.place[at], tile.xyz[at]) = (*pixel, *place, *xyz);
        }
    }
    tile
}
