//! Converts directions to angles about the axis that a scanner rotates about, and finds the regular
//! grid that these angles lie on.

use nalgebra::{UnitQuaternion, Vector3};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Steps and one pixel's middle, about one axis; radians.
#[derive(Debug, Clone, Copy)]
pub(crate) struct AngularGrid {
    pub(crate) axis: Axis,
    pub(crate) row_step: f64,
    pub(crate) col_step: f64,
    pub(crate) elevation: f64,
    pub(crate) azimuth: f64,
}

/// Which axis of the scan frame the scanner spins about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Axis {
    X,
    Y,
    Z,
}

impl Axis {
    /// The usual one first: it is preferred where several fit.
    pub(crate) const ALL: [Self; 3] = [Self::Z, Self::Y, Self::X];

    /// Turns this axis into z.
    pub(crate) fn lattice_from_scan(self) -> UnitQuaternion<f64> {
        match self {
            Self::Z => UnitQuaternion::identity(),
            Self::Y => UnitQuaternion::from_axis_angle(&Vector3::x_axis(), FRAC_PI_2),
            Self::X => UnitQuaternion::from_axis_angle(&Vector3::y_axis(), -FRAC_PI_2),
        }
    }

    /// Azimuth and elevation about this axis, radians.
    pub(crate) fn angles(self, p: [f32; 3]) -> [f64; 2] {
        let [x, y, z] = p.map(f64::from);
        let [x, y, z] = match self {
            Self::Z => [x, y, z],
            Self::Y => [x, -z, y],
            Self::X => [-z, y, x],
        };
        [y.atan2(x), z.atan2(x.hypot(y))]
    }
}

/// An angle in [−π, π).
pub(crate) fn wrap(angle: f64) -> f64 {
    (angle + PI).rem_euclid(TAU) - PI
}

/// The middle one, or the upper of two.
pub(crate) fn median(values: &mut [f64]) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}
