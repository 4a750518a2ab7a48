//! Estimates where a robot's joints are on its links, as far as the points of its fit tell, and
//! fits the robot with its joints there (METHOD.md §17).

mod combine;
mod places;

use contract::{Calibration, Fan, Fit, Verdict};
use geometry::Point;
use robot::Model;

pub use combine::combine;
pub(crate) use places::doubt_places;

use crate::adjust::Adjust;
use crate::assess::report;
use crate::correspond::adjusted_points;
use crate::modes::{PostureModes, Settled, WristModes, better_leaves, leaf_modes};
use crate::problem::{Problem, judged};
use crate::state::Hypothesis;
use crate::verdict::{self, JudgedFit, VerdictEvent};
use crate::{MeasuredScene, Prepared, Settings};
use places::{OwnModel, estimate, open_beside, words};

/// The robot's own model and its fit.
#[must_use]
pub fn calibrate(
    fit: &Fit,
    prepared: &Prepared<'_>,
    scene: &MeasuredScene<'_>,
    settings: &Settings,
    fan: &dyn Fan,
) -> (Model, Fit) {
    let h = scene.hypothesis(&fit.world_from_base, fit.joints.iter().map(|j| j.value).collect());
    let nearby = scene.nearby(prepared, &Point::from(h.local_from_base.translation.vector));
    let nominal = Problem::new(prepared, scene, settings, fan).with_points(&nearby);
    let leaves_of = |model: &Model, h: &Hypothesis| {
        leaf_modes(&Problem { prepared: &prepared.moved(model), ..nominal }, h)
    };
    let mut found = estimate(&nominal, &h, 1);
    let mut leaves = leaves_of(&found.model, &found.adjusted.hypothesis);
    // On joints that are where they are the flange may fit at another turn than on the model's.
    if let Some(posture) = better_leaves(&found.adjusted.hypothesis.posture, &leaves) {
        let h = Hypothesis { posture, ..found.adjusted.hypothesis };
        found = estimate(&nominal, &h, 1);
        leaves = leaves_of(&found.model, &found.adjusted.hypothesis);
    }
    let OwnModel { model, adjusted, frames } = found;
    open_beside(&nominal, &frames, &mut leaves);
    let own = prepared.moved(&model);
    let problem = Problem { prepared: &own, ..nominal };
    let judgement = judged(&problem, &adjusted.hypothesis);
    let mut points = adjusted_points(&problem, &adjusted.hypothesis, settings.part());
    Adjust::new(&problem).sums(&adjusted.state(), &mut points);
    let wrist = WristModes::of(&problem, &adjusted, &leaves, &points);
    let best = Settled { adjusted, judgement, leaves };
    let mut out = report(&problem, &PostureModes { best, points, wrist, others: Vec::new() });
    let as_known = as_known(&nominal, fit, &h, &out);
    verdict::apply(&mut out, &VerdictEvent::Calibrated(as_known));
    let link_rms = fit.links.iter().zip(&out.links).map(|(b, a)| [b.rms, a.rms]).collect();
    keep(&mut out, fit, Calibration { frames, prior: settings.frame_sigma, link_rms });
    (model, out)
}

/// The verdict on the nominal fit, had its joints been known as well as the calibrated ones are:
/// that they are elsewhere is what it did not know.
fn as_known(nominal: &Problem<'_>, fit: &Fit, h: &Hypothesis, calibrated: &Fit) -> Verdict {
    let judgement = judged(nominal, h);
    let (prepared, scene) = (nominal.prepared, nominal.scene);
    let judged = JudgedFit { prepared, scene, judgement: &judgement, held: None };
    // Others than the points may have made it doubtful.
    if fit.verdict < verdict::by_rules(fit, &judged) {
        return fit.verdict;
    }
    let (joints, covariance) = (calibrated.joints.clone(), calibrated.covariance.clone());
    verdict::by_rules(&Fit { joints, covariance, ..fit.clone() }, &judged)
}

/// What the nominal fit knows and the calibrated one keeps; and what the calibration found, in
/// words.
fn keep(out: &mut Fit, fit: &Fit, found: Calibration) {
    out.runner_up.clone_from(&fit.runner_up);
    out.equals.clone_from(&fit.equals);
    out.alike.clone_from(&fit.alike);
    out.tool.clone_from(&fit.tool);
    out.other_branches.clone_from(&fit.other_branches);
    verdict::note(out, words(&found.frames));
    out.calibration = Some(found);
}
