//! Counts points by voxel of the world.

use crate::patch::{WorldRows, apply};
use contract::Occupancy;
use geometry::narrow::floor_i32;

/// Number of slots of the direct-mapped cache in front of the list; a power of two.
const SLOTS: usize = 1 << 12;
/// Number of bits of one coordinate in a key: ±52 km about the first point at voxels of 5 cm.
const BITS: u32 = 21;
/// Middle of a coordinate's range.
const MIDDLE: i64 = 1 << (BITS - 1);
/// Key of an empty slot.
const EMPTY: u64 = u64::MAX;

/// Counts points by voxel; buffers are reused.
#[derive(Debug, Default)]
pub(crate) struct Counter {
    slots: Vec<(u64, u32)>,
    list: Vec<(u64, u32)>,
}

impl Counter {
    /// Adds points.
    pub(crate) fn count(
        &mut self,
        xyz: &[[f32; 3]],
        world_from_scan: &WorldRows,
        edge: f64,
    ) -> Occupancy {
        self.slots.clear();
        self.slots.resize(SLOTS, (EMPTY, 0));
        self.list.clear();
        let inverse = 1.0 / edge;
        let Some(first) = xyz.first() else {
            return Occupancy { edge, voxels: Vec::new() };
        };
        let origin = apply(world_from_scan, *first).map(|v| floor_i32(v * inverse));
        for p in xyz {
            let voxel = apply(world_from_scan, *p).map(|v| floor_i32(v * inverse));
            self.add(pack(voxel, origin));
        }
        self.finish(origin, edge)
    }

    #[inline]
    fn add(&mut self, key: u64) {
        let slot = &mut self.slots[(key.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 52) as usize];
        if slot.0 == key {
            slot.1 += 1;
        } else {
            if slot.0 != EMPTY {
                self.list.push(*slot);
            }
            *slot = (key, 1);
        }
    }

    fn finish(&mut self, origin: [i32; 3], edge: f64) -> Occupancy {
        self.list.extend(self.slots.iter().filter(|s| s.0 != EMPTY));
        self.list.sort_unstable();
        self.list.dedup_by(|later, kept| {
            let same = later.0 == kept.0;
            if same {
                kept.1 = kept.1.saturating_add(later.1);
            }
            same
        });
        let voxels = self.list.iter().map(|&(key, n)| (unpack(key, origin), n)).collect();
        Occupancy { edge, voxels }
    }
}

/// A key that sorts by (z, y, x); coordinates saturate at the ends of their range.
#[inline]
fn pack(voxel: [i32; 3], origin: [i32; 3]) -> u64 {
    let part = |i: usize| {
        let offset = i64::from(voxel[i]) - i64::from(origin[i]) + MIDDLE;
        offset.clamp(0, 2 * MIDDLE - 1) as u64
    };
    part(2) << (2 * BITS) | part(1) << BITS | part(0)
}

fn unpack(key: u64, origin: [i32; 3]) -> [i32; 3] {
    std::array::from_fn(|i| {
        let part = (key >> (BITS * i as u32) & ((1 << BITS) - 1)) as i64;
        (part - MIDDLE + i64::from(origin[i])).clamp(i64::from(i32::MIN), i64::from(i32::MAX))
            as i32
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_point_is_in_its_voxel_once_and_far_from_zero() {
        let pose = [[1.0, 0.0, 0.0, 4e5], [0.0, 1.0, 0.0, 5.3e6], [0.0, 0.0, 1.0, -3.0]];
        let xyz: Vec<[f32; 3]> = (0..5000)
            .map(|i| [(i % 71) as f32 * 0.031, (i / 71) as f32 * -0.07, (i % 13) as f32])
            .collect();
        let got = Counter::default().count(&xyz, &pose, 0.05);
        let mut expected = std::collections::BTreeMap::new();
        for p in &xyz {
            let w = apply(&pose, *p);
            *expected.entry([2, 1, 0].map(|i: usize| (w[i] / 0.05).floor() as i32)).or_insert(0) +=
                1;
        }
        let expected: Vec<([i32; 3], u32)> =
            expected.into_iter().map(|(k, n)| ([k[2], k[1], k[0]], n)).collect();
        // x·(1/edge) and x/edge may round differently at the border of a voxel, so that very few
        // differences are allowed.
        let same = got
            .voxels
            .iter()
            .filter(|v| {
                expected
                    .binary_search_by_key(&(v.0[2], v.0[1], v.0[0]), |e| (e.0[2], e.0[1], e.0[0]))
                    .is_ok()
            })
            .count();
        assert!(same * 100 >= got.voxels.len() * 99);
        assert_eq!(got.voxels.iter().map(|v| v.1).sum::<u32>(), expected.iter().map(|v| v.1).sum());
        assert!(got.voxels.is_sorted_by_key(|v| (v.0[2], v.0[1], v.0[0])));
    }
}
