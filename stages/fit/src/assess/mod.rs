//! Last phase: states how well everything is known, and judges the fit. The report has values with
//! their standard deviations, which joints are open, rivals, postures that explain the points as
//! well, and the verdict.

mod covariance;
mod estimate;
mod joints;
mod rival;

use contract::{Certainty, Fit, JointFit, RunnerUp};
use robot::Model;

pub(crate) use covariance::tip_sigma;
pub use estimate::{PostureEstimate, report_estimate};

use crate::adjust::Adjusted;
use crate::modes::{
    JointModes, MODES, PostureModes, camera_spread, lead, reach_of_others, with_foot,
};
use crate::problem::{Judgement, Problem, link_evidence};
use crate::verdict::{self, JudgedFit, RIVAL, VerdictEvent};
use covariance::{in_world_axes, scans, share, sigma_of, widen};
use joints::{OpenJoints, differs, equals, joints};
use rival::Rival;

/// The fit that is reported of a posture and all that explains the points about as well.
pub(crate) fn report(problem: &Problem<'_>, answer: &PostureModes) -> Fit {
    let prepared = problem.prepared;
    let model = prepared.model;
    let (best, judgement) = (&answer.best.adjusted, &answer.best.judgement);
    let h = &best.hypothesis;
    let n = 6 + h.posture.len();
    let rivals = ranked(problem, answer);
    // With the base's twist in its own axes.
    let mut in_base = with_foot(problem, h, best.covariance.clone());
    let mut open = OpenJoints::of(problem, &in_base, h, &rivals);
    let several: Vec<&JointModes> = answer.best.leaves.iter().filter(|s| s.is_several()).collect();
    widen(problem, answer, &several, &mut in_base);
    open.add_leaves(h, &answer.best.leaves);
    let held: Vec<f64> = (0..n - 6).map(|j| sigma_of(&in_base, 6 + j)).collect();
    if problem.scene.has_camera() {
        let near_equal = rivals.iter().filter(|rival| rival.margin < RIVAL);
        let near_equal = near_equal.map(|rival| &rival.other.hypothesis);
        in_base += camera_spread(problem, best, &answer.points);
        reach_of_others(h, near_equal, &mut open.spread);
    }
    let covariance = in_world_axes(&in_base, &h.local_from_base);
    // Where a joint may stand elsewhere, so may the tip.
    for (j, spread) in open.spread.iter().enumerate() {
        in_base[(6 + j, 6 + j)] = in_base[(6 + j, 6 + j)].max(spread * spread);
    }
    // A flange that may stand otherwise is listed; the robot is not doubted for it.
    let passed = |j: usize| (open.is_open[j] || prepared.leaf[j]) && !prepared.slides(j);
    let passed: Vec<bool> = (0..open.is_open.len()).map(passed).collect();
    let other_answer = rivals.iter().find(|rival| differs(&rival.other.hypothesis, h, &passed));
    let mut fit = Fit {
        model: prepared.index,
        model_name: model.name.clone(),
        world_from_base: problem.scene.world_from_local() * h.local_from_base,
        base_sigma: open.base_sigma(std::array::from_fn(|i| sigma_of(&covariance, i))),
        joints: joints(problem, h, &covariance, &open, &rivals),
        covariance: (0..n * n).map(|i| covariance[(i / n, i % n)]).collect(),
        score: judgement.score,
        explained: judgement.explained,
        rms: best.rms(),
        surface_sigma: best.patch_sigma,
        tip_sigma: tip_sigma(model, &h.posture, &in_base),
        scans: scans(problem, best),
        share: share(problem, best),
        links: link_evidence(prepared, judgement, &best.n_points, &best.link_rms),
        runner_up: other_answer.map(|rival| runner_up(model, judgement, rival)),
        equals: equals(problem, h, &rivals, &passed, &several),
        ..Fit::default()
    };
    let scene = problem.scene;
    verdict::decide(&mut fit, &JudgedFit { prepared, scene, judgement, held: Some(&held) });
    fit
}

/// The others, the one that the best is least better than first.
fn ranked<'o>(problem: &Problem<'_>, answer: &'o PostureModes) -> Vec<Rival<'o>> {
    let (best, judgement) = (&answer.best.adjusted.hypothesis, &answer.best.judgement);
    let mut rivals: Vec<Rival<'o>> = problem.fan.fan(answer.others.iter().collect(), |other| {
        let [by_beams, by_points] = lead(problem, best, judgement, other);
        // What either of them has against the best counts against it, more than what the other has
        // for it.
        let against = MODES.rival.against * by_beams.min(by_points).min(0.0);
        Rival { margin: by_beams.max(by_points) + against, other }
    });
    rivals.sort_by(|a, b| a.margin.total_cmp(&b.margin));
    rivals
}

/// What is said of a posture that is refused before it is worth a report: where it stood, and how
/// much it explained.
pub(crate) fn refused(problem: &Problem<'_>, best: &Adjusted, judgement: &Judgement) -> Fit {
    let (model, h) = (problem.prepared.model, &best.hypothesis);
    let joint = |(free, value): (&usize, &f64)| JointFit {
        name: model.joints[*free].name.clone(),
        value: *value,
        sigma: MODES.any_angle,
        certainty: Certainty::Undetermined,
        equivalents: Vec::new(),
    };
    let mut fit = Fit {
        model: problem.prepared.index,
        model_name: model.name.clone(),
        world_from_base: problem.scene.world_from_local() * h.local_from_base,
        joints: model.free.iter().zip(&h.posture).map(joint).collect(),
        score: judgement.score,
        explained: judgement.explained,
        rms: best.rms(),
        ..Fit::default()
    };
    verdict::apply(&mut fit, &VerdictEvent::Lost);
    fit
}

fn runner_up(model: &Model, best: &Judgement, rival: &Rival<'_>) -> RunnerUp {
    RunnerUp {
        model: model.name.clone(),
        score: rival.other.judgement.explained / best.explained * best.score,
        same_model: true,
        margin: rival.margin,
    }
}
