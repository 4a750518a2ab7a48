//! A mesh and known free space in; the area of the mesh, and what of it lies in free space, out.

use crate::free::FreeSpace;
use crate::mesh::SurfaceMesh;

/// Longest edge of a piece whose middle stands for it, metres: less than half a voxel of space.
const PIECE: f64 = 0.02;

/// Area of a mesh, square metres.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SurfaceArea {
    /// Of all triangles.
    pub all: f64,
    /// Of what lies in voxels that beams passed through.
    pub in_free: f64,
}

/// The area of a mesh, in pieces of at most two centimetres.
#[must_use]
pub fn surface_area(mesh: &SurfaceMesh, free: &FreeSpace) -> SurfaceArea {
    let mut area = SurfaceArea::default();
    let mut waiting: Vec<[[f64; 3]; 3]> = Vec::new();
    for triangle in &mesh.triangles {
        waiting.push(mesh.corners(*triangle));
        while let Some(corners) = waiting.pop() {
            let minus = |a: [f64; 3], b: [f64; 3]| std::array::from_fn(|i| a[i] - b[i]);
            let square = |v: [f64; 3]| v.iter().map(|x| x * x).sum::<f64>();
            let edges = [0, 1, 2].map(|i| square(minus(corners[(i + 1) % 3], corners[i])));
            let longest = (0..3).fold(0, |most, i| if edges[i] > edges[most] { i } else { most });
            if !free.is_empty() && edges[longest] > PIECE * PIECE {
                let [a, b, c] = [0, 1, 2].map(|i| corners[(longest + i) % 3]);
                let middle = std::array::from_fn(|i| (a[i] + b[i]) * 0.5);
                waiting.extend([[a, middle, c], [middle, b, c]]);
                continue;
            }
            let (u, v): ([f64; 3], [f64; 3]) =
                (minus(corners[1], corners[0]), minus(corners[2], corners[0]));
            let cross = std::array::from_fn(|i| {
                u[(i + 1) % 3] * v[(i + 2) % 3] - u[(i + 2) % 3] * v[(i + 1) % 3]
            });
            let own = 0.5 * square(cross).sqrt();
            let middle: [f64; 3] =
                std::array::from_fn(|i| (corners[0][i] + corners[1][i] + corners[2][i]) / 3.0);
            area.all += own;
            if free.is_free(middle) {
                area.in_free += own;
            }
        }
    }
    area
}
