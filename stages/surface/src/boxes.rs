//! Points that a surface leaves by more than its bound in, closed boxes around them out: no point
//! in a box that is no wider than twice the bound is farther from its faces than the bound.

use crate::mesh::SurfaceMesh;
use crate::voxels::VoxelLattice;
use geometry::Aabb;
use std::collections::BTreeMap;

/// Distance that a box keeps from its points, metres: enough that it is no line or plane.
const AROUND: f64 = 0.0005;
/// Edge of the voxels by which points are gathered, as a share of the bound.
const EDGE: f64 = 0.8;
/// Width of boxes that are joined to one, as a share of the bound, across their common direction.
const WIDTH: f64 = 1.0;

/// Points that are to be covered by boxes.
pub struct FarPoints {
    origin: [f64; 3],
    bound: f64,
    /// Bounds of the points of each voxel.
    voxels: BTreeMap<[i64; 3], Aabb>,
}

impl FarPoints {
    /// No point yet.
    #[must_use]
    pub fn new(lattice: VoxelLattice, bound: f64) -> Self {
        Self { origin: lattice.origin, bound, voxels: BTreeMap::new() }
    }

    /// Adds a point, world frame, metres.
    pub fn add(&mut self, world: [f64; 3]) {
        let edge = EDGE * self.bound;
        let at = std::array::from_fn(|i| ((world[i] - self.origin[i]) / edge).floor() as i64);
        self.voxels.entry(at).or_insert(Aabb::EMPTY).add(world);
    }

    /// Adds the points of another list.
    pub fn join(&mut self, other: Self) {
        for (at, bounds) in other.voxels {
            let own = self.voxels.entry(at).or_insert(Aabb::EMPTY);
            own.add(bounds.min);
            own.add(bounds.max);
        }
    }

    /// Adds boxes around all points to a mesh. Returns their number, and how far a point in one
    /// may be from its nearest face, metres.
    pub fn append_to(self, mesh: &mut SurfaceMesh) -> (usize, f64) {
        let boxes = self.boxes();
        let mut farthest = 0.0_f64;
        for own in &boxes {
            let wide = own.grown(AROUND);
            mesh.add_box(wide.min, wide.max);
            farthest = farthest.max(wide.size().into_iter().fold(f64::INFINITY, f64::min) / 2.0);
        }
        (boxes.len(), farthest)
    }

    /// The bounds of points, joined along the axes where they lie in a row.
    fn boxes(self) -> Vec<Aabb> {
        let most = WIDTH * self.bound;
        let mut left: Vec<([i64; 3], [i64; 3], Aabb)> =
            self.voxels.into_iter().map(|(at, bounds)| (at, at, bounds)).collect();
        for axis in 0..3 {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            left.sort_unstable_by_key(|(low, ..)| [low[u], low[v], low[axis]]);
            let mut joined: Vec<([i64; 3], [i64; 3], Aabb)> = Vec::new();
            for (low, high, bounds) in left {
                if let Some((first, last, whole)) = joined.last_mut() {
                    let mut both = *whole;
                    both.add(bounds.min);
                    both.add(bounds.max);
                    let is_beside = last[axis] + 1 == low[axis]
                        && [u, v].iter().all(|i| first[*i] == low[*i] && last[*i] == high[*i]);
                    if is_beside && [u, v].iter().all(|i| both.size()[*i] <= most) {
                        (*last, *whole) = (high, both);
                        continue;
                    }
                }
                joined.push((low, high, bounds));
            }
            left = joined;
        }
        left.into_iter().map(|(.., bounds)| bounds).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::TriangleGrid;

    #[test]
    fn boxes_cover_their_points_within_the_bound_and_rows_become_one() {
        let lattice = VoxelLattice { origin: [0.0; 3], edge: 0.02 };
        let mut far = FarPoints::new(lattice, 0.01);
        let row: Vec<[f64; 3]> = (0..200).map(|k| [f64::from(k) * 0.005, 0.101, 0.202]).collect();
        row.iter().for_each(|p| far.add(*p));
        let mut mesh = SurfaceMesh::default();
        let (n, farthest) = far.append_to(&mut mesh);
        assert!(n == 1 && farthest < 0.002, "{n} boxes, {farthest}");
        let grid = TriangleGrid::new(&mesh, &Aabb::of(row.iter().copied()), 0.01);
        assert!(row.iter().all(|p| grid.square(*p, 0.0) <= 0.01_f32.powi(2)));
    }
}
