//! Base poses of a level of the search and the next, finer grid in; poses about the best places that they lead to, with base
//! and first link, out.

use contract::Fan;
use geometry::{Plane, Pose};

use crate::base::BaseSearch;
use crate::trial::{Said, Trial, best, prefix};

/// Steps that a pose may go beyond its neighbours while it gets better.
const CLIMB: usize = 3;
/// Mean score on a quarter of the samples by which a pose may lag behind the best and still be looked at closely.
pub(crate) const LAG: f64 = 0.15;

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
    /// Goes from each trial to where it gets better and tries what is about that, on a finer grid, with base and first link.
    pub(crate) fn finer(
        &self,
        planes: &[Plane],
        trials: &[Trial],
        (grid, (keep, quota)): (Grid, (usize, usize)),
        fan: &impl Fan,
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

    /// The neighbours of the best pose that steps to ever better ones lead to, those that may be as good: the coarse level may
    /// have taken what stands beside a place for it. What hides a foot may look like one: the first link, at its likely poses on
    /// the root, has a say.
    fn climb(
        &self,
        planes: &[Plane],
        (trial, firsts): (&Trial, &[Pose]),
        grid: &Grid,
    ) -> Vec<Trial> {
        let top = |near: &[Trial]| {
            let better = |a: &Trial, b: &Trial| a.said.score.total_cmp(&b.said.score);
            near.iter().copied().max_by(better).unwrap_or(*trial)
        };
        let mut near = self.neighbours(planes, (trial, firsts), grid);
        let mut best = top(&near);
        for _ in 0..CLIMB {
            let farther = self.neighbours(planes, (&best, firsts), grid);
            let next = top(&farther);
            if next.said.score <= best.said.score {
                break;
            }
            (near, best) = (farther, next);
        }
        // A few samples tell most neighbours to be worse.
        near.retain(|t| t.said.score >= best.said.score - LAG);
        near
    }

    /// A pose and those beside it, with what a few samples of base and first link say; of guessed heights those `rise` planes up
    /// and down.
    fn neighbours(
        &self,
        planes: &[Plane],
        (trial, firsts): (&Trial, &[Pose]),
        grid: &Grid,
    ) -> Vec<Trial> {
        let levels = if self.is_guess { -1..2 } else { 0..1 };
        let all = levels.flat_map(|level| (0..27_i32).map(move |n| (level * grid.rise, n)));
        let near = all.filter_map(|(level, n)| {
            let plane = trial.plane.checked_add_signed(level).filter(|p| *p < planes.len())?;
            let (i, j, k) = (n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1);
            let mut next = Trial { plane, ..*trial };
            next.x += f64::from(i) * grid.step;
            next.y += f64::from(j) * grid.step;
            next.yaw += f64::from(k) * grid.yaw;
            let own = self.look(planes, &next, self.settings.n_fine / 4, grid.tolerance());
            if firsts.is_empty() {
                return Some(Trial { said: own, ..next });
            }
            next.first = self.glance_at(&planes[plane], &next, firsts, grid.tolerance());
            next.said = self.joined(own, next.first);
            Some(next)
        });
        near.collect()
    }

    /// What some samples of the base say at a glance.
    fn look(&self, planes: &[Plane], t: &Trial, n_samples: usize, tolerance: f32) -> Said {
        let pose = self.pose(&planes[t.plane], t.x, t.y, t.yaw) * self.root_from_base;
        self.sight.glance(prefix(self.model, self.base, n_samples), &pose, tolerance)
    }
}
