//! Base poses of a level of the search and the next, finer grid in; poses about the best places
//! that they lead to, with base and first link, out.

use contract::Fan;
use geometry::{Plane, Pose};
use std::collections::HashMap;

use crate::regions::are_stacked;
use crate::search::BaseSearch;
use crate::trial::{Said, Trial, best, prefix};

/// Steps that a pose may go beyond its neighbours while it gets better.
const CLIMB: usize = 3;
/// Mean score on a quarter of the samples by which a pose may lag behind the best and still be
/// looked at closely.
pub(crate) const LAG: f64 = 0.15;

/// Steps from a pose that is refined: planes up, along x and y, yaw.
type Steps = [isize; 4];

/// Spacing of a level of the search: metres, radians, and planes where heights are guessed.
pub(crate) struct Grid {
    pub(crate) step: f64,
    pub(crate) yaw: f64,
    pub(crate) rise: isize,
}

impl Grid {
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
        trials: &[Trial],
        (grid, (keep, quota)): (Grid, (usize, usize)),
        fan: &dyn Fan,
    ) -> Vec<Trial> {
        let (tolerance, apart) = (grid.tolerance(), (grid.step * 0.6, grid.yaw * 0.6));
        let around = |trial: Trial| -> Vec<Trial> {
            let firsts = self.likely_firsts(&planes[trial.plane], &trial, tolerance);
            let mut near = self.climb(planes, (&trial, &firsts), &grid);
            for t in &mut near {
                t.said =
                    self.joined(self.look(planes, t, self.settings.n_fine, tolerance), t.first);
            }
            near
        };
        let mut out: Vec<Trial> = fan.fan(trials.to_vec(), around).into_iter().flatten().collect();
        best(&mut out, (2 * keep, 2 * quota), apart.0, apart.1);
        let mut out = fan.fan(out, |t| self.with_first(&planes[t.plane], t, tolerance));
        best(&mut out, (keep, quota), apart.0, apart.1);
        out
    }

    /// The neighbours of the best pose that steps to ever better ones lead to, those that may be as
    /// good: the coarse level may have taken what stands beside a place for it. What hides a
    /// foot may look like one: the first link, at its likely poses on the root, has a say.
    fn climb(
        &self,
        planes: &[Plane],
        (trial, firsts): (&Trial, &[Pose]),
        grid: &Grid,
    ) -> Vec<Trial> {
        // Those about one pose are mostly about the next, too.
        let mut known: HashMap<Steps, Option<Trial>> = HashMap::new();
        let mut about = |middle: Steps| -> Vec<(Steps, Trial)> {
            let levels = if self.is_guess { -1..2 } else { 0..1 };
            let all = levels.flat_map(|level| (0..27).map(move |n| (level, n)));
            let near = all.filter_map(|(level, n)| {
                let by = [level, n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1];
                let steps = [0, 1, 2, 3].map(|i| middle[i] + by[i]);
                let find = || self.moved_by(planes, (trial, firsts), (grid, steps));
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
        (trial, firsts): (&Trial, &[Pose]),
        (grid, [level, i, j, k]): (&Grid, Steps),
    ) -> Option<Trial> {
        let rise = level * grid.rise;
        let plane = trial.plane.checked_add_signed(rise).filter(|p| *p < planes.len())?;
        if !are_stacked(&planes[trial.plane], &planes[plane], rise) {
            return None;
        }
        let next = Trial {
            plane,
            x: trial.x + i as f64 * grid.step,
            y: trial.y + j as f64 * grid.step,
            yaw: trial.yaw + k as f64 * grid.yaw,
            ..*trial
        };
        let own = self.look(planes, &next, self.settings.n_fine / 4, grid.tolerance());
        if firsts.is_empty() {
            return Some(Trial { said: own, ..next });
        }
        let first = self.glance_at(&planes[plane], &next, firsts, grid.tolerance());
        Some(Trial { said: self.joined(own, first), first, ..next })
    }

    /// What some samples of the base say at a glance.
    fn look(&self, planes: &[Plane], t: &Trial, n_samples: usize, tolerance: f32) -> Said {
        let pose = self.pose(&planes[t.plane], t.x, t.y, t.yaw) * self.root_from_base;
        self.sight.glance(prefix(self.model, self.base, n_samples), &pose, tolerance)
    }
}

/// The trial that scores most, with where it is; of equals the last.
fn highest(near: &[(Steps, Trial)]) -> Option<(Steps, Trial)> {
    near.iter().copied().max_by(|a, b| a.1.said.score.total_cmp(&b.1.said.score))
}
