//! An adjusted posture, and joints that may stand at several values, in; how far the joints before
//! them give way, out.

use contract::{Fan, OneByOne};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;

use crate::adjust::{Adjust, Adjusted};
use crate::beam::Hypothesis;
use crate::normal::Normal;
use crate::refine::Refine;
use crate::report::{EQUAL, OTHER, turn};
use crate::sampled::Sampled;
use crate::spin::Spin;
use crate::turns;

/// Other values of a joint at which the joints before it are asked how far they give way …
const N_SWAYS: usize = 8;
/// … and values all around, where those are fewer.
const N_AROUND: usize = 5;

/// Covariance of the joints that comes from those that may stand at several values, radians² or
/// metres²: a flange's bolts pull at the wrist, and which way they pull is as open as the flange.
/// Each value is as likely as the others. `points` are those of the adjustment, as it ended.
pub(crate) fn sway(
    refine: &Refine<'_>,
    best: &Adjusted,
    several: &[&Spin],
    (near, points): (&[u32], &Sampled),
    fan: &dyn Fan,
) -> DMatrix<f64> {
    let h = &best.hypothesis;
    let n = h.posture.len();
    let mut out = DMatrix::zeros(n, n);
    if several.is_empty() {
        return out;
    }
    let steps = Steps::new(refine, best, several, points, fan);
    // The same step from where it stands: fewer points end a little beside all of them.
    let own = steps.to(None);
    let ends = fan.fan(turned(refine, h, several), |at| {
        let end = steps.to(Some(at));
        // Where it ended at something worse, it is no value that the joint may stand at.
        (refine.worsening(&own, &end, near) < EQUAL).then_some(end)
    });
    let is_swayed: Vec<bool> = (0..n).map(|j| several.iter().all(|s| s.joint != j)).collect();
    let mut modes: Vec<&Hypothesis> = vec![&own];
    for end in ends.iter().flatten() {
        if modes.iter().any(|mode| several.iter().all(|s| turn(mode, end, s.joint) < OTHER)) {
            continue;
        }
        modes.push(end);
        let change = |j: usize, _| match is_swayed[j] {
            true => turns::from_to(own.posture[j], end.posture[j]),
            false => 0.0,
        };
        let away = DVector::from_fn(n, change);
        out += &away * away.transpose();
    }
    out / modes.len() as f64
}

/// One step of the adjustment from other values of a joint.
struct Steps<'a> {
    adjust: Adjust<'a>,
    best: &'a Adjusted,
    /// Points that may lie on links which those joints turn, and the sums of all others.
    turning: Sampled,
    resting: Normal,
}

impl<'a> Steps<'a> {
    fn new(
        refine: &'a Refine<'a>,
        best: &'a Adjusted,
        several: &[&Spin],
        points: &Sampled,
        fan: &dyn Fan,
    ) -> Self {
        let adjust = Adjust::new(refine);
        let moved: Vec<usize> =
            several.iter().flat_map(|s| refine.prepared.carried(s.joint)).collect();
        let [mut resting, turning] = points.about(refine.settings.part()).parted(&moved);
        let resting = adjust.sums(&best.state(), &mut resting, fan).0;
        Self { adjust, best, turning, resting }
    }

    /// Where it ends, from the posture itself or with another value of a joint.
    fn to(&self, other: Option<(usize, f64)>) -> Hypothesis {
        let mut state = self.best.state();
        if let Some((joint, value)) = other {
            state.hypothesis.posture[joint] = value;
        }
        let turning = self.adjust.sums(&state, &mut self.turning.clone(), &OneByOne).0;
        self.adjust.step(state, self.resting.clone().join(turning)).hypothesis
    }
}

/// Joints with other values that they may stand at.
fn turned(refine: &Refine<'_>, h: &Hypothesis, several: &[&Spin]) -> Vec<(usize, f64)> {
    let of = |s: &&Spin| {
        let n = (s.values.len() - 1).min(N_SWAYS);
        let listed = (0..n).map(|k| s.values[1 + k * (s.values.len() - 1) / n]);
        // Where joints before it stand otherwise, it may as well stand where here it may not.
        let around = (n < N_SWAYS).then(|| {
            let by = |k: usize| h.posture[s.joint] + TAU * k as f64 / (N_AROUND + 1) as f64;
            let limits = refine.prepared.model.limits(s.joint);
            (1..=N_AROUND).filter_map(move |k| turns::within(by(k), limits))
        });
        let joint = s.joint;
        let all = listed.chain(around.into_iter().flatten());
        all.map(|value| (joint, value)).collect::<Vec<_>>()
    };
    several.iter().flat_map(of).collect()
}
