//! Geometry on slices: poses, planes, directions, depth images, nearest-sample fields and robust
//! kernels.
//!
//! The crate knows no files, threads or scans. Functions return an `Option` where there is no
//! answer, and never an error.
//!
//! # Example
//! A depth image tells whether a scanner saw a surface, looked through a place, or saw nothing:
//! ```
//! use geometry::{DepthImage, Evidence, Eye, Pose, depth::Empty};
//!
//! // The scanner stands at the origin and looks along +z at a wall 5 m away.
//! let mut image = DepthImage::new(Pose::identity(), 0.5, 100.0);
//! for (x, y) in (-240..=240).flat_map(|x| (-240..=240).map(move |y| (x, y))) {
//!     image.splat([x as f32 * 0.01, y as f32 * 0.01, 5.0]);
//! }
//! image.finish(1, |_| Empty::Unknown);
//!
//! let evidence = Evidence::new([Eye::new([&image])], None);
//! let (samples, normals) = ([[0.0_f32, 0.0, 0.0]], [[0.0_f32, 0.0, -1.0]]);
//! let on_wall = Pose::translation(0.0, 0.0, 5.0); // local_from_body, metres
//! assert_eq!(evidence.probe(&samples, &normals, &on_wall, 0.01).n_on, 1);
//! let before_wall = Pose::translation(0.0, 0.0, 3.0);
//! assert_eq!(evidence.probe(&samples, &normals, &before_wall, 0.01).n_through, 1);
//! ```
#![forbid(unsafe_code)]

pub mod aabb;
pub mod angle;
pub mod depth;
pub mod direction;
pub mod evidence;
pub mod faces;
pub mod field;
pub mod fourier;
mod lanes;
mod level;
pub mod narrow;
pub mod plane;
mod pose;
pub mod probe;
pub mod raw_list;
pub mod robust;
mod spread;
mod stl;

pub use aabb::Aabb;
pub use depth::DepthImage;
pub use evidence::Evidence;
pub use faces::{Eye, Faces};
pub use field::NearestField;
pub use plane::{Moments, Plane};
pub use pose::{Point, Pose, Vector, roll_pitch_yaw};
pub use probe::{Probe, SurfaceSamples};
pub use stl::{STL_HEAD, STL_TRIANGLE, binary_stl, stl_corners};
