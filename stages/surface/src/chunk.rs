//! Voxels of a chunk in, dense bits out, by which neighbours are found without a search. Voxels
//! that touch at an edge or a corner only are joined, so that an oblique wire is one thing.

use crate::voxels::{CHUNK, ChunkAt, MARGIN, VoxelLattice, VoxelPoints, WIDE, read_voxels};

/// Half the thickness of the shell, in edges of a voxel. That of a plane is enough for its two
/// sides not to cross by rounding. Wires and edges of sheets have points on all sides of the
/// mean, and a tube must outlast the reduction.
const HALF_THICKNESS: [f64; 2] = [0.05, 0.125];
/// Steps to the next voxel along x, y and z, by index.
pub(crate) const STEP: [usize; 3] = [WIDE * WIDE, WIDE, 1];

/// Occupied voxels of one chunk of the lattice and its margins.
pub struct ChunkVoxels {
    pub(crate) at: ChunkAt,
    pub(crate) lattice: VoxelLattice,
    bits: RankedBits,
    /// Mean place of the points of each occupied voxel, in edges from its lowest corner.
    middles: Vec<[f32; 3]>,
    /// The points of each voxel that has some, by ascending index.
    measured: Vec<(u32, VoxelPoints)>,
    /// Half the thickness of the shell, in edges: of planes, and of wires and edges of sheets.
    pub(crate) half_thickness: [f64; 2],
}

/// Bits with the number of those that are set before each.
struct RankedBits {
    words: Vec<u64>,
    ranks: Vec<u32>,
}

impl RankedBits {
    fn new(ascending: impl Iterator<Item = usize>) -> Self {
        let mut words = vec![0_u64; (WIDE * WIDE * WIDE).div_ceil(64)];
        ascending.for_each(|at| words[at / 64] |= 1 << (at % 64));
        let mut n = 0;
        let ranks = words.iter().map(|word| {
            let before = n;
            n += word.count_ones();
            before
        });
        Self { ranks: ranks.collect(), words }
    }

    #[inline]
    fn has(&self, at: usize) -> bool {
        self.words[at / 64] >> (at % 64) & 1 == 1
    }

    #[inline]
    fn rank(&self, at: usize) -> usize {
        let below = self.words[at / 64] & ((1 << (at % 64)) - 1);
        (self.ranks[at / 64] + below.count_ones()) as usize
    }
}

/// Position of a voxel in the chunk with its margins, from its index.
pub(crate) fn place(at: usize) -> [usize; 3] {
    [at / STEP[0], at / STEP[1] % WIDE, at % WIDE]
}

impl ChunkVoxels {
    /// The voxels of a chunk whose points lie on surfaces, from the bytes of all its parts, in any
    /// order: the shell is drawn to the points.
    #[must_use]
    pub fn new(lattice: VoxelLattice, at: ChunkAt, bytes: &[u8]) -> Self {
        let mut chunk = Self::read(lattice, at, bytes, HALF_THICKNESS);
        chunk.join_diagonals();
        chunk
    }

    /// The voxels of a chunk as cubes, each with one point in its middle.
    #[must_use]
    pub fn cubes(lattice: VoxelLattice, at: ChunkAt, bytes: &[u8]) -> Self {
        Self::read(lattice, at, bytes, [0.5; 2])
    }

    fn read(lattice: VoxelLattice, at: ChunkAt, bytes: &[u8], half_thickness: [f64; 2]) -> Self {
        let measured = read_voxels(bytes);
        let bits = RankedBits::new(measured.iter().map(|(at, _)| *at as usize));
        let middles = measured.iter().map(|(_, points)| points.middle()).collect();
        Self { at, lattice, bits, middles, measured, half_thickness }
    }

    /// Whether no voxel lies in the chunk itself.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        !self.measured.iter().any(|(at, _)| is_own(*at as usize))
    }

    #[inline]
    pub(crate) fn is_occupied(&self, at: usize) -> bool {
        self.bits.has(at)
    }

    /// Mean place of an occupied voxel's points, in edges from its lowest corner.
    #[inline]
    pub(crate) fn middle(&self, at: usize) -> [f32; 3] {
        self.middles[self.bits.rank(at)]
    }

    /// Indices of the occupied voxels that are the chunk's own, ascending.
    pub(crate) fn own(&self) -> impl Iterator<Item = usize> + '_ {
        let bits = |(at, word): (usize, &u64)| {
            let mut left = *word;
            std::iter::from_fn(move || {
                let bit = left.trailing_zeros() as usize;
                (left != 0).then(|| {
                    left &= left - 1;
                    at * 64 + bit
                })
            })
        };
        self.bits.words.iter().enumerate().flat_map(bits).filter(|at| is_own(*at))
    }

    /// Position of a voxel in the whole lattice.
    pub(crate) fn in_lattice(&self, at: usize) -> [i32; 3] {
        let place = place(at);
        std::array::from_fn(|i| place[i] as i32 - MARGIN + self.at[i] * CHUNK)
    }

    /// Occupies one or two voxels between each two that touch at an edge or a corner only.
    fn join_diagonals(&mut self) {
        let mut added: Vec<(usize, [f32; 3])> = Vec::new();
        for (at, _) in &self.measured {
            let at = *at as usize;
            if place(at).iter().any(|v| *v == 0 || *v == WIDE - 1) {
                continue;
            }
            for towards in DIAGONALS {
                let steps = towards.map(|s| s as isize);
                let to = (0..3).fold(at as isize, |to, i| to + steps[i] * STEP[i] as isize);
                if self.bits.has(to as usize) {
                    self.join(at, to as usize, towards, &mut added);
                }
            }
        }
        if added.is_empty() {
            return;
        }
        let known = self.measured.iter().map(|(at, points)| (*at as usize, points.middle()));
        added.extend(known);
        // Where two pairs add the same voxel, the lower place counts: an order of numbers, not of
        // threads.
        added.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(order(&a.1, &b.1)));
        added.dedup_by_key(|(at, _)| *at);
        self.bits = RankedBits::new(added.iter().map(|(at, _)| *at));
        self.middles = added.into_iter().map(|(_, middle)| middle).collect();
    }

    /// Adds the voxels that join two, if none of those between them is occupied.
    fn join(&self, a: usize, b: usize, towards: [i8; 3], added: &mut Vec<(usize, [f32; 3])>) {
        let moved = |at: usize, i: usize| at as isize + towards[i] as isize * STEP[i] as isize;
        let axes = || (0..3).filter(|i| towards[*i] != 0);
        // Those that share a face with one of the two.
        let back = |i: usize| b as isize - towards[i] as isize * STEP[i] as isize;
        if axes().any(|i| self.bits.has(moved(a, i) as usize) || self.bits.has(back(i) as usize)) {
            return;
        }
        let [from, to] = [a, b].map(|at| self.middle(at));
        let n = axes().count();
        let mut at = a as isize;
        let mut passed = [0.0_f32; 3];
        for (k, i) in axes().take(n - 1).enumerate() {
            at += towards[i] as isize * STEP[i] as isize;
            passed[i] = f32::from(towards[i]);
            let share = (k + 1) as f32 / n as f32;
            // On the line between the two, counted from the lowest corner of the new voxel.
            let middle = std::array::from_fn(|i| {
                let line = to[i] + f32::from(towards[i]) - from[i];
                from[i] + share * line - passed[i]
            });
            added.push((at as usize, middle));
        }
    }
}

/// Half of the neighbours at edges and corners; the other half lies opposite.
const DIAGONALS: [[i8; 3]; 10] = [
    [0, 1, -1],
    [0, 1, 1],
    [1, -1, 0],
    [1, 0, -1],
    [1, 0, 1],
    [1, 1, 0],
    [1, -1, -1],
    [1, -1, 1],
    [1, 1, -1],
    [1, 1, 1],
];

fn order(a: &[f32; 3], b: &[f32; 3]) -> std::cmp::Ordering {
    (0..3).fold(std::cmp::Ordering::Equal, |order, i| order.then(a[i].total_cmp(&b[i])))
}

/// Whether a voxel lies in the chunk and not in its margins.
pub(crate) fn is_own(at: usize) -> bool {
    let margin = MARGIN as usize;
    place(at).iter().all(|v| (margin..WIDE - margin).contains(v))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::OccupiedVoxels;

    #[test]
    fn an_oblique_wire_is_one_thing() {
        let lattice = VoxelLattice { origin: [0.0; 3], edge: 1.0 };
        let mut voxels = OccupiedVoxels::new(lattice);
        for k in 0..40 {
            voxels.add([10.5 + f64::from(k); 3]).expect("near");
        }
        let chunk = ChunkVoxels::new(lattice, [0; 3], &voxels.into_chunks()[&[0; 3]]);
        assert_eq!(chunk.own().count(), 40 + 2 * 39);
        let joined = |at: usize| {
            let is_neighbour =
                |i: usize| chunk.is_occupied(at + STEP[i]) || chunk.is_occupied(at - STEP[i]);
            (0..3).any(is_neighbour)
        };
        assert!(chunk.own().all(joined));
        for at in chunk.own() {
            let (middle, place) = (chunk.middle(at), place(at));
            let on = std::array::from_fn::<f32, 3, _>(|i| middle[i] + place[i] as f32);
            assert!(on.iter().all(|v| (v - on[0]).abs() < 2e-3), "{on:?}");
        }
    }
}
