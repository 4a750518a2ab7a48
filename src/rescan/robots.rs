//! Compares a robot of the earlier result with the new scans: its present fit, or that it is gone
//! or lost.

use super::other_model::is_the_same;
use crate::detect::robots::{self, poses};
use crate::detect::search::Search;
use crate::detect::tools::attach_tools_in;
use crate::label::known_space::reach;
use contract::{Fit, Region, Result, Verdict};
use fit::MeasuredScene;
use fit::verdict::{self, VerdictEvent};
use freespace::{Visibility, VisibilityQuery};
use geometry::{Aabb, Point, Pose, Vector};
use robot::Model;

/// Number of surface points of each link that are looked up in the new scans.
const ASKED: usize = 400;
/// Least share of these that must be seen for the robot to be compared.
const MIN_JUDGED: f64 = 0.06;
/// Share of the seen points with beams through them up to which a robot may stand unchanged, though
/// too little of it is seen for a fit. Fences and edges cause up to a tenth.
const STANDS: f64 = 0.1;
/// The same share beyond which the earlier posture is contradicted.
const CONTRADICTED: f64 = 0.25;
/// The same share for the foot link, from which on the robot is gone.
const GONE: f64 = 0.6;
/// Distance of bases beyond which a fit is of another robot, metres.
const SAME_PLACE: f64 = 0.5;

/// A link that turns against its base by more than this angle, radians, does not belong to the
/// foot. A link whose rotation in the world changes by no more, and whose corners move by no more
/// than the distance below, metres, has not moved: sessions are registered within millimetres.
const FOOT_TURNS: f64 = 0.001_75;
/// Greatest motion of the corners of a link that has not moved, metres: sessions are registered
/// within millimetres.
const STAYS: f64 = 0.005;

/// Cosine of the tilt beyond which a robot does not stand on a floor.
const UPRIGHT: f64 = 0.9;

/// State of an earlier robot in the new scans.
pub(crate) enum RobotState {
    /// It was refined from its earlier posture.
    Found(Box<Fit>),
    /// It was searched and found again; and whether the new scans contradict its earlier posture.
    Anew(Box<Fit>, bool),
    /// It is gone.
    Gone,
    /// The new scans see too little of it, and do not contradict its earlier posture.
    Unseen,
    /// The new scans see too little of it for a fit, and contradict its earlier posture.
    Open,
    /// The new scans contradict its earlier posture, and show no other one.
    Lost,
}

/// Evidence about a posture: the share of all surface points that were seen, the share of those
/// with beams through them, and the latter share for the foot link.
struct PostureEvidence {
    judged: f64,
    through: f64,
    foot: f64,
}

/// Whether robots near a cell are mounted on walls or ceilings.
pub(crate) fn hang(fits: &[Fit], cell: &Aabb) -> bool {
    let about = cell.grown(SAME_PLACE);
    let here = |f: &&Fit| about.contains(f.world_from_base.translation.vector.into());
    let up = |f: &Fit| (f.world_from_base.rotation * Vector::z()).z;
    fits.iter().filter(here).any(|fit| up(fit) < UPRIGHT)
}

/// Reach of robots of a library, except those on rails, metres.
const FAR_REACH: f64 = 4.0;

/// Search and look-ups in one of two sessions.
pub(crate) struct Observed<'s, 'a, 'm> {
    /// Search in the scans of this session.
    pub(crate) search: &'s Search<'a, 'm>,
    /// Look-up in the scans of this session.
    pub(crate) watch: &'s VisibilityQuery<'s>,
    /// Look-up in the scans of the other session.
    pub(crate) other_session: &'s VisibilityQuery<'s>,
    /// Regions that were found in this session.
    pub(crate) regions: &'s [Region],
}

/// Compares one robot with the scans of this session and of the other; the model is returned where
/// it is not in the library.
pub(crate) fn compare_robot(
    before: &Fit,
    models: &[Model],
    seen: &Observed<'_, '_, '_>,
) -> Result<(RobotState, Option<Model>)> {
    let &Observed { search, watch, other_session, regions } = seen;
    let model = &models[before.model];
    let said = evidence_of(before, model, watch);
    if said.judged < MIN_JUDGED {
        return Ok((
            if said.through < STANDS { RobotState::Unseen } else { RobotState::Open },
            None,
        ));
    }
    let near = home(before, model, regions);
    // If new beams pass through much of the earlier posture, the robot has moved and is searched
    // from its base alone.
    if said.through <= CONTRADICTED
        && let Some(fit) = search.again(&near, before, model)?
    {
        // The earlier verdict supports the present fit only where all joints are determined again.
        let mut sure = fit.clone();
        verdict::apply(&mut sure, &VerdictEvent::SeenAgain(before.verdict));
        let is_same =
            !crate::result::changes::stands_otherwise(before, &sure) && knows(&fit, before);
        match fit.verdict {
            Verdict::Trusted | Verdict::Doubtful if only_foot_turns(before, &fit, model) => {
                return Ok((RobotState::Found(Box::new(before.clone())), None));
            }
            Verdict::Trusted if !is_same => return Ok((RobotState::Found(Box::new(fit)), None)),
            Verdict::Trusted | Verdict::Doubtful if is_same => {
                return Ok((RobotState::Found(Box::new(sure)), None));
            }
            _ => {}
        }
    }
    if said.through < STANDS && before.verdict != Verdict::Refused {
        return Ok((RobotState::Unseen, None));
    }
    Ok(match search_again(before, models, search, other_session, &near)? {
        Some((fit, own)) => (RobotState::Anew(Box::new(fit), said.through > CONTRADICTED), own),
        None if said.foot > GONE => (RobotState::Gone, None),
        None if said.through > CONTRADICTED => (RobotState::Lost, None),
        None => (RobotState::Open, None),
    })
}

/// Whether two postures differ only in the foot, under links that have not moved. The turn of a
/// round foot with few points trades off with the first joint; that one undoes the other is no real
/// change.
fn only_foot_turns(then: &Fit, now: &Fit, model: &Model) -> bool {
    let bounds: Vec<Aabb> = model.links.iter().map(|link| link.bounds).collect();
    let stood = |fit: &Fit| (fit.world_from_base, poses(fit, model));
    is_foot_alone([&stood(then), &stood(now)], &bounds)
}

/// The same check for bases and links (before, now) and the links' bounds.
fn is_foot_alone([then, now]: [&(Pose, Vec<Pose>); 2], bounds: &[Aabb]) -> bool {
    let own =
        |(base, links): &(Pose, Vec<Pose>), l: usize| base.rotation.inverse() * links[l].rotation;
    let turns = |l: &usize| own(then, *l).angle_to(&own(now, *l)) > FOOT_TURNS;
    let stays = |l: usize| {
        let shift = |c: [f64; 3]| (then.1[l] * Point::from(c) - now.1[l] * Point::from(c)).norm();
        // A small wrist link can turn far while its corners hardly move.
        then.1[l].rotation.angle_to(&now.1[l].rotation) <= FOOT_TURNS
            && bounds[l].corners().into_iter().all(|corner| shift(corner) <= STAYS)
    };
    let with_shape = (0..bounds.len()).filter(|l| !bounds[*l].is_empty());
    let (moved, foot): (Vec<usize>, Vec<usize>) = with_shape.partition(turns);
    !moved.is_empty() && !foot.is_empty() && moved.into_iter().all(stays)
}

/// Whether a fit determines all joints that another fit determines.
fn knows(fit: &Fit, other: &Fit) -> bool {
    let mut joints = fit.joints.iter().zip(&other.joints);
    joints.all(|(own, other)| own.is_determined() || !other.is_determined())
}

/// Searches a robot with a changed posture at its place; the model is returned where it is not in
/// the library.
fn search_again(
    before: &Fit,
    models: &[Model],
    search: &Search<'_, '_>,
    other_session: &VisibilityQuery<'_>,
    near: &Region,
) -> Result<Option<(Fit, Option<Model>)>> {
    let world_from_base = &before.world_from_base;
    let bare = models.iter().position(|m| m.name == before.model_name).unwrap_or(before.model);
    // Its arm may have left the region of its base.
    let region = reach(before, &models[before.model]);
    let base = Point::from(world_from_base.translation.vector);
    let is_here = |at: &Point| (at - base).norm() < SAME_PLACE;
    search.in_scene(&region, |scene, settings| {
        let on_base = |scene: &MeasuredScene<'_>| {
            let fit = search.on_base(scene, bare, world_from_base);
            let is_same = |f: &Fit| is_the_same(f, &models[bare], scene, other_session);
            fit.map(|fit| (is_same(&fit), fit))
        };
        let mut tried: Vec<(bool, Fit)> = on_base(scene).into_iter().collect();
        let is_clear = |tried: &[(bool, Fit)]| tried.iter().any(|(is_same, _)| *is_same);
        if !is_clear(&tried) {
            // The surroundings of its base are searched at a finer resolution.
            tried.extend(search.in_scene(&beside(near, base), |scene, _| on_base(scene))?);
        }
        let is_clear = is_clear(&tried);
        let mut found: Vec<Fit> = tried.into_iter().map(|(_, fit)| fit).collect();
        if !is_clear {
            found.extend(search.region_about(&beside(near, base), Some((base, SAME_PLACE)))?);
        }
        if found.len() > 1 {
            found = fit::choose(found, models, |_| false);
        }
        found.retain(|fit| is_here(&fit.world_from_base.translation.vector.into()));
        let with_tools = found
            .into_iter()
            .map(|fit| attach_tools_in(scene, fit, models, search.library(), settings));
        Ok(with_tools.max_by(|(a, _), (b, _)| {
            a.verdict.cmp(&b.verdict).then_with(|| a.explained.total_cmp(&b.explained))
        }))
    })?
}

/// The part of a region that a robot on a base can fill.
fn beside(region: &Region, base: Point) -> Region {
    let mut bounds = region.world_bounds();
    for i in 0..2 {
        bounds.min[i] = bounds.min[i].max(base[i] - FAR_REACH);
        bounds.max[i] = bounds.max[i].min(base[i] + FAR_REACH);
    }
    robots::region(&bounds.center(), &bounds)
}

/// The region of the new scans that contains a robot; its whole reach where none does.
fn home(fit: &Fit, model: &Model, regions: &[Region]) -> Region {
    let base = fit.world_from_base.translation.vector;
    let own = regions.iter().find(|r| r.world_bounds().grown(0.3).contains(base.into()));
    own.copied().unwrap_or_else(|| reach(fit, model))
}

fn evidence_of(fit: &Fit, model: &Model, watch: &VisibilityQuery<'_>) -> PostureEvidence {
    let (mut n, mut judged, mut through) = (0_usize, 0_usize, 0_usize);
    let mut foot = None;
    for (link, pose) in model.links.iter().zip(poses(fit, model)) {
        let step = (link.cad.points.len() / ASKED).max(1);
        let (mut own, mut gone) = (0_usize, 0_usize);
        for p in link.cad.points.iter().step_by(step) {
            n += 1;
            let sight = watch.look((pose * Point::from(p.map(f64::from))).into());
            own += usize::from(sight >= Visibility::Through);
            gone += usize::from(sight == Visibility::Through);
        }
        (judged, through) = (judged + own, through + gone);
        if own > 0 && foot.is_none() {
            foot = Some(gone as f64 / own as f64);
        }
    }
    PostureEvidence {
        judged: judged as f64 / n.max(1) as f64,
        through: through as f64 / judged.max(1) as f64,
        foot: foot.unwrap_or(0.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_foot_that_turns_under_an_arm_that_stays_is_no_change() {
        let up = |angle: f64, z: f64| Pose::new([0.0, 0.0, z].into(), [0.0, 0.0, angle].into());
        let stood = |yaw: f64, joint: f64| {
            let base = Pose::new([3.0, 1.0, 0.0].into(), [0.0, 0.0, yaw].into());
            (base, vec![base, base * up(joint, 0.4)])
        };
        let foot = Aabb { min: [-0.2, -0.2, 0.0], max: [0.2, 0.2, 0.4] };
        let arm = Aabb { min: [-0.2, -0.2, 0.0], max: [1.2, 0.2, 0.6] };
        let is_alone = |yaw: f64, joint: f64| {
            is_foot_alone([&stood(0.3, 0.5), &stood(0.3 + yaw, 0.5 + joint)], &[foot, arm])
        };
        assert!(is_alone(-0.061, 0.062));
        // Either the arm has moved, with its foot or alone, or nothing turns.
        assert!(!is_alone(-0.061, 0.075) && !is_alone(0.0, 0.062) && !is_alone(-0.061, 0.0));
        assert!(!is_alone(0.0, 0.0));
        // A flange that turns by 3° has moved, though its corners move by only 2 mm.
        let flange = Aabb { min: [-0.03, -0.03, 0.0], max: [0.03, 0.03, 0.02] };
        assert!(!is_foot_alone([&stood(0.3, 0.5), &stood(0.3, 0.552)], &[foot, flange]));
    }
}
