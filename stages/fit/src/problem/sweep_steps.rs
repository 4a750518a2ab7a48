//! The steps in which a search sweeps joints. They are also the measure of how near two postures
//! are to each other.

use std::f64::consts::TAU;

use super::context::Problem;
use crate::state::Hypothesis;
use crate::{Prepared, Settings};

/// Least step of a joint that turns, radians.
const MIN_STEP: f64 = 0.01;
/// Bases that are turned by more against each other differ, radians.
const BASE_TURN: f64 = 0.03;

/// The values of a joint that a sweep tries: `low + span·k/n` for k = 0 … n.
#[derive(Debug, Clone, Copy)]
pub(crate) struct JointSweep {
    /// Radians or metres.
    pub(crate) low: f64,
    pub(crate) span: f64,
    /// Number of steps.
    pub(crate) n: usize,
}

impl JointSweep {
    /// A value of the sweep.
    pub(crate) fn value(&self, k: usize) -> f64 {
        self.low + self.span * k as f64 / self.n as f64
    }

    /// From one value to the next.
    pub(crate) fn step(&self) -> f64 {
        self.span / self.n as f64
    }
}

/// Sweeps of a model's joints.
#[derive(Clone, Copy)]
pub(crate) struct SweepSteps<'a> {
    prepared: &'a Prepared<'a>,
    settings: &'a Settings,
    /// What a link may be off and still score, metres.
    pub(crate) tolerance: f64,
}

impl<'a> SweepSteps<'a> {
    pub(crate) fn new(problem: &Problem<'a>, tolerance: f64) -> Self {
        Self { prepared: problem.prepared, settings: problem.settings, tolerance }
    }

    /// The steps for another tolerance, metres.
    pub(crate) fn with_tolerance(self, tolerance: f64) -> Self {
        Self { tolerance, ..self }
    }

    /// The sweep of a joint: an arc step moves its samples by the tolerance at most.
    pub(crate) fn sweep(&self, free: usize) -> JointSweep {
        let [low, high] = self.prepared.model.limits(free);
        let tolerance = self.tolerance;
        let (span, step) = if self.prepared.slides(free) {
            (high - low, tolerance / 2.0)
        } else {
            let arc = tolerance / self.prepared.lever[free];
            ((high - low).min(TAU), arc.clamp(MIN_STEP, self.settings.max_step))
        };
        JointSweep { low, span, n: (span / step).ceil().max(1.0) as usize }
    }

    /// Whether two hypotheses agree to within `steps` sweep steps in all joints up to one, and in
    /// the base.
    pub(crate) fn alike(&self, a: &Hypothesis, b: &Hypothesis, upto: usize, steps: f64) -> bool {
        let shift =
            (a.local_from_base.translation.vector - b.local_from_base.translation.vector).norm();
        let turn = a.local_from_base.rotation.angle_to(&b.local_from_base.rotation);
        shift < 0.5 * self.tolerance
            && turn < BASE_TURN
            && (0..=upto).all(|j| {
                let sweep = self.sweep(j);
                (a.posture[j] - b.posture[j]).abs() <= steps * sweep.span / sweep.n as f64
            })
    }
}
