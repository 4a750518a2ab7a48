//! Poses, positions and displacements: names for the types of `nalgebra`.

use nalgebra::UnitQuaternion;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// A rigid motion `a_from_b`: it converts coordinates from frame `b` to frame `a`, metres.
pub type Pose = nalgebra::Isometry3<f64>;
/// A position, metres.
pub type Point = nalgebra::Point3<f64>;
/// A displacement or direction, metres or unit length.
pub type Vector = nalgebra::Vector3<f64>;

/// Roll, pitch and yaw as URDF has them, `Rz(yaw) · Ry(pitch) · Rx(roll)`, radians. They give the
/// turn back at a pitch of a quarter turn as well, where angles of a matrix take roll and yaw from
/// what is left of rounding.
#[must_use]
pub fn roll_pitch_yaw(turn: &UnitQuaternion<f64>) -> [f64; 3] {
    let (w, x, y, z) = (turn.w, turn.i, turn.j, turn.k);
    // Halves of yaw + roll and yaw - roll, each from the part of the quaternion that tells it.
    let half_sum = (x + z).atan2(w - y);
    let half_difference = (z - x).atan2(w + y);
    let pitch = 2.0 * (w + y).hypot(z - x).atan2((w - y).hypot(x + z)) - FRAC_PI_2;
    let whole = |angle: f64| match angle {
        _ if angle > PI => angle - TAU,
        _ if angle <= -PI => angle + TAU,
        _ => angle,
    };
    [whole(half_sum - half_difference), pitch, whole(half_sum + half_difference)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_give_any_turn_back_at_a_quarter_turn_of_pitch_too() {
        let angles = [-PI, -2.0, -FRAC_PI_2, -1e-9, 0.0, 0.3, FRAC_PI_2, 3.0, PI];
        let near = [0.0, 1e-16, 1e-12, 1e-9, 1e-8, 1e-6, 1e-3, 0.5];
        let pitches = near.iter().flat_map(|d| [FRAC_PI_2 - d, d - FRAC_PI_2, *d]);
        for pitch in pitches {
            for (roll, yaw) in angles.iter().flat_map(|r| angles.map(|y| (*r, y))) {
                let turn = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
                for turn in [turn, UnitQuaternion::new_unchecked(-turn.into_inner())] {
                    let [r, p, y] = roll_pitch_yaw(&turn);
                    let again = UnitQuaternion::from_euler_angles(r, p, y);
                    let off = (again.coords - turn.coords).norm();
                    let off = off.min((again.coords + turn.coords).norm());
                    assert!(off < 2e-15, "{roll} {pitch} {yaw}: {off}");
                    let within = |angle: f64| angle.abs() <= PI;
                    assert!(within(r) && within(y) && p.abs() <= FRAC_PI_2 + 1e-15);
                }
            }
        }
        assert_eq!(roll_pitch_yaw(&UnitQuaternion::identity()), [0.0; 3]);
    }
}
