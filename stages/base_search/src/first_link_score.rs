//! A base pose under test in; out comes what the first moving link, swept over its joint, says of
//! it: many a box looks like a foot, but few look like a foot with a carousel on it.

use geometry::{Plane, Pose, Probe};
use std::f64::consts::TAU;

use crate::first_link::FirstLink;
use crate::problem::BaseSearch;
use crate::trial::{BaseTrial, LAG, SampleScore, Samples, of_judged};

/// Tolerance at which a base is judged in the end, metres: half a step of the finest grid.
const BASE_TOLERANCE: f32 = 0.04;
/// Tolerance at which a first link is judged in the end, metres: that of the base, and the steps of
/// its joint.
const FIRST_LINK_TOLERANCE: f32 = 0.06;
/// Least mean score of what could be judged of the worse of base and first link. Of 125 robots that
/// were found none is below 0.64.
const MIN_JUDGED_SCORE: f64 = 0.5;
/// Least mean of both of these scores. Of 125 robots that were found none is below 0.70.
const MIN_MEAN_JUDGED_SCORE: f64 = 0.58;
/// Base poses of a place that are asked for that.
const N_JUDGED_POSES: usize = 4;
/// Share of a foot's surface up to which beams judged little of it.
const LITTLE_SEEN: f32 = 0.3;
/// Yaws that such a foot is tried at: every 5°.
const N_YAWS: i32 = 72;
/// Values of the first joint that are looked at with all samples at a glance.
const N_GLANCES: usize = 6;
/// Of those so many are kept while a base is moved about.
const N_LIKELY: usize = 3;
/// Tolerance of the first link, as a multiple of the base's: its joint has steps, too.
const FIRST_REACH: f32 = 1.5;

impl BaseSearch<'_> {
    /// Whether what could be judged of the base and of the first link fits them: much of a cabinet
    /// has the height of a foot, but not its shape.
    fn is_like(&self, plane: &Plane, trial: &BaseTrial) -> bool {
        if !self.region.evidence.has_beams() {
            return true;
        }
        let local_from_root = self.pose(plane, trial.x, trial.y, trial.yaw);
        let base = of_judged(&self.probe_base(plane, trial));
        if base < MIN_JUDGED_SCORE {
            return false;
        }
        let first = self.first.as_ref().map_or(base, |first| {
            if !self.region.each.is_empty() {
                return of_judged(&self.first_apart(&local_from_root, first, FIRST_LINK_TOLERANCE));
            }
            let samples = Samples::first(self.model, first.link, self.settings.n_coarse);
            let probe = |pose| samples.probe(self.region.evidence, pose, FIRST_LINK_TOLERANCE);
            let poses = first.poses(&local_from_root);
            let probes = poses.iter().map(probe);
            let best = probes.max_by(|a, b| self.region.mean(a).total_cmp(&self.region.mean(b)));
            best.map_or(base, |probe| of_judged(&probe))
        });
        base.min(first) >= MIN_JUDGED_SCORE && 0.5 * (base + first) >= MIN_MEAN_JUDGED_SCORE
    }

    /// Whether a base pose of a place looks like the robot, perhaps one that is added. The best may
    /// be the right place turned wrongly: a foot of which plates leave little says less of its
    /// yaw than what stands on it, so it is turned to where that little fits, and goes first.
    pub(crate) fn accept(&self, local: &[Plane], place: &mut Vec<BaseTrial>) -> bool {
        if place.iter().take(N_JUDGED_POSES).any(|trial| self.is_like(&local[trial.plane], trial)) {
            return true;
        }
        let Some(best) = place.first().copied() else { return false };
        let plane = &local[best.plane];
        if !self.region.each.is_empty() || self.probe_base(plane, &best).seen() > LITTLE_SEEN {
            return false;
        }
        let turned = (1..N_YAWS).map(|k| {
            let trial =
                BaseTrial { yaw: best.yaw + TAU * f64::from(k) / f64::from(N_YAWS), ..best };
            (of_judged(&self.probe_base(plane, &trial)), trial)
        });
        let turned = turned.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, trial)| trial);
        let found = turned.filter(|trial| self.is_like(plane, trial));
        found.into_iter().for_each(|trial| place.insert(0, trial));
        found.is_some()
    }

    fn probe_base(&self, plane: &Plane, trial: &BaseTrial) -> Probe {
        let samples = Samples::first(self.model, self.base, self.settings.n_fine);
        let pose = self.pose(plane, trial.x, trial.y, trial.yaw) * self.root_from_base;
        samples.probe(self.region.evidence, &pose, BASE_TOLERANCE)
    }

    /// The trial with the score of the base and of the first moving link at its best joint value.
    pub(crate) fn with_first(&self, plane: &Plane, trial: BaseTrial, tolerance: f32) -> BaseTrial {
        let own = self.score_base(plane, &trial, tolerance, self.settings.n_fine);
        let Some(of_first) = &self.first else { return BaseTrial { said: own, ..trial } };
        let tolerance = FIRST_REACH * tolerance;
        let first = if self.region.each.is_empty() {
            let samples = Samples::first(self.model, of_first.link, self.settings.n_coarse);
            let (poses, few) = self.sweep(plane, &trial, of_first, tolerance);
            let least = few.iter().fold(f64::NEG_INFINITY, |a, b| a.max(*b)) - LAG;
            let full = poses.iter().zip(&few).filter(|(_, few)| **few >= least);
            let said =
                |p: &Pose| self.region.said(&samples.probe(self.region.evidence, p, tolerance));
            highest(full.map(|(p, _)| said(p)))
        } else {
            let local_from_base = self.pose(plane, trial.x, trial.y, trial.yaw);
            let probe = self.first_apart(&local_from_base, of_first, tolerance);
            // Each scan sees less than half of it.
            SampleScore::of(&probe, of_judged(&probe) * (2.0 * f64::from(probe.seen())).min(1.0))
        };
        BaseTrial { said: self.joined(own, first), first, ..trial }
    }

    /// The same at a glance, to whatever score the base has already.
    pub(crate) fn glance_at_first(
        &self,
        plane: &Plane,
        trial: BaseTrial,
        tolerance: f32,
    ) -> BaseTrial {
        let Some(of_first) = self.first.as_ref().filter(|_| self.region.each.is_empty()) else {
            return trial;
        };
        let samples = Samples::first(self.model, of_first.link, self.settings.n_coarse);
        let (poses, few) = self.sweep(plane, &trial, of_first, tolerance);
        let mut best: Vec<usize> = (0..few.len()).collect();
        best.sort_by(|a, b| few[*b].total_cmp(&few[*a]));
        let said = |k: &usize| self.region.glance(samples, &poses[*k], tolerance);
        let first = highest(best.iter().take(N_GLANCES).map(said));
        BaseTrial { said: self.joined(trial.said, first), first, ..trial }
    }

    /// Poses of the first link in the root's frame that a few samples of it like best where the
    /// robot stands so; none where each scan is asked by itself, and none on guessed heights: a
    /// camera sees too little of it (of twelve frames one was found, four without).
    pub(crate) fn likely_firsts(
        &self,
        plane: &Plane,
        trial: &BaseTrial,
        tolerance: f32,
    ) -> Vec<Pose> {
        let is_asked = self.region.each.is_empty() && !self.is_guess;
        let Some(first) = self.first.as_ref().filter(|_| is_asked) else {
            return Vec::new();
        };
        let (_, few) = self.sweep(plane, trial, first, FIRST_REACH * tolerance);
        let mut best: Vec<usize> = (0..few.len()).collect();
        best.sort_by(|a, b| few[*b].total_cmp(&few[*a]));
        best.into_iter().take(N_LIKELY).map(|k| first.root_from_link[k]).collect()
    }

    /// What a few samples of the first link say at a glance at the best of some poses in the root's
    /// frame.
    pub(crate) fn glance_at(
        &self,
        plane: &Plane,
        trial: &BaseTrial,
        root_from_links: &[Pose],
        tolerance: f32,
    ) -> SampleScore {
        let Some(first) = &self.first else { return SampleScore::default() };
        let samples = Samples::first(self.model, first.link, self.settings.n_coarse / 4);
        let local_from_root = self.pose(plane, trial.x, trial.y, trial.yaw);
        let said = |pose: &Pose| {
            self.region.glance(samples, &(local_from_root * pose), FIRST_REACH * tolerance)
        };
        highest(root_from_links.iter().map(said))
    }

    /// What base and first link say, each with the root of its area.
    pub(crate) fn joined(&self, base: SampleScore, first: SampleScore) -> SampleScore {
        let weight = |l: usize| f64::from(self.model.links[l].cad.area).sqrt();
        let weights = (weight(self.base), self.first.as_ref().map_or(0.0, |f| weight(f.link)));
        let mean = |a: f64, b: f64| (weights.0 * a + weights.1 * b) / (weights.0 + weights.1);
        SampleScore { score: mean(base.score, first.score), seen: mean(base.seen, first.seen) }
    }

    /// Poses of the first link over its joint, and what a few samples say of each: most are
    /// hopeless.
    fn sweep(
        &self,
        plane: &Plane,
        trial: &BaseTrial,
        first: &FirstLink,
        tolerance: f32,
    ) -> (Vec<Pose>, Vec<f64>) {
        let poses = first.poses(&self.pose(plane, trial.x, trial.y, trial.yaw));
        let some = Samples::first(self.model, first.link, self.settings.n_coarse / 4);
        let few = |pose: &Pose| self.region.glance(some, pose, tolerance).score;
        let few = poses.iter().map(few).collect();
        (poses, few)
    }

    /// What the scans say of the first moving link, each at the joint value that it likes best.
    fn first_apart(&self, local_from_root: &Pose, first: &FirstLink, tolerance: f32) -> Probe {
        let poses = first.poses(local_from_root);
        let samples = Samples::first(self.model, first.link, self.settings.n_coarse / 2);
        let mut sum = Probe::default();
        for evidence in &self.region.each {
            let probes = poses.iter().map(|p| samples.probe(evidence, p, tolerance));
            let best = probes.max_by(|a, b| a.score.total_cmp(&b.score));
            best.iter().for_each(|b| sum.join(b));
        }
        sum
    }
}

/// What the pose says that scores most.
fn highest(all: impl Iterator<Item = SampleScore>) -> SampleScore {
    let nothing = SampleScore { score: f64::NEG_INFINITY, seen: 0.0 };
    all.fold(nothing, |best, said| if said.score > best.score { said } else { best })
}
