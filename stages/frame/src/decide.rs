//! Decides which judged pose of the new scans to take, or why none is clear enough.

use crate::judge::{Judged, PoseEvidence, judge};
use crate::refine::{Chosen, Laid, NEAR, WIDE, apart};
use crate::search;
use crate::session::SessionSurfaces;
use contract::Fan;
use geometry::{Pose, Vector};

/// Smallest number of non-level surfels on surfaces of the other session for a searched pose: 6 m².
const MIN_SAME: usize = 150;
/// The corresponding number where the files state the pose: 2.4 m².
const MIN_SAME_STATED: usize = 60;
/// Smallest number of upright surfels that determine a pose in each horizontal direction: 1.2 m².
const MIN_HOLD: f64 = 30.0;
/// Smallest share of the comparable surfels that lie on the other session's surfaces, for the
/// stated pose.
const MIN_SHARE_STATED: f64 = 0.7;
/// The corresponding share for a searched pose.
const MIN_SHARE: f64 = 0.75;
/// The same share for the stated pose if no other place fits as well: much in the cell has changed.
const MIN_SHARE_CHANGED: f64 = 0.4;
/// Largest difference of a pose that counts as the stated one: metres, radians. The registration of
/// each scan corrects that much.
const STATED: (f64, f64) = (0.03, 0.0035);
/// Largest correction of the stated pose: metres, radians (0.6°).
const STATED_ABOUT: (f64, f64) = (0.15, 0.01);
/// Poses that differ by more belong to different places: metres, radians (1°).
const PLACE: (f64, f64) = (0.3, 0.0175);
/// Another place is a rival if at least this share of the surfels that lie on old surfaces in the
/// best pose also do so in it.
const SERIOUS: f64 = 0.5;
/// By how many more surfels a rival must be contradicted than the best place: 8 m² of both sessions
/// together, more than one object that was moved to a similar place (a loaded pallet has up to 3 m²
/// in each session).
const MIN_MARGIN: i64 = 200;
/// The same margin as share of the surfels that lie on old surfaces in the best pose.
const MARGIN_SHARE: f64 = 0.02;
/// Largest number of places that are reported to the user.
const MAX_TOLD: usize = 4;

/// A pose of the new session in the earlier one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FramePlace {
    /// The pose between the sessions, each about its own origin, with its uncertainty.
    pub laid: Laid,
    /// The evidence for and against it.
    pub evidence: PoseEvidence,
    /// Difference between the contradicting surfels of the next best place and of this one; `None`
    /// if there is no other place.
    pub margin: Option<i64>,
}

/// The result of checking the stated pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Answer {
    /// The stated pose is right.
    Holds(FramePlace),
    /// The stated pose is nearly right; the place has the correction.
    Near(FramePlace),
    /// The stated pose is contradicted, or has too little evidence.
    Not(Option<FramePlace>),
}

/// Why no pose is taken.
#[derive(Debug, Clone, PartialEq)]
pub enum Refusal {
    /// Nothing of the new session fits the earlier one well; the best pose that was tried.
    Nothing(Option<Box<FramePlace>>),
    /// Several places fit, the best first; they differ by no more evidence than objects that were
    /// moved could account for.
    Several(Vec<FramePlace>),
}

/// Checks whether new scans lie where they are stated to; `stated` is the pose
/// `old_world_from_new_world`.
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
    // A correction of centimetres is accepted only if surfaces determine all directions.
    if is_within(STATED) || place.laid.hold < MIN_HOLD {
        Answer::Holds(place)
    } else {
        Answer::Near(place)
    }
}

/// The pose near a rough one that a user gives, if surfaces and beams confirm it.
///
/// # Errors
/// The refined pose, if surfaces and beams do not confirm it; `None` if it could not be refined.
pub fn from_rough(
    old: &SessionSurfaces,
    new: &SessionSurfaces,
    rough: &Pose,
) -> Result<FramePlace, Option<Box<FramePlace>>> {
    let laid = Chosen::of(&new.surfels).lay(&old.surfels, rough, &WIDE).ok_or(None)?;
    let place = plain(&judge(old, new, laid));
    if is_borne_out(&place) { Ok(place) } else { Err(Some(Box::new(place))) }
}

/// The pose of the new session in the earlier one, searched over all shifts and yaws; `stated` is
/// one of the poses that are tested.
///
/// # Errors
/// The reason, if no pose is clear.
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
    // Poses with few surfels on the earlier session are dropped here, to save memory.
    let judged = fan.fan(apart_ones, |laid| {
        let judged = judge(old, new, laid);
        (judged.evidence.n_same() >= MIN_SAME_STATED).then_some(judged)
    });
    let mut judged: Vec<Judged> = judged.into_iter().flatten().collect();
    judged.sort_by_key(|j| std::cmp::Reverse(j.evidence.score()));
    clear(&places(judged, &at), stated, &at)
}

/// Whether a place is the stated pose, within what the registration of each scan corrects.
#[must_use]
pub fn is_stated(place: &FramePlace, stated: &Pose, new: &SessionSurfaces) -> bool {
    let off = apart(&place.laid.old_from_new, stated, &middle(new));
    off.0 <= STATED.0 && off.1 <= STATED.1
}

/// The best judged pose of each place.
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

/// The best of these places, if it is clear.
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
    // A pose that the files state needs no margin: the statement is evidence for it.
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

/// Whether the evidence confirms a pose that a user states.
fn is_borne_out(place: &FramePlace) -> bool {
    place.evidence.n_same() >= MIN_SAME_STATED && place.evidence.share() >= MIN_SHARE_STATED
}

/// The point of a new session at which poses are compared.
fn middle(new: &SessionSurfaces) -> Vector {
    let n = new.surfels.all.len().max(1) as f64;
    new.surfels.all.iter().map(|s| s.at).sum::<Vector>() / n
}
