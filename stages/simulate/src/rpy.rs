//! Poses from positions and angles, as scene files and URDFs give them.

use geometry::{Pose, Vector};
use nalgebra::{Translation3, UnitQuaternion};

/// A pose from a position (metres) and roll, pitch, yaw about the fixed axes x, y, z (degrees).
#[must_use]
pub fn pose(xyz: [f64; 3], rpy_deg: [f64; 3]) -> Pose {
    let [r, p, y] = rpy_deg.map(f64::to_radians);
    Pose::from_parts(
        Translation3::from(Vector::from(xyz)),
        UnitQuaternion::from_euler_angles(r, p, y),
    )
}
