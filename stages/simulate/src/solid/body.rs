//! A closed triangle body: joined, moved, rotated and measured.

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
    /// The body as binary STL, metres.
    #[must_use]
    pub fn to_stl(&self) -> Vec<u8> {
        let corner = |i: u32| self.vertices[i as usize].coords.into();
        geometry::binary_stl(self.triangles.iter().map(|triangle| triangle.map(corner)))
    }

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
