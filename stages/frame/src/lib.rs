//! Finds where the frame of new scans lies in that of an earlier session, from surfaces and beams
//! of both, and how clearly.
//!
//! 1. Each session is described by surfels: one voxel of 0.2 m, its mean point and normal
//!    ([`Gathered`], [`Surfels`]); and by panoramas: how far the beams of a scanner went in each
//!    direction ([`Panorama`]).
//! 2. Yaw angles come from the histograms of the normals of upright surfaces, heights from those of
//!    level ones, and places from the correlation of plans of both sessions over all shifts
//!    (`search`).
//! 3. Each such pose is refined, point to plane, by shift and yaw (`refine`).
//! 4. Each refined pose is judged (`judge`): which surfels lie on surfels of the other session, and
//!    which lie where the beams of the other session went through.
//! 5. The best pose is taken only if every other place that fits about as well is contradicted by
//!    many more surfels of fixed objects than moved objects could account for (`decide`).
//!
//! # Example
//! ```
//! use frame::{Answer, Gathered, Panorama, SessionSurfaces, at_stated};
//! use geometry::{Pose, Vector, direction::unit};
//!
//! // A scanner in a room of 10 m × 7 m × 4 m.
//! let (at, origin) = (Vector::new(4.0, 3.0, 1.7), Vector::zeros());
//! let mut eye = Panorama::new(&Pose::translation(at.x, at.y, at.z), &origin);
//! let mut points = Gathered::about(origin);
//! for (row, col) in (-220..220).flat_map(|row| (0..900).map(move |col| (row, col))) {
//!     let angle = |i: i32| (f64::from(i) * 0.4 + 0.1).to_radians();
//!     let along = unit(angle(col), angle(row));
//!     let to = |i: usize| if along[i] > 0.0 { [10.0, 7.0, 4.0][i] - at[i] } else { -at[i] };
//!     let range = (0..3).map(|i| to(i) / along[i]).fold(f64::INFINITY, f64::min);
//!     eye.add(along.map(|v| (v * range) as f32));
//!     points.add((at + Vector::from(along) * range).into(), Some(&at));
//! }
//! let session = SessionSurfaces { surfels: points.surfels(&[]), eyes: vec![eye.finish()] };
//! // The scans lie on themselves where they are stated to.
//! assert!(matches!(at_stated(&session, &session, &Pose::identity()), Answer::Holds(_)));
//! ```
#![forbid(unsafe_code)]

mod decide;
mod judge;
mod panorama;
mod plans;
mod refine;
mod search;
mod session;
mod surfels;
#[cfg(test)]
mod tests;

pub use decide::{Answer, FramePlace, Refusal, at_stated, find, from_rough, is_stated};
pub use judge::PoseEvidence;
pub use panorama::Panorama;
pub use refine::Laid;
pub use session::SessionSurfaces;
pub use surfels::{Gathered, Surfel, Surfels};
