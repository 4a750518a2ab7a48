//! Mathematics on slices: poses, planes, directions, depth images, robust kernels.
//!
//! Numbers in, numbers out. Knows no files, no threads, no scans; doubt is an `Option`, never an
//! error.
#![forbid(unsafe_code)]

pub mod aabb;
pub mod depth;
pub mod direction;
pub mod evidence;
pub mod faces;
pub mod field;
mod lanes;
mod level;
pub mod narrow;
pub mod plane;
pub mod probe;
pub mod robust;
mod spread;

pub use aabb::Aabb;
pub use depth::DepthImage;
pub use evidence::Evidence;
pub use faces::{Eye, Faces};
pub use field::NearestField;
pub use plane::{Moments, Plane};
pub use probe::Probe;

/// A rigid motion `a_from_b`: takes coordinates in frame `b` to frame `a`, metres.
pub type Pose = nalgebra::Isometry3<f64>;
/// A position, metres.
pub type Point = nalgebra::Point3<f64>;
/// A displacement or direction, metres or unit length.
pub type Vector = nalgebra::Vector3<f64>;
