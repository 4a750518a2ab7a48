//! How far joints yield to leaf joints after them that may stand at several values (METHOD.md
//! §14.2, *sway*).

use contract::OneByOne;
use geometry::angle;
use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;

use super::settings::MODES;
use super::settled::JointModes;
use crate::adjust::{Adjust, Adjusted, Normal};
use crate::correspond::{AdjustPoints, worsening};
use crate::problem::Problem;
use crate::state::Hypothesis;

/// Covariance of the joints that comes from those that may stand at several values, radians² or
/// metres²: a flange's bolts pull at the wrist, and which way they pull is as open as the flange.
/// Each value is as likely as the others. `points` are those of the adjustment, as it ended.
pub(crate) fn coupled_spread(
    problem: &Problem<'_>,
    best: &Adjusted,
    several: &[&JointModes],
    points: &AdjustPoints,
) -> DMatrix<f64> {
    let h = &best.hypothesis;
    let n = h.posture.len();
    let mut out = DMatrix::zeros(n, n);
    if several.is_empty() {
        return out;
    }
    let steps = OneStep::new(problem, best, several, points);
    // The same step from where it stands: fewer points end a little beside all of them.
    let own = steps.to(None);
    let ends = problem.fan.fan(turned(problem, h, several), |value| {
        let end = steps.to(Some(value));
        // Where it ended at something worse, it is no value that the joint may stand at.
        (worsening(problem, &own, &end) < MODES.equal).then_some(end)
    });
    let is_swayed: Vec<bool> = (0..n).map(|j| several.iter().all(|s| s.joint != j)).collect();
    let mut modes: Vec<&Hypothesis> = vec![&own];
    for end in ends.iter().flatten() {
        if modes
            .iter()
            .any(|mode| several.iter().all(|s| mode.turn(end, s.joint) < MODES.other_turn))
        {
            continue;
        }
        modes.push(end);
        let change = |j: usize, _| match is_swayed[j] {
            true => angle::from_to(own.posture[j], end.posture[j]),
            false => 0.0,
        };
        let away = DVector::from_fn(n, change);
        out += &away * away.transpose();
    }
    out / modes.len() as f64
}

/// A value of a joint.
struct JointValue {
    joint: usize,
    value: f64,
}

/// One step of the adjustment from other values of a joint.
struct OneStep<'a> {
    /// On the calling thread: many steps are taken at the same time.
    adjust: Adjust<'a>,
    best: &'a Adjusted,
    /// Points that may lie on links which those joints turn, and the sums of all others.
    turning: AdjustPoints,
    resting: Normal,
}

impl<'a> OneStep<'a> {
    fn new(
        problem: &Problem<'a>,
        best: &'a Adjusted,
        several: &[&JointModes],
        points: &AdjustPoints,
    ) -> Self {
        let moved: Vec<usize> =
            several.iter().flat_map(|s| problem.prepared.carried(s.joint)).collect();
        let [mut resting, turning] = points.about(problem.settings.part()).parted(&moved);
        let resting = Adjust::new(problem).sums(&best.state(), &mut resting).0;
        let adjust = Adjust::new(&Problem { fan: &OneByOne, ..*problem });
        Self { adjust, best, turning, resting }
    }

    /// Where it ends, from the posture itself or with another value of a joint.
    fn to(&self, other: Option<JointValue>) -> Hypothesis {
        let mut state = self.best.state();
        if let Some(JointValue { joint, value }) = other {
            state.hypothesis.posture[joint] = value;
        }
        let turning = self.adjust.sums(&state, &mut self.turning.clone()).0;
        self.adjust.step(state, self.resting.clone().join(turning)).hypothesis
    }
}

/// Joints with other values that they may stand at.
fn turned(problem: &Problem<'_>, h: &Hypothesis, several: &[&JointModes]) -> Vec<JointValue> {
    let of = |s: &&JointModes| {
        let n = (s.values.len() - 1).min(MODES.coupled.n_listed);
        let listed = (0..n).map(|k| s.values[1 + k * (s.values.len() - 1) / n]);
        // Where joints before it stand otherwise, it may as well stand where here it may not.
        let around = (n < MODES.coupled.n_listed).then(|| {
            let by = |k: usize| {
                h.posture[s.joint] + TAU * k as f64 / (MODES.coupled.n_around + 1) as f64
            };
            let limits = problem.prepared.model.limits(s.joint);
            (1..=MODES.coupled.n_around).filter_map(move |k| angle::within(by(k), limits))
        });
        let joint = s.joint;
        let all = listed.chain(around.into_iter().flatten());
        all.map(|value| JointValue { joint, value }).collect::<Vec<_>>()
    };
    several.iter().flat_map(of).collect()
}
