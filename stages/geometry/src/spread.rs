//! Computes for each voxel of a grid which sample is nearest to its centre.
//!
//! It works axis by axis, as exact distance transforms do (Felzenszwalb and Huttenlocher, Theory of
//! Computing 8, 2012): first the nearest sample within each row, then the nearest of all rows in a
//! plane, then the nearest of all planes. Eight voxels of a row are handled together, and rows are
//! visited in order of distance until no further one can be nearer.

use wide::f32x8;

/// Number of voxels of a row that are handled together.
pub(crate) const N_LANES: usize = 8;

/// Placement of the voxels.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct VoxelGrid {
    /// Lowest corner of the first voxel, metres.
    pub(crate) origin: [f32; 3],
    /// Edge of a voxel, metres.
    pub(crate) edge: f32,
    /// Number of voxels per metre.
    pub(crate) inverse_edge: f32,
    /// Number of voxels along each axis.
    pub(crate) size: [usize; 3],
}

impl VoxelGrid {
    /// Centres of the first `n` voxels along `axis`, metres.
    fn middles(&self, axis: usize, n: usize) -> Vec<f32> {
        (0..n).map(|place| self.origin[axis] + (place as f32 + 0.5) * self.edge).collect()
    }

    /// The voxel of a place, metres; `None` outside of the grid.
    #[inline]
    pub(crate) fn index(&self, p: [f32; 3]) -> Option<[u32; 3]> {
        let mut index = [0; 3];
        for i in 0..3 {
            let v = (p[i] - self.origin[i]) * self.inverse_edge;
            if !(v >= 0.0 && v < self.size[i] as f32) {
                return None;
            }
            index[i] = v as u32;
        }
        Some(index)
    }
}

/// The nearest samples known so far for eight voxels of a row: x, y, z, and the sample's number
/// plus one as bits, so that one comparison selects all four.
type Eight = [f32x8; 4];

/// No sample: so far away that its squared distance (1e18 m²) exceeds any reach.
const NONE: Eight = [FAR, FAR, FAR, f32x8::ZERO];
const FAR: f32x8 = f32x8::splat(1e9);

/// The numbers plus one of eight samples.
fn numbers(eight: &Eight) -> [u32; N_LANES] {
    eight[3].to_array().map(f32::to_bits)
}

/// The nearest samples of the voxels of one plane.
struct VoxelPlane {
    eights: Vec<Eight>,
    /// For each group of eight voxels, whether any of them has a sample.
    has_sample: Vec<bool>,
}

impl VoxelPlane {
    fn new(n: usize) -> Self {
        Self { eights: vec![NONE; n], has_sample: vec![false; n] }
    }

    fn line(&self, y: usize, n_eights: usize) -> PlaneRow<'_> {
        let row = y * n_eights..(y + 1) * n_eights;
        (&self.eights[row.clone()], &self.has_sample[row])
    }

    fn clear(&mut self) {
        let filled =
            self.has_sample.iter_mut().zip(&mut self.eights).filter(|(has_sample, _)| **has_sample);
        filled.for_each(|(has_sample, eight)| (*has_sample, *eight) = (false, NONE));
    }
}

/// One row of a plane: its groups of eight voxels, and which groups have a sample.
type PlaneRow<'a> = (&'a [Eight], &'a [bool]);

/// A row with a lower bound of the squared distance of its samples from another row, m².
struct VoxelRow<'a> {
    beyond2: f32,
    eights: &'a [Eight],
    has_sample: &'a [bool],
}

/// A sample with the voxel that holds it.
struct Seed {
    /// Row of the grid: `z * size.y + y`.
    row: usize,
    x: usize,
    sample: u32,
}

/// The inputs and constants of one run of [`spread`].
struct Spread<'a> {
    points: &'a [[f32; 3]],
    grid: VoxelGrid,
    /// Square of the reach, m².
    limit: f32,
    /// Number of planes or rows on either side that can hold a sample within reach.
    n_rings: usize,
    /// Number of groups of eight voxels in a row.
    n_eights: usize,
    /// Centres of the voxels along each axis, metres; those of x go up to the end of the last
    /// group.
    middles: [Vec<f32>; 3],
}

/// Finds the nearest sample to each voxel of a grid within `reach` metres. Calls `take` with the
/// first voxel (x) and the row (y, z) of each group of eight voxels of which any has a sample, and
/// with eight sample numbers plus one, 0 beyond reach. A group may extend past the end of its row.
pub(crate) fn spread(
    points: &[[f32; 3]],
    grid: VoxelGrid,
    reach: f32,
    mut take: impl FnMut([u32; 3], &[u32; N_LANES]),
) {
    let [n_x, n_y, n_z] = grid.size;
    let limit = reach * reach;
    let n_rings = (reach / grid.edge + 0.5) as usize;
    let n_eights = n_x.div_ceil(N_LANES);
    let middles = [n_eights * N_LANES, n_y, n_z];
    let middles = [0, 1, 2].map(|axis| grid.middles(axis, middles[axis]));
    let it = Spread { points, grid, limit, n_rings, n_eights, middles };
    let seeds = it.seeds();
    let n_planes = 2 * n_rings + 1;
    let n = n_y * it.n_eights;
    let mut rows = VoxelPlane::new(n);
    let mut planes: Vec<VoxelPlane> = (0..n_planes).map(|_| VoxelPlane::new(n)).collect();
    let mut from = 0;
    for z in 0..n_z + n_rings {
        let plane = &mut planes[z % n_planes];
        plane.clear();
        let to = from + seeds[from..].partition_point(|seed| seed.row < (z + 1) * n_y);
        if to > from {
            rows.clear();
            it.along_rows(&seeds[from..to], z, &mut rows);
            it.across_rows(&rows, z, plane);
        }
        from = to;
        if let Some(z) = z.checked_sub(n_rings) {
            it.across_planes(&planes, z, &mut take);
        }
    }
}

impl Spread<'_> {
    /// All samples in the order of their voxels.
    fn seeds(&self) -> Vec<Seed> {
        let [n_x, n_y, _] = self.grid.size;
        let key = |(i, p): (u32, &[f32; 3])| {
            let [x, y, z] = self.grid.index(*p)?.map(|v| v as usize);
            Some((((z * n_y + y) * n_x + x) as u64) << 32 | u64::from(i))
        };
        let mut keys: Vec<u64> = (0..).zip(self.points).filter_map(key).collect();
        keys.sort_unstable();
        let seed = |key: u64| {
            let voxel = (key >> 32) as usize;
            Seed { row: voxel / n_x, x: voxel % n_x, sample: key as u32 }
        };
        keys.into_iter().map(seed).collect()
    }

    /// For each row of the plane, the nearest of the row's own samples.
    fn along_rows(&self, seeds: &[Seed], z: usize, rows: &mut VoxelPlane) {
        let n_y = self.grid.size[1];
        let mut best = vec![FAR; self.n_eights];
        for seeds in seeds.chunk_by(|a, b| a.row == b.row) {
            let y = seeds[0].row % n_y;
            best.fill(f32x8::splat(self.limit));
            let mut before = 0;
            let mut left = seeds;
            while let Some(x) = left.first().map(|seed| seed.x) {
                let (here, others) = left.split_at(left.partition_point(|seed| seed.x == x));
                // Beyond this voxel the next sample of the row is nearer.
                let after = others.first().map_or(self.grid.size[0] - 1, |seed| seed.x);
                let first = before.max(x.saturating_sub(self.n_rings));
                let last = after.min(x + self.n_rings);
                for eight in first / N_LANES..=last / N_LANES {
                    let at = y * self.n_eights + eight;
                    let middles = self.middles_of([eight, y, z]);
                    for seed in here {
                        let [px, py, pz] = self.points[seed.sample as usize];
                        let new = [px, py, pz, f32::from_bits(seed.sample + 1)].map(f32x8::splat);
                        rows.has_sample[at] |=
                            keep_nearer(middles, &new, &mut best[eight], &mut rows.eights[at]);
                    }
                }
                (before, left) = (x, others);
            }
        }
    }

    /// The nearest sample of the plane, from the nearest samples of its rows.
    fn across_rows(&self, rows: &VoxelPlane, z: usize, plane: &mut VoxelPlane) {
        let mut lines = Vec::new();
        for y in 0..self.grid.size[1] {
            self.outwards(&mut lines, y, self.grid.size[1], |y| rows.line(y, self.n_eights));
            for eight in 0..self.n_eights {
                if let Some(kept) = self.nearest(&lines, [eight, y, z]) {
                    let at = y * self.n_eights + eight;
                    (plane.eights[at], plane.has_sample[at]) = (kept, true);
                }
            }
        }
    }

    /// The nearest sample of all, from the nearest samples of the planes.
    fn across_planes(
        &self,
        planes: &[VoxelPlane],
        z: usize,
        take: &mut impl FnMut([u32; 3], &[u32; N_LANES]),
    ) {
        let mut lines = Vec::new();
        for y in 0..self.grid.size[1] {
            let line = |z: usize| planes[z % planes.len()].line(y, self.n_eights);
            self.outwards(&mut lines, z, self.grid.size[2], line);
            for eight in 0..self.n_eights {
                if let Some(kept) = self.nearest(&lines, [eight, y, z]) {
                    take([eight * N_LANES, y, z].map(|v| v as u32), &numbers(&kept));
                }
            }
        }
    }

    /// The line at `place` and then those on either side of it among `n`, by growing distance.
    fn outwards<'b>(
        &self,
        lines: &mut Vec<VoxelRow<'b>>,
        place: usize,
        n: usize,
        line: impl Fn(usize) -> PlaneRow<'b>,
    ) {
        lines.clear();
        for ring in 0..=self.n_rings {
            let beyond = (ring as f32 - 0.5).max(0.0) * self.grid.edge;
            let sides = [place.checked_sub(ring), (ring > 0).then_some(place + ring)];
            for at in sides.into_iter().flatten().filter(|at| *at < n) {
                let (eights, has_sample) = line(at);
                if has_sample.contains(&true) {
                    lines.push(VoxelRow { beyond2: beyond * beyond, eights, has_sample });
                }
            }
        }
    }

    /// The centres of the eight voxels of a group.
    #[inline]
    fn middles_of(&self, [eight, y, z]: [usize; 3]) -> [f32x8; 3] {
        let lanes = &self.middles[0][eight * N_LANES..(eight + 1) * N_LANES];
        let x = f32x8::new(std::array::from_fn(|lane| lanes[lane]));
        [x, f32x8::splat(self.middles[1][y]), f32x8::splat(self.middles[2][z])]
    }

    /// The nearest samples to a group of eight voxels among the samples of these lines; `None`
    /// where none of the voxels has one.
    #[inline]
    fn nearest(&self, lines: &[VoxelRow], place: [usize; 3]) -> Option<Eight> {
        let middles = self.middles_of(place);
        let (mut best, mut kept, mut has_sample) = (f32x8::splat(self.limit), NONE, false);
        for line in lines {
            if best.simd_le(f32x8::splat(line.beyond2)).all() {
                break;
            }
            if line.has_sample[place[0]] {
                has_sample |= keep_nearer(middles, &line.eights[place[0]], &mut best, &mut kept);
            }
        }
        has_sample.then_some(kept)
    }
}

/// Replaces those samples in `kept` for which the one in `new` is nearer to the voxel's centre.
/// `best` holds the squared distances of the kept ones, m². Returns whether any was replaced.
#[inline]
fn keep_nearer(middles: [f32x8; 3], new: &Eight, best: &mut f32x8, kept: &mut Eight) -> bool {
    let [dx, dy, dz] = [0, 1, 2].map(|i| new[i] - middles[i]);
    let d2 = dx * dx + dy * dy + dz * dz;
    let is_nearer = d2.simd_lt(*best);
    *best = is_nearer.select(d2, *best);
    for (kept, new) in kept.iter_mut().zip(new) {
        *kept = is_nearer.select(*new, *kept);
    }
    is_nearer.any()
}
