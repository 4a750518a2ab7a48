//! Refines base poses from one level of the search to the next, finer grid: a hill climb from each
//! pose with base and first link together, then scores of the poses around the best one.

use contract::Fan;
use geometry::{Plane, Pose};
use std::collections::HashMap;

use crate::first_link_score::FIRST_LINK_REACH;
use crate::problem::BaseSearch;
use crate::regions::are_stacked;
use crate::trial::{BaseTrial, MAX_LAG, SampleScore, Samples, Thinning, best};

/// Limit of the steps of a climb beyond the first neighbours.
const CLIMB: usize = 3;

/// The start of a climb.
struct ClimbStart<'a> {
    trial: &'a BaseTrial,
    /// Likely poses of the first link in the root's frame; empty if the first link is not scored.
    root_from_firsts: &'a [Pose],
}

/// Steps from the start of a climb: planes upwards, x, y, yaw.
type ClimbSteps = [isize; 4];

/// A level of the search: the spacing of its grid, and how many of its poses are kept.
pub(crate) struct SearchLevel {
    /// Step along the plane, metres.
    pub(crate) step: f64,
    /// Step of the yaw, radians.
    pub(crate) yaw: f64,
    /// Step between guessed planes.
    pub(crate) rise: isize,
    /// Limit of base poses that are kept for the next level.
    pub(crate) keep: usize,
    /// Limit of these at one place.
    pub(crate) quota: usize,
    /// Whether quick scores are enough to choose the poses for the next level.
    pub(crate) is_quick: bool,
}

impl SearchLevel {
    /// Largest distance of a point from the surface that it counts for, metres.
    fn tolerance(&self) -> f32 {
        (self.step * 1.5).clamp(0.025, 0.08) as f32
    }
}

impl BaseSearch<'_> {
    /// Climbs from each trial to a local maximum, and scores the trials around it with base and
    /// first link on the level's grid.
    pub(crate) fn refine_level(
        &self,
        planes: &[Plane],
        trials: &[BaseTrial],
        level: &SearchLevel,
        fan: &dyn Fan,
    ) -> Vec<BaseTrial> {
        let climbed = self.climb_all(planes, trials, level, fan);
        self.rate(planes, climbed, level, fan)
    }

    /// Climbs from each trial to a local maximum: the trials around it, with quick scores.
    pub(crate) fn climb_all(
        &self,
        planes: &[Plane],
        trials: &[BaseTrial],
        level: &SearchLevel,
        fan: &dyn Fan,
    ) -> Vec<BaseTrial> {
        let tolerance = level.tolerance();
        let around = |trial: BaseTrial| -> Vec<BaseTrial> {
            let firsts = self.likely_first_links(&planes[trial.plane], &trial, tolerance);
            let mut near =
                self.climb(planes, &ClimbStart { trial: &trial, root_from_firsts: &firsts }, level);
            for t in &mut near {
                t.rating =
                    self.combined(self.look(planes, t, self.settings.n_fine, tolerance), t.first);
            }
            near
        };
        fan.fan(trials.to_vec(), around).into_iter().flatten().collect()
    }

    /// The best of these trials, scored with base and first link on the level's grid.
    pub(crate) fn rate(
        &self,
        planes: &[Plane],
        mut trials: Vec<BaseTrial>,
        level: &SearchLevel,
        fan: &dyn Fan,
    ) -> Vec<BaseTrial> {
        let tolerance = level.tolerance();
        let kept = Thinning {
            keep: level.keep,
            quota: level.quota,
            step: level.step * 0.6,
            yaw_step: level.yaw * 0.6,
        };
        best(&mut trials, Thinning { keep: 2 * kept.keep, quota: 2 * kept.quota, ..kept });
        let rated = |t: BaseTrial| match level.is_quick {
            true => {
                let rating = self.look(planes, &t, self.settings.n_fine, tolerance);
                let trial = BaseTrial { rating, ..t };
                let tolerance = FIRST_LINK_REACH * tolerance;
                self.quick_with_first_link(&planes[t.plane], trial, tolerance, None)
            }
            false => self.with_first_link(&planes[t.plane], t, tolerance),
        };
        let mut out = fan.fan(trials, rated);
        best(&mut out, kept);
        out
    }

    /// Climbs to the best pose and returns its neighbours that may be as good. The coarse level may
    /// have taken an object beside a base for the base. What hides a base may look like one, so
    /// that the first link at its likely poses is scored as well.
    fn climb(
        &self,
        planes: &[Plane],
        start: &ClimbStart<'_>,
        level: &SearchLevel,
    ) -> Vec<BaseTrial> {
        // Most neighbours of one pose are neighbours of the next, too.
        let mut known: HashMap<ClimbSteps, Option<BaseTrial>> = HashMap::new();
        let mut about = |middle: ClimbSteps| -> Vec<(ClimbSteps, BaseTrial)> {
            let heights = if self.is_guess { -1..2 } else { 0..1 };
            let all = heights.flat_map(|height| (0..27).map(move |n| (height, n)));
            // A thrifty climb changes its height alone.
            let is_tried = |(height, n): &(isize, isize)| {
                *height == 0 || *n == 13 || self.thrift.climbs_aslant
            };
            let near = all.filter(is_tried).filter_map(|(height, n)| {
                let by = [height, n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1];
                let steps = [0, 1, 2, 3].map(|i| middle[i] + by[i]);
                let find = || self.moved_by(planes, start, level, steps);
                known.entry(steps).or_insert_with(find).map(|trial| (steps, trial))
            });
            near.collect()
        };
        let mut near = about([0; 4]);
        let mut best = highest(&near);
        for _ in 0..CLIMB {
            let Some((middle, so_far)) = best else { break };
            let farther = about(middle);
            let next = highest(&farther);
            if next.is_none_or(|(_, trial)| trial.rating.score <= so_far.rating.score) {
                break;
            }
            (near, best) = (farther, next);
        }
        // Few samples suffice to exclude most neighbours.
        let least = best.map_or(f64::INFINITY, |(_, trial)| trial.rating.score - MAX_LAG);
        near.into_iter().map(|(_, trial)| trial).filter(|t| t.rating.score >= least).collect()
    }

    /// The trial at some steps from the start, with a quick score of few samples of base and first
    /// link; `None` if there is no such plane.
    fn moved_by(
        &self,
        planes: &[Plane],
        start: &ClimbStart<'_>,
        level: &SearchLevel,
        [height, i, j, k]: ClimbSteps,
    ) -> Option<BaseTrial> {
        let trial = start.trial;
        let rise = height * level.rise;
        let plane = trial.plane.checked_add_signed(rise).filter(|p| *p < planes.len())?;
        if !are_stacked(&planes[trial.plane], &planes[plane], rise) {
            return None;
        }
        let next = BaseTrial {
            plane,
            x: trial.x + i as f64 * level.step,
            y: trial.y + j as f64 * level.step,
            yaw: trial.yaw + k as f64 * level.yaw,
            ..*trial
        };
        let of_base = self.look(planes, &next, self.settings.n_fine / 4, level.tolerance());
        if start.root_from_firsts.is_empty() {
            return Some(BaseTrial { rating: of_base, ..next });
        }
        let first = self.quick_first_score(
            &planes[plane],
            &next,
            start.root_from_firsts,
            level.tolerance(),
        );
        Some(BaseTrial { rating: self.combined(of_base, first), first, ..next })
    }

    /// Quick score of some samples of the base.
    fn look(
        &self,
        planes: &[Plane],
        t: &BaseTrial,
        n_samples: usize,
        tolerance: f32,
    ) -> SampleScore {
        let pose = self.pose(&planes[t.plane], t.x, t.y, t.yaw) * self.root_from_base;
        let samples = Samples::first(self.model, self.base, n_samples);
        self.quick_score(samples, &pose, tolerance)
    }
}

/// The trial with the highest score and its steps; of equals the last.
fn highest(near: &[(ClimbSteps, BaseTrial)]) -> Option<(ClimbSteps, BaseTrial)> {
    near.iter().copied().max_by(|a, b| a.1.rating.score.total_cmp(&b.1.rating.score))
}
