//! Points of one tile in, its bytes on disk and its catalogue entry out; and back.
//!
//! Three little-endian arrays, each padded with zeros to 64 bytes: xyz (f32 × 3), place (u32, less the tile's first
//! place), pixel (u16).

use super::catalogue::{ALIGN, TileEntry};
use super::parts::Part;
use super::record::{PixelOrder, Record};
use contract::{Map, Result, Scan, Tile, TilePoints, Weigh};
use geometry::{Aabb, Pose};

#[cfg(target_endian = "big")]
compile_error!("the store casts little-endian arrays");

/// Sorts, bounds and encodes tiles.
pub(super) struct Encode {
    world_from_scan: Vec<Pose>,
}

/// A tile as it goes to disk; the entry's offset is still to be set.
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
    type In = Part;
    type Out = Encoded;
    type Scratch = PixelOrder;

    fn apply(&self, mut part: Part, order: &mut PixelOrder) -> Result<Encoded> {
        Ok(self.encode(&mut part, order, Vec::new()))
    }
}

impl Encode {
    /// The tile of some points, its bytes in memory that was used before.
    pub(super) fn encode(
        &self,
        part: &mut Part,
        order: &mut PixelOrder,
        mut bytes: Vec<u8>,
    ) -> Encoded {
        let records = &mut part.records;
        if !records.is_sorted_by_key(Record::place) {
            records.sort_unstable_by_key(Record::place);
        }
        let bounds = self.bounds(part.at.scan.0, records);
        let first_place = records.first().map_or(0, Record::place);
        let n = records.len();
        let [xyz_at, place_at, pixel_at, end] = layout(n as u64).map(|v| v as usize);
        bytes.clear();
        bytes.resize(end, 0);
        let (xyz, rest) = bytes[xyz_at..].split_at_mut(place_at);
        let (place, pixel) = rest.split_at_mut(pixel_at - place_at);
        order.begin(records);
        for r in &*records {
            let at = order.next(r);
            xyz[12 * at..12 * at + 12].copy_from_slice(bytemuck::bytes_of(&r.xyz));
            let less = (r.place() - first_place) as u32;
            place[4 * at..4 * at + 4].copy_from_slice(&less.to_le_bytes());
            pixel[2 * at..2 * at + 2].copy_from_slice(&r.pixel.to_le_bytes());
        }
        let entry = TileEntry {
            at: part.at,
            n_points: n as u64,
            first_place,
            bounds,
            offset: 0,
            checksum: crc32c::crc32c(&bytes),
        };
        Encoded { entry, bytes }
    }
}

/// Offsets of the three arrays and of the end, for `n` points.
pub(super) fn layout(n: u64) -> [u64; 4] {
    let place = (12 * n).next_multiple_of(ALIGN);
    let pixel = (place + 4 * n).next_multiple_of(ALIGN);
    [0, place, pixel, (pixel + 2 * n).next_multiple_of(ALIGN)]
}

/// The points of a tile in its (aligned) bytes, which have the length that [`layout`] says.
pub(super) fn points<'a>(entry: &TileEntry, bytes: &'a [u8]) -> TilePoints<'a> {
    let n = entry.n_points as usize;
    let [_, place, pixel, _] = layout(entry.n_points).map(|v| v as usize);
    TilePoints {
        at: entry.at,
        first_place: entry.first_place,
        xyz: bytemuck::cast_slice(&bytes[..12 * n]),
        place: bytemuck::cast_slice(&bytes[place..place + 4 * n]),
        pixel: bytemuck::cast_slice(&bytes[pixel..pixel + 2 * n]),
    }
}

/// The same, copied out.
pub(super) fn decode(entry: &TileEntry, bytes: &[u8]) -> Tile {
    let TilePoints { at, first_place, place, pixel, xyz } = points(entry, bytes);
    let (place, pixel, xyz) = (place.to_vec(), pixel.to_vec(), xyz.to_vec());
    Tile { at, first_place, place, pixel, xyz, bounds: entry.bounds }
}
