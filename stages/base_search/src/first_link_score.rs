//! Scores base poses by the first moving link, swept over the range of its joint. Many boxes have
//! the shape of a robot's base, but few have the shape of a base with a carousel on it.

use geometry::{Plane, Pose, Probe};
use std::collections::HashMap;
use std::f64::consts::TAU;

use crate::first_link::FirstLink;
use crate::first_link_stencils::FirstLinkStencils;
use crate::problem::BaseSearch;
use crate::trial::{BaseTrial, MAX_LAG, SampleScore, Samples, judged_score};

/// Tolerance of the final test of a base, metres: half a step of the finest grid.
const BASE_TOLERANCE: f32 = 0.04;
/// Tolerance of the final test of a first link, metres: that of the base, plus the step between
/// values of its joint.
const FIRST_LINK_TOLERANCE: f32 = 0.06;
/// Least mean score of the judged samples of base and first link, whichever is worse. The smallest
/// value of 125 robots that were found is 0.64.
const MIN_JUDGED_SCORE: f64 = 0.5;
/// Least mean of both of these scores. The smallest value of 125 robots that were found is 0.70.
const MIN_MEAN_JUDGED_SCORE: f64 = 0.58;
/// Number of base poses of a place that are tested.
const N_JUDGED_POSES: usize = 4;
/// Share of judged samples up to which beams determine the yaw of a base too weakly.
const LITTLE_SEEN: f32 = 0.3;
/// Number of yaw angles that are tried for such a base: every 5°.
const N_YAWS: i32 = 72;
/// Number of values of the first joint that get a quick score with all samples.
const N_QUICK_VALUES: usize = 6;
/// Number of likely values of the first joint that are kept while a base is moved.
const N_LIKELY: usize = 3;
/// Tolerance of the first link as a multiple of the base's: its joint has steps, too.
pub(crate) const FIRST_LINK_REACH: f32 = 1.5;

/// Which bases are plausible, as far as it was asked: places are judged again after each batch.
#[derive(Debug, Default)]
pub(crate) struct PlausibleBases(HashMap<[u64; 4], bool>);

/// The pose of a trial as a key.
fn key(trial: &BaseTrial) -> [u64; 4] {
    [trial.plane as u64, trial.x.to_bits(), trial.y.to_bits(), trial.yaw.to_bits()]
}

impl BaseSearch<'_> {
    /// Whether the judged samples of base and first link fit the beams. Large parts of a cabinet
    /// have the height of a base, but not its shape.
    fn is_plausible(&self, plane: &Plane, trial: &BaseTrial) -> bool {
        if !self.region.evidence.has_beams() {
            return true;
        }
        let local_from_root = self.pose(plane, trial.x, trial.y, trial.yaw);
        let base = judged_score(&self.probe_base(plane, trial));
        if base < MIN_JUDGED_SCORE {
            return false;
        }
        let first = self.first.as_ref().map_or(base, |first| {
            if !self.region.by_scan.is_empty() {
                return judged_score(&self.probe_first_by_scan(
                    &local_from_root,
                    first,
                    FIRST_LINK_TOLERANCE,
                ));
            }
            let samples = Samples::first(self.model, first.link, self.settings.n_coarse);
            let probe = |pose| samples.probe(self.region.evidence, pose, FIRST_LINK_TOLERANCE);
            let poses = first.poses(&local_from_root);
            let probes = poses.iter().map(probe);
            let best = probes.max_by(|a, b| self.region.mean(a).total_cmp(&self.region.mean(b)));
            best.map_or(base, |probe| judged_score(&probe))
        });
        base.min(first) >= MIN_JUDGED_SCORE && 0.5 * (base + first) >= MIN_MEAN_JUDGED_SCORE
    }

    /// Whether one of the best base poses of a place is plausible; another one may be added in
    /// front. The best pose may stand at the right place with a wrong yaw: of a base that plates
    /// mostly hide, the samples determine the yaw less than the links above it. Such a base is also
    /// tried at the yaw that its judged samples fit best.
    pub(crate) fn accept(
        &self,
        local: &[Plane],
        place: &mut Vec<BaseTrial>,
        known: &mut PlausibleBases,
    ) -> bool {
        let mut is_plausible = |trial: &BaseTrial| {
            let find = || self.is_plausible(&local[trial.plane], trial);
            *known.0.entry(key(trial)).or_insert_with(find)
        };
        if place.iter().take(N_JUDGED_POSES).any(&mut is_plausible) {
            return true;
        }
        let Some(best) = place.first().copied() else { return false };
        let plane = &local[best.plane];
        if !self.region.by_scan.is_empty() || self.probe_base(plane, &best).seen() > LITTLE_SEEN {
            return false;
        }
        let turned = (1..N_YAWS).map(|k| {
            let trial =
                BaseTrial { yaw: best.yaw + TAU * f64::from(k) / f64::from(N_YAWS), ..best };
            (judged_score(&self.probe_base(plane, &trial)), trial)
        });
        let turned = turned.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, trial)| trial);
        let found = turned.filter(is_plausible);
        found.into_iter().for_each(|trial| place.insert(0, trial));
        found.is_some()
    }

    fn probe_base(&self, plane: &Plane, trial: &BaseTrial) -> Probe {
        let samples = Samples::first(self.model, self.base, self.settings.n_fine);
        let pose = self.pose(plane, trial.x, trial.y, trial.yaw) * self.root_from_base;
        samples.probe(self.region.evidence, &pose, BASE_TOLERANCE)
    }

    /// Returns the trial with the combined score of the base and of the first moving link at its
    /// best joint value. `tolerance` is in metres.
    pub(crate) fn with_first_link(
        &self,
        plane: &Plane,
        trial: BaseTrial,
        tolerance: f32,
    ) -> BaseTrial {
        let of_base = self.score_base(plane, &trial, tolerance, self.settings.n_fine);
        let Some(first_link) = &self.first else { return BaseTrial { rating: of_base, ..trial } };
        let tolerance = FIRST_LINK_REACH * tolerance;
        let first = if self.region.by_scan.is_empty() {
            let samples = Samples::first(self.model, first_link.link, self.settings.n_coarse);
            let (poses, quick_scores) = self.sweep(plane, &trial, first_link, tolerance);
            let least = quick_scores.iter().fold(f64::NEG_INFINITY, |a, b| a.max(*b)) - MAX_LAG;
            let full = poses.iter().zip(&quick_scores).filter(|(_, score)| **score >= least);
            let full = full.map(|(pose, _)| pose).collect();
            let rating =
                |p: &Pose| self.region.rating(&samples.probe(self.region.evidence, p, tolerance));
            highest(self.likely_poses(samples, full, tolerance).into_iter().map(rating))
        } else {
            let local_from_base = self.pose(plane, trial.x, trial.y, trial.yaw);
            let probe = self.probe_first_by_scan(&local_from_base, first_link, tolerance);
            // Each scan sees less than half of the link.
            SampleScore::of(&probe, judged_score(&probe) * (2.0 * f64::from(probe.seen())).min(1.0))
        };
        BaseTrial { rating: self.combined(of_base, first), first, ..trial }
    }

    /// Like [`Self::with_first_link`], but with quick scores, the score that the base has already,
    /// and the tolerance of the link itself, metres. On a coarse grid the link's samples are looked
    /// up in `stencils`.
    pub(crate) fn quick_with_first_link(
        &self,
        plane: &Plane,
        trial: BaseTrial,
        tolerance: f32,
        stencils: Option<&FirstLinkStencils<'_>>,
    ) -> BaseTrial {
        let Some(first_link) = self.first.as_ref().filter(|_| self.region.by_scan.is_empty())
        else {
            return trial;
        };
        let local_from_root = self.pose(plane, trial.x, trial.y, trial.yaw);
        let shift = stencils.and_then(|stencils| stencils.shift(&trial, &local_from_root));
        let score = |k: usize, n_samples: usize| {
            let known = shift.as_ref().and_then(|shift| shift.look_up(k, n_samples));
            known.unwrap_or_else(|| {
                let samples = Samples::first(self.model, first_link.link, n_samples);
                let pose = local_from_root * first_link.root_from_link[k];
                self.quick_score(samples, &pose, tolerance)
            })
        };
        let few = self.settings.n_coarse / 4;
        let n = first_link.root_from_link.len();
        let mut best: Vec<(f64, usize)> = (0..n).map(|k| (score(k, few).score, k)).collect();
        best.sort_by(|a, b| b.0.total_cmp(&a.0));
        let rating = |(_, k): &(f64, usize)| score(*k, self.settings.n_coarse);
        let first = highest(best.iter().take(N_QUICK_VALUES).map(rating));
        BaseTrial { rating: self.combined(trial.rating, first), first, ..trial }
    }

    /// The poses of the first link whose quick score with all samples is highest; all poses in a
    /// thorough search.
    fn likely_poses<'p>(
        &self,
        samples: Samples<'_>,
        mut poses: Vec<&'p Pose>,
        tolerance: f32,
    ) -> Vec<&'p Pose> {
        if self.thrift.is_best_first && poses.len() > N_QUICK_VALUES {
            let score = |pose: &Pose| self.quick_score(samples, pose, tolerance).score;
            let mut scored: Vec<(f64, &Pose)> = poses.into_iter().map(|p| (score(p), p)).collect();
            scored.sort_by(|a, b| b.0.total_cmp(&a.0));
            poses = scored.into_iter().take(N_QUICK_VALUES).map(|(_, pose)| pose).collect();
        }
        poses
    }

    /// The likely poses of the first link in the root's frame, by quick scores of few samples at
    /// the trial's base pose. There are none if scans are scored one by one. There are none for
    /// guessed planes either, where a camera sees too little of the link (with them one of twelve
    /// frames was found, without them four).
    pub(crate) fn likely_first_links(
        &self,
        plane: &Plane,
        trial: &BaseTrial,
        tolerance: f32,
    ) -> Vec<Pose> {
        let is_scored = self.region.by_scan.is_empty() && !self.is_guess;
        let Some(first) = self.first.as_ref().filter(|_| is_scored) else {
            return Vec::new();
        };
        let (_, quick_scores) = self.sweep(plane, trial, first, FIRST_LINK_REACH * tolerance);
        let mut best: Vec<usize> = (0..quick_scores.len()).collect();
        best.sort_by(|a, b| quick_scores[*b].total_cmp(&quick_scores[*a]));
        best.into_iter().take(N_LIKELY).map(|k| first.root_from_link[k]).collect()
    }

    /// Quick score of few samples of the first link at the best of some poses in the root's frame.
    pub(crate) fn quick_first_score(
        &self,
        plane: &Plane,
        trial: &BaseTrial,
        root_from_links: &[Pose],
        tolerance: f32,
    ) -> SampleScore {
        let Some(first) = &self.first else { return SampleScore::default() };
        let samples = Samples::first(self.model, first.link, self.settings.n_coarse / 4);
        let local_from_root = self.pose(plane, trial.x, trial.y, trial.yaw);
        let rating = |pose: &Pose| {
            self.quick_score(samples, &(local_from_root * pose), FIRST_LINK_REACH * tolerance)
        };
        highest(root_from_links.iter().map(rating))
    }

    /// The combined score of base and first link, each weighted by the square root of its area.
    pub(crate) fn combined(&self, base: SampleScore, first: SampleScore) -> SampleScore {
        let weight = |l: usize| f64::from(self.model.links[l].cad.area).sqrt();
        let weights = (weight(self.base), self.first.as_ref().map_or(0.0, |f| weight(f.link)));
        let mean = |a: f64, b: f64| (weights.0 * a + weights.1 * b) / (weights.0 + weights.1);
        SampleScore { score: mean(base.score, first.score), seen: mean(base.seen, first.seen) }
    }

    /// The poses of the first link over the range of its joint, with a quick score of few samples
    /// for each. Most of them score too low to be tested further.
    fn sweep(
        &self,
        plane: &Plane,
        trial: &BaseTrial,
        first: &FirstLink,
        tolerance: f32,
    ) -> (Vec<Pose>, Vec<f64>) {
        let poses = first.poses(&self.pose(plane, trial.x, trial.y, trial.yaw));
        let samples = Samples::first(self.model, first.link, self.settings.n_coarse / 4);
        let score = |pose: &Pose| self.quick_score(samples, pose, tolerance).score;
        let quick_scores = poses.iter().map(score).collect();
        (poses, quick_scores)
    }

    /// The probe of the first moving link, summed over the scans, each at the joint value that
    /// scores best in it.
    fn probe_first_by_scan(
        &self,
        local_from_root: &Pose,
        first: &FirstLink,
        tolerance: f32,
    ) -> Probe {
        let poses = first.poses(local_from_root);
        let samples = Samples::first(self.model, first.link, self.settings.n_coarse / 2);
        let mut sum = Probe::default();
        for evidence in &self.region.by_scan {
            let probes = poses.iter().map(|p| samples.probe(evidence, p, tolerance));
            let best = probes.max_by(|a, b| a.score.total_cmp(&b.score));
            best.iter().for_each(|b| sum.join(b));
        }
        sum
    }
}

/// The highest score; of equals the first.
fn highest(all: impl Iterator<Item = SampleScore>) -> SampleScore {
    let nothing = SampleScore { score: f64::NEG_INFINITY, seen: 0.0 };
    all.fold(nothing, |best, rating| if rating.score > best.score { rating } else { best })
}
