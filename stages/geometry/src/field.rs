//! A grid that gives the nearest surface sample to any place near the surface in constant time. It
//! keeps the sample's index instead of a distance, so that point-to-plane distances can be computed
//! from the sample's own facet.

use crate::Aabb;
use crate::spread::{N_LANES, VoxelGrid, spread};

/// A voxel grid about a surface. Each voxel within reach holds the index of the sample that is
/// nearest to the voxel's centre.
#[derive(Debug, Clone, Default)]
pub struct NearestField {
    grid: VoxelGrid,
    /// Number of bricks along each axis, see [`BRICK`].
    bricks: [usize; 3],
    /// Index of the nearest sample plus one, 0 beyond reach; brick after brick, x fastest.
    cells: Vec<u32>,
}

/// Base-two logarithm of the voxels along the edge of a brick. Bricks keep voxels that are
/// neighbours in space on the same memory page.
const BRICK: u32 = N_LANES.ilog2();
const IN_BRICK: u32 = (1 << BRICK) - 1;

/// Largest number of voxels of a field; they take a quarter of a gigabyte.
pub const MAX_CELLS: f64 = 67e6;

/// `edge`, widened as little as needed so that the bounds take at most [`MAX_CELLS`] voxels in
/// whole bricks, metres.
fn affordable(bounds: &Aabb, mut edge: f32) -> f32 {
    let brick = |edge: f32| f64::from(edge) * f64::from(1_u32 << BRICK);
    let n_cells = |edge: f32| {
        let n = bounds.size().map(|s| (s / brick(edge)).ceil() + 1.0);
        n.iter().product::<f64>() * f64::from(1_u32 << (3 * BRICK))
    };
    while n_cells(edge) > MAX_CELLS {
        edge *= 1.25;
    }
    edge
}

impl NearestField {
    /// A field over samples (metres) with voxels of `edge` metres that reaches `reach` metres from
    /// the samples. The voxels are wider where there would be more than [`MAX_CELLS`] of them.
    #[must_use]
    pub fn new(points: &[[f32; 3]], edge: f32, reach: f32) -> Self {
        let bounds = Aabb::of(points.iter().map(|p| p.map(f64::from)));
        if bounds.is_empty() {
            return Self::default();
        }
        let bounds = bounds.grown(f64::from(reach));
        let edge = affordable(&bounds, edge);
        let size = bounds.size().map(|s| (s / f64::from(edge)).ceil() as usize + 1);
        let bricks = size.map(|n| n.div_ceil(1 << BRICK));
        let origin = bounds.min.map(|v| v as f32);
        let grid = VoxelGrid { origin, edge, inverse_edge: 1.0 / edge, size };
        let cells = vec![0; bricks.iter().product::<usize>() << (3 * BRICK)];
        let mut field = Self { grid, bricks, cells };
        // Voxels beyond reach are never written, so that their memory is never touched.
        spread(points, grid, reach, |first, samples| {
            let at = field.at(first);
            field.cells[at..at + N_LANES].copy_from_slice(samples);
        });
        field
    }

    /// The same field, with sample `i` replaced by sample `numbers[i]`.
    #[must_use]
    pub fn renumbered(mut self, numbers: &[u32]) -> Self {
        for cell in self.cells.iter_mut().filter(|cell| **cell > 0) {
            *cell = numbers[*cell as usize - 1] + 1;
        }
        self
    }

    #[inline]
    fn at(&self, [x, y, z]: [u32; 3]) -> usize {
        let [bx, by, bz] = [x, y, z].map(|v| (v >> BRICK) as usize);
        let [x, y, z] = [x, y, z].map(|v| (v & IN_BRICK) as usize);
        let brick = (bz * self.bricks[1] + by) * self.bricks[0] + bx;
        ((brick << BRICK | z) << BRICK | y) << BRICK | x
    }

    /// Index of the sample nearest to `p`, to within half the diagonal of a voxel; `None` beyond
    /// reach.
    #[inline]
    #[must_use]
    pub fn nearest(&self, p: [f32; 3]) -> Option<usize> {
        let at = self.at(self.grid.index(p)?);
        (self.cells[at] as usize).checked_sub(1)
    }

    /// Lowest corner of the grid, metres, and number of voxels per metre.
    #[must_use]
    pub fn grid(&self) -> ([f32; 3], f32) {
        (self.grid.origin, self.grid.inverse_edge)
    }

    /// Number of voxels along each axis.
    #[must_use]
    pub fn size(&self) -> [usize; 3] {
        self.grid.size
    }

    /// Index of the sample nearest to the centre of a voxel; `None` beyond reach or outside the
    /// grid.
    #[inline]
    #[must_use]
    pub fn in_voxel(&self, index: [u32; 3]) -> Option<usize> {
        (*self.cells.get(self.at(index))? as usize).checked_sub(1)
    }

    /// Memory of the field, bytes.
    #[must_use]
    pub fn weight_bytes(&self) -> usize {
        self.cells.len() * 4
    }
}

#[cfg(test)]
fn distance2(a: [f32; 3], b: [f32; 3]) -> f32 {
    (0..3).map(|i| (a[i] - b[i]) * (a[i] - b[i])).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nearest_agrees_with_search_to_a_voxel() {
        // A bent sheet of samples.
        let points: Vec<[f32; 3]> = (0..40)
            .flat_map(|i| (0..40).map(move |j| (i as f32 * 0.01, j as f32 * 0.01)))
            .map(|(x, y)| [x, y, 0.2 * (x * 7.0).sin()])
            .collect();
        let field = NearestField::new(&points, 0.008, 0.05);
        let mut state = 1_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 40) as f32 / (1 << 24) as f32
        };
        let mut n_near = 0;
        for _ in 0..5000 {
            let p = [random() * 0.5 - 0.05, random() * 0.5 - 0.05, random() * 0.5 - 0.25];
            let exact =
                points.iter().map(|q| distance2(p, *q)).fold(f32::INFINITY, f32::min).sqrt();
            match field.nearest(p) {
                Some(i) => {
                    n_near += 1;
                    assert!(distance2(p, points[i]).sqrt() <= exact + 0.008 * 1.74);
                }
                None => assert!(exact > 0.05 - 0.008),
            }
        }
        assert!(n_near > 500);
    }
}
