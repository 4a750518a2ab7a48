//! The report of a posture that another method found: judged by the beams, and not adjusted.

use contract::{Fit, JointFit};
use geometry::Pose;

use crate::problem::{judge, link_evidence};
use crate::state::Hypothesis;
use crate::{MeasuredScene, Prepared, Settings};

/// A posture that another method found.
#[derive(Debug, Clone)]
pub struct PostureEstimate {
    /// Base of the robot in the local frame of the region, metres.
    pub local_from_base: Pose,
    /// A value for each free joint, radians or metres.
    pub posture: Vec<f64>,
    /// How far a sample of the surface may be from what a beam met and still count as explained,
    /// metres.
    pub tolerance: f64,
}

/// The fit of an estimate with what the beams say of it; `None` where they say too little for it,
/// or too much against it, for a report ([`Settings::min_score`], [`Settings::max_violation`]).
///
/// Uncertainties and verdict are left to the caller: no covariance is known.
#[must_use]
pub fn report_estimate(
    prepared: &Prepared<'_>,
    scene: &MeasuredScene<'_>,
    settings: &Settings,
    estimate: &PostureEstimate,
) -> Option<Fit> {
    let model = prepared.model;
    let h = Hypothesis::at(estimate.local_from_base, estimate.posture.clone());
    let judgement = judge(prepared, scene, settings, &h, estimate.tolerance);
    if judgement.score < settings.min_score || judgement.violation > settings.max_violation {
        return None;
    }
    let joint = |(free, value): (&usize, &f64)| JointFit {
        name: model.joints[*free].name.clone(),
        value: *value,
        ..JointFit::default()
    };
    let (no_points, no_rms) = (vec![0; model.links.len()], vec![0.0; model.links.len()]);
    Some(Fit {
        model: prepared.index,
        model_name: model.name.clone(),
        world_from_base: scene.world_from_local() * h.local_from_base,
        joints: model.free.iter().zip(&h.posture).map(joint).collect(),
        score: judgement.score,
        explained: judgement.explained,
        links: link_evidence(prepared, &judgement, &no_points, &no_rms),
        ..Fit::default()
    })
}
