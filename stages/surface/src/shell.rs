//! Occupied voxels in, their closed surface out: a thin shell whose corners are drawn to the points
//! nearby (surface nets with the points as their data).
//!
//! Each face between an occupied and an empty voxel becomes two triangles. A corner stands once for
//! each group of voxels around it that share faces, so that things which only touch stay apart and
//! the surface is one of a body.

use crate::chunk::{ChunkVoxels, STEP};
use crate::free::FreeSpace;
use crate::mesh::{SeamId, SurfaceMesh};
use crate::voxels::{CHUNK, WIDE};
use rustc_hash::FxHashMap;

/// Distance from free voxels that corners keep, metres.
const APART: f64 = 1e-4;

/// For each set of occupied voxels around a corner (bits by 4x + 2y + z), the group of each voxel:
/// the lowest of those that it is joined to by faces.
struct Groups([[u8; 8]; 256]);

impl Groups {
    fn new() -> Self {
        let mut all = [[0_u8; 8]; 256];
        for (set, groups) in all.iter_mut().enumerate() {
            *groups = std::array::from_fn(|voxel| voxel as u8);
            // Seven rounds reach the farthest of eight.
            for _ in 0..7 {
                for voxel in 0..8 {
                    for other in [voxel ^ 1, voxel ^ 2, voxel ^ 4] {
                        if set >> voxel & 1 == 1 && set >> other & 1 == 1 {
                            groups[voxel] = groups[voxel].min(groups[other]);
                        }
                    }
                }
            }
        }
        Self(all)
    }
}

/// The surface of the voxels of a chunk that are its own.
pub(crate) fn shell(chunk: &ChunkVoxels, free: &FreeSpace) -> SurfaceMesh {
    let mut net = Net {
        chunk,
        free,
        groups: Groups::new(),
        known: FxHashMap::default(),
        mesh: SurfaceMesh::default(),
    };
    for at in chunk.own() {
        for axis in 0..3 {
            for is_upper in [false, true] {
                net.face(at, axis, is_upper);
            }
        }
    }
    net.mesh
}

struct Net<'a> {
    chunk: &'a ChunkVoxels,
    free: &'a FreeSpace,
    groups: Groups,
    /// Vertices by index of the corner and group.
    known: FxHashMap<u32, u32>,
    mesh: SurfaceMesh,
}

impl Net<'_> {
    /// Adds the face of an occupied voxel, if the voxel beyond it is empty.
    fn face(&mut self, at: usize, axis: usize, is_upper: bool) {
        let beyond = if is_upper { at + STEP[axis] } else { at - STEP[axis] };
        if self.chunk.is_occupied(beyond) {
            return;
        }
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let first = if is_upper { at + STEP[axis] } else { at };
        // Counter-clockwise from outside.
        let [p, q] = if is_upper { [u, v] } else { [v, u] };
        let corners =
            [first, first + STEP[p], first + STEP[p] + STEP[q], first + STEP[q]].map(|corner| {
                // The voxel's place among the eight around the corner.
                let place = [0, 1, 2].map(|i| usize::from(within(corner, at, i)));
                self.vertex(corner, 4 * place[0] + 2 * place[1] + place[2])
            });
        let [a, b, c, d] = corners;
        let apart = |a: u32, b: u32| {
            let [a, b] = [a, b].map(|i| self.mesh.vertices[i as usize]);
            (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>()
        };
        let halves = if apart(a, c) <= apart(b, d) {
            [[a, b, c], [a, c, d]]
        } else {
            [[a, b, d], [b, c, d]]
        };
        self.mesh.triangles.extend(halves);
    }

    /// The vertex at the lowest corner of the voxel with index `corner`, for the group of one of
    /// the eight voxels around it.
    fn vertex(&mut self, corner: usize, voxel: usize) -> u32 {
        let around: [usize; 8] = std::array::from_fn(|k| {
            let lower = |i: usize, bit: usize| if k >> bit & 1 == 1 { 0 } else { STEP[i] };
            corner - lower(0, 2) - lower(1, 1) - lower(2, 0)
        });
        let is_set = |k: usize| usize::from(self.chunk.is_occupied(around[k])) << k;
        let set: usize = (0..8).map(is_set).sum();
        let groups = &self.groups.0[set];
        let group = groups[voxel];
        let key = (corner * 8) as u32 + u32::from(group);
        if let Some(&known) = self.known.get(&key) {
            return known;
        }
        let at = self.chunk.in_lattice(corner);
        let corner_at = at.map(f64::from);
        let (mut mean, mut middle, mut n) = ([0.0; 3], [0.0; 3], 0.0);
        let mut nearest = (f64::INFINITY, [0.0; 3]);
        for k in (0..8).filter(|k| set >> k & 1 == 1 && groups[*k] == group) {
            let (own, lowest) = (self.chunk.middle(around[k]), self.chunk.in_lattice(around[k]));
            let own: [f64; 3] = std::array::from_fn(|i| f64::from(lowest[i]) + f64::from(own[i]));
            for i in 0..3 {
                mean[i] += own[i];
                middle[i] += f64::from(lowest[i]) + 0.5;
            }
            n += 1.0;
            let apart = (0..3).map(|i| (own[i] - corner_at[i]).powi(2)).sum::<f64>();
            if apart < nearest.0 {
                nearest = (apart, own);
            }
        }
        // A corner of a plane has four voxels of it, one at its edge or on a wire one or two.
        let thickness = 2.0 * self.chunk.half_thickness[usize::from(n < 3.0)];
        let drawn: [f64; 3] = std::array::from_fn(|i| {
            let outwards = corner_at[i] - middle[i] / n;
            mean[i] / n + outwards * thickness
        });
        let lattice = &self.chunk.lattice;
        let world = lattice.world(drawn);
        let world = self.free.kept_out(world, lattice.world(nearest.1), APART);
        let vertex = self.mesh.vertices.len() as u32;
        self.mesh.vertices.push(world);
        if at.iter().any(|v| v.rem_euclid(CHUNK) == 0) {
            self.mesh.seam.push((vertex, SeamId { corner: at, group }));
        }
        self.known.insert(key, vertex);
        vertex
    }
}

/// Whether a voxel lies on the upper side of its corner along an axis.
fn within(corner: usize, voxel: usize, axis: usize) -> bool {
    let along = |at: usize| at / STEP[axis] % WIDE;
    along(corner) == along(voxel)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{OccupiedVoxels, VoxelLattice};
    use std::collections::BTreeMap;

    fn shell_of(points: &[[f64; 3]]) -> SurfaceMesh {
        let lattice = VoxelLattice { origin: [0.0; 3], edge: 0.01 };
        let mut voxels = OccupiedVoxels::new(lattice);
        points.iter().for_each(|p| voxels.add(*p).expect("near"));
        let chunk = ChunkVoxels::new(lattice, [0; 3], &voxels.into_chunks()[&[0; 3]]);
        shell(&chunk, &FreeSpace::default())
    }

    #[test]
    fn the_shell_of_a_plane_is_closed_and_thin() {
        let plane = |k: i32| {
            let (x, y) = (f64::from(k / 100), f64::from(k % 100));
            [0.5 + 0.004 * x, 0.5 + 0.004 * y, 0.5 + 0.0003 * x]
        };
        let mesh = shell_of(&(0..10_000).map(plane).collect::<Vec<_>>());
        let mut edges: BTreeMap<[u32; 2], i32> = BTreeMap::new();
        for t in &mesh.triangles {
            for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                *edges.entry([a.min(b), a.max(b)]).or_default() += if a < b { 1 } else { -1 };
            }
        }
        assert!(edges.values().all(|n| *n == 0), "each edge is passed once each way");
        for v in &mesh.vertices {
            let off = v[2] - (0.5 + 0.0003 / 0.004 * (v[0] - 0.5));
            assert!(off.abs() < 0.0015, "{v:?}: {off}");
        }
    }

    #[test]
    fn cubes_stand_where_their_voxels_do() {
        let lattice = VoxelLattice { origin: [0.0; 3], edge: 0.05 };
        let mut voxels = OccupiedVoxels::new(lattice);
        for p in [[0.125, 0.125, 0.125], [0.175, 0.125, 0.125]] {
            voxels.add(p).expect("near");
        }
        let chunk = ChunkVoxels::cubes(lattice, [0; 3], &voxels.into_chunks()[&[0; 3]]);
        let mesh = shell(&chunk, &FreeSpace::default());
        let bounds = geometry::Aabb::of(mesh.vertices.iter().copied());
        let wanted = [[0.1, 0.1, 0.1], [0.2, 0.15, 0.15]];
        for (found, wanted) in [bounds.min, bounds.max].iter().zip(wanted) {
            let is_there = found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-4);
            assert!(is_there, "{found:?}, not {wanted:?}");
        }
    }

    #[test]
    fn a_single_point_has_a_closed_surface_around_it() {
        let mesh = shell_of(&[[0.123, 0.456, 0.789]]);
        assert_eq!((mesh.vertices.len(), mesh.triangles.len()), (8, 12));
    }
}
