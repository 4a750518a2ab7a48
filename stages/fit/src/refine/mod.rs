//! Second phase: refines hypotheses of a search ([`Refined`]). Base and all joints move to the
//! least robust point-to-plane error on thinned points, and beams judge where they end (METHOD.md
//! §11.1).
//!
//! In the rounds with wide gates, surface that beams went through is moved along these beams, too
//! (`correspond/pierced.rs`).

mod gauss_newton;
mod rounds;

pub(crate) use gauss_newton::add_scaled;
pub(crate) use rounds::COARSE_ROUNDS;

use crate::correspond::{PerLink, some, stratified};
use crate::problem::{Judgement, Problem, SweepSteps, judge, judged};
use crate::state::Hypothesis;
use gauss_newton::{noise, run};
use rounds::{FINE_ROUNDS, NEAR_ROUNDS, Round};

/// A posture refined on thinned points, with what the beams say of it.
#[derive(Debug, Clone)]
pub(crate) struct Refined {
    pub(crate) hypothesis: Hypothesis,
    pub(crate) judgement: Judgement,
}

/// Rounds that end at a posture, with the gate that the noise of the points asks for.
const N_LAST_ROUNDS: usize = 4;

/// Gate of the last rounds.
struct LastGate {
    /// In standard deviations of the residuals.
    sigmas: f64,
    /// Bounds of the gate, metres.
    least: f64,
    most: f64,
    /// Gate within which the residuals are looked at for that, metres.
    asked: f64,
}

const LAST_GATE: LastGate = LastGate { sigmas: 4.5, least: 0.008, most: 0.025, asked: 0.022 };

/// Points that a schedule of rounds uses.
struct RoundPoints {
    /// Points of a link.
    per_link: usize,
    /// Points that are looked at for those, thinned evenly.
    looked_at: usize,
}

/// Coarse rounds: enough points to hold a link's pose to a millimetre.
const COARSE_POINTS: RoundPoints = RoundPoints { per_link: 600, looked_at: 30_000 };
/// Fine rounds: enough points to hold a link's pose to a fifth of a millimetre, which tells
/// hypotheses apart.
const FINE_POINTS: RoundPoints = RoundPoints { per_link: 1000, looked_at: 60_000 };
/// Distance from the roughly placed links within which points take part in the fine rounds, metres:
/// just inside the reach of the fine field.
const FINE_GATE: f64 = 0.0255;
/// Tolerance of the judgement after the coarse rounds, metres.
const COARSE_TOLERANCE: f64 = 0.03;
/// Sweep steps within which, in all joints but the last, two coarsely refined postures are one.
const TWIN_STEPS: f64 = 0.7;

/// Coarse rounds for hypotheses of a search; the best of them, of near twins the first.
pub(crate) fn coarse(
    problem: &Problem<'_>,
    steps: &SweepSteps<'_>,
    found: Vec<Hypothesis>,
) -> Vec<Hypothesis> {
    let Problem { prepared, scene, settings, .. } = *problem;
    let mut out: Vec<(Hypothesis, f64)> = Vec::new();
    let last = found.first().map_or(0, |h| h.posture.len().saturating_sub(1));
    for h in problem.fan.fan(found, |h| approach(problem, &h, &COARSE_ROUNDS)) {
        if out.iter().any(|(k, _)| steps.alike(k, &h, last, TWIN_STEPS)) {
            continue;
        }
        let judgement = judge(prepared, scene, settings, &h, COARSE_TOLERANCE);
        out.push((h, judgement.explained));
    }
    out.sort_by(|a, b| b.1.total_cmp(&a.1));
    out.truncate(settings.n_polish);
    out.into_iter().map(|(h, _)| h).collect()
}

/// Rounds with wide gates on few points of each link.
pub(crate) fn approach(problem: &Problem<'_>, h: &Hypothesis, rounds: &[Round]) -> Hypothesis {
    let RoundPoints { per_link, looked_at } = COARSE_POINTS;
    let wanted = PerLink { gate: rounds[0].gate, cap: per_link };
    let few = stratified(problem, h, &some(problem.thin, looked_at), wanted);
    run(problem, h, &few, rounds)
}

/// Fine rounds with the gate that the noise asks for, then the judgement.
pub(crate) fn polish(problem: &Problem<'_>, h: &Hypothesis) -> Refined {
    let RoundPoints { per_link, looked_at } = FINE_POINTS;
    let wanted = PerLink { gate: FINE_GATE, cap: per_link };
    let few = stratified(problem, h, &some(problem.thin, looked_at), wanted);
    let h = run(problem, h, &few, &FINE_ROUNDS);
    let hypothesis = run(problem, &h, &few, &last_rounds(problem, &h, &few));
    let judgement = judged(problem, &hypothesis);
    Refined { hypothesis, judgement }
}

/// Coarse rounds from near, then [`polish`].
pub(crate) fn polish_near(problem: &Problem<'_>, h: &Hypothesis) -> Refined {
    polish(problem, &approach(problem, h, NEAR_ROUNDS))
}

/// The rounds that end at a posture, from one that is nearly it.
fn last_rounds(problem: &Problem<'_>, h: &Hypothesis, few: &[u32]) -> Vec<Round> {
    let gate = (LAST_GATE.sigmas * noise(problem, h, few, LAST_GATE.asked))
        .clamp(LAST_GATE.least, LAST_GATE.most);
    vec![Round { gate, balanced: false }; N_LAST_ROUNDS]
}

/// Sorts postures: those that explain the most surface first.
pub(crate) fn best_first(refined: &mut [Refined]) {
    refined.sort_by(|a, b| b.judgement.explained.total_cmp(&a.judgement.explained));
}
