//! An adjusted posture in; out come the other values of its last joints at which the points fit as well or better: a
//! flange with six bolts looks the same every 60°, and only points on its small features tell (fit.md §4e).

use geometry::Point;
use std::f64::consts::TAU;

use crate::beam::Hypothesis;
use crate::refine::Refine;

/// Arc between trial values at the joint's lever, metres: finer than the features that tell them apart.
pub(crate) const STEP: f64 = 0.003;
/// Largest step, radians: 1°.
pub(crate) const MAX_STEP: f64 = 0.0175;
/// Points farther than this from everything count as if they were so far, metres.
const CAP: f32 = 0.015;
/// Points in front of the flange's face count as if they were no farther, metres: something may hang there.
const HELD: f32 = 0.5 * CAP;
/// Points within this of the swept links take part, metres.
const NEAR: f64 = 0.03;
/// Most points of a sweep.
const MAX_POINTS: usize = 3000;
/// Fewer points tell nothing.
pub(crate) const MIN_POINTS: usize = 30;
/// Values nearer than this to one another are one, radians: 3°.
const APART: f64 = 0.052;
/// Extra sum of squares, relative to the best's and in units of the noise's variance, up to which a value is as good:
/// 3 % of the squares is less than what real castings differ by.
pub(crate) const AS_GOOD: (f64, f64) = (0.03, 30.0);

/// Values of one joint.
#[derive(Debug, Clone)]
pub(crate) struct Spin {
    pub(crate) joint: usize,
    /// All values at which the points fit as well as at the best one, best first.
    pub(crate) values: Vec<f64>,
    /// How far around the posture's own value all values are as good, at most, radians: 0 where those beside it are worse.
    pub(crate) extent: f64,
}

/// Size of the run of values around `own`, up or down, whose costs are within the limit.
fn extent(costs: &[(f64, f64)], own: f64, limit: f64) -> f64 {
    let mut offsets: Vec<(f64, f64)> = costs.iter().map(|c| (c.0 - own, c.1)).collect();
    offsets.sort_by(|a, b| a.0.total_cmp(&b.0));
    let is_good = |c: &&(f64, f64)| c.1 <= limit;
    let up = offsets.iter().filter(|c| c.0 >= 0.0).take_while(is_good).last();
    let down = offsets.iter().rev().filter(|c| c.0 <= 0.0).take_while(is_good).last();
    up.map_or(0.0, |c| c.0).max(down.map_or(0.0, |c| -c.0))
}

impl Refine<'_> {
    /// Sweeps each joint that moves nothing but the links that it places and the tool.
    pub(crate) fn spins(&self, h: &Hypothesis, near: &[u32], variance: f64) -> Vec<Spin> {
        let leaves = (0..h.posture.len()).filter(|&j| self.prepared.leaf[j]);
        leaves.filter_map(|joint| self.spin(h, near, joint, variance)).collect()
    }

    fn spin(&self, h: &Hypothesis, near: &[u32], joint: usize, variance: f64) -> Option<Spin> {
        let moved = &self.prepared.carried(joint);
        let [low, high] = self.prepared.model.limits(joint);
        let prismatic = self.prepared.model.joints[self.prepared.model.free[joint]].kind
            == robot::JointKind::Prismatic;
        if prismatic || moved.is_empty() {
            return None;
        }
        let span = (high - low).min(TAU);
        let step = (STEP / self.prepared.lever[joint]).min(MAX_STEP);
        let n = (span / step).ceil() as usize;
        // Around the value found, so that it is one of those tried.
        let first = if high - low > TAU { h.posture[joint] - span / 2.0 } else { low };
        let points = self.swept(h, near, moved);
        if points.len() < MIN_POINTS {
            return None;
        }
        let still = self.distances(h, &points, |l| !moved.contains(&l));
        let mut trial = h.clone();
        let mut cost = |value: f64| {
            trial.posture[joint] = value;
            let own = self.distances(&trial, &points, |l| moved.contains(&l));
            let least = own.iter().zip(&still).map(|(a, b)| f64::from(a.min(*b)).powi(2));
            least.sum::<f64>() / variance
        };
        let costs: Vec<(f64, f64)> = (0..=n)
            .map(|k| first + span * k as f64 / n as f64)
            .chain([h.posture[joint]])
            .map(|value| (value, cost(value)))
            .collect();
        let best = costs.iter().map(|c| c.1).fold(f64::INFINITY, f64::min);
        let limit = best + (AS_GOOD.0 * best).max(AS_GOOD.1);
        let extent = extent(&costs, h.posture[joint], limit);
        // A tool is held by more than its outline: within its own valley the covariance tells.
        let is_bare = moved.len() == self.prepared.placed_by[joint].len();
        let extent = if is_bare || extent > APART { extent } else { 0.0 };
        let mut good: Vec<(f64, f64)> = costs.into_iter().filter(|c| c.1 <= limit).collect();
        good.sort_by(|a, b| a.1.total_cmp(&b.1));
        let mut values: Vec<f64> = Vec::new();
        for (value, _) in good {
            let apart = |v: &f64| {
                let d = (value - v).rem_euclid(TAU);
                d.min(TAU - d) > APART
            };
            if values.iter().all(apart) {
                values.push(value);
            }
        }
        Some(Spin { joint, values, extent })
    }

    /// How much worse another posture explains the points on the links that stand differently in it: the part of its
    /// squared distances that the best one does without; about 0 for equals, negative where the other is better.
    pub(crate) fn worsening(&self, best: &Hypothesis, other: &Hypothesis, near: &[u32]) -> f64 {
        let moved = crate::judge::moved([self.prepared; 2], [best, other]);
        self.worsening_in(self, [best, other], &moved, near)
    }

    /// Links that another model of the same robot places otherwise.
    pub(crate) fn apart(&self, other: &Self, h: &Hypothesis) -> Vec<usize> {
        crate::judge::moved([self.prepared, other.prepared], [h, h])
    }

    /// The same for a posture here and one of another model of the same robot; `moved` are the links that stand
    /// differently.
    pub(crate) fn worsening_in(
        &self,
        there: &Self,
        [best, other]: [&Hypothesis; 2],
        moved: &[usize],
        near: &[u32],
    ) -> f64 {
        let mut points = self.swept(best, near, moved);
        points.extend(there.swept(other, near, moved));
        points.sort_unstable();
        points.dedup();
        if points.len() < MIN_POINTS {
            return 0.0;
        }
        let squares = |refine: &Self, h: &Hypothesis| {
            refine.squares(h, &points, &[&refine.distances(h, &points, |_| true)])
        };
        let (a, b) = (squares(self, best), squares(there, other));
        (b - a) / b.max(a).max(points.len() as f64 * self.scene.noise * self.scene.noise)
    }

    /// Sum of the squared distances of points, each the least of its own; those in front of the flange's face count less:
    /// something may hang there.
    pub(crate) fn squares(&self, h: &Hypothesis, points: &[u32], distances: &[&[f32]]) -> f64 {
        let held = self.held(h, points);
        let of = |i: usize| {
            let most = if held[i] { HELD } else { CAP };
            f64::from(distances.iter().map(|d| d[i]).fold(most, f32::min)).powi(2)
        };
        (0..points.len()).map(of).sum()
    }

    /// Which points may be of what hangs on the flange.
    fn held(&self, h: &Hypothesis, points: &[u32]) -> Vec<bool> {
        let face = self.prepared.face.and_then(|face| {
            let frames = self.link_frames(h);
            frames.into_iter().find(|(l, _)| *l == face.link).map(|(_, frame)| (face, frame))
        });
        let Some((face, frame)) = face else { return vec![false; points.len()] };
        let at = |i: &u32| geometry::depth::transform(&frame, self.scene.points[*i as usize].p);
        points.iter().map(|i| face.is_held(at(i))).collect()
    }

    /// Points near the links whatever their joint's value: within their sphere about the joint's axis, thinned.
    pub(crate) fn swept(&self, h: &Hypothesis, near: &[u32], moved: &[usize]) -> Vec<u32> {
        let poses = self.local_from_links(h);
        let spheres: Vec<(Point, f64)> = moved
            .iter()
            .map(|&l| {
                let bounds = &self.prepared.model.links[l].bounds;
                let radius = 0.5 * bounds.size().iter().map(|s| s * s).sum::<f64>().sqrt() + NEAR;
                let middle: Point = bounds.center();
                (poses[l] * middle, radius)
            })
            .collect();
        let inside = |i: &u32| {
            let p = Point::from(self.scene.points[*i as usize].p.map(f64::from));
            spheres.iter().any(|(c, r)| (p - c).norm() < *r)
        };
        let all: Vec<u32> = near.iter().copied().filter(inside).collect();
        let n = all.len().min(MAX_POINTS);
        (0..n).map(|k| all[k * all.len() / n]).collect()
    }

    /// Distance of each point from the surface of the chosen links along their normals, at most the cap, metres.
    pub(crate) fn distances(
        &self,
        h: &Hypothesis,
        points: &[u32],
        chosen: impl Fn(usize) -> bool,
    ) -> Vec<f32> {
        let frames: Vec<_> = self.link_frames(h).into_iter().filter(|(l, _)| chosen(*l)).collect();
        let of = |&i: &u32| {
            let p = self.scene.points[i as usize].p;
            let mut least = CAP;
            for (l, frame) in &frames {
                let q = geometry::depth::transform(frame, p);
                let Some(at) = self.prepared.links[*l].fields.fine.nearest(q) else { continue };
                let cad = &self.prepared.model.links[*l].cad;
                let (x, n) = (cad.points[at], cad.normals[at]);
                let off: f32 = (0..3).map(|k| n[k] * (q[k] - x[k])).sum();
                let apart: f32 = (0..3).map(|k| (q[k] - x[k]).powi(2)).sum::<f32>().sqrt();
                // Beyond the edge of a facet its plane means nothing.
                least = least.min(if apart > 2.0 * cad.spacing + CAP { CAP } else { off.abs() });
            }
            least
        };
        points.iter().map(of).collect()
    }
}
