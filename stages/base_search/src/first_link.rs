//! A base pose under test in; out comes what the first moving link, swept over its joint, says of
//! it: many a box looks like a foot, but few look like a foot with a carousel on it.

use geometry::{Plane, Pose, Probe};
use robot::Model;
use std::f64::consts::TAU;

use crate::hill_climb::LAG;
use crate::search::BaseSearch;
use crate::trial::{Said, Trial, first_moving, of_judged, prefix};

/// Tolerances at which base and first link are judged in the end, metres: half a step of the finest
/// grid.
const JUDGE: (f32, f32) = (0.04, 0.06);
/// Mean score of what could be judged: of the worse of base and first link, and of both. Of 125
/// robots that were found none is below 0.64 and 0.70.
const LIKE: (f64, f64) = (0.5, 0.58);
/// Base poses of a place that are asked for that.
const N_LIKE: usize = 4;
/// Share of a foot's surface up to which beams judged little of it.
const LITTLE: f32 = 0.3;
/// Yaws that such a foot is tried at: every 5°.
const N_YAWS: i32 = 72;
/// Values of the first joint that are looked at with all samples at a glance.
const N_GLANCES: usize = 6;
/// Of those so many are kept while a base is moved about.
const N_LIKELY: usize = 3;
/// The first link is looked at with so many times the base's tolerance: its joint has steps, too.
const FIRST_REACH: f32 = 1.5;
/// Step of the first joint, radians.
const FIRST_STEP: f64 = 0.14;

/// The first link that moves and has a surface.
#[derive(Debug)]
pub(crate) struct First {
    pub(crate) link: usize,
    /// Its poses in the root's frame over its joint's range, at most one turn.
    root_from_link: Vec<Pose>,
}

impl First {
    /// `None` where nothing moves.
    pub(crate) fn of(model: &Model) -> Option<Self> {
        let (free, link) = first_moving(model)?;
        let [low, high] = model.limits(free);
        let span = (high - low).min(TAU);
        let n = (span / FIRST_STEP).ceil().max(1.0);
        let mut posture = model.home();
        let pose = |k: usize| {
            posture[free] = low + span * k as f64 / n;
            model.poses(&posture)[link]
        };
        Some(Self { link, root_from_link: (0..=n as usize).map(pose).collect() })
    }

    /// Its poses where the robot stands so.
    fn poses(&self, local_from_root: &Pose) -> Vec<Pose> {
        self.root_from_link.iter().map(|root_from_link| local_from_root * root_from_link).collect()
    }
}

impl BaseSearch<'_> {
    /// Whether what could be judged of the base and of the first link fits them: much of a cabinet
    /// has the height of a foot, but not its shape.
    fn is_like(&self, plane: &Plane, trial: &Trial) -> bool {
        if !self.sight.evidence.has_beams() {
            return true;
        }
        let local_from_root = self.pose(plane, trial.x, trial.y, trial.yaw);
        let base = of_judged(&self.probe_base(plane, trial));
        if base < LIKE.0 {
            return false;
        }
        let first = self.first.as_ref().map_or(base, |first| {
            if !self.sight.each.is_empty() {
                return of_judged(&self.first_apart(&local_from_root, first, JUDGE.1));
            }
            let cad = prefix(self.model, first.link, self.settings.n_coarse);
            let probe = |pose| self.sight.evidence.probe(cad.0, cad.1, pose, JUDGE.1);
            let poses = first.poses(&local_from_root);
            let probes = poses.iter().map(probe);
            let best = probes.max_by(|a, b| self.sight.mean(a).total_cmp(&self.sight.mean(b)));
            best.map_or(base, |probe| of_judged(&probe))
        });
        base.min(first) >= LIKE.0 && 0.5 * (base + first) >= LIKE.1
    }

    /// Whether a base pose of a place looks like the robot, perhaps one that is added. The best may
    /// be the right place turned wrongly: a foot of which plates leave little says less of its
    /// yaw than what stands on it, so it is turned to where that little fits, and goes first.
    pub(crate) fn accept(&self, local: &[Plane], place: &mut Vec<Trial>) -> bool {
        if place.iter().take(N_LIKE).any(|trial| self.is_like(&local[trial.plane], trial)) {
            return true;
        }
        let Some(best) = place.first().copied() else { return false };
        let plane = &local[best.plane];
        if !self.sight.each.is_empty() || self.probe_base(plane, &best).seen() > LITTLE {
            return false;
        }
        let turned = (1..N_YAWS).map(|k| {
            let trial = Trial { yaw: best.yaw + TAU * f64::from(k) / f64::from(N_YAWS), ..best };
            (of_judged(&self.probe_base(plane, &trial)), trial)
        });
        let turned = turned.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, trial)| trial);
        let found = turned.filter(|trial| self.is_like(plane, trial));
        found.into_iter().for_each(|trial| place.insert(0, trial));
        found.is_some()
    }

    fn probe_base(&self, plane: &Plane, trial: &Trial) -> Probe {
        let cad = prefix(self.model, self.base, self.settings.n_fine);
        let pose = self.pose(plane, trial.x, trial.y, trial.yaw) * self.root_from_base;
        self.sight.evidence.probe(cad.0, cad.1, &pose, JUDGE.0)
    }

    /// The trial with the score of the base and of the first moving link at its best joint value.
    pub(crate) fn with_first(&self, plane: &Plane, trial: Trial, tolerance: f32) -> Trial {
        let own = self.score_base(plane, &trial, (tolerance, self.settings.n_fine));
        let Some(of_first) = &self.first else { return Trial { said: own, ..trial } };
        let tolerance = FIRST_REACH * tolerance;
        let first = if self.sight.each.is_empty() {
            let cad = prefix(self.model, of_first.link, self.settings.n_coarse);
            let (poses, few) = self.sweep(plane, &trial, of_first, tolerance);
            let least = few.iter().fold(f64::NEG_INFINITY, |a, b| a.max(*b)) - LAG;
            let full = poses.iter().zip(&few).filter(|(_, few)| **few >= least);
            let said =
                |p: &Pose| self.sight.said(&self.sight.evidence.probe(cad.0, cad.1, p, tolerance));
            highest(full.map(|(p, _)| said(p)))
        } else {
            let local_from_base = self.pose(plane, trial.x, trial.y, trial.yaw);
            let probe = self.first_apart(&local_from_base, of_first, tolerance);
            // Each scan sees less than half of it.
            Said::of(&probe, of_judged(&probe) * (2.0 * f64::from(probe.seen())).min(1.0))
        };
        Trial { said: self.joined(own, first), first, ..trial }
    }

    /// The same at a glance, to whatever score the base has already.
    pub(crate) fn glance_at_first(&self, plane: &Plane, trial: Trial, tolerance: f32) -> Trial {
        let Some(of_first) = self.first.as_ref().filter(|_| self.sight.each.is_empty()) else {
            return trial;
        };
        let cad = prefix(self.model, of_first.link, self.settings.n_coarse);
        let (poses, few) = self.sweep(plane, &trial, of_first, tolerance);
        let mut best: Vec<usize> = (0..few.len()).collect();
        best.sort_by(|a, b| few[*b].total_cmp(&few[*a]));
        let said = |k: &usize| self.sight.glance(cad, &poses[*k], tolerance);
        let first = highest(best.iter().take(N_GLANCES).map(said));
        Trial { said: self.joined(trial.said, first), first, ..trial }
    }

    /// Poses of the first link in the root's frame that a few samples of it like best where the
    /// robot stands so; none where each scan is asked by itself, and none on guessed heights: a
    /// camera sees too little of it (of twelve frames one was found, four without).
    pub(crate) fn likely_firsts(&self, plane: &Plane, trial: &Trial, tolerance: f32) -> Vec<Pose> {
        let is_asked = self.sight.each.is_empty() && !self.is_guess;
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
        trial: &Trial,
        root_from_links: &[Pose],
        tolerance: f32,
    ) -> Said {
        let Some(first) = &self.first else { return Said::default() };
        let cad = prefix(self.model, first.link, self.settings.n_coarse / 4);
        let local_from_root = self.pose(plane, trial.x, trial.y, trial.yaw);
        let said = |pose: &Pose| {
            self.sight.glance(cad, &(local_from_root * pose), FIRST_REACH * tolerance)
        };
        highest(root_from_links.iter().map(said))
    }

    /// What base and first link say, each with the root of its area.
    pub(crate) fn joined(&self, base: Said, first: Said) -> Said {
        let weight = |l: usize| f64::from(self.model.links[l].cad.area).sqrt();
        let weights = (weight(self.base), self.first.as_ref().map_or(0.0, |f| weight(f.link)));
        let mean = |a: f64, b: f64| (weights.0 * a + weights.1 * b) / (weights.0 + weights.1);
        Said { score: mean(base.score, first.score), seen: mean(base.seen, first.seen) }
    }

    /// Poses of the first link over its joint, and what a few samples say of each: most are
    /// hopeless.
    fn sweep(
        &self,
        plane: &Plane,
        trial: &Trial,
        first: &First,
        tolerance: f32,
    ) -> (Vec<Pose>, Vec<f64>) {
        let poses = first.poses(&self.pose(plane, trial.x, trial.y, trial.yaw));
        let some = prefix(self.model, first.link, self.settings.n_coarse / 4);
        let few = |pose: &Pose| self.sight.glance(some, pose, tolerance).score;
        let few = poses.iter().map(few).collect();
        (poses, few)
    }

    /// What the scans say of the first moving link, each at the joint value that it likes best.
    fn first_apart(&self, local_from_root: &Pose, first: &First, tolerance: f32) -> Probe {
        let poses = first.poses(local_from_root);
        let cad = prefix(self.model, first.link, self.settings.n_coarse / 2);
        let mut sum = Probe::default();
        for evidence in &self.sight.each {
            let probes = poses.iter().map(|p| evidence.probe(cad.0, cad.1, p, tolerance));
            let best = probes.max_by(|a, b| a.score.total_cmp(&b.score));
            best.iter().for_each(|b| sum.join(b));
        }
        sum
    }
}

/// What the pose says that scores most.
fn highest(all: impl Iterator<Item = Said>) -> Said {
    let nothing = Said { score: f64::NEG_INFINITY, seen: 0.0 };
    all.fold(nothing, |best, said| if said.score > best.score { said } else { best })
}
