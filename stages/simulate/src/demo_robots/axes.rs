//! Axes and limits that joints of the demo robots share.

/// Axes of joints: roll about x, pitch about y, yaw about z.
pub(crate) const X: [f64; 3] = [1.0, 0.0, 0.0];
pub(crate) const Y: [f64; 3] = [0.0, 1.0, 0.0];
pub(crate) const Z: [f64; 3] = [0.0, 0.0, 1.0];
/// Limits of a joint that turns almost a full turn, so that no pose is reached twice, radians.
pub(crate) const FULL_TURN: [f64; 2] = [-3.1, 3.1];
