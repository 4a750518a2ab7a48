//! Points in, occupied voxels out: of each voxel the sum of its points, so that parts of a voxel
//! from several tiles are joined in any order with the same outcome.

use contract::{Error, Result};
use rustc_hash::FxHashMap;
use std::collections::BTreeMap;

/// Edge of a chunk, voxels: its bits, with the margin, fit into a core's own cache.
pub(crate) const CHUNK: i32 = 128;
/// Width of the margin by which a chunk knows its neighbours, voxels: one for the shape of corners,
/// one for what joins voxels there, and one for the voxels that this depends on.
pub(crate) const MARGIN: i32 = 3;
/// Steps of a voxel's edge to which a point is rounded; a hundredth of a millimetre at an edge of
/// ten millimetres.
const STEPS: f64 = 1024.0;
/// Number of points of a voxel that count for its middle: more would change nothing, and their sums
/// stay within 32 bits.
const MOST_SUMMED: u32 = 1 << 21;
/// Number of voxels along each axis, from the origin to either side.
const FARTHEST: i32 = 1 << 20;
/// Length of a voxel on disk, bytes.
const RECORD: usize = 24;

/// The lattice of voxels: cubes whose corners lie at whole multiples of the edge from the origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VoxelLattice {
    /// A corner of the lattice, world frame, metres.
    pub origin: [f64; 3],
    /// Edge of a voxel, metres.
    pub edge: f64,
}

/// Position of a chunk of the lattice, in whole chunks from the origin.
pub type ChunkAt = [i32; 3];

/// Points of one voxel, or of a part of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct VoxelPoints {
    /// Number of points.
    n: u32,
    /// Number of points in the sum.
    n_summed: u32,
    sum: [u32; 3],
}

/// Occupied voxels of some points.
pub struct OccupiedVoxels {
    lattice: VoxelLattice,
    voxels: FxHashMap<u64, VoxelPoints>,
    /// The voxel of the point before, which is often that of the next one, too.
    last: (u64, VoxelPoints),
}

impl VoxelLattice {
    /// The voxel of a point and its place in it, in steps.
    fn place(&self, world: [f64; 3]) -> Result<([i32; 3], [u16; 3])> {
        let (mut at, mut inside) = ([0; 3], [0; 3]);
        for i in 0..3 {
            let v = (world[i] - self.origin[i]) / self.edge;
            let floor = v.floor();
            if floor.is_nan() || floor.abs() >= f64::from(FARTHEST - CHUNK) {
                let what = format!(
                    "the plant is larger than {:.0} m, which a mesh of this bound can span",
                    f64::from(FARTHEST) * self.edge
                );
                let [x, y, z] = world;
                let place = format!("({x:.3}, {y:.3}, {z:.3})");
                return Err(Error::bad_input(what).at(place).hint("give a larger --bound"));
            }
            at[i] = floor as i32;
            inside[i] = ((v - floor) * STEPS) as u16;
        }
        Ok((at, inside))
    }

    /// The world place of a place in the lattice, which is given in edges.
    pub(crate) fn world(&self, at: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|i| self.origin[i] + at[i] * self.edge)
    }
}

impl VoxelPoints {
    const NONE: Self = Self { n: 0, n_summed: 0, sum: [0; 3] };

    fn add(&mut self, inside: [u16; 3]) {
        self.n = self.n.saturating_add(1);
        if self.n_summed < MOST_SUMMED {
            self.n_summed += 1;
            self.sum.iter_mut().zip(inside).for_each(|(sum, v)| *sum += u32::from(v));
        }
    }

    /// Adds another part of the same voxel.
    pub(crate) fn join(&mut self, other: &Self) {
        self.n = self.n.saturating_add(other.n);
        // Sums of two parts that are both full would not fit; the first by size stands for both.
        if self.n_summed.saturating_add(other.n_summed) <= MOST_SUMMED {
            self.n_summed += other.n_summed;
            self.sum.iter_mut().zip(other.sum).for_each(|(sum, v)| *sum += v);
        } else if (other.n_summed, other.sum) > (self.n_summed, self.sum) {
            (self.n_summed, self.sum) = (other.n_summed, other.sum);
        }
    }

    /// Mean place of the points in the voxel, in edges.
    pub(crate) fn middle(&self) -> [f32; 3] {
        let all = f64::from(self.n_summed.max(1)) * STEPS;
        // The middle of a step stands for the points in it.
        self.sum.map(|v| ((f64::from(v) / all) + 0.5 / STEPS) as f32)
    }

    fn write(&self, key: u32, out: &mut Vec<u8>) {
        out.extend(key.to_le_bytes());
        out.extend(self.n.to_le_bytes());
        out.extend(self.n_summed.to_le_bytes());
        self.sum.iter().for_each(|v| out.extend(v.to_le_bytes()));
    }

    fn read(record: &[u8]) -> (u32, Self) {
        let int = |at: usize| {
            u32::from_le_bytes([record[at], record[at + 1], record[at + 2], record[at + 3]])
        };
        let points = Self { n: int(4), n_summed: int(8), sum: [int(12), int(16), int(20)] };
        (int(0), points)
    }
}

fn key(at: [i32; 3]) -> u64 {
    at.iter().fold(0, |key, v| key << 21 | u64::from((v + FARTHEST) as u32))
}

fn place_of(key: u64) -> [i32; 3] {
    [42, 21, 0].map(|shift| ((key >> shift & 0x1f_ffff) as i32) - FARTHEST)
}

impl OccupiedVoxels {
    /// No voxel yet.
    #[must_use]
    pub fn new(lattice: VoxelLattice) -> Self {
        Self { lattice, voxels: FxHashMap::default(), last: (0, VoxelPoints::NONE) }
    }

    /// Adds a point, world frame, metres.
    ///
    /// # Errors
    /// The point is too far from the lattice's origin.
    pub fn add(&mut self, world: [f64; 3]) -> Result<()> {
        let (at, inside) = self.lattice.place(world)?;
        let key = key(at);
        if key != self.last.0 {
            self.settle();
            self.last.0 = key;
        }
        self.last.1.add(inside);
        Ok(())
    }

    fn settle(&mut self) {
        let (key, points) = std::mem::replace(&mut self.last, (0, VoxelPoints::NONE));
        if points.n > 0 {
            self.voxels.entry(key).or_insert(VoxelPoints::NONE).join(&points);
        }
    }

    /// The voxels of each chunk that they lie in or whose margin they touch, as bytes for
    /// [`ChunkVoxels`](crate::ChunkVoxels).
    #[must_use]
    pub fn into_chunks(mut self) -> BTreeMap<ChunkAt, Vec<u8>> {
        self.settle();
        let mut all: Vec<(u64, VoxelPoints)> = self.voxels.into_iter().collect();
        all.sort_unstable_by_key(|(key, _)| *key);
        let mut out: BTreeMap<ChunkAt, Vec<u8>> = BTreeMap::new();
        for (key, points) in all {
            let at = place_of(key);
            let first = at.map(|v| (v - MARGIN).div_euclid(CHUNK));
            let last = at.map(|v| (v + MARGIN).div_euclid(CHUNK));
            for x in first[0]..=last[0] {
                for y in first[1]..=last[1] {
                    for z in first[2]..=last[2] {
                        let chunk = [x, y, z];
                        let bytes = out.entry(chunk).or_default();
                        points.write(index(chunk, at), bytes);
                    }
                }
            }
        }
        out
    }
}

/// Number of voxels along an edge of a chunk with its margins.
pub(crate) const WIDE: usize = (CHUNK + 2 * MARGIN) as usize;

/// Index of a voxel in a chunk with its margins.
fn index(chunk: ChunkAt, at: [i32; 3]) -> u32 {
    let own: [u32; 3] = std::array::from_fn(|i| (at[i] - chunk[i] * CHUNK + MARGIN) as u32);
    (own[0] * WIDE as u32 + own[1]) * WIDE as u32 + own[2]
}

/// Reads the voxels of a chunk, by ascending index; parts of one voxel are joined.
pub(crate) fn read_voxels(bytes: &[u8]) -> Vec<(u32, VoxelPoints)> {
    let mut all: Vec<_> = bytes.chunks_exact(RECORD).map(VoxelPoints::read).collect();
    all.retain(|(at, _)| (*at as usize) < WIDE * WIDE * WIDE);
    // Parts are joined by rules that do not depend on their order.
    all.sort_unstable_by_key(|(at, _)| *at);
    all.dedup_by(|later, kept| {
        let is_same = later.0 == kept.0;
        if is_same {
            kept.1.join(&later.1);
        }
        is_same
    });
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_a_voxel_join_to_the_whole_in_any_order() -> Result<()> {
        let lattice = VoxelLattice { origin: [0.0; 3], edge: 0.01 };
        let points = [[0.001, 0.002, 0.003], [0.009, 0.004, 0.001], [0.005, 0.005, 0.0099]];
        let of = |points: &[[f64; 3]]| -> Result<Vec<u8>> {
            let mut voxels = OccupiedVoxels::new(lattice);
            points.iter().try_for_each(|p| voxels.add(*p))?;
            Ok(voxels.into_chunks()[&[0, 0, 0]].clone())
        };
        let whole = read_voxels(&of(&points)?);
        for parts in [[0, 1], [1, 0]] {
            let halves = [of(&points[..1])?, of(&points[1..])?];
            let joined: Vec<u8> = parts.iter().flat_map(|i| halves[*i].clone()).collect();
            assert_eq!(read_voxels(&joined), whole);
        }
        let middle = whole[0].1.middle();
        assert!(
            middle.iter().zip([0.5, 0.3667, 0.4633]).all(|(a, b)| (a - b).abs() < 2e-3),
            "{middle:?}"
        );
        Ok(())
    }

    #[test]
    fn a_voxel_at_an_edge_is_known_to_both_chunks() -> Result<()> {
        let lattice = VoxelLattice { origin: [0.0; 3], edge: 0.01 };
        let mut voxels = OccupiedVoxels::new(lattice);
        voxels.add([-0.015, 1.0, 1.0])?;
        let chunks: Vec<ChunkAt> = voxels.into_chunks().into_keys().collect();
        assert_eq!(chunks, [[-1, 0, 0], [0, 0, 0]]);
        Ok(())
    }

    #[test]
    fn a_plant_that_no_lattice_spans_is_refused() {
        let lattice = VoxelLattice { origin: [0.0; 3], edge: 0.01 };
        let mut voxels = OccupiedVoxels::new(lattice);
        for far in [f64::NAN, 1e9, -1e5] {
            assert!(voxels.add([0.0, far, 0.0]).is_err(), "{far}");
        }
    }
}
