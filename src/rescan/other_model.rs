//! Decides whether another model may stand on the base of an earlier robot, from the fit of the
//! earlier model and both sessions. Only then all models are searched.

use crate::detect::robots::poses;
use contract::{Fit, Verdict};
use fit::MeasuredScene;
use freespace::{Visibility, VisibilityQuery};
use geometry::{Aabb, Point, Pose, Vector};
use robot::Model;

/// Distance from a base within which new points may be cables or a plinth, metres.
const ABOUT_FOOT: f64 = 0.3;
/// Distance from the boxes of its links up to which points belong to the robot (hoses, covers),
/// metres.
const OWN: f64 = 0.08;
/// Largest share of new points within its reach that need not belong to the robot, such as a tool
/// or a box. For robots that only moved, in halls with other changes around them, it was up to a
/// half.
const MAX_STRANGE: f64 = 0.5;
/// Number of points that are examined.
const ASKED: usize = 4000;

/// Whether neither beams nor new points contradict a fit on an earlier base. If such a fit is
/// doubtful, too little was seen, and of another model as little would be.
pub(crate) fn is_the_same(
    fit: &Fit,
    model: &Model,
    scene: &MeasuredScene<'_>,
    other_session: &VisibilityQuery<'_>,
) -> bool {
    fit.verdict == Verdict::Trusted
        || fit::verdict::is_uncontradicted(fit, scene)
            && strange(fit, model, scene, other_session) <= MAX_STRANGE
}

/// Share of the points within a robot's reach, where the other session saw free space, that do not
/// belong to the robot.
fn strange(
    fit: &Fit,
    model: &Model,
    scene: &MeasuredScene<'_>,
    other_session: &VisibilityQuery<'_>,
) -> f64 {
    let base = Point::from(fit.world_from_base.translation.vector);
    let links: Vec<(Pose, Aabb)> = model
        .links
        .iter()
        .zip(poses(fit, model))
        .filter(|(link, _)| !link.bounds.is_empty())
        .map(|(link, pose)| (pose.inverse(), link.bounds.grown(OWN)))
        .collect();
    let is_own = |at: &Point| links.iter().any(|(link, own)| own.contains((link * at).into()));
    let up = fit.world_from_base.rotation * Vector::z();
    let is_foot = |at: &Point| (at - base).dot(&up) < ABOUT_FOOT;
    let near = scene.places(&base, model.reach());
    let step = near.len().div_ceil(ASKED).max(1);
    let (mut n, mut n_strange) = (0_usize, 0_usize);
    for at in near.iter().step_by(step).filter(|at| !is_foot(at)) {
        if other_session.look((*at).into()) == Visibility::Through {
            n += 1;
            n_strange += usize::from(!is_own(at));
        }
    }
    n_strange as f64 / n.max(1) as f64
}
