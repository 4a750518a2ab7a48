//! A settled posture and others in; out comes the best of them, its flips and other bends of its
//! wrist looked at, too.
//!
//! Beams and points decide together, on the links that stand differently: a small wrist turned by
//! half a turn about both of its axes differs in a bolt or two, which beams alone do not tell; and
//! a wrist among the points of what hangs on it is drawn to them, which beams do tell.

use contract::Fan;

use crate::beam::{Beam, Hypothesis};
use crate::judge::{Judgement, margin, moved};
use crate::refine::{NEAR_ROUNDS, Refine};
use crate::report::{OTHER, closes, turn};
use crate::settle::{Settled, settle};
use crate::solve::{Polished, polish, roughly};

/// Share of the surface explained that a flipped posture may lack and still be looked at closely …
const FLIP_SHORT: f64 = 0.03;
/// … and any other.
const SHORT: f64 = 0.01;
/// Sweep steps within which, in all joints but a last one that turns, two postures are one.
const STEPS: f64 = 1.0;
/// How clearly a posture may be worse before it is settled and still be compared.
const LEAD: f64 = 0.1;
/// So many are compared.
const N_RIVALS: usize = 3;
/// So often is the best one's wrist flipped and bent, where another takes its place.
const N_LOOKS: usize = 3;

/// Slides that differ by more stand otherwise, metres.
const SLID: f64 = 0.01;

/// How clearly the beams, and the points, prefer a posture to another on the links that stand
/// differently. Where only a tool's part slid the points do not count: they are of what the tool
/// holds as well.
pub(crate) fn lead(
    refine: &Refine<'_>,
    best: (&Hypothesis, &Judgement),
    (other, judgement): &Polished,
    near: &[u32],
) -> [f64; 2] {
    let by_beams = margin(refine.prepared, best, (other, judgement));
    let by_points = match is_slid(refine, best.0, other) {
        true => 0.0,
        false => refine.worsening(best.0, other, near),
    };
    [by_beams, by_points]
}

/// Whether two postures differ in slides of a tool's parts, and in nothing else.
fn is_slid(refine: &Refine<'_>, a: &Hypothesis, b: &Hypothesis) -> bool {
    let (slides, rest): (Vec<_>, Vec<_>) = (0..a.posture.len()).partition(|&j| closes(refine, j));
    slides.iter().any(|&j| turn(a, b, j) > SLID) && rest.iter().all(|&j| turn(a, b, j) <= OTHER)
}

/// The best of a posture, the others, and what is like it but for its wrist; all the rest joins the
/// others.
pub(crate) fn best_of(
    beam: &Beam<'_>,
    refine: &Refine<'_>,
    best: Settled,
    others: &mut Vec<Polished>,
    (near, all): (&[u32], &[u32]),
    fan: &dyn Fan,
) -> Settled {
    let mut best = best;
    let mut rivals = near_rivals((beam, refine), others, &best, near, fan);
    for _ in 0..N_LOOKS {
        let before = best.0.hypothesis.clone();
        rivals.extend(fan.fan(beam.flips(&before), |flipped| {
            polish(refine, &roughly(refine, &flipped, near, NEAR_ROUNDS, fan), near, fan)
        }));
        let (better, rest) = compare(refine, best, rivals, (near, all), fan);
        others.extend(rest);
        let bends = refine.bends(&better.0.hypothesis, near, fan);
        let mut bends = fan.fan(bends, |h| polish(refine, &h, near, fan));
        bends.extend(refine.slides(&better.0.hypothesis, fan));
        let bent = near_rivals((beam, refine), &bends, &better, near, fan);
        others.extend(bends);
        let (better, rest) = compare(refine, better, bent, (near, all), fan);
        others.extend(rest);
        best = better;
        // What took its place has flips of its own.
        let last = before.posture.len().saturating_sub(2);
        if beam.alike(&before, &best.0.hypothesis, last, STEPS) {
            break;
        }
        rivals = Vec::new();
    }
    best
}

/// Others, of which those that move no link by as much as postures are compared by are adjusted
/// like the best: polished from elsewhere a small wrist may be degrees off, on its way to the same
/// posture.
pub(crate) fn at_rest(
    refine: &Refine<'_>,
    (best, ..): &Settled,
    others: &[Polished],
    (near, all): (&[u32], &[u32]),
    fan: &dyn Fan,
) -> Vec<Polished> {
    let (h, prepared) = (&best.hypothesis, refine.prepared);
    let is_on_its_way = |other: &Hypothesis| {
        (0..h.posture.len()).any(|j| !prepared.leaf[j] && turn(h, other, j) > OTHER)
            && moved([prepared; 2], [h, other]).is_empty()
    };
    let at_rest = |other: &Polished| match is_on_its_way(&other.0) {
        true => end(&settle(refine, &other.0, (near, all), fan)),
        false => other.clone(),
    };
    fan.fan(others.iter().collect(), at_rest)
}

/// Postures that explain nearly as much and that beams and points together hardly like less, best
/// first, few.
fn near_rivals(
    (beam, refine): (&Beam<'_>, &Refine<'_>),
    others: &[Polished],
    (best, judgement, _): &Settled,
    near: &[u32],
    fan: &dyn Fan,
) -> Vec<Polished> {
    let least = judgement.explained - SHORT * judgement.explained.abs();
    let last = best.hypothesis.posture.len().saturating_sub(1);
    // Other values of a last joint that turns are looked at apart; one that slides closes a gun.
    let upto = if refine.is_prismatic(last) { last } else { last.saturating_sub(1) };
    let is_known = |a: &Hypothesis, b: &Hypothesis| beam.alike(a, b, upto, STEPS);
    let others = others.iter();
    let others = others.filter(|p| p.1.explained > least && !is_known(&best.hypothesis, &p.0));
    let mut all: Vec<(f64, &Polished)> = fan.fan(others.collect(), |p| {
        (lead(refine, (&best.hypothesis, judgement), p, near).iter().sum(), p)
    });
    all.retain(|(lead, _)| *lead < LEAD);
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut out: Vec<Polished> = Vec::new();
    for (_, other) in all {
        if out.len() < N_RIVALS && !out.iter().any(|p| is_known(&p.0, &other.0)) {
            out.push(other.clone());
        }
    }
    out
}

fn end((adjusted, judgement, _): &Settled) -> Polished {
    (adjusted.hypothesis.clone(), judgement.clone())
}

/// The best of a posture and others, and the rest.
fn compare(
    refine: &Refine<'_>,
    mut best: Settled,
    others: Vec<Polished>,
    (near, all): (&[u32], &[u32]),
    fan: &dyn Fan,
) -> (Settled, Vec<Polished>) {
    let mut rest = Vec::new();
    for polished in others {
        let least = best.1.explained - FLIP_SHORT * best.1.explained.abs();
        if polished.1.explained < least {
            rest.push(polished);
            continue;
        }
        let mut other = settle(refine, &polished.0, (near, all), fan);
        let ahead = lead(refine, (&best.0.hypothesis, &best.1), &end(&other), near);
        if ahead.iter().sum::<f64>() < 0.0 {
            std::mem::swap(&mut best, &mut other);
        }
        rest.push(end(&other));
    }
    (best, rest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cubes::with_jaw;

    #[test]
    fn only_a_jaw_that_slid_is_told_by_beams_alone() {
        with_jaw(|refine, state| {
            let own = &state.hypothesis;
            let slid = |posture: [f64; 2]| {
                let other = Hypothesis { posture: posture.to_vec(), ..own.clone() };
                is_slid(refine, own, &other)
            };
            assert!(slid([0.0, 0.02]) && slid([0.01, -0.02]));
            assert!(!slid([0.1, 0.02]) && !slid([0.1, 0.0]) && !slid([0.0, 0.005]));
        });
    }
}
