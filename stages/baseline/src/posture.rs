//! Where a robot stands while its joints are found one after the other.

use geometry::Pose;

/// A base pose, and a posture of which the first joints are found; the others are as at home.
#[derive(Debug, Clone)]
pub(crate) struct Placement {
    /// Base of the robot in the local frame of the region.
    pub(crate) local_from_base: Pose,
    /// A value for each free joint, radians or metres.
    pub(crate) posture: Vec<f64>,
}
