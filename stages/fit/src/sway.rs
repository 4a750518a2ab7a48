//! An adjusted posture, and joints that may stand at several values, in; how far the joints before them give way, out.

use contract::{Fan, OneByOne};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;

use crate::adjust::{Adjust, Adjusted};
use crate::beam::Hypothesis;
use crate::normal::Normal;
use crate::pairs::Known;
use crate::refine::Refine;
use crate::report::{EQUAL, OTHER, turn};
use crate::spin::Spin;
use crate::turns;

/// Other values of a joint at which the joints before it are asked how far they give way …
const N_SWAYS: usize = 8;
/// … and values all around, where those are fewer.
const N_AROUND: usize = 5;

/// Covariance of the joints that comes from those that may stand at several values, radians² or metres²: a flange's
/// bolts pull at the wrist, and which way they pull is as open as the flange. Each value is as likely as the others.
/// `points` and their gate are those of the adjustment.
pub(crate) fn sway(
    refine: &Refine<'_>,
    best: &Adjusted,
    several: &[&Spin],
    (near, (points, gate)): (&[u32], (&[u32], f64)),
    fan: &impl Fan,
) -> DMatrix<f64> {
    let h = &best.hypothesis;
    let n = h.posture.len();
    let mut out = DMatrix::zeros(n, n);
    if several.is_empty() {
        return out;
    }
    let every = points.len().div_ceil(refine.settings.max_points).max(1);
    let points: Vec<u32> = points.iter().copied().step_by(every).collect();
    let steps = Steps::new(refine, best, several, (&points, gate), fan);
    // The same step from where it stands: fewer points end a little beside all of them.
    let own = steps.to(None);
    let ends = fan.fan(turned(refine, h, several), |at| steps.to(Some(at)));
    // Where it ended at something worse, it is no value that the joint may stand at.
    let as_good = |end: &&Hypothesis| refine.worsening(&own, end, near) < EQUAL;
    let is_swayed: Vec<bool> = (0..n).map(|j| several.iter().all(|s| s.joint != j)).collect();
    let mut modes: Vec<&Hypothesis> = vec![&own];
    for end in ends.iter().filter(as_good) {
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
    gate: f64,
    /// Points that may lie on links which those joints turn, and the sums of all others.
    turning: Vec<u32>,
    resting: Normal,
}

impl<'a> Steps<'a> {
    fn new(
        refine: &'a Refine<'a>,
        best: &'a Adjusted,
        several: &[&Spin],
        (points, gate): (&[u32], f64),
        fan: &impl Fan,
    ) -> Self {
        let adjust = Adjust { refine, frames: &[] };
        let state = best.state();
        let mut known = vec![None; points.len()];
        adjust.sums(&state, (points, &mut known), gate, fan);
        let moved: Vec<usize> =
            several.iter().flat_map(|s| refine.prepared.carried(s.joint)).collect();
        let rests = |k: &Option<Known>| k.is_some_and(|k| !moved.contains(&k.link()));
        let pairs = points.iter().copied().zip(known);
        let (resting, turning): (Vec<_>, Vec<_>) = pairs.partition(|(_, k)| rests(k));
        let (points, mut known): (Vec<u32>, Vec<_>) = resting.into_iter().unzip();
        let resting = adjust.sums(&state, (&points, &mut known), gate, fan).0;
        let turning = turning.into_iter().map(|(point, _)| point).collect();
        Self { adjust, best, gate, turning, resting }
    }

    /// Where it ends, from the posture itself or with another value of a joint.
    fn to(&self, other: Option<(usize, f64)>) -> Hypothesis {
        let mut state = self.best.state();
        if let Some((joint, value)) = other {
            state.hypothesis.posture[joint] = value;
        }
        let mut known = vec![None; self.turning.len()];
        let turning = self.adjust.sums(&state, (&self.turning, &mut known), self.gate, &OneByOne).0;
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
