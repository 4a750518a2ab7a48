//! Finds other bends of the joint before an open flange, each at the turn of the flange that suits
//! it best, and how well the points fit there (METHOD.md §9).
//!
//! A flange that is turned wrongly pulls the wrist with it, by degrees where a hundred points lie
//! on both. Neither joint alone finds the way back, and the valley there is as narrow as that of
//! the right turn.

use geometry::{Point, angle};
use std::f64::consts::TAU;

use super::settings::{MODES, WristLimits};
use super::settled::JointModes;
use crate::adjust::{Adjust, Adjusted};
use crate::correspond::{AdjustPoints, spheres};
use crate::problem::{AdjustState, Problem};
use crate::state::Hypothesis;

const LIMITS: WristLimits = MODES.wrist;

/// Bends of a wrist.
pub(crate) struct WristModes {
    /// The joint that bends it, the last but one.
    pub(crate) joint: usize,
    /// Where it was adjusted to.
    own: f64,
    /// Each with the best turn of the flange, and half the robust squares of all points over their
    /// variance.
    bends: Vec<Bend>,
}

#[derive(Clone, Copy)]
struct Bend {
    bend: f64,
    turn: f64,
    cost: f64,
}

impl WristModes {
    /// `None` where the flange is not open, or the joint before it is known.
    pub(crate) fn of(
        problem: &Problem<'_>,
        best: &Adjusted,
        leaves: &[JointModes],
        points: &AdjustPoints,
    ) -> Option<Self> {
        let at = 6 + best.hypothesis.posture.len().checked_sub(2)?;
        let is_known = best.covariance[(at, at)] < LIMITS.known * LIMITS.known;
        if is_known { None } else { Self::at(problem, &best.state(), leaves, points) }
    }

    fn at(
        problem: &Problem<'_>,
        state: &AdjustState,
        leaves: &[JointModes],
        points: &AdjustPoints,
    ) -> Option<Self> {
        let (prepared, h) = (problem.prepared, &state.hypothesis);
        let flange = leaves.iter().find(|modes| modes.is_several())?.joint;
        let joint = flange.checked_sub(1).filter(|_| flange + 1 == h.posture.len())?;
        if prepared.slides(joint) || prepared.leaf[joint] {
            return None;
        }
        let points = about(problem, h, joint, points);
        if points.points().is_empty() || points.points().len() > LIMITS.max_points {
            return None;
        }
        let asked = points.about(LIMITS.asked);
        let share = asked.points().len() as f64 / points.points().len() as f64;
        let (bends, turns) = (bends(problem, h, joint), turns(problem, h, flange));
        let adjust = Adjust::new(problem);
        let cost = |(bend, turn): (f64, f64)| {
            let mut state = state.clone();
            state.hypothesis.posture[joint] = bend;
            state.hypothesis.posture[flange] = turn;
            Bend { bend, turn, cost: adjust.cost(&state, &asked) / share }
        };
        let all = bends.iter().flat_map(|bend| turns.iter().map(|turn| (*bend, *turn)));
        let all = problem.fan.fan(all.collect(), cost);
        let least = |row: &[Bend]| row.iter().copied().min_by(|a, b| a.cost.total_cmp(&b.cost));
        let bends = all.chunks(turns.len()).filter_map(least).collect();
        Some(Self { joint, own: h.posture[joint], bends })
    }

    /// A posture bent to where the points fit best, where they fit clearly better there.
    pub(crate) fn better(&self, h: &Hypothesis) -> Option<Hypothesis> {
        let own = self.bends.iter().find(|b| b.bend == self.own)?;
        let best = self.bends.iter().min_by(|a, b| a.cost.total_cmp(&b.cost))?;
        (best.cost + LIMITS.lead < own.cost).then(|| {
            let mut other = h.clone();
            other.posture[self.joint] = best.bend;
            other.posture[self.joint + 1] = best.turn;
            other
        })
    }

    /// Mean square of the bends from the posture's own, each as likely as the points make it,
    /// radians².
    pub(crate) fn variance(&self) -> f64 {
        let least = self.bends.iter().map(|b| b.cost).fold(f64::INFINITY, f64::min);
        let [sum, total] = self.bends.iter().fold([0.0; 2], |[sum, total], b| {
            let weight = ((least - b.cost) / LIMITS.alike).exp();
            [sum + weight * (b.bend - self.own).powi(2), total + weight]
        });
        sum / total
    }
}

/// Where another adjustment ended, and its points.
pub(crate) struct OtherEnd<'e> {
    pub(crate) hypothesis: &'e Hypothesis,
    pub(crate) points: &'e AdjustPoints,
}

/// How much better points fit where another adjustment ended, as the scans are off at the first:
/// half their robust squares over their variance. Asked are those about what `joint` moves in
/// either.
pub(crate) fn gain(
    problem: &Problem<'_>,
    state: &AdjustState,
    points: &AdjustPoints,
    other: &OtherEnd<'_>,
    joint: usize,
) -> f64 {
    let OtherEnd { hypothesis: other, points: others } = *other;
    let own = about(problem, &state.hypothesis, joint, points);
    let all = own.with(&about(problem, other, joint, others));
    let adjust = Adjust::new(problem);
    let there = AdjustState { hypothesis: other.clone(), ..state.clone() };
    adjust.cost(state, &all) - adjust.cost(&there, &all)
}

/// Points that lie about what a joint moves, and on nothing else.
fn about(
    problem: &Problem<'_>,
    h: &Hypothesis,
    joint: usize,
    points: &AdjustPoints,
) -> AdjustPoints {
    let moved = problem.prepared.carried(joint);
    let [_, turning] = points.parted(&moved);
    let spheres = spheres(problem, h, &moved);
    let is_about = |i: &u32| {
        let p = Point::from(problem.scene.points[*i as usize].p.map(f64::from));
        spheres.iter().any(|(c, r)| (p - c).norm() < *r)
    };
    let is_about: Vec<bool> = turning.points().iter().map(is_about).collect();
    turning.kept(&is_about)
}

/// Bends that are tried, the posture's own among them.
fn bends(problem: &Problem<'_>, h: &Hypothesis, joint: usize) -> Vec<f64> {
    let lever = problem.prepared.lever[joint];
    let (most, step) = (LIMITS.far.at(lever), LIMITS.step.at(lever));
    let n = (most / step).ceil() as i32;
    let [low, high] = problem.prepared.model.limits(joint);
    let all = (-n..=n).map(|k| (k, h.posture[joint] + step * f64::from(k)));
    all.filter(|(k, v)| *k == 0 || (low..=high).contains(v)).map(|(_, v)| v).collect()
}

/// Turns of the flange that are tried, likewise.
fn turns(problem: &Problem<'_>, h: &Hypothesis, flange: usize) -> Vec<f64> {
    let n = TAU * problem.prepared.lever[flange] / LIMITS.turn_step;
    let n = n.ceil().clamp(LIMITS.least_turns, LIMITS.most_turns);
    let (own, limits) = (h.posture[flange], problem.prepared.model.limits(flange));
    let others = (1..n as usize).filter_map(|k| angle::within(own + TAU * k as f64 / n, limits));
    std::iter::once(own).chain(others).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::before_plate;

    /// What is asked of a plate's wrist where it is looked at as bent and turned by so much.
    fn of(posture: [f64; 2], look: impl Fn(&WristModes, &Hypothesis)) {
        let places: Vec<[f64; 2]> =
            (0..225).map(|i| [i % 15, i / 15].map(|k| 0.006 * f64::from(k) - 0.042)).collect();
        before_plate(&places, posture, |problem, state| {
            let points = AdjustPoints::new((0..225).collect(), 0.02);
            let values = vec![posture[1], posture[1] + 1.6];
            let modes = JointModes { joint: 1, values, extent: 0.0 };
            let wrist = WristModes::at(problem, state, &[modes], &points);
            look(&wrist.expect("a wrist"), &state.hypothesis);
        });
    }

    #[test]
    fn a_wrist_that_is_bent_away_from_its_points_is_bent_back() {
        of([0.1, 0.6], |wrist, h| {
            let better = wrist.better(h).expect("another bend").posture;
            assert!(better[0].abs() < LIMITS.step.angle, "{better:?}");
            assert!(wrist.variance().sqrt() > 0.08, "{}", wrist.variance().sqrt());
        });
        of([0.0, 0.6], |wrist, h| {
            assert!(wrist.better(h).is_none());
            assert!(wrist.variance().sqrt() < 0.005, "{}", wrist.variance().sqrt());
        });
    }

    #[test]
    fn bends_that_fit_alike_are_as_likely() {
        let bend = |bend: f64| Bend { bend, turn: 0.0, cost: 7.0 };
        let wrist = WristModes { joint: 0, own: 0.0, bends: [-0.02, 0.0, 0.02].map(bend).to_vec() };
        assert!((wrist.variance() - 0.0008 / 3.0).abs() < 1e-12);
    }
}
