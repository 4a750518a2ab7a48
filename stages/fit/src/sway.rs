//! An adjusted posture, and joints that may stand at several values, in; how far the joints before them give way, out.

use contract::{Fan, OneByOne};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;

use crate::adjust::{Adjust, Adjusted, State};
use crate::beam::Hypothesis;
use crate::refine::Refine;
use crate::report::{EQUAL, OTHER, turn};
use crate::solve::adjusted_points;
use crate::spin::Spin;
use crate::turns;

/// Other values of a joint at which the joints before it are asked how far they give way …
const N_SWAYS: usize = 8;
/// … and values all around, where those are fewer.
const N_AROUND: usize = 5;

/// Covariance of the joints that comes from those that may stand at several values, radians² or metres²: a flange's
/// bolts pull at the wrist, and which way they pull is as open as the flange. Each value is as likely as the others.
pub(crate) fn sway(
    refine: &Refine<'_>,
    best: &Adjusted,
    several: &[&Spin],
    (near, all): (&[u32], &[u32]),
    fan: &impl Fan,
) -> DMatrix<f64> {
    let h = &best.hypothesis;
    let n = h.posture.len();
    let mut out = DMatrix::zeros(n, n);
    if several.is_empty() {
        return out;
    }
    let (points, gate) = adjusted_points(refine, h, all, fan);
    let adjust = Adjust { refine, frames: &[] };
    let mut known = vec![None; points.len()];
    // The same step from where it stands: fewer points end a little beside all of them.
    let own = adjust.step(best.state(), (&points, &mut known), gate, fan);
    let ends = fan.fan(turned(refine, h, several), |(joint, value)| {
        let moved = &refine.prepared.placed_by[joint..];
        let stays = |link: usize| moved.iter().all(|links| !links.contains(&link));
        let mut known: Vec<_> = known.iter().map(|k| k.filter(|k| stays(k.link()))).collect();
        let mut state = best.state();
        state.hypothesis.posture[joint] = value;
        adjust.step(state, (&points, &mut known), gate, &OneByOne)
    });
    // Where it ended at something worse, it is no value that the joint may stand at.
    let as_good = |end: &&State| refine.worsening(&own.hypothesis, &end.hypothesis, near) < EQUAL;
    let is_swayed: Vec<bool> = (0..n).map(|j| several.iter().all(|s| s.joint != j)).collect();
    let mut modes: Vec<&Hypothesis> = vec![&own.hypothesis];
    for State { hypothesis: end, .. } in ends.iter().filter(as_good) {
        if modes.iter().any(|mode| several.iter().all(|s| turn(mode, end, s.joint) < OTHER)) {
            continue;
        }
        modes.push(end);
        let change = |j: usize, _| match is_swayed[j] {
            true => turns::from_to(own.hypothesis.posture[j], end.posture[j]),
            false => 0.0,
        };
        let away = DVector::from_fn(n, change);
        out += &away * away.transpose();
    }
    out / modes.len() as f64
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
