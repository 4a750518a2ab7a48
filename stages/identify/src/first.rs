//! A base pose under test in; out comes what the first moving link, swept over its joint, says of it: many a box looks like
//! a foot, but few look like a foot with a carousel on it.

use geometry::{Plane, Pose, Probe};

use crate::base::{BaseSearch, LAG};
use crate::trial::{Trial, of_judged, prefix};

/// Tolerances at which base and first link are judged in the end, metres: half a step of the finest grid.
const JUDGE: (f32, f32) = (0.04, 0.06);
/// Mean score of what could be judged: of the worse of base and first link, and of both. Of 125 robots that were found
/// none is below 0.64 and 0.70.
const LIKE: (f64, f64) = (0.5, 0.58);
/// Values of the first joint that are looked at with all samples at a glance.
const N_GLANCES: usize = 6;
/// Step of the first joint, radians.
const FIRST_STEP: f64 = 0.14;

impl BaseSearch<'_> {
    /// Whether what could be judged of the base and of the first link fits them: much of a cabinet has the height of a
    /// foot, but not its shape.
    pub(crate) fn is_like(&self, plane: &Plane, trial: &Trial) -> bool {
        if !self.sight.evidence.has_beams() {
            return true;
        }
        let local_from_root = self.pose(plane, trial.x, trial.y, trial.yaw);
        let cad = prefix(self.model, self.base, self.settings.n_fine);
        let pose = local_from_root * self.root_from_base;
        let base = of_judged(&self.sight.evidence.probe(cad.0, cad.1, &pose, JUDGE.0));
        if base < LIKE.0 {
            return false;
        }
        let first = self.first.map_or(base, |(free, link)| {
            if !self.sight.each.is_empty() {
                return of_judged(&self.first_apart(local_from_root, (free, link), JUDGE.1));
            }
            let poses = self.turns(free).map(|q| {
                let mut posture = self.model.home();
                posture[free] = q;
                local_from_root * self.model.poses(&posture)[link]
            });
            let cad = prefix(self.model, link, self.settings.n_coarse);
            let probes = poses.map(|pose| self.sight.evidence.probe(cad.0, cad.1, &pose, JUDGE.1));
            let best = probes.max_by(|a, b| self.sight.mean(a).total_cmp(&self.sight.mean(b)));
            best.map_or(base, |probe| of_judged(&probe))
        });
        base.min(first) >= LIKE.0 && 0.5 * (base + first) >= LIKE.1
    }

    /// Values of a joint over its range, at most one turn.
    fn turns(&self, free: usize) -> impl Iterator<Item = f64> + use<> {
        let [low, high] = self.model.limits(free);
        let span = (high - low).min(std::f64::consts::TAU);
        let n = (span / FIRST_STEP).ceil().max(1.0);
        (0..=n as usize).map(move |k| low + span * k as f64 / n)
    }

    /// The trial with the score of the base and of the first moving link at its best joint value.
    pub(crate) fn with_first(&self, plane: &Plane, trial: Trial, tolerance: f32) -> Trial {
        let own = self.score_base(plane, &trial, (tolerance, self.settings.n_fine));
        let Some(of_first) = self.first else { return Trial { score: own, ..trial } };
        let tolerance = tolerance * 1.5;
        let first = if self.sight.each.is_empty() {
            let cad = prefix(self.model, of_first.1, self.settings.n_coarse);
            let (poses, few) = self.sweep(plane, &trial, of_first, tolerance);
            let least = few.iter().fold(f64::NEG_INFINITY, |a, b| a.max(*b)) - LAG;
            let full = poses.iter().zip(&few).filter(|(_, few)| **few >= least);
            let score =
                |p: &Pose| self.sight.mean(&self.sight.evidence.probe(cad.0, cad.1, p, tolerance));
            full.map(|(p, _)| score(p)).fold(f64::NEG_INFINITY, f64::max)
        } else {
            let local_from_base = self.pose(plane, trial.x, trial.y, trial.yaw);
            let probe = self.first_apart(local_from_base, of_first, tolerance);
            // Each scan sees less than half of it.
            of_judged(&probe) * (2.0 * f64::from(probe.seen())).min(1.0)
        };
        Trial { score: self.joined(own, first), first, ..trial }
    }

    /// The same at a glance, to whatever score the base has already.
    pub(crate) fn glance_at_first(&self, plane: &Plane, trial: Trial, tolerance: f32) -> Trial {
        let Some(of_first) = self.first.filter(|_| self.sight.each.is_empty()) else {
            return trial;
        };
        let cad = prefix(self.model, of_first.1, self.settings.n_coarse);
        let (poses, few) = self.sweep(plane, &trial, of_first, tolerance);
        let mut best: Vec<usize> = (0..few.len()).collect();
        best.sort_by(|a, b| few[*b].total_cmp(&few[*a]));
        let score = |k: &usize| self.sight.glance(cad, &poses[*k], tolerance);
        let first = best.iter().take(N_GLANCES).map(score).fold(f64::NEG_INFINITY, f64::max);
        Trial { score: self.joined(trial.score, first), first, ..trial }
    }

    /// The mean score of the base and the first link, each with the root of its area.
    pub(crate) fn joined(&self, base: f64, first: f64) -> f64 {
        let weight = |l: usize| f64::from(self.model.links[l].cad.area).sqrt();
        let weights = (weight(self.base), self.first.map_or(0.0, |(_, link)| weight(link)));
        (weights.0 * base + weights.1 * first) / (weights.0 + weights.1)
    }

    /// Poses of the first link over its joint, and what a few samples say of each: most are hopeless.
    fn sweep(
        &self,
        plane: &Plane,
        trial: &Trial,
        (free, link): (usize, usize),
        tolerance: f32,
    ) -> (Vec<Pose>, Vec<f64>) {
        let local_from_base = self.pose(plane, trial.x, trial.y, trial.yaw);
        let mut posture = self.model.home();
        let pose = |q: f64| {
            posture[free] = q;
            local_from_base * self.model.poses(&posture)[link]
        };
        let poses: Vec<Pose> = self.turns(free).map(pose).collect();
        let some = prefix(self.model, link, self.settings.n_coarse / 4);
        let few = |pose: &Pose| self.sight.glance(some, pose, tolerance);
        let few = poses.iter().map(few).collect();
        (poses, few)
    }

    /// What the scans say of the first moving link, each at the joint value that it likes best.
    fn first_apart(
        &self,
        local_from_root: Pose,
        (free, link): (usize, usize),
        tolerance: f32,
    ) -> Probe {
        let mut posture = self.model.home();
        let poses: Vec<Pose> = self
            .turns(free)
            .map(|q| {
                posture[free] = q;
                local_from_root * self.model.poses(&posture)[link]
            })
            .collect();
        let cad = prefix(self.model, link, self.settings.n_coarse / 2);
        let mut sum = Probe::default();
        for evidence in &self.sight.each {
            let probes = poses.iter().map(|p| evidence.probe(cad.0, cad.1, p, tolerance));
            let best = probes.max_by(|a, b| a.score.total_cmp(&b.score));
            best.iter().for_each(|b| sum.join(b));
        }
        sum
    }
}
