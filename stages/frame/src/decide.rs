//! Judged poses in; the one that is clear, or what keeps each from being so, out.

use crate::judge::{Judged, PoseEvidence, judge};
use crate::refine::{Chosen, Laid, NEAR, WIDE, apart};
use crate::{SessionSurfaces, search};
use contract::Fan;
use geometry::{Pose, Vector};

/// Fewest surfels of surfaces that are not level that lie on the other session's: 6 m², and 2.4 m²
/// where files state the pose.
const MIN_SAME: usize = 150;
const MIN_SAME_STATED: usize = 60;
/// Surfels of upright surfaces that hold a pose in each direction of the plan, at least: 1.2 m².
const MIN_HOLD: f64 = 30.0;
/// Least share of what can be compared that lies on the other session's surfaces: of the stated
/// pose, and of one that was searched.
const MIN_SHARE_STATED: f64 = 0.7;
const MIN_SHARE: f64 = 0.75;
/// The same of the stated pose where no other place fits as well: much in the cell has changed.
const MIN_SHARE_CHANGED: f64 = 0.4;
/// A pose this near to the stated one is the stated one: metres, radians. The registration of each
/// scan takes it back.
const STATED: (f64, f64) = (0.03, 0.0035);
/// The stated pose is looked for within this, metres, radians: 0.6°.
const STATED_ABOUT: (f64, f64) = (0.15, 0.01);
/// Poses that differ by more are of different places: metres, radians (1°).
const PLACE: (f64, f64) = (0.3, 0.0175);
/// Another place is asked for where at least this share of what lies on old surfaces under the best
/// pose does so under it.
const SERIOUS: f64 = 0.5;
/// So many surfels more must speak against another place than against the best one: 8 m² of both
/// sessions together, more than one thing that was moved from where its like stood (a loaded pallet
/// has up to 3 m² in each session).
const MIN_MARGIN: i64 = 200;
/// The same as a share of what lies on old surfaces under the best pose.
const MARGIN_SHARE: f64 = 0.02;
/// Places that are told to a person, at most.
const MAX_TOLD: usize = 4;

/// A pose of the new session in the earlier one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FramePlace {
    /// The pose, each session about its own origin, and how well it is determined.
    pub laid: Laid,
    /// What speaks for and against it.
    pub evidence: PoseEvidence,
    /// By how many surfels more the next best other place is contradicted; `None` where there is
    /// no other.
    pub margin: Option<i64>,
}

/// What is said of the stated pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Answer {
    /// It holds.
    Holds(FramePlace),
    /// It nearly holds: so far off, clearly.
    Near(FramePlace),
    /// It is contradicted, or too little speaks for it.
    Not(Option<FramePlace>),
}

/// Why no pose is taken.
#[derive(Debug, Clone, PartialEq)]
pub enum Refusal {
    /// Nothing of the new session lies well on the earlier one; the best of what was tried.
    Nothing(Option<Box<FramePlace>>),
    /// Several places fit, the best first: what tells them apart is less than what may have been
    /// moved.
    Several(Vec<FramePlace>),
}

/// Whether new scans lie where they are stated to, `stated` being the earlier session's world from
/// theirs.
#[must_use]
pub fn at_stated(old: &SessionSurfaces, new: &SessionSurfaces, stated: &Pose) -> Answer {
    let chosen = Chosen::of(&new.surfels);
    let Some(laid) = chosen.lay(&old.surfels, stated, &NEAR) else { return Answer::Not(None) };
    let place = plain(&judge(old, new, laid));
    let off = apart(&laid.old_from_new, stated, &middle(new));
    let is_within = |most: (f64, f64)| off.0 <= most.0 && off.1 <= most.1;
    if !is_borne_out(&place) || !is_within(STATED_ABOUT) {
        return Answer::Not(Some(place));
    }
    // A few centimetres are believed only where surfaces hold the pose in all directions.
    if is_within(STATED) || place.laid.hold < MIN_HOLD {
        Answer::Holds(place)
    } else {
        Answer::Near(place)
    }
}

/// The pose near a rough one that a person gives, and whether surfaces and beams bear it out.
///
/// # Errors
/// The pose as far as it could be refined, where they do not.
pub fn from_rough(
    old: &SessionSurfaces,
    new: &SessionSurfaces,
    rough: &Pose,
) -> Result<FramePlace, Option<Box<FramePlace>>> {
    let laid = Chosen::of(&new.surfels).lay(&old.surfels, rough, &WIDE).ok_or(None)?;
    let place = plain(&judge(old, new, laid));
    if is_borne_out(&place) { Ok(place) } else { Err(Some(Box::new(place))) }
}

/// Where the new session lies in the earlier one, searched over all shifts and yaws; `stated` is
/// one of the poses that are asked for.
///
/// # Errors
/// No pose is clear.
pub fn find(
    old: &SessionSurfaces,
    new: &SessionSurfaces,
    stated: &Pose,
    fan: &dyn Fan,
) -> Result<FramePlace, Refusal> {
    let chosen = Chosen::of(&new.surfels);
    let mut poses = search::poses(&old.surfels, &new.surfels, fan);
    poses.push(*stated);
    let laid = fan.fan(poses, |pose| chosen.lay(&old.surfels, &pose, &WIDE));
    let mut apart_ones: Vec<Laid> = Vec::new();
    let at = middle(new);
    for laid in laid.into_iter().flatten() {
        let is_known = |other: &Laid| {
            let (shift, turn) = apart(&laid.old_from_new, &other.old_from_new, &at);
            shift < 0.1 * PLACE.0 && turn < 0.1 * PLACE.1
        };
        if !apart_ones.iter().any(is_known) {
            apart_ones.push(laid);
        }
    }
    // Of a pose that lays little on the earlier session, no more is kept.
    let judged = fan.fan(apart_ones, |laid| {
        let judged = judge(old, new, laid);
        (judged.evidence.n_same() >= MIN_SAME_STATED).then_some(judged)
    });
    let mut judged: Vec<Judged> = judged.into_iter().flatten().collect();
    judged.sort_by_key(|j| std::cmp::Reverse(j.evidence.score()));
    clear(&places(judged, &at), stated, &at)
}

/// Whether a pose is the stated one, as near as the registration of each scan can tell.
#[must_use]
pub fn is_stated(place: &FramePlace, stated: &Pose, new: &SessionSurfaces) -> bool {
    let off = apart(&place.laid.old_from_new, stated, &middle(new));
    off.0 <= STATED.0 && off.1 <= STATED.1
}

/// The best of each place.
fn places(judged: Vec<Judged>, at: &Vector) -> Vec<Judged> {
    let mut out: Vec<Judged> = Vec::new();
    for one in judged {
        let is_here = |other: &Judged| {
            let (shift, turn) = apart(&one.laid.old_from_new, &other.laid.old_from_new, at);
            shift < PLACE.0 && turn < PLACE.1
        };
        if !out.iter().any(is_here) {
            out.push(one);
        }
    }
    out
}

/// The first of some places, if it is clear.
fn clear(places: &[Judged], stated: &Pose, at: &Vector) -> Result<FramePlace, Refusal> {
    let Some((best, others)) = places.split_first() else { return Err(Refusal::Nothing(None)) };
    let mut place = plain(best);
    let off = apart(&place.laid.old_from_new, stated, at);
    let is_stated = off.0 <= STATED_ABOUT.0 && off.1 <= STATED_ABOUT.1;
    if !is_good(&place, if is_stated { MIN_SHARE_CHANGED } else { MIN_SHARE }) {
        return Err(Refusal::Nothing(Some(Box::new(place))));
    }
    let n_same = best.evidence.n_same() as f64;
    let serious: Vec<&Judged> =
        others.iter().filter(|o| o.evidence.n_same() as f64 >= SERIOUS * n_same).collect();
    let margin = |other: &&Judged| best.margin_over(other);
    place.margin = serious.iter().map(margin).min();
    // That the files state it speaks for a pose as much as what stands there.
    let least = if is_stated { 0 } else { MIN_MARGIN.max((MARGIN_SHARE * n_same) as i64) };
    let rivals: Vec<FramePlace> =
        serious.iter().filter(|o| margin(o) < least).map(|o| plain(o)).take(MAX_TOLD - 1).collect();
    if rivals.is_empty() {
        return Ok(place);
    }
    Err(Refusal::Several([vec![place], rivals].concat()))
}

fn plain(judged: &Judged) -> FramePlace {
    FramePlace { laid: judged.laid, evidence: judged.evidence, margin: None }
}

fn is_good(place: &FramePlace, min_share: f64) -> bool {
    place.evidence.n_same() >= MIN_SAME
        && place.laid.hold >= MIN_HOLD
        && place.evidence.share() >= min_share
}

/// Whether enough speaks for a pose that somebody states.
fn is_borne_out(place: &FramePlace) -> bool {
    place.evidence.n_same() >= MIN_SAME_STATED && place.evidence.share() >= MIN_SHARE_STATED
}

/// Where poses of a new session are compared.
fn middle(new: &SessionSurfaces) -> Vector {
    let n = new.surfels.all.len().max(1) as f64;
    new.surfels.all.iter().map(|s| s.at).sum::<Vector>() / n
}
