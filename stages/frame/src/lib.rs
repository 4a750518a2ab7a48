//! Surfaces and beams of an earlier session and of new scans in; where the frame of the new scans
//! lies in that of the earlier session, and how clearly, out.
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
//!    much more of what stands still than could have been moved (`decide`).
#![forbid(unsafe_code)]

mod decide;
mod judge;
mod panorama;
mod plans;
mod refine;
mod search;
mod surfels;
#[cfg(test)]
mod tests;

pub use decide::{Answer, FramePlace, Refusal, at_stated, find, from_rough, is_stated};
pub use judge::PoseEvidence;
pub use panorama::Panorama;
pub use refine::Laid;
pub use surfels::{Gathered, Surfel, Surfels};

/// What one session knows: its surfaces, and how far its beams went.
#[derive(Debug, Clone, Default)]
pub struct SessionSurfaces {
    /// Its surfaces, about an origin of its own.
    pub surfels: Surfels,
    /// Its scanners, about the same origin.
    pub eyes: Vec<Panorama>,
}
