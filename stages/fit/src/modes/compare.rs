//! Comparison of whole postures by beams and points together, on the links that stand differently
//! (METHOD.md §9).
//!
//! A small wrist turned by half a turn about both of its axes differs in a bolt or two, which beams
//! alone do not tell. A wrist among the points of what hangs on it is drawn to them, which beams do
//! tell.

use super::settings::{MODES, RivalLimits};
use super::settled::Settled;
use crate::correspond::worsening;
use crate::problem::{JudgedPosture, Judgement, Problem, SweepSteps, links_apart, margin};
use crate::refine::Refined;
use crate::state::Hypothesis;

const LIMITS: RivalLimits = MODES.rival;

/// How clearly the beams, and the points, prefer a posture to another on the links that stand
/// differently. Where only a tool's part slid the points do not count: they are of what the tool
/// holds as well.
pub(crate) fn lead(
    problem: &Problem<'_>,
    best: &Hypothesis,
    judgement: &Judgement,
    other: &Refined,
) -> [f64; 2] {
    let own = JudgedPosture { hypothesis: best, judgement };
    let rival = JudgedPosture { hypothesis: &other.hypothesis, judgement: &other.judgement };
    let by_beams = margin(problem.prepared, own, rival);
    let by_points = match is_slid(problem, best, &other.hypothesis) {
        true => 0.0,
        false => worsening(problem, best, &other.hypothesis),
    };
    [by_beams, by_points]
}

/// How clearly a settled posture is ahead of another one, by beams and points together.
pub(crate) fn ahead(problem: &Problem<'_>, best: &Settled, other: &Refined) -> f64 {
    lead(problem, &best.adjusted.hypothesis, &best.judgement, other).iter().sum::<f64>()
}

/// Whether two postures differ in slides of a tool's parts, and in nothing else.
fn is_slid(problem: &Problem<'_>, a: &Hypothesis, b: &Hypothesis) -> bool {
    let (slides, rest): (Vec<_>, Vec<_>) =
        (0..a.posture.len()).partition(|&j| closes_tool(problem, j));
    slides.iter().any(|&j| a.turn(b, j) > LIMITS.slid)
        && rest.iter().all(|&j| a.turn(b, j) <= MODES.other_turn)
}

/// Whether a joint slides and moves nothing but a part of a tool.
pub(crate) fn closes_tool(problem: &Problem<'_>, joint: usize) -> bool {
    problem.prepared.leaf[joint] && problem.prepared.slides(joint)
}

/// Whether another posture differs from one in a joint, but moves no link by as much as postures
/// are compared by: a small wrist that was refined from elsewhere may be degrees off, on its way to
/// the same posture.
pub(crate) fn is_on_its_way(problem: &Problem<'_>, h: &Hypothesis, other: &Hypothesis) -> bool {
    let prepared = problem.prepared;
    (0..h.posture.len()).any(|j| !prepared.leaf[j] && h.turn(other, j) > MODES.other_turn)
        && links_apart([prepared; 2], [h, other]).is_empty()
}

/// Postures that explain nearly as much and that beams and points together hardly like less, best
/// first, few.
pub(crate) fn close_rivals(
    problem: &Problem<'_>,
    steps: &SweepSteps<'_>,
    others: &[Refined],
    best: &Settled,
) -> Vec<Refined> {
    let (h, judgement) = (&best.adjusted.hypothesis, &best.judgement);
    let least = judgement.explained - LIMITS.short * judgement.explained.abs();
    let last = h.posture.len().saturating_sub(1);
    // Other values of a last joint that turns are looked at apart; one that slides closes a gun.
    let upto = if problem.prepared.slides(last) { last } else { last.saturating_sub(1) };
    let is_known = |a: &Hypothesis, b: &Hypothesis| steps.alike(a, b, upto, LIMITS.same_steps);
    let others = others.iter();
    let others = others.filter(|p| p.judgement.explained > least && !is_known(h, &p.hypothesis));
    let mut all: Vec<(f64, &Refined)> =
        problem.fan.fan(others.collect(), |p| (ahead(problem, best, p), p));
    all.retain(|(ahead, _)| *ahead < LIMITS.lead);
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut out: Vec<Refined> = Vec::new();
    for (_, other) in all {
        let is_twin = |p: &Refined| is_known(&p.hypothesis, &other.hypothesis);
        if out.len() < LIMITS.n_rivals && !out.iter().any(is_twin) {
            out.push(other.clone());
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::with_jaw;

    #[test]
    fn only_a_jaw_that_slid_is_told_by_beams_alone() {
        with_jaw(|problem, state| {
            let own = &state.hypothesis;
            let slid = |posture: [f64; 2]| {
                let other = Hypothesis { posture: posture.to_vec(), ..own.clone() };
                is_slid(problem, own, &other)
            };
            assert!(slid([0.0, 0.02]) && slid([0.01, -0.02]));
            assert!(!slid([0.1, 0.02]) && !slid([0.1, 0.0]) && !slid([0.0, 0.005]));
        });
    }
}
