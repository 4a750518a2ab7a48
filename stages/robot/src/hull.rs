//! The convex hull of points.

use crate::model::Mesh;
use parry3d::transformation::try_convex_hull;

/// The convex hull of points (metres), with triangles counter-clockwise as seen from outside;
/// `None` for fewer than four points, or where they lie in a plane.
#[must_use]
pub fn hull(points: &[[f32; 3]]) -> Option<Mesh> {
    let points: Vec<_> = points.iter().map(|p| glamx::Vec3::from_array(*p)).collect();
    let (vertices, triangles) = try_convex_hull(&points).ok()?;
    let volume: f32 = triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|i| vertices[i as usize] - vertices[0]);
            a.dot(b.cross(c)) / 6.0
        })
        .sum();
    // A flat hull has two sides and no volume.
    (volume > FLAT)
        .then(|| Mesh { vertices: vertices.iter().map(|v| v.to_array()).collect(), triangles })
}

/// Smallest volume of a body, m³: that of a cube of 1 mm.
const FLAT: f32 = 1e-9;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_with_a_point_inside_has_eight_corners() {
        let mut points: Vec<[f32; 3]> =
            (0..8).map(|k| [k & 1, k >> 1 & 1, k >> 2].map(|b| b as f32)).collect();
        points.push([0.5; 3]);
        let mesh = hull(&points).expect("a body");
        assert_eq!((mesh.vertices.len(), mesh.triangles.len()), (8, 12));
        assert!(hull(&points[..3]).is_none());
    }
}
