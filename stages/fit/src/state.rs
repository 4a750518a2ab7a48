//! What every phase of a fit passes on: a base pose with a posture, and the errors of scans.

use geometry::{Pose, Vector, angle};
use nalgebra::{Translation3, UnitQuaternion};

/// A base pose and a posture, of which a search may have set the first joints only.
#[derive(Debug, Clone)]
pub(crate) struct Hypothesis {
    /// Base of the robot in the local frame of the region.
    pub(crate) local_from_base: Pose,
    /// A value for each free joint, radians or metres.
    pub(crate) posture: Vec<f64>,
    /// Sum over placed links of √area · mean sample score; only hypotheses of one search compare.
    pub(crate) score: f64,
}

impl Hypothesis {
    /// A base pose and a posture that no search has scored.
    pub(crate) fn at(local_from_base: Pose, posture: Vec<f64>) -> Self {
        Self { local_from_base, posture, score: 0.0 }
    }

    /// Takes a step: base twist in base axes (translation, rotation), then one value a joint.
    pub(crate) fn take(&mut self, step: &[f64]) {
        self.local_from_base *= pose_of(&step[..6]);
        for (q, change) in self.posture.iter_mut().zip(&step[6..]) {
            *q += change;
        }
    }

    /// Difference of a joint between two postures, without whole turns, radians.
    pub(crate) fn turn(&self, other: &Self, joint: usize) -> f64 {
        angle::apart(self.posture[joint], other.posture[joint])
    }
}

/// The pose that a small step of six values stands for: translation, then rotation vector.
pub(crate) fn pose_of(step: &[f64]) -> Pose {
    let turn = UnitQuaternion::from_scaled_axis(Vector::new(step[3], step[4], step[5]));
    Pose::from_parts(Translation3::new(step[0], step[1], step[2]), turn)
}

/// Unknowns of a scan: shift, turn, range bias.
pub(crate) const N_SCAN: usize = 7;

/// How a scan differs from its stated pose, as far as the points near a robot tell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ScanError {
    /// To be added to its points, metres, local axes.
    pub(crate) shift: Vector,
    /// Turn of its points about the scanner, radians, local axes.
    pub(crate) turn: Vector,
    /// Range bias: the scan's ranges are too long by this, metres.
    pub(crate) bias: f64,
}

impl ScanError {
    /// A scan that stands where it is stated to stand.
    pub(crate) const NONE: Self =
        Self { shift: Vector::new(0.0, 0.0, 0.0), turn: Vector::new(0.0, 0.0, 0.0), bias: 0.0 };

    /// The values in the order of the unknowns.
    pub(crate) fn values(&self) -> [f64; N_SCAN] {
        let (t, w) = (self.shift, self.turn);
        [t.x, t.y, t.z, w.x, w.y, w.z, self.bias]
    }

    /// Takes a step of its unknowns.
    pub(crate) fn take(&mut self, step: &[f64]) {
        self.shift += Vector::new(step[0], step[1], step[2]);
        self.turn += Vector::new(step[3], step[4], step[5]);
        self.bias += step[6];
    }
}
