//! Base poses in; out come postures that the beams allow, best first: a beam search along the joints, in which every
//! local maximum of every sweep competes with all others (METHOD.md §8, §9).

use contract::Fan;
use geometry::probe::HIDDEN_PRICE;
use geometry::{Pose, Vector};

use crate::{Prepared, Scene, Settings};

/// A base pose (local frame) and a posture of which the first joints are set.
#[derive(Debug, Clone)]
pub(crate) struct Hypothesis {
    pub(crate) local_from_base: Pose,
    pub(crate) posture: Vec<f64>,
    /// Sum over placed links of √area · mean sample score.
    pub(crate) score: f64,
}

/// Mean score by which a value may lag behind the best on a quarter of the samples and still be looked at: three of
/// that mean's standard deviations.
const HOPELESS: f64 = 0.4;

/// The search for one model's posture.
pub(crate) struct Beam<'a> {
    pub(crate) prepared: &'a Prepared<'a>,
    pub(crate) scene: &'a Scene<'a>,
    pub(crate) settings: &'a Settings,
    /// What a link may be off and still score, metres.
    pub(crate) tolerance: f64,
}

/// Mean score of the links placed so far down to which a search goes on: half of what it is where no beam reached any of them, as
/// a bench or the arm itself may hide a foot.
const MOST_HIDDEN: f64 = 0.5 * HIDDEN_PRICE as f64;
/// A base is turned by half and a quarter of this to settle it, radians: what its foot shows of its yaw.
const SHAKEN_YAW: f64 = 0.03;
/// Tolerance where what carries the searched links is fitted already, metres (METHOD.md §9).
const FITTED: f64 = 0.02;

impl<'a> Beam<'a> {
    /// For postures of which nothing is known.
    pub(crate) fn new(
        prepared: &'a Prepared<'a>,
        scene: &'a Scene<'a>,
        settings: &'a Settings,
    ) -> Self {
        Self { prepared, scene, settings, tolerance: settings.search_tolerance }
    }

    /// For links whose carriers are fitted already: a small wrist fits many places to within a hand's width.
    pub(crate) fn fitted(&self) -> Self {
        Self { tolerance: self.tolerance.min(FITTED), ..*self }
    }
}

impl Beam<'_> {
    /// The best hypotheses over all joints, best first.
    pub(crate) fn run(&self, bases: &[Pose], fan: &impl Fan) -> Vec<Hypothesis> {
        let home = self.prepared.model.home();
        let tolerance = self.tolerance as f32;
        let beam: Vec<Hypothesis> = bases
            .iter()
            .map(|base| {
                let mut h =
                    Hypothesis { local_from_base: *base, posture: home.clone(), score: 0.0 };
                h.score = self.score(&h, &self.prepared.fixed, tolerance);
                h
            })
            .collect();
        self.resume(beam, 0, fan)
    }

    /// Goes on from hypotheses whose joints before `first` are set and scored.
    pub(crate) fn resume(
        &self,
        mut beam: Vec<Hypothesis>,
        first: usize,
        fan: &impl Fan,
    ) -> Vec<Hypothesis> {
        let (tolerance, n) = (self.tolerance as f32, self.prepared.placed_by.len());
        for free in first..n {
            if self.prepared.placed_by[free].is_empty() {
                continue;
            }
            let extended = fan.fan(beam, |h| self.extend(&h, free, tolerance));
            let mut next: Vec<Hypothesis> = extended.into_iter().flatten().collect();
            self.keep_best(&mut next, free);
            let rest = next.split_off(self.settings.settle.min(next.len()));
            next = fan.fan(next, |mut h| {
                self.settle(&mut h, free);
                h
            });
            next.extend(rest);
            sort(&mut next);
            // Not one hypothesis explains more than the beams contradict: no robot of this model stands here.
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
        let placed = self.prepared.placed_by[..=upto].iter().flatten();
        self.prepared.fixed.iter().chain(placed).map(|&l| self.prepared.links[l].weight).sum()
    }

    /// Weighted score of some links.
    pub(crate) fn score(&self, h: &Hypothesis, links: &[usize], tolerance: f32) -> f64 {
        self.score_at(&self.placed(h, links), (tolerance, self.settings.n_search))
    }

    /// Where some links stand, local frame.
    pub(crate) fn placed(&self, h: &Hypothesis, links: &[usize]) -> Vec<(usize, Pose)> {
        let poses = self.prepared.model.poses(&h.posture);
        links.iter().map(|&l| (l, h.local_from_base * poses[l])).collect()
    }

    /// Weighted score of so many samples of each link.
    pub(crate) fn score_at(
        &self,
        placed: &[(usize, Pose)],
        (tolerance, n_samples): (f32, usize),
    ) -> f64 {
        let score = |(l, pose): &(usize, Pose)| {
            let (points, normals) = self.prepared.samples(*l, n_samples);
            let probe = self.scene.scouts.probe(points, normals, pose, tolerance);
            self.prepared.links[*l].weight * f64::from(probe.mean())
        };
        placed.iter().map(score).sum()
    }

    /// All values of a sweep of one joint, each with the score of what it places added.
    pub(crate) fn every(&self, h: &Hypothesis, free: usize, fan: &impl Fan) -> Vec<Hypothesis> {
        let (low, span, n) = self.sweep(free);
        let links = &self.prepared.placed_by[free];
        fan.fan((0..n).collect(), |k| {
            let mut next = h.clone();
            next.posture[free] = low + span * k as f64 / n as f64;
            next.score += self.score(&next, links, self.tolerance as f32);
            next
        })
    }

    /// All local maxima of a sweep of one joint, each with the score of what it places added.
    fn extend(&self, h: &Hypothesis, free: usize, tolerance: f32) -> Vec<Hypothesis> {
        let links = &self.prepared.placed_by[free];
        let extended = |(value, score): (f64, f64)| {
            let mut next = h.clone();
            next.posture[free] = value;
            next.score += score;
            next
        };
        self.peaks(h, free, links, tolerance).into_iter().map(extended).collect()
    }

    /// Start, span and number of steps of a joint's sweep: an arc step moves its samples by the tolerance at most.
    pub(crate) fn sweep(&self, free: usize) -> (f64, f64, usize) {
        let [low, high] = self.prepared.model.limits(free);
        let tolerance = self.tolerance;
        let (span, step) = if self.prepared.slides(free) {
            (high - low, tolerance / 2.0)
        } else {
            let arc = tolerance / self.prepared.lever[free];
            ((high - low).min(std::f64::consts::TAU), arc.clamp(0.01, self.settings.max_step))
        };
        (low, span, (span / step).ceil().max(1.0) as usize)
    }

    /// Sorts, drops near twins, and cuts to the beam's width.
    fn keep_best(&self, beam: &mut Vec<Hypothesis>, upto: usize) {
        sort(beam);
        let mut kept: Vec<Hypothesis> = Vec::with_capacity(self.settings.beam);
        for h in beam.drain(..) {
            if kept.len() == self.settings.beam {
                break;
            }
            if !kept.iter().any(|k| self.alike(k, &h, upto, 1.2)) {
                kept.push(h);
            }
        }
        *beam = kept;
    }

    /// Whether two hypotheses agree to within `steps` sweep steps in all joints set, and in the base.
    pub(crate) fn alike(&self, a: &Hypothesis, b: &Hypothesis, upto: usize, steps: f64) -> bool {
        let tolerance = self.tolerance;
        let shift =
            (a.local_from_base.translation.vector - b.local_from_base.translation.vector).norm();
        let turn = a.local_from_base.rotation.angle_to(&b.local_from_base.rotation);
        shift < 0.5 * tolerance
            && turn < 0.03
            && (0..=upto).all(|j| {
                let (_, span, n) = self.sweep(j);
                (a.posture[j] - b.posture[j]).abs() <= steps * span / n as f64
            })
    }

    /// Shakes base and joints set so far, one by one, in halving steps, while the score of all placed links rises:
    /// errors of a parent must not pile up in its children.
    fn settle(&self, h: &mut Hypothesis, upto: usize) {
        let tolerance = (0.7 * self.tolerance) as f32;
        // Scores of the links that each joint places, the base's first: a joint leaves those before it as they are.
        let placed = |j: usize| &self.prepared.placed_by[j];
        let mut parts: Vec<f64> = vec![self.score(h, &self.prepared.fixed, tolerance)];
        parts.extend((0..=upto).map(|j| self.score(h, placed(j), tolerance)));
        for step in [0.5, 0.25] {
            for j in (0..=upto).rev() {
                let (_, span, n) = self.sweep(j);
                let d = step * span / n as f64;
                let limits = self.prepared.model.limits(j);
                self.climb(h, (j + 1, &mut parts), tolerance, |h, sign| {
                    h.posture[j] = (h.posture[j] + sign * d).clamp(limits[0], limits[1]);
                });
            }
            // Along what it stands on, and about the axis that is upright there.
            let shift = 0.4 * step * self.tolerance;
            let shakes = [
                Pose::translation(shift, 0.0, 0.0),
                Pose::translation(0.0, shift, 0.0),
                Pose::rotation(Vector::z() * (step * SHAKEN_YAW)),
            ];
            for shake in shakes {
                self.climb(h, (0, &mut parts), tolerance, |h, sign| {
                    h.local_from_base *= if sign > 0.0 { shake } else { shake.inverse() };
                });
            }
        }
        h.score = parts.iter().sum();
    }

    /// Takes the shaken hypothesis if its score is higher, with the scores of its parts; those before `first` stay.
    fn climb(
        &self,
        h: &mut Hypothesis,
        (first, parts): (usize, &mut [f64]),
        tolerance: f32,
        shake: impl Fn(&mut Hypothesis, f64),
    ) {
        let top: f64 = parts[first..].iter().sum();
        for sign in [1.0, -1.0] {
            let mut trial = h.clone();
            shake(&mut trial, sign);
            let links = |part: usize| match part {
                0 => &self.prepared.fixed,
                j => &self.prepared.placed_by[j - 1],
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

    /// Values of a joint at which the score of some links is a local maximum, with that score.
    pub(crate) fn peaks(
        &self,
        h: &Hypothesis,
        free: usize,
        links: &[usize],
        tolerance: f32,
    ) -> Vec<(f64, f64)> {
        let (low, span, n) = self.sweep(free);
        let mut trial = h.clone();
        let values: Vec<f64> = (0..=n).map(|k| low + span * k as f64 / n as f64).collect();
        let mut at = |value: &f64| {
            trial.posture[free] = *value;
            self.placed(&trial, links)
        };
        let placed: Vec<_> = values.iter().map(&mut at).collect();
        let score = |k: usize, n_samples: usize| self.score_at(&placed[k], (tolerance, n_samples));
        // A few samples tell most values to be hopeless.
        let few: Vec<f64> = (0..=n).map(|k| score(k, self.settings.n_search / 4)).collect();
        let weight: f64 = links.iter().map(|&l| self.prepared.links[l].weight).sum();
        let hopeless = few.iter().fold(f64::NEG_INFINITY, |a, b| a.max(*b)) - HOPELESS * weight;
        let full = |k| if few[k] < hopeless { few[k] } else { score(k, self.settings.n_search) };
        let scores: Vec<f64> = (0..=n).map(full).collect();
        (0..=n)
            .filter(|&k| {
                few[k] >= hopeless
                    && (k == 0 || scores[k] > scores[k - 1])
                    && (k == n || scores[k] >= scores[k + 1])
            })
            .map(|k| (values[k], scores[k]))
            .collect()
    }
}

pub(crate) fn sort(beam: &mut [Hypothesis]) {
    beam.sort_by(|a, b| b.score.total_cmp(&a.score));
}
