//! Distances from the surface of a link, or from points attached to it. All coordinates are in the
//! frame of the link, metres.

use crate::obstacle::{HALF_CELL, distance};
use contract::{Space, SpaceGrid, SpaceKind};
use geometry::{Aabb, NearestField};
use glamx::Vec3;
use parry3d::shape::{CompositeShapeRef, TriMesh};
use robot::Mesh;

/// Smallest edge of the voxels for what a link encloses, metres. They are wider where there would
/// be more than [`N_INSIDE`].
const INSIDE_EDGE: f64 = 0.004;
/// Largest number of these voxels for one link.
const N_INSIDE: f64 = 4e6;
/// Diagonal of a cube of edge 1.
const DIAGONAL: f64 = 1.7321;
/// Edge of the voxels that give the nearest attached point, metres.
const ATTACHED_EDGE: f32 = 0.01;
/// Further reach of these voxels, metres: their own diagonal, even where they had to be widened.
const ATTACHED_REACH: f32 = 0.1;

/// The distance of a place from a shape.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Gap {
    /// It is farther than the limit of the query.
    Far,
    /// Lower bound of the distance from the surface, metres.
    At(f32),
    /// The place is enclosed by the shape, away from its surface.
    Inside,
}

/// A shape whose distance from obstacles is checked.
pub(crate) enum PartShape {
    /// Triangles, and the voxels that they enclose.
    Surface(Box<TriMesh>, Space),
    /// Attached points, with an index of the nearest one.
    Attached(Vec<[f32; 3]>, NearestField),
}

impl PartShape {
    /// A shape for queries of at least `least` metres; `None` for a mesh without triangles.
    pub(crate) fn surface(mesh: &Mesh, bounds: &Aabb, least: f32) -> Option<Self> {
        let corners = mesh.vertices.iter().map(|v| Vec3::from_array(*v)).collect();
        let triangles = TriMesh::new(corners, mesh.triangles.clone()).ok()?;
        // A place farther than the limit lies in no voxel of the surface, so that it is known on
        // which side it is.
        let widest = (f64::from(least) / DIAGONAL).max(INSIDE_EDGE);
        let volume: f64 = bounds.size().iter().map(|s| s.max(INSIDE_EDGE)).product();
        let edge = (volume / N_INSIDE).cbrt().clamp(INSIDE_EDGE, widest);
        Some(Self::Surface(Box::new(triangles), enclosed(mesh, bounds, edge)))
    }

    /// A shape of attached points for queries of at most `most` metres.
    pub(crate) fn attached(points: Vec<[f32; 3]>, most: f32) -> Self {
        let field = NearestField::new(&points, ATTACHED_EDGE, most + ATTACHED_REACH);
        Self::Attached(points, field)
    }

    /// Distance of a place, if it is at most `within` metres. Enclosed places are inside, however
    /// near the surface is.
    pub(crate) fn gap(&self, p: [f32; 3], within: f32) -> Gap {
        match self {
            Self::Surface(_, inside) if encloses(inside, p) => Gap::Inside,
            Self::Surface(mesh, _) => {
                let at = Vec3::from_array(p);
                let found = CompositeShapeRef(&**mesh).project_local_point(at, within, false);
                found.map_or(Gap::Far, |(_, there)| Gap::At((there.point - at).length()))
            }
            Self::Attached(points, field) => match field.nearest(p) {
                Some(i) => {
                    // The point nearest to the centre of the voxel may be farther by the diagonal,
                    // and each point stands for a cell.
                    let off = DIAGONAL as f32 / field.grid().1 + HALF_CELL;
                    let gap = (distance(points[i], p) - off).max(0.0);
                    if gap <= within { Gap::At(gap) } else { Gap::Far }
                }
                None => Gap::Far,
            },
        }
    }

    /// Whether it gives distances at any range. Attached points give them only up to the limit they
    /// were prepared for.
    pub(crate) fn is_unlimited(&self) -> bool {
        matches!(self, Self::Surface(..))
    }
}

fn encloses(inside: &Space, p: [f32; 3]) -> bool {
    let at = inside.grid().index(p.map(f64::from));
    at.is_some_and(|at| inside.voxels()[at] == SpaceKind::Robot)
}

/// The voxels that cannot be reached from outside without crossing the mesh, without those of its
/// surface.
fn enclosed(mesh: &Mesh, bounds: &Aabb, edge: f64) -> Space {
    let grid = SpaceGrid::over(&bounds.grown(2.0 * edge), edge);
    let mut space = Space::unknown(grid);
    for triangle in &mesh.triangles {
        let corners = triangle.map(|i| Vec3::from_array(mesh.vertices[i as usize]));
        samples(corners, 0.5 * grid.edge as f32, |p| {
            if let Some(at) = grid.index(p.to_array().map(f64::from)) {
                space.voxels_mut()[at] = SpaceKind::Free;
            }
        });
    }
    let is_surface = |(_, kind): &(usize, &SpaceKind)| **kind == SpaceKind::Free;
    let all = space.voxels().iter().enumerate();
    let surface: Vec<usize> = all.filter(is_surface).map(|(at, _)| at).collect();
    for at in grid.enclosed(&grid.bounds(), &surface) {
        space.voxels_mut()[at] = SpaceKind::Robot;
    }
    space
}

/// Samples of a triangle, at most `apart` from each other along two of its sides.
fn samples([a, b, c]: [Vec3; 3], apart: f32, mut take: impl FnMut(Vec3)) {
    // From the corner between the two shorter sides, so that needles give few samples.
    let lengths = [(c - b).length(), (c - a).length(), (b - a).length()];
    let longest = (0..3).max_by(|&i, &j| lengths[i].total_cmp(&lengths[j])).unwrap_or(0);
    let [from, u, v] = [[a, b, c], [b, c, a], [c, a, b]][longest];
    let (u, v) = (u - from, v - from);
    let steps = |length: f32| (length / apart).ceil().max(1.0);
    let n = steps(u.length());
    for i in 0..=n as usize {
        let at = i as f32 / n;
        let m = steps((1.0 - at) * v.length());
        (0..=m as usize).for_each(|j| take(from + u * at + v * ((1.0 - at) * j as f32 / m)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cube of edge 0.4 about the origin.
    fn cube() -> (Mesh, Aabb) {
        let bounds = Aabb { min: [-0.2; 3], max: [0.2; 3] };
        let vertices = bounds.corners().map(|c| c.map(|v| v as f32)).to_vec();
        let quads =
            [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
        let triangles =
            quads.iter().flat_map(|q: &[u32; 4]| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]);
        (Mesh { vertices, triangles: triangles.collect() }, bounds)
    }

    #[test]
    fn a_place_is_far_at_the_surface_or_inside() {
        let (mesh, bounds) = cube();
        let shape = PartShape::surface(&mesh, &bounds, 0.03).expect("triangles");
        assert_eq!(shape.gap([0.5, 0.0, 0.0], 0.1), Gap::Far);
        let Gap::At(gap) = shape.gap([0.25, 0.1, -0.1], 0.1) else { panic!("near") };
        assert!((gap - 0.05).abs() < 1e-6, "{gap}");
        assert_eq!(shape.gap([0.0; 3], 0.1), Gap::Inside);
        // The side is right whatever the limit of the query is.
        for (margin, k) in [0.0085, 0.02].into_iter().flat_map(|m| (1..20).map(move |k| (m, k))) {
            let shape = PartShape::surface(&mesh, &bounds, margin).expect("triangles");
            let off = 0.01 * k as f32 - 0.0005;
            let gap = shape.gap([0.2 - off, 0.0137, -0.0049], margin);
            assert!(off < 0.007 || gap == Gap::Inside, "{margin} {off}: {gap:?}");
        }
        // A cube with a side missing encloses nothing.
        let open = Mesh { triangles: mesh.triangles[2..].to_vec(), ..mesh };
        let shape = PartShape::surface(&open, &bounds, 0.03).expect("triangles");
        assert_eq!(shape.gap([0.0; 3], 0.1), Gap::Far);
    }

    #[test]
    fn distances_from_attached_points_are_lower_bounds() {
        let points: Vec<[f32; 3]> = (0..200).map(|i| [0.003 * i as f32, 0.0, 0.0]).collect();
        let shape = PartShape::attached(points, 0.05);
        for k in 0..100 {
            let off = 0.0005 * k as f32;
            match shape.gap([0.2, off, 0.0], 0.05) {
                Gap::At(gap) => assert!(gap <= off + 2e-3 && gap >= off - 0.023, "{gap} {off}"),
                Gap::Far => assert!(off > 0.05, "{off}"),
                Gap::Inside => panic!("points enclose nothing"),
            }
        }
    }
}
