//! First phase: finds hypotheses, postures that the beams allow, from base poses. It is a beam
//! search along the joints, in which every local maximum of every sweep, to within its steps,
//! competes with all others (METHOD.md §8, §9).

mod alternatives;

use geometry::probe::HIDDEN_PRICE;
use geometry::{Pose, Probe, Vector};
use std::ops::Range;

use crate::problem::{Problem, SweepSteps};
use crate::state::Hypothesis;
use crate::{Prepared, Settings};

/// Mean score by which a value may lag behind the best on a quarter of the samples and still be
/// looked at: three of that mean's standard deviations.
const HOPELESS: f64 = 0.4;

/// Share of the tolerance by which two steps of a sweep may move samples, so that every second
/// value is enough to find its maxima.
const FINE_ARC: f64 = 0.67;

/// Mean score of the links placed so far down to which a search goes on: half of what it is where
/// no beam reached any of them, as a bench or the arm itself may hide a foot.
const MOST_HIDDEN: f64 = 0.5 * HIDDEN_PRICE as f64;

/// How joints and bases are shaken to settle them.
struct Shakes {
    /// Shares of a sweep step, one after the other.
    steps: [f64; 2],
    /// Share of the tolerance by which a base is shifted, times the share of the step.
    shift: f64,
    /// A base is turned by so much, radians, times the share of the step: what its foot shows of
    /// its yaw.
    yaw: f64,
    /// Turning joints with which the base is shaken: the small links after those say little of it.
    n_joints: usize,
}

const SHAKES: Shakes = Shakes { steps: [0.5, 0.25], shift: 0.4, yaw: 0.03, n_joints: 3 };
/// Share of the tolerance with which settled hypotheses are scored.
const SETTLE_TOLERANCE: f64 = 0.7;
/// Sweep steps within which, in all joints set so far, two hypotheses are one.
const TWIN_STEPS: f64 = 1.2;
/// Tolerance where what carries the searched links is fitted already, metres (METHOD.md §9).
const FITTED_TOLERANCE: f64 = 0.02;

/// The search for one model's posture.
#[derive(Clone, Copy)]
pub(crate) struct BeamSearch<'a> {
    problem: Problem<'a>,
    /// How joints are swept, and what a link may be off and still score.
    pub(crate) steps: SweepSteps<'a>,
}

/// How closely links are looked at.
struct Sampling {
    /// What a link may be off and still score, metres.
    tolerance: f32,
    /// Samples of a link.
    n_samples: usize,
}

/// The values of a joint's sweep among which maxima are looked for.
struct PeakSweep {
    /// The free joint.
    free: usize,
    /// One value of so many is looked at first.
    stride: usize,
}

/// Scores of what a base and each joint place, of which those before `first` stay.
struct PartScores<'p> {
    first: usize,
    all: &'p mut [f64],
}

impl<'a> BeamSearch<'a> {
    /// A search for postures of which nothing is known.
    pub(crate) fn new(problem: &Problem<'a>) -> Self {
        let steps = SweepSteps::new(problem, problem.settings.search_tolerance);
        Self { problem: *problem, steps }
    }

    /// For links whose carriers are fitted already: a small wrist fits many places to within a
    /// hand's width.
    pub(crate) fn fitted(&self) -> Self {
        let tolerance = self.steps.tolerance.min(FITTED_TOLERANCE);
        Self { steps: self.steps.with_tolerance(tolerance), ..*self }
    }
}

impl BeamSearch<'_> {
    /// The best hypotheses over all joints, best first.
    pub(crate) fn run(&self, bases: &[Pose]) -> Vec<Hypothesis> {
        let home = self.prepared().model.home();
        let tolerance = self.steps.tolerance as f32;
        let beam: Vec<Hypothesis> = bases
            .iter()
            .map(|base| {
                let mut h = Hypothesis::at(*base, home.clone());
                h.score = self.score(&h, &self.prepared().fixed, tolerance);
                h
            })
            .collect();
        self.resume(beam, 0)
    }

    /// Goes on from hypotheses whose joints before `first` are set and scored.
    pub(crate) fn resume(&self, mut beam: Vec<Hypothesis>, first: usize) -> Vec<Hypothesis> {
        let (tolerance, n) = (self.steps.tolerance as f32, self.prepared().placed_by.len());
        for free in first..n {
            if self.prepared().placed_by[free].is_empty() {
                continue;
            }
            let fan = self.problem.fan;
            let extended = fan.fan(beam, |h| self.extend(&h, free, tolerance));
            let mut next: Vec<Hypothesis> = extended.into_iter().flatten().collect();
            self.keep_best(&mut next, free);
            let rest = next.split_off(self.settings().settle.min(next.len()));
            next = fan.fan(next, |mut h| {
                self.settle(&mut h, free);
                h
            });
            next.extend(rest);
            sort(&mut next);
            // Not one hypothesis explains more than the beams contradict: no robot of this model
            // stands here.
            let least = if free + 1 < n { -MOST_HIDDEN * self.weight(free) } else { 0.0 };
            if next.first().is_none_or(|h| h.score <= least) {
                return Vec::new();
            }
            beam = next;
        }
        beam
    }

    /// Weight of all links that the joints up to one place.
    fn weight(&self, upto: usize) -> f64 {
        let placed = self.prepared().placed_by[..=upto].iter().flatten();
        self.prepared().fixed.iter().chain(placed).map(|&l| self.prepared().links[l].weight).sum()
    }

    /// Weighted score of some links.
    pub(crate) fn score(&self, h: &Hypothesis, links: &[usize], tolerance: f32) -> f64 {
        let n_samples = self.settings().n_search;
        self.score_at(&self.placed(h, links), Sampling { tolerance, n_samples })
    }

    /// Where some links stand, local frame.
    pub(crate) fn placed(&self, h: &Hypothesis, links: &[usize]) -> Vec<(usize, Pose)> {
        let poses = self.prepared().model.poses(&h.posture);
        links.iter().map(|&l| (l, h.local_from_base * poses[l])).collect()
    }

    /// Weighted score of so many samples of each link.
    fn score_at(
        &self,
        placed: &[(usize, Pose)],
        Sampling { tolerance, n_samples }: Sampling,
    ) -> f64 {
        self.weighted(placed, &self.probes(placed, tolerance, 0..n_samples, &[]))
    }

    /// What the scans say of the samples of each link, on top of what they say of those before
    /// them.
    fn probes(
        &self,
        placed: &[(usize, Pose)],
        tolerance: f32,
        which: Range<usize>,
        before: &[Probe],
    ) -> Vec<Probe> {
        let probe = |(at, (link, pose)): (usize, &(usize, Pose))| {
            let (points, normals) = self.prepared().samples(*link, which.end);
            let first = which.start.min(points.len());
            let (points, normals) = (&points[first..], &normals[first..]);
            let samples = geometry::SurfaceSamples { points, normals };
            let before = before.get(at).copied().unwrap_or_default();
            self.problem.scene.scouts.probe_more(before, samples, pose, tolerance)
        };
        placed.iter().enumerate().map(probe).collect()
    }

    /// Sum of the mean scores of links, each with the weight of its link.
    fn weighted(&self, placed: &[(usize, Pose)], probes: &[Probe]) -> f64 {
        let of = |((link, _), probe): (&(usize, Pose), &Probe)| {
            self.prepared().links[*link].weight * f64::from(probe.mean())
        };
        placed.iter().zip(probes).map(of).sum()
    }

    /// All values of a sweep of one joint, each with the score of what it places added.
    pub(crate) fn every(&self, h: &Hypothesis, free: usize) -> Vec<Hypothesis> {
        let sweep = self.steps.sweep(free);
        let links = &self.prepared().placed_by[free];
        self.problem.fan.fan((0..sweep.n).collect(), |k| {
            let mut next = h.clone();
            next.posture[free] = sweep.value(k);
            next.score += self.score(&next, links, self.steps.tolerance as f32);
            next
        })
    }

    /// All local maxima of a sweep of one joint, each with the score of what it places added.
    fn extend(&self, h: &Hypothesis, free: usize, tolerance: f32) -> Vec<Hypothesis> {
        let links = &self.prepared().placed_by[free];
        let extended = |(value, score): (f64, f64)| {
            let mut next = h.clone();
            next.posture[free] = value;
            next.score += score;
            next
        };
        let sweep = PeakSweep { free, stride: self.stride(free) };
        self.peaks(h, sweep, links, tolerance).into_iter().map(extended).collect()
    }

    /// Sorts, drops near twins, and cuts to the beam's width.
    fn keep_best(&self, beam: &mut Vec<Hypothesis>, upto: usize) {
        sort(beam);
        let mut kept: Vec<Hypothesis> = Vec::with_capacity(self.settings().beam);
        for h in beam.drain(..) {
            if kept.len() == self.settings().beam {
                break;
            }
            if !kept.iter().any(|k| self.steps.alike(k, &h, upto, TWIN_STEPS)) {
                kept.push(h);
            }
        }
        *beam = kept;
    }

    fn prepared(&self) -> &Prepared<'_> {
        self.problem.prepared
    }

    fn settings(&self) -> &Settings {
        self.problem.settings
    }

    /// Shakes the joints set so far, and the base with the first of them, one by one, in halving
    /// steps, while the score of all placed links rises: errors of a parent must not pile up in
    /// its children.
    fn settle(&self, h: &mut Hypothesis, upto: usize) {
        let tolerance = (SETTLE_TOLERANCE * self.steps.tolerance) as f32;
        // Scores of the links that each joint places, the base's first: a joint leaves those before
        // it as they are.
        let placed = |j: usize| &self.prepared().placed_by[j];
        let mut parts: Vec<f64> = vec![self.score(h, &self.prepared().fixed, tolerance)];
        parts.extend((0..=upto).map(|j| self.score(h, placed(j), tolerance)));
        let turns = |j: &usize| !self.prepared().slides(*j) && !placed(*j).is_empty();
        let is_shaken = (0..=upto).filter(turns).count() <= SHAKES.n_joints;
        for step in SHAKES.steps {
            for j in (0..=upto).rev() {
                let sweep = self.steps.sweep(j);
                let d = step * sweep.span / sweep.n as f64;
                let limits = self.prepared().model.limits(j);
                self.climb(
                    h,
                    PartScores { first: j + 1, all: &mut parts },
                    tolerance,
                    |h, sign| {
                        h.posture[j] = (h.posture[j] + sign * d).clamp(limits[0], limits[1]);
                    },
                );
            }
            if !is_shaken {
                continue;
            }
            // Along what it stands on, and about the axis that is upright there.
            let shift = SHAKES.shift * step * self.steps.tolerance;
            let shakes = [
                Pose::translation(shift, 0.0, 0.0),
                Pose::translation(0.0, shift, 0.0),
                Pose::rotation(Vector::z() * (step * SHAKES.yaw)),
            ];
            for shake in shakes {
                self.climb(h, PartScores { first: 0, all: &mut parts }, tolerance, |h, sign| {
                    h.local_from_base *= if sign > 0.0 { shake } else { shake.inverse() };
                });
            }
        }
        h.score = parts.iter().sum();
    }

    /// Takes the shaken hypothesis if its score is higher, with the scores of its parts; those
    /// before `first` stay.
    fn climb(
        &self,
        h: &mut Hypothesis,
        PartScores { first, all: parts }: PartScores<'_>,
        tolerance: f32,
        shake: impl Fn(&mut Hypothesis, f64),
    ) {
        let top: f64 = parts[first..].iter().sum();
        for sign in [1.0, -1.0] {
            let mut trial = h.clone();
            shake(&mut trial, sign);
            let links = |part: usize| match part {
                0 => &self.prepared().fixed,
                j => &self.prepared().placed_by[j - 1],
            };
            let next: Vec<f64> = (first..parts.len())
                .map(|part| self.score(&trial, links(part), tolerance))
                .collect();
            if next.iter().sum::<f64>() > top {
                parts[first..].copy_from_slice(&next);
                *h = trial;
                return;
            }
        }
    }

    /// Values of a joint at which the score of some links is a local maximum, with that score: of
    /// every so many values of its sweep, and then of those beside each maximum among them.
    fn peaks(
        &self,
        h: &Hypothesis,
        PeakSweep { free, stride }: PeakSweep,
        links: &[usize],
        tolerance: f32,
    ) -> Vec<(f64, f64)> {
        let sweep = self.steps.sweep(free);
        let (n, value) = (sweep.n, |k: usize| sweep.value(k));
        let mut trial = h.clone();
        let mut place = |k: usize| {
            trial.posture[free] = value(k);
            self.placed(&trial, links)
        };
        let some: Vec<usize> = (0..n).step_by(stride).chain([n]).collect();
        let placed: Vec<Vec<(usize, Pose)>> = some.iter().map(|k| place(*k)).collect();
        // A few samples tell most values to be hopeless.
        let (n_few, n_all) = (self.settings().n_search / 4, self.settings().n_search);
        let probes = |at: &Vec<_>| self.probes(at, tolerance, 0..n_few, &[]);
        let probes: Vec<Vec<Probe>> = placed.iter().map(probes).collect();
        let few: Vec<f64> = placed.iter().zip(&probes).map(|(p, q)| self.weighted(p, q)).collect();
        let weight: f64 = links.iter().map(|&l| self.prepared().links[l].weight).sum();
        let hopeless = few.iter().fold(f64::NEG_INFINITY, |a, b| a.max(*b)) - HOPELESS * weight;
        let full = |i: usize| match few[i] < hopeless {
            true => few[i],
            false => {
                let all = self.probes(&placed[i], tolerance, n_few..n_all, &probes[i]);
                self.weighted(&placed[i], &all)
            }
        };
        let last = some.len() - 1;
        let scores: Vec<f64> = (0..=last).map(full).collect();
        let is_peak = |i: &usize| {
            few[*i] >= hopeless
                && (*i == 0 || scores[*i] > scores[i - 1])
                && (*i == last || scores[*i] >= scores[i + 1])
        };
        let mut highest = |i: usize| {
            let begin = some[i.saturating_sub(1)] + usize::from(i > 0);
            let end = some[(i + 1).min(last)] - usize::from(i < last);
            let beside = (begin..=end).filter(|k| *k != some[i]);
            let beside = beside
                .map(|k| (k, self.score_at(&place(k), Sampling { tolerance, n_samples: n_all })));
            let own = (some[i], scores[i]);
            beside.fold(own, |best, other| if other.1 > best.1 { other } else { best })
        };
        let peaks: Vec<usize> = (0..=last).filter(is_peak).collect();
        peaks.into_iter().map(&mut highest).map(|(k, score)| (value(k), score)).collect()
    }

    /// Steps from one value of a joint's sweep that is looked at to the next: two where they move
    /// the samples of the links that it places by less than what those are told apart by.
    fn stride(&self, free: usize) -> usize {
        let arc = self.steps.sweep(free).step() * self.prepared().lever[free];
        let is_fine = !self.prepared().slides(free) && 2.0 * arc <= FINE_ARC * self.steps.tolerance;
        // In a camera's bent view the right one of many low maxima is lost: one arm of eight.
        1 + usize::from(is_fine && !self.problem.scene.has_camera())
    }
}

pub(crate) fn sort(beam: &mut [Hypothesis]) {
    beam.sort_by(|a, b| b.score.total_cmp(&a.score));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::before_plate;

    #[test]
    fn every_second_value_leads_to_the_highest_of_all() {
        let along = |k: usize| 0.09 * (k as f64 / 40.0 - 0.5);
        let places: Vec<[f64; 2]> = (0..41 * 41).map(|k| [along(k % 41), along(k / 41)]).collect();
        before_plate(&places, [0.0, 0.0], |problem, state| {
            let search = BeamSearch::new(problem);
            let (h, tolerance) = (&state.hypothesis, search.steps.tolerance as f32);
            let plate = &problem.prepared.placed_by[1];
            let peaks = search.peaks(h, PeakSweep { free: 0, stride: 2 }, plate, tolerance);
            let sweep = search.steps.sweep(0);
            let (low, span, n) = (sweep.low, sweep.span, sweep.n);
            let score = |k: usize| {
                let posture = vec![low + span * k as f64 / n as f64, 0.0];
                search.score(&Hypothesis { posture, ..h.clone() }, plate, tolerance)
            };
            let all: Vec<f64> = (0..=n).map(score).collect();
            let highest = all.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let found = peaks.iter().map(|p| p.1).fold(f64::NEG_INFINITY, f64::max);
            assert!(highest > 0.0 && (found - highest).abs() < 1e-12, "{found} of {highest}");
            for (value, score) in &peaks {
                let k = ((value - low) / span * n as f64).round() as usize;
                let beside = [k.saturating_sub(1), (k + 1).min(n)];
                assert!(beside.iter().all(|k| all[*k] <= *score), "{value}");
            }
            assert_eq!((search.stride(0), search.stride(1)), (2, 2));
        });
    }
}
