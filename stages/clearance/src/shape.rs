//! The surface of a link, or points that hang on it, in; how far a place is from it, out. All in the frame of the link, metres.

use crate::obstacles::distance;
use contract::{Space, SpaceGrid, SpaceKind};
use geometry::{Aabb, NearestField};
use glamx::Vec3;
use parry3d::shape::{CompositeShapeRef, TriMesh};
use robot::Mesh;

/// Edge of the voxels that tell what a link encloses, metres: cracks between badly joined triangles are narrower.
const INSIDE_EDGE: f64 = 0.02;
/// Edge of the voxels that tell which hanging point is nearest, metres.
const HUNG_EDGE: f32 = 0.01;
/// What that may be off, metres: twice the half diagonal of such a voxel.
const HUNG_BIAS: f32 = 0.0174;

/// A place seen from a shape.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Gap {
    /// Farther than was asked for.
    Far,
    /// So far from its surface, at least, metres.
    At(f32),
    /// Enclosed by it, away from its surface.
    Inside,
}

/// What is not to touch anything.
pub(crate) enum Shape {
    /// Triangles, and what they enclose.
    Surface(TriMesh, Space),
    /// Points.
    Hung(Vec<[f32; 3]>, NearestField),
}

impl Shape {
    /// Nothing for a mesh without triangles.
    pub(crate) fn surface(mesh: &Mesh, bounds: &Aabb) -> Option<Self> {
        let corners = mesh.vertices.iter().map(|v| Vec3::from_array(*v)).collect();
        let triangles = TriMesh::new(corners, mesh.triangles.clone()).ok()?;
        Some(Self::Surface(triangles, enclosed(mesh, bounds)))
    }

    /// Points that are told from up to `reach` away.
    pub(crate) fn hung(points: Vec<[f32; 3]>, reach: f32) -> Self {
        let field = NearestField::new(&points, HUNG_EDGE, reach + HUNG_BIAS);
        Self::Hung(points, field)
    }

    /// How far a place is, if it is `within` metres.
    pub(crate) fn gap(&self, p: [f32; 3], within: f32) -> Gap {
        match self {
            Self::Surface(mesh, inside) => {
                let at = Vec3::from_array(p);
                let found = CompositeShapeRef(mesh).project_local_point(at, within, false);
                match found {
                    Some((_, projection)) => Gap::At((projection.point - at).length()),
                    None if encloses(inside, p) => Gap::Inside,
                    None => Gap::Far,
                }
            }
            Self::Hung(points, field) => match field.nearest(p) {
                Some(i) => {
                    let gap = (distance(points[i], p) - HUNG_BIAS).max(0.0);
                    if gap <= within { Gap::At(gap) } else { Gap::Far }
                }
                None => Gap::Far,
            },
        }
    }

    /// Whether it tells distances however large they are.
    pub(crate) fn tells_all(&self) -> bool {
        matches!(self, Self::Surface(..))
    }
}

fn encloses(inside: &Space, p: [f32; 3]) -> bool {
    let at = inside.grid().index(p.map(f64::from));
    at.is_some_and(|at| inside.voxels()[at] == SpaceKind::Robot)
}

/// What cannot be reached from outside without crossing the mesh; its surface is not in it.
fn enclosed(mesh: &Mesh, bounds: &Aabb) -> Space {
    let grid = SpaceGrid::over(&bounds.grown(2.0 * INSIDE_EDGE), INSIDE_EDGE);
    let mut space = Space::unknown(grid);
    let mut surface = Vec::new();
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|i| Vec3::from_array(mesh.vertices[i as usize]));
        let longest = (b - a).length().max((c - a).length()).max((c - b).length());
        // Two samples a voxel on each side leave none out that a triangle goes through by more than a corner.
        let n = (f64::from(longest) / (0.5 * grid.edge)).ceil().max(1.0);
        let step = 1.0 / n;
        let n = n as usize;
        for (i, j) in (0..=n).flat_map(|i| (0..=n - i).map(move |j| (i, j))) {
            let [u, v] = [i, j].map(|k| (k as f64 * step) as f32);
            let p = a + (b - a) * u + (c - a) * v;
            surface.extend(grid.index(p.to_array().map(f64::from)));
        }
    }
    surface.sort_unstable();
    surface.dedup();
    for at in grid.enclosed(&grid.bounds(), &surface) {
        space.voxels_mut()[at] = SpaceKind::Robot;
    }
    surface.iter().for_each(|at| space.voxels_mut()[*at] = SpaceKind::Free);
    space
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
        let shape = Shape::surface(&mesh, &bounds).expect("triangles");
        assert_eq!(shape.gap([0.5, 0.0, 0.0], 0.1), Gap::Far);
        let Gap::At(gap) = shape.gap([0.25, 0.1, -0.1], 0.1) else { panic!("near") };
        assert!((gap - 0.05).abs() < 1e-6, "{gap}");
        assert_eq!(shape.gap([0.0; 3], 0.1), Gap::Inside);
        // Where one of its sides is missing, nothing is enclosed.
        let open = Mesh { triangles: mesh.triangles[2..].to_vec(), ..mesh };
        let shape = Shape::surface(&open, &bounds).expect("triangles");
        assert_eq!(shape.gap([0.0; 3], 0.1), Gap::Far);
    }

    #[test]
    fn points_that_hang_are_never_farther_than_they_are() {
        let points: Vec<[f32; 3]> = (0..200).map(|i| [0.003 * i as f32, 0.0, 0.0]).collect();
        let shape = Shape::hung(points, 0.05);
        for k in 0..100 {
            let off = 0.0005 * k as f32;
            match shape.gap([0.2, off, 0.0], 0.05) {
                Gap::At(gap) => assert!(gap <= off + 2e-3 && gap >= off - 0.02, "{gap} {off}"),
                Gap::Far => assert!(off > 0.05, "{off}"),
                Gap::Inside => panic!("points enclose nothing"),
            }
        }
    }
}
