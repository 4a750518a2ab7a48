//! An adjusted posture and its points in; out come other bends of the joint before an open flange,
//! each at the turn of the flange that suits it best, and how well the points fit there (METHOD.md
//! §9).
//!
//! A flange turned to where it is not pulls the wrist with it, by degrees where a hundred points
//! lie on both: neither joint alone finds back, and the valley there is as narrow as the right
//! one's.

use contract::Fan;
use geometry::Point;
use std::f64::consts::TAU;

use crate::adjust::{Adjust, Adjusted, State};
use crate::beam::Hypothesis;
use crate::refine::Refine;
use crate::sampled::Sampled;
use crate::spin::Spin;
use crate::turns;

/// More points on what the joint moves hold it, however the flange stands.
const MAX_POINTS: usize = 3000;
/// A joint that is stated better than this has one valley, radians (0.1°): those that were
/// elsewhere were stated to 0.25° and more.
const KNOWN: f64 = 0.001_75;
/// About so many of them are asked.
const ASKED: usize = 400;
/// Bends are tried up to this arc at the joint's lever to either side, and this far apart, metres:
/// the gate of the adjustment, the noise of its points …
const ARC: [f64; 2] = [0.015, 0.002];
/// … and by no more than this, radians: 12 and 1°.
const BEND: [f64; 2] = [0.21, 0.0175];
/// Turns of the flange are tried this far apart, metres at its lever, but so many at least and at
/// most.
const TURN_STEP: f64 = 0.006;
const N_TURNS: [f64; 2] = [36.0, 90.0];
/// What a bend's cost must be less by than the posture's own to be looked at: that of a point
/// beside all surface.
const LEAD: f64 = 3.7;
/// Costs by so much apart are as one for points that are right each by itself: those of a wrist lie
/// side by side, and err alike.
const ALIKE: f64 = 2.0;

/// Bends of a wrist.
pub(crate) struct Wrist {
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

impl Wrist {
    /// `None` where the flange is not open, or the joint before it is known.
    pub(crate) fn of(
        refine: &Refine<'_>,
        (best, spins): (&Adjusted, &[Spin]),
        points: &Sampled,
        fan: &dyn Fan,
    ) -> Option<Self> {
        let at = 6 + best.hypothesis.posture.len().checked_sub(2)?;
        let is_known = best.covariance[(at, at)] < KNOWN * KNOWN;
        if is_known { None } else { Self::at(refine, (&best.state(), spins), points, fan) }
    }

    fn at(
        refine: &Refine<'_>,
        (state, spins): (&State, &[Spin]),
        points: &Sampled,
        fan: &dyn Fan,
    ) -> Option<Self> {
        let (prepared, h) = (refine.prepared, &state.hypothesis);
        let flange = spins.iter().find(|s| s.values.len() > 1)?.joint;
        let joint = flange.checked_sub(1).filter(|_| flange + 1 == h.posture.len())?;
        if refine.is_prismatic(joint) || prepared.leaf[joint] {
            return None;
        }
        let points = about(refine, h, joint, points);
        if points.points().is_empty() || points.points().len() > MAX_POINTS {
            return None;
        }
        let asked = points.about(ASKED);
        let share = asked.points().len() as f64 / points.points().len() as f64;
        let (bends, turns) = (bends(refine, h, joint), turns(refine, h, flange));
        let adjust = Adjust::new(refine);
        let cost = |(bend, turn): (f64, f64)| {
            let mut state = state.clone();
            state.hypothesis.posture[joint] = bend;
            state.hypothesis.posture[flange] = turn;
            Bend { bend, turn, cost: adjust.cost(&state, &asked) / share }
        };
        let all = bends.iter().flat_map(|bend| turns.iter().map(|turn| (*bend, *turn)));
        let all = fan.fan(all.collect(), cost);
        let least = |row: &[Bend]| row.iter().copied().min_by(|a, b| a.cost.total_cmp(&b.cost));
        let bends = all.chunks(turns.len()).filter_map(least).collect();
        Some(Self { joint, own: h.posture[joint], bends })
    }

    /// A posture bent to where the points fit best, where they fit clearly better there.
    pub(crate) fn better(&self, h: &Hypothesis) -> Option<Hypothesis> {
        let own = self.bends.iter().find(|b| b.bend == self.own)?;
        let best = self.bends.iter().min_by(|a, b| a.cost.total_cmp(&b.cost))?;
        (best.cost + LEAD < own.cost).then(|| {
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
            let weight = ((least - b.cost) / ALIKE).exp();
            [sum + weight * (b.bend - self.own).powi(2), total + weight]
        });
        sum / total
    }
}

/// How much better points fit where another adjustment ended, as the scans are off at the first:
/// half their robust squares over their variance. Asked are those about what `joint` moves in
/// either.
pub(crate) fn gain(
    refine: &Refine<'_>,
    (state, points): (&State, &Sampled),
    (other, others): (&Hypothesis, &Sampled),
    joint: usize,
) -> f64 {
    let own = about(refine, &state.hypothesis, joint, points);
    let all = own.with(&about(refine, other, joint, others));
    let adjust = Adjust::new(refine);
    let there = State { hypothesis: other.clone(), ..state.clone() };
    adjust.cost(state, &all) - adjust.cost(&there, &all)
}

/// Points that lie about what a joint moves, and on nothing else.
fn about(refine: &Refine<'_>, h: &Hypothesis, joint: usize, points: &Sampled) -> Sampled {
    let moved = refine.prepared.carried(joint);
    let [_, turning] = points.parted(&moved);
    let spheres = refine.spheres(h, &moved);
    let is_about = |i: &u32| {
        let p = Point::from(refine.scene.points[*i as usize].p.map(f64::from));
        spheres.iter().any(|(c, r)| (p - c).norm() < *r)
    };
    let is_about: Vec<bool> = turning.points().iter().map(is_about).collect();
    turning.kept(&is_about)
}

/// Bends that are tried, the posture's own among them.
fn bends(refine: &Refine<'_>, h: &Hypothesis, joint: usize) -> Vec<f64> {
    let lever = refine.prepared.lever[joint];
    let [most, step] = [0, 1].map(|k| (ARC[k] / lever).min(BEND[k]));
    let n = (most / step).ceil() as i32;
    let [low, high] = refine.prepared.model.limits(joint);
    let all = (-n..=n).map(|k| (k, h.posture[joint] + step * f64::from(k)));
    all.filter(|(k, v)| *k == 0 || (low..=high).contains(v)).map(|(_, v)| v).collect()
}

/// Turns of the flange that are tried, likewise.
fn turns(refine: &Refine<'_>, h: &Hypothesis, flange: usize) -> Vec<f64> {
    let n = (TAU * refine.prepared.lever[flange] / TURN_STEP).ceil().clamp(N_TURNS[0], N_TURNS[1]);
    let (own, limits) = (h.posture[flange], refine.prepared.model.limits(flange));
    let others = (1..n as usize).filter_map(|k| turns::within(own + TAU * k as f64 / n, limits));
    std::iter::once(own).chain(others).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cubes::before_plate;
    use contract::OneByOne;

    /// What is asked of a plate's wrist where it is looked at as bent and turned by so much.
    fn of(posture: [f64; 2], look: impl Fn(&Wrist, &Hypothesis)) {
        let places: Vec<[f64; 2]> =
            (0..225).map(|i| [i % 15, i / 15].map(|k| 0.006 * f64::from(k) - 0.042)).collect();
        before_plate(&places, posture, |refine, state| {
            let points = Sampled::new((0..225).collect(), 0.02);
            let spin = Spin { joint: 1, values: vec![posture[1], posture[1] + 1.6], extent: 0.0 };
            let wrist = Wrist::at(refine, (state, &[spin]), &points, &OneByOne);
            look(&wrist.expect("a wrist"), &state.hypothesis);
        });
    }

    #[test]
    fn a_wrist_that_is_bent_away_from_its_points_is_bent_back() {
        of([0.1, 0.6], |wrist, h| {
            let better = wrist.better(h).expect("another bend").posture;
            assert!(better[0].abs() < BEND[1], "{better:?}");
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
        let wrist = Wrist { joint: 0, own: 0.0, bends: [-0.02, 0.0, 0.02].map(bend).to_vec() };
        assert!((wrist.variance() - 0.0008 / 3.0).abs() < 1e-12);
    }
}
