//! Poses, positions and displacements: names for the types of `nalgebra`.

/// A rigid motion `a_from_b`: it converts coordinates from frame `b` to frame `a`, metres.
pub type Pose = nalgebra::Isometry3<f64>;
/// A position, metres.
pub type Point = nalgebra::Point3<f64>;
/// A displacement or direction, metres or unit length.
pub type Vector = nalgebra::Vector3<f64>;
