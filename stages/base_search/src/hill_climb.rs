//! Base poses of a level of the search and the next, finer grid in; poses about the best places
//! that they lead to, with base and first link, out.

use contract::Fan;
use geometry::{Plane, Pose};
use std::collections::HashMap;

use crate::problem::BaseSearch;
use crate::regions::are_stacked;
use crate::trial::{BaseTrial, LAG, SampleScore, Samples, Thinning, best};

/// Steps that a pose may go beyond its neighbours while it gets better.
const CLIMB: usize = 3;

/// Where a climb starts.
struct ClimbStart<'a> {
    trial: &'a BaseTrial,
    /// Likely poses of the first link, frame of the root; none where it is not asked.
    root_from_firsts: &'a [Pose],
}

/// Steps from a pose that is refined: planes up, along x and y, yaw.
type ClimbSteps = [isize; 4];

/// A level of the search: the spacing of its grid, and how many of its poses are kept.
pub(crate) struct SearchLevel {
    /// Step along the plane, metres.
    pub(crate) step: f64,
    /// Step of the yaw, radians.
    pub(crate) yaw: f64,
    /// Planes from one height to the next, where heights are guessed.
    pub(crate) rise: isize,
    /// Base poses that go on to the next level.
    pub(crate) keep: usize,
    /// Most of them at one place.
    pub(crate) quota: usize,
}

impl SearchLevel {
    /// How far from a surface a point may be that counts, metres.
    fn tolerance(&self) -> f32 {
        (self.step * 1.5).clamp(0.025, 0.08) as f32
    }
}

impl BaseSearch<'_> {
    /// Goes from each trial to where it gets better and tries what is about that, on a finer grid,
    /// with base and first link.
    pub(crate) fn finer(
        &self,
        planes: &[Plane],
        trials: &[BaseTrial],
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
        let around = |trial: BaseTrial| -> Vec<BaseTrial> {
            let firsts = self.likely_firsts(&planes[trial.plane], &trial, tolerance);
            let mut near =
                self.climb(planes, &ClimbStart { trial: &trial, root_from_firsts: &firsts }, level);
            for t in &mut near {
                t.said =
                    self.joined(self.look(planes, t, self.settings.n_fine, tolerance), t.first);
            }
            near
        };
        let mut out: Vec<BaseTrial> =
            fan.fan(trials.to_vec(), around).into_iter().flatten().collect();
        best(&mut out, Thinning { keep: 2 * kept.keep, quota: 2 * kept.quota, ..kept });
        let mut out = fan.fan(out, |t| self.with_first(&planes[t.plane], t, tolerance));
        best(&mut out, kept);
        out
    }

    /// The neighbours of the best pose that steps to ever better ones lead to, those that may be as
    /// good: the coarse level may have taken what stands beside a place for it. What hides a
    /// foot may look like one: the first link, at its likely poses on the root, has a say.
    fn climb(
        &self,
        planes: &[Plane],
        start: &ClimbStart<'_>,
        level: &SearchLevel,
    ) -> Vec<BaseTrial> {
        // Those about one pose are mostly about the next, too.
        let mut known: HashMap<ClimbSteps, Option<BaseTrial>> = HashMap::new();
        let mut about = |middle: ClimbSteps| -> Vec<(ClimbSteps, BaseTrial)> {
            let heights = if self.is_guess { -1..2 } else { 0..1 };
            let all = heights.flat_map(|height| (0..27).map(move |n| (height, n)));
            let near = all.filter_map(|(height, n)| {
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
            if next.is_none_or(|(_, trial)| trial.said.score <= so_far.said.score) {
                break;
            }
            (near, best) = (farther, next);
        }
        // A few samples tell most neighbours to be worse.
        let least = best.map_or(f64::INFINITY, |(_, trial)| trial.said.score - LAG);
        near.into_iter().map(|(_, trial)| trial).filter(|t| t.said.score >= least).collect()
    }

    /// A pose moved by some steps, with what a few samples of base and first link say; `None` where
    /// there is no such plane.
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
        let own = self.look(planes, &next, self.settings.n_fine / 4, level.tolerance());
        if start.root_from_firsts.is_empty() {
            return Some(BaseTrial { said: own, ..next });
        }
        let first =
            self.glance_at(&planes[plane], &next, start.root_from_firsts, level.tolerance());
        Some(BaseTrial { said: self.joined(own, first), first, ..next })
    }

    /// What some samples of the base say at a glance.
    fn look(
        &self,
        planes: &[Plane],
        t: &BaseTrial,
        n_samples: usize,
        tolerance: f32,
    ) -> SampleScore {
        let pose = self.pose(&planes[t.plane], t.x, t.y, t.yaw) * self.root_from_base;
        let samples = Samples::first(self.model, self.base, n_samples);
        self.region.glance(samples, &pose, tolerance)
    }
}

/// The trial that scores most, with where it is; of equals the last.
fn highest(near: &[(ClimbSteps, BaseTrial)]) -> Option<(ClimbSteps, BaseTrial)> {
    near.iter().copied().max_by(|a, b| a.1.said.score.total_cmp(&b.1.said.score))
}
