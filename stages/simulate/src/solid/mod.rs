//! Closed triangle bodies from outlines, rings and paths, of which hall and demo robots are made.

mod cap;
mod shapes;

pub use shapes::{Ring, bolts, cuboid, disc, lathe, loft, prism, rounded, tube};

use geometry::{Point, Pose, Vector};
use nalgebra::{Translation3, UnitQuaternion};
use robot::Mesh;

/// A closed triangle body, counter-clockwise as seen from outside, metres. Its pieces may overlap.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Solid {
    /// Vertices, metres.
    pub vertices: Vec<Point>,
    /// Indices of three vertices each.
    pub triangles: Vec<[u32; 3]>,
}

impl Solid {
    /// Several bodies as one.
    #[must_use]
    pub fn of(parts: impl IntoIterator<Item = Solid>) -> Self {
        let mut out = Self::default();
        for part in parts {
            out.add(&part);
        }
        out
    }

    /// Adds another body.
    pub fn add(&mut self, other: &Self) {
        let first = self.vertices.len() as u32;
        self.vertices.extend_from_slice(&other.vertices);
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|i| i + first)));
    }

    /// The body transformed by `pose`.
    #[must_use]
    pub fn posed(mut self, pose: &Pose) -> Self {
        for vertex in &mut self.vertices {
            *vertex = pose * *vertex;
        }
        self
    }

    /// The body moved by a displacement, metres.
    #[must_use]
    pub fn at(self, xyz: [f64; 3]) -> Self {
        self.posed(&Pose::from_parts(
            Translation3::from(Vector::from(xyz)),
            UnitQuaternion::identity(),
        ))
    }

    /// The body rotated about the origin: roll, pitch, yaw about the fixed axes x, y, z, degrees.
    #[must_use]
    pub fn turned(self, rpy_deg: [f64; 3]) -> Self {
        let [r, p, y] = rpy_deg.map(f64::to_radians);
        self.posed(&Pose::from_parts(
            Translation3::identity(),
            UnitQuaternion::from_euler_angles(r, p, y),
        ))
    }

    /// The body with its z axis laid along +x (x becomes −z): bodies are drawn upright, then laid
    /// down.
    #[must_use]
    pub fn along_x(self) -> Self {
        self.turned([0.0, 90.0, 0.0])
    }

    /// The body with its z axis laid along +y (y becomes −z).
    #[must_use]
    pub fn along_y(self) -> Self {
        self.turned([-90.0, 0.0, 0.0])
    }

    /// The same surface in single precision.
    #[must_use]
    pub fn mesh(&self) -> Mesh {
        Mesh {
            vertices: self.vertices.iter().map(|p| [p.x as f32, p.y as f32, p.z as f32]).collect(),
            triangles: self.triangles.clone(),
        }
    }

    /// Signed volume, m³: positive where triangles are counter-clockwise from outside.
    #[must_use]
    pub fn volume(&self) -> f64 {
        self.triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|i| self.vertices[i as usize].coords);
                a.dot(&b.cross(&c)) / 6.0
            })
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    /// Whether every edge is used once in each direction, so that there is no hole and no doubled
    /// face.
    fn is_closed(solid: &Solid) -> bool {
        let mut edges: BTreeMap<(u32, u32), i32> = BTreeMap::new();
        for t in &solid.triangles {
            for k in 0..3 {
                *edges.entry((t[k], t[(k + 1) % 3])).or_default() += 1;
            }
        }
        edges.iter().all(|(&(a, b), &n)| n == 1 && edges.get(&(b, a)) == Some(&1))
    }

    #[test]
    fn shapes_are_closed_and_turned_outwards() {
        let u = [
            [0.0, 0.0],
            [3.0, 0.0],
            [3.0, 2.0],
            [2.0, 2.0],
            [2.0, 1.0],
            [1.0, 1.0],
            [1.0, 2.0],
            [0.0, 2.0],
        ];
        let path =
            [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.5, 0.0, 1.5], [0.5, 1.0, 1.5]].map(Point::from);
        let shapes = [
            ("cuboid", cuboid([1.0, 2.0, 3.0], 0.0), 6.0, 1e-9),
            ("chamfered", cuboid([1.0, 2.0, 3.0], 0.05), 6.0, 0.1),
            ("prism", prism(&u, -0.5, 0.5, 0.0), 5.0, 1e-9),
            ("prism with chamfer", prism(&u, -0.5, 0.5, 0.05), 5.0, 0.3),
            ("disc", disc(1.0, 0.0, 1.0, 0.02, 64), std::f64::consts::PI, 0.1),
            ("tube", tube(&path, 0.1, 24), 0.075, 0.005),
            (
                "loft",
                loft(&[
                    rounded([0.0; 3], [1.0, 1.0], 0.2, 6),
                    rounded([0.1, 0.0, 1.0], [0.5, 0.5], 0.1, 6),
                ]),
                0.55,
                0.05,
            ),
        ];
        for (name, solid, volume, slack) in shapes {
            assert!(is_closed(&solid), "{name} is not closed");
            assert!((solid.volume() - volume).abs() < slack, "{name}: {}", solid.volume());
        }
    }
}
