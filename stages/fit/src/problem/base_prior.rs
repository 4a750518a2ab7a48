//! What is known of the base before any point is looked at (METHOD.md §5).

use contract::Candidate;
use geometry::Pose;
use nalgebra::Translation3;

use crate::Settings;

/// The base stands upright on a plane.
#[derive(Clone, Copy)]
pub(crate) struct Prior {
    /// Frame on the plane, z = normal, local frame.
    pub(crate) local_from_plane: Pose,
    /// Standard deviations of height, metres, and tilt, radians.
    pub(crate) sigma: [f64; 2],
}

impl Prior {
    /// The installation plane of a candidate, at the height of the base's origin.
    pub(crate) fn of(candidate: &Candidate, local_from_world: &Pose, settings: &Settings) -> Self {
        // The candidate's bases already stand on the plane: the first one tells the height of the
        // origin above it.
        let base = candidate.bases.first().map_or_else(Pose::identity, |b| local_from_world * b.0);
        let (at, turn) =
            (Translation3::from(base.translation.vector), candidate.plane.plane.frame());
        let is_guess = candidate.plane.is_guess();
        let sigma = if is_guess { settings.guess_sigma } else { settings.plane_sigma };
        Self { local_from_plane: Pose::from_parts(at, turn), sigma }
    }
}
