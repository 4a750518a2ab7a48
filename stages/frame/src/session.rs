//! The surfaces of one session, with the panoramas of its scanners.

use crate::panorama::Panorama;
use crate::surfels::Surfels;

/// The surfaces of one session, and how far its beams went.
#[derive(Debug, Clone, Default)]
pub struct SessionSurfaces {
    /// Surfaces, about an origin of the session's own.
    pub surfels: Surfels,
    /// Scanners, about the same origin.
    pub eyes: Vec<Panorama>,
}
