//! One candidate in, one fit out: search, refine, judge; or nothing, where no posture explains what
//! was measured.

use contract::{Candidate, Fan, Fit, OneByOne};
use geometry::{Point, Pose};
use nalgebra::Translation3;

use crate::beam::{Beam, Hypothesis};
use crate::branch::branches;
use crate::judge::{Judgement, judge, judged};
use crate::refine::{COARSE_ROUNDS, FINE_ROUNDS, N_LAST_ROUNDS, NEAR_ROUNDS, Prior, Refine, Round};
use crate::report::refused;
use crate::rivals::best_of;
use crate::settle::{finish, settle};
use crate::strata::some;
use crate::verdict::is_lost;
use crate::{Prepared, Scene, Settings};

/// Gate of the last rounds in multiples of the noise found, and its bounds, metres.
const LAST_GATE: (f64, f64, f64) = (4.5, 0.008, 0.025);

/// Score of the best posture so far below which no other wrist makes it a robot: where beams tell,
/// where they are a camera's, which bends surfaces, and where only points do. Of 250 robots among
/// clutter, behind fences, with noise of 10 mm, none had less than 0.58 after the quick look; one
/// whose balancer its model has fixed had 0.47; half of what small arms find in clutter
/// has less than 0.45. An arm in a depth camera's cloud had 0.33, thirteen
/// other places of that cloud at most 0.22.
const HOPELESS_SCORE: [f64; 3] = [0.45, 0.25, 0.1];
/// How far beyond its reach points may still be the robot's, metres: an error of the base.
pub(crate) const NEAR_MARGIN: f64 = 0.15;
/// Points of a link in the coarse rounds: enough to hold its pose to a millimetre.
const COARSE_CAP: usize = 600;
/// Points that are looked at for those, thinned evenly.
const COARSE_NEAR: usize = 30_000;
/// Distance from the roughly placed links within which points take part in the fine rounds, metres:
/// just inside the reach of the fine field.
const FINE_GATE: f64 = 0.0255;

/// Fits the candidate's model in the scene; `None` where nothing comes near.
#[must_use]
pub fn fit(
    candidate: &Candidate,
    prepared: &Prepared<'_>,
    scene: &Scene<'_>,
    settings: &Settings,
    fan: &dyn Fan,
) -> Option<Fit> {
    let local_from_world = scene.world_from_local().inverse();
    let bases: Vec<Pose> =
        candidate.bases.iter().map(|(pose, _)| local_from_world * pose).collect();
    let prior = Some(prior(candidate, &local_from_world, settings));
    let refine = Refine { prepared, scene, settings, prior };
    let base = bases.first().map_or_else(Point::origin, |b| Point::from(b.translation.vector));
    let [near, all] = scene.within(&base, prepared.reach + NEAR_MARGIN);
    let is_clear = candidate.bases.first().is_some_and(|b| b.1 >= CLEAR_BASE);
    if !is_clear && !is_promising(&refine, &bases, &near, fan) {
        return None;
    }
    let beam = Beam::new(prepared, scene, settings);
    let closer = beam.fitted();
    let found = beam.run(&bases, fan);
    let refined = rough(&beam, &refine, found, &near, fan);
    let mut polished = fan.fan(refined, |h| polish(&refine, &h, &near, fan));
    sort(&mut polished);
    look_beside(&closer, &refine, &mut polished, &near, fan)?;
    let (best, judgement) = polished.first()?;
    if judgement.score < settings.min_score || judgement.violation > settings.max_violation {
        return None;
    }
    let best = settle(&refine, best, (&near, &all), fan);
    if is_lost(&best.0, scene) {
        return Some(refused(&refine, &best.0, &best.1));
    }
    let best = best_of(&closer, &refine, best, &mut polished, (&near, &all), fan);
    let other = branches(&refine, &best.0.hypothesis, &best.1, &near);
    let Some((loops, model)) = other else {
        return Some(finish(&refine, best, &polished, (&near, &all), fan));
    };
    let own = prepared.moved(&model);
    let refine = Refine { prepared: &own, ..refine };
    let best = settle(&refine, &best.0.hypothesis, (&near, &all), fan);
    let fit = finish(&refine, best, &polished, (&near, &all), fan);
    Some(Fit { other_branches: loops, ..fit })
}

/// The fit of a robot that stands where an earlier one had it, or near enough for the refinement;
/// `None` where the beams contradict that.
#[must_use]
pub fn again(
    before: &Fit,
    prepared: &Prepared<'_>,
    scene: &Scene<'_>,
    settings: &Settings,
    fan: &dyn Fan,
) -> Option<Fit> {
    let refine = Refine { prepared, scene, settings, prior: None };
    let start = Hypothesis {
        local_from_base: scene.world_from_local().inverse() * before.world_from_base,
        posture: before.joints.iter().map(|joint| joint.value).collect(),
        score: 0.0,
    };
    let base = Point::from(start.local_from_base.translation.vector);
    let [near, all] = scene.within(&base, prepared.reach + NEAR_MARGIN);
    let polished = polish(&refine, &roughly(&refine, &start, &near, NEAR_ROUNDS, fan), &near, fan);
    if polished.1.score < settings.min_score || polished.1.violation > settings.max_violation {
        return None;
    }
    let best = settle(&refine, &polished.0, (&near, &all), fan);
    let fit = finish(&refine, best, &[polished], (&near, &all), fan);
    // `prepared` is of the model with all that.
    let (tool, other_branches) = (before.tool.clone(), before.other_branches.clone());
    Some(Fit { tool, other_branches, calibration: before.calibration.clone(), ..fit })
}

/// Score of a base from which on the search is made at once.
const CLEAR_BASE: f64 = 0.35;
/// Hypotheses of a quick look, and of those that are settled and refined.
const QUICK: [usize; 3] = [25, 8, 3];

/// Whether anything like the robot's arm stands on one of the bases. A right one may end with a
/// wrong wrist in a quick look, but not without shoulder and elbow.
fn is_promising(refine: &Refine<'_>, bases: &[Pose], near: &[u32], fan: &dyn Fan) -> bool {
    let found = quick(refine, bases, near, fan);
    found.is_some_and(|found| found.1.score >= hopeless(refine.scene))
}

/// A quick look with few hypotheses: the best posture.
pub(crate) fn quick(
    refine: &Refine<'_>,
    bases: &[Pose],
    near: &[u32],
    fan: &dyn Fan,
) -> Option<Polished> {
    let [beam, settle, n_refine] = QUICK;
    let quick = Settings { beam, settle, n_refine, n_polish: 1, ..refine.settings.clone() };
    let search = Beam::new(refine.prepared, refine.scene, &quick);
    let refine = Refine { settings: &quick, prior: refine.prior, ..*refine };
    let best = rough(&search, &refine, search.run(bases, fan), near, fan).into_iter().next();
    best.map(|h| polish(&refine, &h, near, fan))
}

fn hopeless(scene: &Scene<'_>) -> f64 {
    let [scanner, camera, points] = HOPELESS_SCORE;
    match (scene.evidence.has_beams(), scene.has_camera()) {
        (true, false) => scanner,
        (true, true) => camera,
        (false, _) => points,
    }
}

/// Where the refinement alone ends from a base (world) and a posture near the truth, without any
/// search: for measuring how near a search must come.
#[must_use]
pub fn converge(
    prepared: &Prepared<'_>,
    scene: &Scene<'_>,
    settings: &Settings,
    (world_from_base, posture): (&Pose, &[f64]),
) -> (Pose, Vec<f64>) {
    let world_from_local = scene.world_from_local();
    let refine = Refine { prepared, scene, settings, prior: None };
    let h = Hypothesis {
        local_from_base: world_from_local.inverse() * world_from_base,
        posture: posture.to_vec(),
        score: 0.0,
    };
    let base = Point::from(h.local_from_base.translation.vector);
    let [near, _] = scene.within(&base, prepared.reach + NEAR_MARGIN);
    let (end, _) =
        polish(&refine, &roughly(&refine, &h, &near, &COARSE_ROUNDS, &OneByOne), &near, &OneByOne);
    (world_from_local * end.local_from_base, end.posture)
}

/// What is looked for beside a polished posture.
enum Look {
    /// Links that the beams contradict, anew.
    Again,
    /// Other postures that may explain as much.
    Others,
}

/// Adds what is found beside the best of some postures, best first; `None` where it is too poor for
/// a robot.
fn look_beside(
    beam: &Beam<'_>,
    refine: &Refine<'_>,
    polished: &mut Vec<Polished>,
    near: &[u32],
    fan: &dyn Fan,
) -> Option<()> {
    for look in [Look::Again, Look::Others] {
        let Some((best, judgement)) = polished.first() else { break };
        if judgement.score < hopeless(refine.scene) {
            return None;
        }
        let more = match look {
            Look::Again => beam.again(best, judgement, fan),
            Look::Others => beam.alternatives(best, fan),
        };
        polished.extend(fan.fan(more, |h| {
            // One joint of a fitted arm swept to a peak is less than a step off: what hangs beside
            // its link must not draw it away within the gates of the coarse rounds.
            let start = match look {
                Look::Again => roughly(refine, &h, near, NEAR_ROUNDS, fan),
                Look::Others => h,
            };
            polish(refine, &start, near, fan)
        }));
        sort(polished);
    }
    Some(())
}

fn sort(polished: &mut [Polished]) {
    polished.sort_by(|a, b| b.1.explained.total_cmp(&a.1.explained));
}

/// Coarse rounds for the best of the beam; near twins are dropped.
fn rough(
    beam: &Beam<'_>,
    refine: &Refine<'_>,
    found: Vec<Hypothesis>,
    near: &[u32],
    fan: &dyn Fan,
) -> Vec<Hypothesis> {
    let settings = refine.settings;
    let mut out: Vec<(Hypothesis, f64)> = Vec::new();
    let last = found.first().map_or(0, |h| h.posture.len().saturating_sub(1));
    let found = beam.varied(found, settings.n_refine);
    for h in fan.fan(found, |h| roughly(refine, &h, near, &COARSE_ROUNDS, fan)) {
        if out.iter().any(|(k, _)| beam.alike(k, &h, last, 0.7)) {
            continue;
        }
        let judgement = judge(refine.prepared, refine.scene, settings, &h, 0.03);
        out.push((h, judgement.explained));
    }
    out.sort_by(|a, b| b.1.total_cmp(&a.1));
    out.truncate(settings.n_polish);
    out.into_iter().map(|(h, _)| h).collect()
}

/// Coarse rounds on few points of each link.
pub(crate) fn roughly(
    refine: &Refine<'_>,
    h: &Hypothesis,
    near: &[u32],
    rounds: &[Round],
    fan: &dyn Fan,
) -> Hypothesis {
    let few = refine.stratified(h, &some(near, COARSE_NEAR), (rounds[0].gate, COARSE_CAP), fan);
    refine.run(h, &few, rounds, fan)
}

/// Points of a link in the fine rounds: enough to hold its pose to a fifth of a millimetre, which
/// tells hypotheses apart.
const POLISH_CAP: usize = 1000;
/// Points that are looked at for those, thinned evenly.
const POLISH_NEAR: usize = 60_000;

/// A posture on thinned points, with what the beams say of it.
pub(crate) type Polished = (Hypothesis, Judgement);

/// Fine rounds, then the judgement.
pub(crate) fn polish(refine: &Refine<'_>, h: &Hypothesis, near: &[u32], fan: &dyn Fan) -> Polished {
    let h = fine(refine, h, near, fan);
    let judgement = judged(refine, &h);
    (h, judgement)
}

/// Fine rounds on thinned points, with the gate that the noise asks for.
pub(crate) fn fine(refine: &Refine<'_>, h: &Hypothesis, near: &[u32], fan: &dyn Fan) -> Hypothesis {
    fine_on(refine, h, &few(refine, h, near, fan), fan)
}

/// Points for that.
fn few(refine: &Refine<'_>, h: &Hypothesis, near: &[u32], fan: &dyn Fan) -> Vec<u32> {
    refine.stratified(h, &some(near, POLISH_NEAR), (FINE_GATE, POLISH_CAP), fan)
}

/// The same on points that are chosen.
fn fine_on(refine: &Refine<'_>, h: &Hypothesis, few: &[u32], fan: &dyn Fan) -> Hypothesis {
    let h = refine.run(h, few, &FINE_ROUNDS, fan);
    refine.run(&h, few, &last_rounds(refine, &h, few), fan)
}

/// The rounds that end at a posture, from one that is nearly it: with the gate that the noise there
/// asks for.
fn last_rounds(refine: &Refine<'_>, h: &Hypothesis, few: &[u32]) -> Vec<Round> {
    let gate = (LAST_GATE.0 * refine.noise(h, few, 0.022)).clamp(LAST_GATE.1, LAST_GATE.2);
    vec![Round { gate, balanced: false }; N_LAST_ROUNDS]
}

/// The installation plane, at the height of the base's origin.
fn prior(candidate: &Candidate, local_from_world: &Pose, settings: &Settings) -> Prior {
    // The candidate's bases already stand on the plane: the first one tells the height of the
    // origin above it.
    let base = candidate.bases.first().map_or_else(Pose::identity, |b| local_from_world * b.0);
    let (at, turn) = (Translation3::from(base.translation.vector), candidate.plane.plane.frame());
    let is_guess = candidate.plane.is_guess();
    let sigma = if is_guess { settings.guess_sigma } else { settings.plane_sigma };
    Prior { local_from_plane: Pose::from_parts(at, turn), sigma }
}
