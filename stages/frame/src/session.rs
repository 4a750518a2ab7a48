//! The surfaces of one session, with the panoramas of its scanners.

use crate::panorama::Panorama;
use crate::surfels::Surfels;

/// The surfaces of one session, and the ranges of its beams.
#[derive(Debug, Clone, Default)]
pub struct SessionSurfaces {
    /// Surfels, relative to an origin of the session's own.
    pub surfels: Surfels,
    /// Panoramas of its scanners, relative to the same origin.
    pub eyes: Vec<Panorama>,
}
