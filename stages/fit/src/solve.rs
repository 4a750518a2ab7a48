//! The fit of one model to one scene, on one page: search, refine, adjust, ask for other postures,
//! assess.
//!
//! | phase | returns | in |
//! | --- | --- | --- |
//! | search the joints with beams | [`Hypothesis`] | `search` |
//! | refine base and joints on thinned points | [`Refined`] | `refine` |
//! | adjust base, joints and scans on many points | [`Settled`] | `adjust` |
//! | find all that explains the points as well | [`PostureModes`] | `modes` |
//! | state how well everything is known, and judge | [`Fit`] | `assess` |
//!
//! No phase calls an earlier one. Where another posture has to be refined and adjusted in turn, the
//! loop stands here: [`add_found_beside`] over what a search finds beside the best, [`settle`] over
//! the modes of leaf joints, [`best_of`] over flipped and bent wrists, [`bend_wrist`] over bends at
//! an open flange.

use contract::{Candidate, Fan, Fit, OneByOne};
use geometry::{Point, Pose};

use crate::adjust::{Adjust, on_whole_beams};
use crate::assess::{refused, report};
use crate::calibrate::doubt_places;
use crate::correspond::{AdjustPoints, adjusted_points};
use crate::modes::{
    MODES, OtherEnd, OtherLoops, PostureModes, Settled, WristModes, ahead, bends, better_leaves,
    close_rivals, gain, is_on_its_way, leaf_modes, other_loops, slides,
};
use crate::problem::{Judgement, Prior, Problem, SweepSteps, judged};
use crate::refine::{COARSE_ROUNDS, Refined, approach, best_first, coarse, polish, polish_near};
use crate::search::BeamSearch;
use crate::state::Hypothesis;
use crate::verdict::{self, is_lost};
use crate::{MeasuredScene, Prepared, Settings};

/// Score of the best posture so far below which no other wrist makes it a robot.
///
/// Of 250 robots among clutter, behind fences, with noise of 10 mm, none had less than 0.58 after
/// the quick look; one whose balancer its model has fixed had 0.47; half of what small arms find in
/// clutter has less than 0.45. An arm in a depth camera's cloud had 0.33, thirteen other places of
/// that cloud at most 0.22.
struct HopelessScore {
    /// Where beams of scanners tell.
    scanner: f64,
    /// Where beams are a depth camera's, which bends surfaces.
    camera: f64,
    /// Where only points tell.
    points: f64,
}

const HOPELESS_SCORE: HopelessScore = HopelessScore { scanner: 0.45, camera: 0.25, points: 0.1 };
/// Score of a base from which on the full search is made at once where points or a depth camera's
/// beams tell.
const CLEAR_BASE: f64 = 0.35;
/// Score after a glance or a quick look from which on the full search is made at once. Of 58 robots
/// that were found none had less than 0.678 after a quick look; of 462 wrong places two had 0.66 or
/// more.
const CLEAR_LOOK: f64 = 0.66;
/// The search of a look at a candidate.
struct NarrowBeam {
    /// Hypotheses kept at each joint.
    kept: usize,
    settled: usize,
    refined: usize,
    /// Samples of a link where beams of scanners tell.
    samples: usize,
}

/// A quick look, and a glance before it, which takes half of its time. With a beam of 5 and two
/// settled one of 162 right places is lost.
const QUICK: NarrowBeam = NarrowBeam { kept: 25, settled: 8, refined: 3, samples: 60 };
const GLANCE: NarrowBeam = NarrowBeam { kept: 12, settled: 4, refined: 1, samples: 40 };
/// Score after a glance below which a place of scanners' beams gets no quick look. 162 right places
/// have 0.595 or more, 393 wrong ones 0.505 at most.
const HOPELESS_GLANCE: f64 = 0.35;

/// One point of so many of the last adjustment is enough to choose what it is made of, where that
/// is more than links have at least.
struct SettledPart {
    scanner: usize,
    /// Of depth cameras, whose errors are alike over a hand's width: a wrist in eight views was
    /// lost with fewer points.
    camera: usize,
}

const SETTLED_PART: SettledPart = SettledPart { scanner: 30, camera: 15 };
/// Most rounds in which the best one's wrist is flipped and bent, where another takes its place.
const N_WRIST_ROUNDS: usize = 3;
/// Most times that the wrist of the answer is bent.
const N_BENDS: usize = 2;

/// Fits the candidate's model in the scene; `None` where nothing comes near.
#[must_use]
pub fn fit(
    candidate: &Candidate,
    prepared: &Prepared<'_>,
    scene: &MeasuredScene<'_>,
    settings: &Settings,
    fan: &dyn Fan,
) -> Option<Fit> {
    let local_from_world = scene.world_from_local().inverse();
    let bases: Vec<Pose> =
        candidate.bases.iter().map(|(pose, _)| local_from_world * pose).collect();
    let base = bases.first().map_or_else(Point::origin, |b| Point::from(b.translation.vector));
    let nearby = scene.nearby(prepared, &base);
    let prior = Some(Prior::of(candidate, &local_from_world, settings));
    let plain = Problem::new(prepared, scene, settings, fan).with_points(&nearby);
    let problem = Problem { prior, ..plain };
    let is_clear =
        !is_by_scanners(scene) && candidate.bases.first().is_some_and(|base| base.1 >= CLEAR_BASE);
    if !is_clear && !is_promising(&problem, &bases) {
        return None;
    }
    fit_from(&problem, &bases)
}

/// The phases in their order, from base poses in the local frame.
fn fit_from(problem: &Problem<'_>, bases: &[Pose]) -> Option<Fit> {
    let search = BeamSearch::new(problem);
    let found = coarsely(problem, &search, bases);
    let mut refined = problem.fan.fan(found, |h| polish(problem, &h));
    best_first(&mut refined);
    let closer = search.fitted();
    add_found_beside(problem, &closer, &mut refined)?;
    let best = refined.first()?;
    if !is_reported(&best.judgement, problem.settings) {
        return None;
    }
    let best = settle(problem, &best.hypothesis);
    if is_lost(&best.adjusted, problem.scene) {
        return Some(refused(problem, &best.adjusted, &best.judgement));
    }
    let best = best_of(problem, &closer, best, &mut refined);
    match other_loops(problem, &best.adjusted.hypothesis, &best.judgement) {
        None => Some(finish(problem, best, &refined)),
        Some(OtherLoops { loops, model }) => {
            let own = problem.prepared.moved(&model);
            let problem = Problem { prepared: &own, ..*problem };
            let best = settle(&problem, &best.adjusted.hypothesis);
            let fit = finish(&problem, best, &refined);
            Some(Fit { other_branches: loops, ..fit })
        }
    }
}

/// The fit of a robot that stands where an earlier one had it, or near enough for the refinement;
/// `None` where the beams contradict that.
#[must_use]
pub fn again(
    before: &Fit,
    prepared: &Prepared<'_>,
    scene: &MeasuredScene<'_>,
    settings: &Settings,
    fan: &dyn Fan,
) -> Option<Fit> {
    let posture = before.joints.iter().map(|joint| joint.value).collect();
    let start = scene.hypothesis(&before.world_from_base, posture);
    let nearby = scene.nearby(prepared, &Point::from(start.local_from_base.translation.vector));
    let problem = Problem::new(prepared, scene, settings, fan).with_points(&nearby);
    let refined = polish_near(&problem, &start);
    if !is_reported(&refined.judgement, settings) {
        return None;
    }
    let best = settle(&problem, &refined.hypothesis);
    let fit = finish(&problem, best, &[refined]);
    // `prepared` is of the model with all that.
    let (tool, other_branches) = (before.tool.clone(), before.other_branches.clone());
    Some(Fit { tool, other_branches, calibration: before.calibration.clone(), ..fit })
}

/// Where the refinement alone ends from a base (world) and a posture near the truth, without any
/// search: for measuring how near a search must come.
#[must_use]
pub fn converge(
    prepared: &Prepared<'_>,
    scene: &MeasuredScene<'_>,
    settings: &Settings,
    world_from_base: &Pose,
    posture: &[f64],
) -> (Pose, Vec<f64>) {
    let start = scene.hypothesis(world_from_base, posture.to_vec());
    let nearby = scene.nearby(prepared, &Point::from(start.local_from_base.translation.vector));
    let problem = Problem::new(prepared, scene, settings, &OneByOne).with_points(&nearby);
    let end = polish(&problem, &approach(&problem, &start, &COARSE_ROUNDS)).hypothesis;
    (scene.world_from_local() * end.local_from_base, end.posture)
}

/// Whether what the beams say of a posture is worth a report.
fn is_reported(judgement: &Judgement, settings: &Settings) -> bool {
    judgement.score >= settings.min_score && judgement.violation <= settings.max_violation
}

/// Whether anything like the robot's arm stands on one of the bases. A right one may end with a
/// wrong wrist in a quick look, but not without shoulder and elbow; what is no clear match must at
/// least lie on the points, as all 58 robots that were found did, and 3 of 462 wrong places.
fn is_promising(problem: &Problem<'_>, bases: &[Pose]) -> bool {
    let is_scanned = is_by_scanners(problem.scene);
    if is_scanned {
        let score = |problem: &Problem<'_>, h: &Hypothesis| judged(problem, h).score;
        let glance = look(problem, bases, &GLANCE, score).unwrap_or(f64::NEG_INFINITY);
        if !(HOPELESS_GLANCE..CLEAR_LOOK).contains(&glance) {
            return glance >= CLEAR_LOOK;
        }
    }
    let Some(found) = quick(problem, bases) else { return false };
    let (score, scene) = (found.judgement.score, problem.scene);
    if score < hopeless(scene) {
        return false;
    }
    let is_clear = !is_scanned || score >= CLEAR_LOOK;
    is_clear || !is_lost(&settle(problem, &found.hypothesis).adjusted, scene)
}

/// Whether beams of scanners alone judge a scene.
fn is_by_scanners(scene: &MeasuredScene<'_>) -> bool {
    scene.evidence.has_beams() && !scene.has_camera()
}

fn hopeless(scene: &MeasuredScene<'_>) -> f64 {
    match (scene.evidence.has_beams(), scene.has_camera()) {
        (true, false) => HOPELESS_SCORE.scanner,
        (true, true) => HOPELESS_SCORE.camera,
        (false, _) => HOPELESS_SCORE.points,
    }
}

/// A quick look with few hypotheses: the best posture.
pub(crate) fn quick(problem: &Problem<'_>, bases: &[Pose]) -> Option<Refined> {
    look(problem, bases, &QUICK, polish)
}

/// A look with few hypotheses: what `then` makes of the best one after coarse rounds.
fn look<T>(
    problem: &Problem<'_>,
    bases: &[Pose],
    beam: &NarrowBeam,
    then: impl FnOnce(&Problem<'_>, &Hypothesis) -> T,
) -> Option<T> {
    let most = if is_by_scanners(problem.scene) { beam.samples } else { usize::MAX };
    let settings = Settings {
        n_search: problem.settings.n_search.min(most),
        beam: beam.kept,
        settle: beam.settled,
        n_refine: beam.refined,
        n_polish: 1,
        ..problem.settings.clone()
    };
    let problem = Problem { settings: &settings, ..*problem };
    let best = coarsely(&problem, &BeamSearch::new(&problem), bases).into_iter().next();
    best.map(|h| then(&problem, &h))
}

/// The search over some bases, and coarse rounds for the best that it finds.
fn coarsely(problem: &Problem<'_>, search: &BeamSearch<'_>, bases: &[Pose]) -> Vec<Hypothesis> {
    let found = search.varied(search.run(bases), problem.settings.n_refine);
    coarse(problem, &search.steps, found)
}

/// Adds what a search finds beside the best of some postures, best first: links that the beams
/// contradict, anew; then other postures that may explain as much. `None` where the best is too
/// poor for a robot.
fn add_found_beside(
    problem: &Problem<'_>,
    search: &BeamSearch<'_>,
    refined: &mut Vec<Refined>,
) -> Option<()> {
    for is_contradicted in [true, false] {
        let Some(best) = refined.first() else { break };
        if best.judgement.score < hopeless(problem.scene) {
            return None;
        }
        let more = match is_contradicted {
            true => search.again(&best.hypothesis, &best.judgement),
            false => search.alternatives(&best.hypothesis),
        };
        refined.extend(problem.fan.fan(more, |h| match is_contradicted {
            true => polish_near(problem, &h),
            // One joint of a fitted arm swept to a peak is less than a step off: what hangs beside
            // its link must not draw it away within the gates of the coarse rounds.
            false => polish(problem, &h),
        }));
        best_first(refined);
    }
    Some(())
}

/// Adjusts a posture; where another value of its leaf joints fits the points better, that one.
pub(crate) fn settle(problem: &Problem<'_>, h: &Hypothesis) -> Settled {
    let Problem { prepared, scene, settings, .. } = *problem;
    let part = if scene.has_camera() { SETTLED_PART.camera } else { SETTLED_PART.scanner };
    let mut points = adjusted_points(problem, h, settings.max_points / part);
    let loose: Vec<usize> = (0..h.posture.len()).filter(|&j| prepared.leaf[j]).collect();
    let adjust = Adjust::new(problem);
    let mut best = Adjust { loose: &loose, ..adjust }.run(h, &mut points);
    let mut leaves = leaf_modes(problem, &best.hypothesis);
    // The same points of the same links; what is known of the scans stays.
    let mut state = best.state();
    let other = better_leaves(&best.hypothesis.posture, &leaves);
    if let Some(posture) = &other {
        state.hypothesis.posture.clone_from(posture);
        leaves.iter().for_each(|s| points.forget(&prepared.carried(s.joint)));
    }
    if !loose.is_empty() {
        best = adjust.run_from(state, &mut points);
    }
    if other.is_some() {
        leaves = leaf_modes(problem, &best.hypothesis);
    }
    let judgement = judged(problem, &best.hypothesis);
    Settled { adjusted: best, judgement, leaves }
}

/// The best of a posture, the others, and what is like it but for its wrist; all the rest joins the
/// others.
fn best_of(
    problem: &Problem<'_>,
    search: &BeamSearch<'_>,
    best: Settled,
    others: &mut Vec<Refined>,
) -> Settled {
    let (fan, steps) = (problem.fan, &search.steps);
    let first = best.adjusted.hypothesis.clone();
    let mut best = best;
    let mut rivals = close_rivals(problem, steps, others, &best);
    for _ in 0..N_WRIST_ROUNDS {
        let before = best.adjusted.hypothesis.clone();
        rivals.extend(fan.fan(search.flips(&before), |flipped| polish_near(problem, &flipped)));
        best = better_of(problem, best, rivals, others);
        let h = &best.adjusted.hypothesis;
        let mut bent = fan.fan(bends(problem, h), |bent| polish(problem, &bent));
        bent.extend(slides(problem, h));
        rivals = close_rivals(problem, steps, &bent, &best);
        others.extend(bent);
        best = better_of(problem, best, rivals, others);
        // What took its place has flips of its own.
        if is_same_arm(steps, &before, &best.adjusted.hypothesis) {
            break;
        }
        rivals = Vec::new();
    }
    if is_same_arm(steps, &first, &best.adjusted.hypothesis) {
        return best;
    }
    // The others were found beside the first wrist and have that: a base that stands a quarter turn
    // off under the right wrist is not among them.
    let more = search.alternatives(&best.adjusted.hypothesis);
    let more = fan.fan(more, |h| polish(problem, &h));
    let rivals = close_rivals(problem, steps, &more, &best);
    others.extend(more);
    better_of(problem, best, rivals, others)
}

/// Whether two postures agree in all joints but the last.
fn is_same_arm(steps: &SweepSteps<'_>, before: &Hypothesis, after: &Hypothesis) -> bool {
    let last = before.posture.len().saturating_sub(2);
    steps.alike(before, after, last, MODES.rival.same_steps)
}

/// The best of a posture and its rivals, each adjusted; all the rest joins the others.
fn better_of(
    problem: &Problem<'_>,
    mut best: Settled,
    rivals: Vec<Refined>,
    others: &mut Vec<Refined>,
) -> Settled {
    for rival in rivals {
        let explained = best.judgement.explained;
        if rival.judgement.explained < explained - MODES.rival.flip_short * explained.abs() {
            others.push(rival);
            continue;
        }
        let mut other = settle(problem, &rival.hypothesis);
        if ahead(problem, &best, &other.refined()) < 0.0 {
            std::mem::swap(&mut best, &mut other);
        }
        others.push(other.refined());
    }
    best
}

/// The answer on all points that pay, with all that explains them about as well, as it is reported.
pub(crate) fn finish(problem: &Problem<'_>, mut best: Settled, others: &[Refined]) -> Fit {
    let mut points = sharpen(problem, &mut best);
    let wrist = bend_wrist(problem, &mut best, &mut points);
    let misfits = doubt_places(problem, &mut best);
    let h = &best.adjusted.hypothesis;
    let at_rest = |other: &Refined| match is_on_its_way(problem, h, &other.hypothesis) {
        true => settle(problem, &other.hypothesis).refined(),
        false => other.clone(),
    };
    let others = problem.fan.fan(others.iter().collect(), at_rest);
    let mut fit = report(problem, &PostureModes { best, points, wrist, others });
    verdict::note(&mut fit, misfits);
    fit
}

/// Adjusts the answer once more, on as many points as pay: only what is reported is worth them, not
/// what it is chosen from. Those points.
fn sharpen(problem: &Problem<'_>, best: &mut Settled) -> AdjustPoints {
    let state = best.adjusted.state();
    let points = adjusted_points(problem, &state.hypothesis, problem.settings.max_points);
    let open = best.open_leaves();
    let mut points = on_whole_beams(problem, &state, &open, points);
    // An open flange need not come to rest.
    let adjust = Adjust { loose: &open, ..Adjust::new(problem) };
    best.adjusted = adjust.run_from(state.with_open_smoothness(), &mut points);
    best.judgement = judged(problem, &best.adjusted.hypothesis);
    points
}

/// Bends the wrist of the answer to where the points fit best; how well they fit at other bends,
/// where that is asked.
fn bend_wrist(
    problem: &Problem<'_>,
    best: &mut Settled,
    points: &mut AdjustPoints,
) -> Option<WristModes> {
    for _ in 0..N_BENDS {
        let state = best.adjusted.state();
        let wrist = WristModes::of(problem, &best.adjusted, &best.leaves, points)?;
        let Some(start) = wrist.better(&state.hypothesis) else { return Some(wrist) };
        let mut other = best.clone();
        other.adjusted.hypothesis = start;
        let others = sharpen(problem, &mut other);
        let end = OtherEnd { hypothesis: &other.adjusted.hypothesis, points: &others };
        if gain(problem, &state, points, &end, wrist.joint) <= 0.0 {
            return Some(wrist);
        }
        other.leaves = leaf_modes(problem, &other.adjusted.hypothesis);
        (*best, *points) = (other, others);
    }
    WristModes::of(problem, &best.adjusted, &best.leaves, points)
}
