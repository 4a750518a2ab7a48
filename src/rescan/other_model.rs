//! A robot's fit on the base that it had, and what both sessions saw about it, in; whether another
//! model may stand there instead, out: a search of all models is only worth it then.

use crate::label::known_space::poses;
use contract::{Fit, Verdict};
use fit::MeasuredScene;
use freespace::{Visibility, VisibilityQuery};
use geometry::{Aabb, Point, Pose, Vector};
use robot::Model;

/// What stands so near a base was there before, or is its own: cables, plinth, metres.
const ABOUT_FOOT: f64 = 0.3;
/// How far beyond the boxes of its links points are a robot's own: hoses, covers, metres.
const OWN: f64 = 0.08;
/// Share of what is new within its reach that need not be its own: a tool, a box that was put
/// there. Of robots that only moved, in halls with other things moved about them, it was up to a
/// half.
const MAX_STRANGE: f64 = 0.5;
/// Points that are looked at.
const ASKED: usize = 4000;

/// Whether nothing speaks against a fit on an old base: neither the beams nor what is new there. If
/// it is doubtful, then because too little of it was seen, and of another model as little would be.
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

/// Share of what stands within a robot's reach, where the other session saw that nothing did, that
/// is not its own.
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
