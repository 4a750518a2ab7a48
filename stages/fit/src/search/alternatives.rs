//! Finds other postures that are worth refining, from one that is fitted: other values of one
//! joint, the base turned under the robot, the flipped wrist, and a new search from the first joint
//! whose links the beams contradict (METHOD.md §9).

use geometry::angle;
use nalgebra::UnitQuaternion;
use robot::JointKind;
use std::f64::consts::{PI, TAU};

use super::{BeamSearch, PeakSweep, Sampling, sort};
use crate::problem::Judgement;
use crate::state::Hypothesis;

/// Share of the links' and the whole score that an alternative may lack and still be refined.
const SCORE_SHORT: f64 = 0.15;
/// What makes a link be searched anew (METHOD.md §9): beams contradict it.
struct ContradictedLink {
    /// Most of its surface that beams may go through, as a share of what was judged.
    max_violated: f32,
    /// Least of its judged surface that must be met.
    min_matched: f32,
    /// Least of its surface that must have been judged to say so.
    min_seen: f32,
}

const CONTRADICTED: ContradictedLink =
    ContradictedLink { max_violated: 0.06, min_matched: 0.35, min_seen: 0.05 };

/// How a base is turned to where it explains as much.
struct TurnedBase {
    /// Yaws that are tried: every 2°. In that arc the base's corners move by half of the
    /// tolerance.
    n_yaws: usize,
    /// Share of the search's tolerance with which they are scored: where the base stands is known.
    tolerance: f64,
    /// Share of its surface by which a yaw may explain less than the one found: the best may lie
    /// between two.
    short: f64,
    /// Most turned bases that are refined: a square foot has three beside its own.
    most: usize,
}

const TURNED: TurnedBase = TurnedBase { n_yaws: 180, tolerance: 0.5, short: 0.05, most: 4 };

/// Hypotheses of a new search that are refined.
const N_AGAIN: usize = 10;

/// Most hypotheses to be refined that differ in their last joint only.
const N_FLANGES: usize = 3;
/// Sweep steps up to which the other joints of two hypotheses are the same for that.
const WRIST_STEPS: f64 = 6.0;
/// Sweep steps from the posture's own value from which on another maximum of a joint is another
/// value.
const OTHER_STEPS: f64 = 2.5;
/// A mirrored joint that is beyond its limit by no more than this is put to its limit, radians.
const BEYOND_LIMIT: f64 = 3.0_f64.to_radians();
/// Least amplitude of the cosine between the outer axes of three joints, as the middle one turns,
/// for a flip of the three.
const MIN_MIRRORED: f64 = 0.5;

impl BeamSearch<'_> {
    /// Other values of single joints that score nearly as well as these or better, best first.
    pub(crate) fn alternatives(&self, h: &Hypothesis) -> Vec<Hypothesis> {
        let joints = (0..h.posture.len()).collect();
        let found = self.problem.fan.fan(joints, |free| self.other_values(h, free));
        let mut out: Vec<Hypothesis> = found.into_iter().flatten().collect();
        sort(&mut out);
        out.truncate(self.settings().n_polish);
        out.extend(self.turned_bases(h));
        out
    }

    /// The base turned under the robot, its first joint turned back: what stands on it stays. A
    /// round base shows its yaw by a connector box only.
    fn turned_bases(&self, h: &Hypothesis) -> Vec<Hypothesis> {
        let model = self.problem.prepared.model;
        let joint = &model.joints[model.free[0]];
        if self.problem.prepared.slides(0) || self.problem.prepared.fixed.is_empty() {
            return Vec::new();
        }
        let frame = model.poses(&h.posture)[joint.parent] * joint.parent_from_joint;
        let closely = || Sampling {
            tolerance: (TURNED.tolerance * self.steps.tolerance) as f32,
            n_samples: self.settings().n_judge,
        };
        let fixed = &self.problem.prepared.fixed;
        let turn = |k: usize| {
            let angle = TAU * k as f64 / TURNED.n_yaws as f64;
            let value = self.within_limits(0, h.posture[0] - angle)?;
            let spun = frame * UnitQuaternion::from_axis_angle(&joint.axis, angle);
            let mut next = h.clone();
            next.local_from_base = h.local_from_base * spun * frame.inverse();
            next.posture[0] = value;
            Some((self.score_at(&self.placed(&next, fixed), closely()), next))
        };
        let all: Vec<_> = (0..TURNED.n_yaws).map(turn).collect();
        let Some((own, _)) = &all[0] else { return Vec::new() };
        let score = |k: usize| all[k % TURNED.n_yaws].as_ref().map_or(f64::NEG_INFINITY, |a| a.0);
        let weight: f64 = fixed.iter().map(|&l| self.problem.prepared.links[l].weight).sum();
        let least = own - TURNED.short * weight;
        let is_peak = |k: &usize| {
            score(*k) > score(k + 1)
                && score(*k) >= score(k + TURNED.n_yaws - 1)
                && score(*k) >= least
        };
        let peaks = (2..TURNED.n_yaws - 1).filter(is_peak);
        let mut out: Vec<Hypothesis> = peaks
            .filter_map(|k| all[k].clone())
            .map(|(score, next)| Hypothesis { score: h.score + score - own, ..next })
            .collect();
        sort(&mut out);
        out.truncate(TURNED.most);
        out
    }

    /// Other maxima of one joint alone: a joint whose link nearly hides in its parent may have been
    /// caught at the wrong one.
    fn other_values(&self, h: &Hypothesis, free: usize) -> Vec<Hypothesis> {
        if self.problem.prepared.placed_by[free].is_empty() {
            return Vec::new();
        }
        let tolerance = self.steps.tolerance as f32;
        let moved = self.problem.prepared.carried(free);
        let own = self.score(h, &moved, tolerance);
        let sweep = self.steps.sweep(free);
        let apart = |value: f64| match self.problem.prepared.slides(free) {
            true => (value - h.posture[free]).abs(),
            false => angle::apart(value, h.posture[free]),
        };
        let far = |value: f64| apart(value) > OTHER_STEPS * sweep.span / sweep.n as f64;
        let least = own - SCORE_SHORT * (own.abs() + h.score.abs());
        // All that is carried moves farther than what the joint places.
        self.peaks(h, PeakSweep { free, stride: 1 }, &moved, tolerance)
            .into_iter()
            .filter(|(value, score)| far(*value) && *score > least)
            .map(|(value, score)| {
                let mut next = h.clone();
                next.posture[free] = value;
                next.score = h.score + score - own;
                next
            })
            .collect()
    }

    /// The other way to hold the same hand: for each three turning joints in a row the outer ones
    /// half a turn on, the middle one mirrored about the value at which the outer axes are
    /// parallel. Within limits, where it scores well.
    pub(crate) fn flips(&self, h: &Hypothesis) -> Vec<Hypothesis> {
        let tolerance = self.steps.tolerance as f32;
        let mut out = Vec::new();
        for first in 0..h.posture.len().saturating_sub(2) {
            let Some(middle) = self.mirror(h, first) else { continue };
            let moved = self.problem.prepared.carried(first);
            let own = self.score(h, &moved, tolerance);
            let mut next = h.clone();
            let turned = [
                h.posture[first] + PI,
                2.0 * middle - h.posture[first + 1],
                h.posture[first + 2] + PI,
            ];
            let values: Vec<f64> =
                (0..3).filter_map(|k| self.within_limits(first + k, turned[k])).collect();
            if values.len() < 3 {
                continue;
            }
            next.posture[first..first + 3].copy_from_slice(&values);
            let score = self.score(&next, &moved, tolerance);
            next.score = h.score + score - own;
            if score > own - SCORE_SHORT * (own.abs() + h.score.abs()) {
                out.push(next);
            }
        }
        out
    }

    /// Value of joint `first + 1` at which the axes of its neighbours are parallel; `None` where
    /// one of the three does not turn or nothing is mirrored by it.
    fn mirror(&self, h: &Hypothesis, first: usize) -> Option<f64> {
        let model = self.problem.prepared.model;
        let turns = |j: usize| model.joints[model.free[j]].kind != JointKind::Prismatic;
        if !(first..first + 3).all(turns) {
            return None;
        }
        // The cosine between the outer axes is A + B cos q + C sin q: three values tell.
        let mut posture = h.posture.clone();
        let cosine: Vec<f64> = (0..3)
            .map(|k| {
                posture[first + 1] = TAU / 3.0 * f64::from(k);
                let poses = model.poses(&posture);
                let axis = |j: usize| {
                    let joint = &model.joints[model.free[j]];
                    poses[joint.child].rotation * joint.axis.into_inner()
                };
                axis(first).dot(&axis(first + 2))
            })
            .collect();
        let b = (2.0 * cosine[0] - cosine[1] - cosine[2]) / 3.0;
        let c = (cosine[1] - cosine[2]) / 3.0_f64.sqrt();
        (b.hypot(c) > MIN_MIRRORED).then(|| c.atan2(b))
    }

    /// A value of a joint, whole turns added, within its limits; at a limit that it is only a
    /// little beyond, since what it was made of may be off.
    fn within_limits(&self, free: usize, value: f64) -> Option<f64> {
        let [low, high] = self.problem.prepared.model.limits(free);
        let value = angle::within(value, [low - BEYOND_LIMIT, high + BEYOND_LIMIT])?;
        Some(value.clamp(low, high))
    }

    /// A new search from the joint before the first link that the beams contradict; nothing where
    /// they contradict none.
    pub(crate) fn again(&self, h: &Hypothesis, judgement: &Judgement) -> Vec<Hypothesis> {
        let bad = |l: usize| {
            let probe = &judgement.probes[l];
            let matched = probe.n_on as f32 / probe.n_seen.max(1) as f32;
            probe.seen() > CONTRADICTED.min_seen
                && (probe.violation() > CONTRADICTED.max_violated
                    || matched < CONTRADICTED.min_matched)
        };
        let first_bad =
            self.problem.prepared.placed_by.iter().position(|links| links.iter().any(|&l| bad(l)));
        let Some(first) = first_bad.map(|j| j.saturating_sub(1)) else { return Vec::new() };
        let mut links = self.problem.prepared.fixed.clone();
        self.problem.prepared.placed_by[..first].iter().for_each(|placed| links.extend(placed));
        let mut start = h.clone();
        start.score = self.score(h, &links, self.steps.tolerance as f32);
        self.varied(self.resume(vec![start], first), N_AGAIN)
    }

    /// The first `n` of some hypotheses, few of those that differ in their last joint only: a
    /// flange that may stand anywhere must not crowd out another wrist.
    pub(crate) fn varied(&self, found: Vec<Hypothesis>, n: usize) -> Vec<Hypothesis> {
        let mut kept: Vec<Hypothesis> = Vec::new();
        for next in found {
            let upto = next.posture.len().saturating_sub(2);
            let alike = |k: &&Hypothesis| self.steps.alike(k, &next, upto, WRIST_STEPS);
            if kept.len() < n && kept.iter().filter(alike).count() < N_FLANGES {
                kept.push(next);
            }
        }
        kept
    }
}
