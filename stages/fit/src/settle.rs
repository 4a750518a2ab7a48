//! A polished posture in; out come the same adjusted, with the values that the points leave to its
//! last joints, and the report of the best, its wrist bent to where the points fit best.

use contract::{Fan, Fit};

use crate::adjust::{Adjust, Adjusted};
use crate::beam::Hypothesis;
use crate::calibrate::doubt;
use crate::footprint;
use crate::judge::{Judgement, judged};
use crate::refine::Refine;
use crate::report::report;
use crate::rivals::at_rest;
use crate::sampled::Sampled;
use crate::solve::Polished;
use crate::spin::Spin;
use crate::strata::adjusted_points;
use crate::turns;
use crate::verdict;
use crate::wrist::{self, Wrist};

/// A posture adjusted, with the values that the points leave to its last joints.
pub(crate) type Settled = (Adjusted, Judgement, Vec<Spin>);

/// Adjusts a posture; where another value of its last joints fits the points better, that one.
pub(crate) fn settle(
    refine: &Refine<'_>,
    h: &Hypothesis,
    (near, all): (&[u32], &[u32]),
    fan: &dyn Fan,
) -> Settled {
    let part = if refine.scene.has_camera() { OF_CAMERAS } else { SETTLED };
    let mut points = adjusted_points(refine, h, (all, refine.settings.max_points / part), fan);
    let leaves: Vec<usize> = (0..h.posture.len()).filter(|&j| refine.prepared.leaf[j]).collect();
    let adjust = Adjust::new(refine);
    let mut best = Adjust { loose: &leaves, ..adjust }.run(h, &mut points, fan);
    let mut spins = refine.spins(&best.hypothesis, near, fan);
    // The same points of the same links; what is known of the scans stays.
    let mut state = best.state();
    let other = better(&best.hypothesis.posture, &spins);
    if let Some(posture) = &other {
        state.hypothesis.posture.clone_from(posture);
        spins.iter().for_each(|s| points.forget(&refine.prepared.carried(s.joint)));
    }
    if !leaves.is_empty() {
        best = adjust.run_from(state, &mut points, fan);
    }
    if other.is_some() {
        spins = refine.spins(&best.hypothesis, near, fan);
    }
    let judgement = judged(refine, &best.hypothesis);
    (best, judgement, spins)
}

/// A part of the points of the last adjustment is enough to choose what it is made of: one of so
/// many, where that is more than links have at least.
const SETTLED: usize = 30;
/// The same of depth cameras, whose points err alike over a hand's width: a wrist in eight views
/// was lost with fewer.
const OF_CAMERAS: usize = 15;

/// A posture with the best values of its last joints, where one of them is another mode, not the
/// same one found again.
pub(crate) fn better(posture: &[f64], spins: &[Spin]) -> Option<Vec<f64>> {
    let mut out = posture.to_vec();
    spins.iter().for_each(|s| out[s.joint] = s.values[0]);
    let is_other = |s: &Spin| turns::apart(posture[s.joint], out[s.joint]) > OTHER_MODE;
    spins.iter().any(is_other).then_some(out)
}

/// From so far apart on they are two, radians: 3°.
const OTHER_MODE: f64 = 0.052;

/// The report, with what does not fit.
pub(crate) fn finish(
    refine: &Refine<'_>,
    mut best: Settled,
    others: &[Polished],
    (near, all): (&[u32], &[u32]),
    fan: &dyn Fan,
) -> Fit {
    let mut points = sharpen(refine, &mut best, all, fan);
    let wrist = bent(refine, (&mut best, &mut points), (near, all), fan);
    let misfits = doubt(refine, (&mut best.0, &mut best.2), all, fan);
    let others = at_rest(refine, &best, others, (near, all), fan);
    let mut fit = report(refine, &best, &others, (near, &points), wrist.as_ref(), fan);
    verdict::note(&mut fit, misfits);
    fit
}

/// The answer with its wrist bent to where the points fit best, and its points; how well they fit
/// at other bends, where that is asked.
fn bent(
    refine: &Refine<'_>,
    (best, points): (&mut Settled, &mut Sampled),
    (near, all): (&[u32], &[u32]),
    fan: &dyn Fan,
) -> Option<Wrist> {
    for _ in 0..N_BENT {
        let state = best.0.state();
        let wrist = Wrist::of(refine, (&best.0, &best.2), points, fan)?;
        let Some(start) = wrist.better(&state.hypothesis) else { return Some(wrist) };
        let mut other = best.clone();
        other.0.hypothesis = start;
        let others = sharpen(refine, &mut other, all, fan);
        let end = (&other.0.hypothesis, &others);
        let gain = wrist::gain(refine, (&state, points), end, wrist.joint);
        if gain <= 0.0 {
            return Some(wrist);
        }
        other.2 = refine.spins(&other.0.hypothesis, near, fan);
        (*best, *points) = (other, others);
    }
    Wrist::of(refine, (&best.0, &best.2), points, fan)
}

/// So often at most.
const N_BENT: usize = 2;

/// The answer once more, on as many points as pay: only what is reported is worth them, not what it
/// is chosen from. Those points.
fn sharpen(
    refine: &Refine<'_>,
    (best, judgement, spins): &mut Settled,
    all: &[u32],
    fan: &dyn Fan,
) -> Sampled {
    let n = refine.settings.max_points;
    let state = best.state();
    let points = adjusted_points(refine, &best.hypothesis, (all, n), fan);
    let open: Vec<usize> = spins.iter().filter(|s| s.values.len() > 1).map(|s| s.joint).collect();
    let mut points = footprint::whole(refine, (&state, &open), points, fan);
    // An open flange need not come to rest.
    let adjust = Adjust { loose: &open, ..Adjust::new(refine) };
    *best = adjust.run_from(state.open(), &mut points, fan);
    *judgement = judged(refine, &best.hypothesis);
    points
}
