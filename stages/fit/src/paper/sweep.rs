//! A posture whose joints before one are set in; that joint's value by a sweep in equal steps out (the source, §5).

use geometry::{Point, Pose, Vector};
use robot::JointKind;
use std::f64::consts::{FRAC_PI_2, TAU};

use super::Paper;
use crate::beam::Hypothesis;

/// Samples of a link in a sweep.
const N_SAMPLES: usize = 120;
/// Distances count up to this, metres: beyond, one place is as wrong as another.
const CAP: f64 = 0.05;
/// A sample moves off its surface if a quarter turn takes it farther than this from it, metres.
const OFF_SURFACE: f32 = 0.012;

impl Paper<'_> {
    /// The value with the smallest mean distance: that of the joint's own link, or, where that is nearly symmetric about
    /// the joint's axis, together with the next one's best.
    pub(super) fn sweep(&self, h: &Hypothesis, joint: usize) -> f64 {
        let next = (joint + 1..h.posture.len()).find(|&j| !self.prepared.placed_by[j].is_empty());
        let ahead = next.filter(|_| self.is_near_symmetric(joint));
        let (low, span) = self.span(joint);
        let [coarse, fine] = self.settings.sweep_step;
        let n = (span / coarse).ceil().max(1.0) as usize;
        let cost = |value: f64| self.cost(h, joint, value, ahead);
        let tried = (0..=n).map(|k| low + span * k as f64 / n as f64);
        let best = least(tried, &cost);
        let steps = (coarse / fine).ceil() as i32;
        let limit = |v: f64| v.clamp(low, low + span);
        least((-steps..=steps).map(|k| limit(best + f64::from(k) * fine)), &cost)
    }

    /// Smallest value and width of a joint's sweep.
    fn span(&self, joint: usize) -> (f64, f64) {
        let [low, high] = self.prepared.model.limits(joint);
        let index = self.prepared.model.free[joint];
        let turns = self.prepared.model.joints[index].kind != JointKind::Prismatic;
        (low, if turns { (high - low).min(TAU) } else { high - low })
    }

    fn cost(&self, h: &Hypothesis, joint: usize, value: f64, ahead: Option<usize>) -> f64 {
        let mut trial = h.clone();
        trial.posture[joint] = value;
        let own = self.off(&trial, joint);
        let Some(next) = ahead else { return own };
        let (low, span) = self.span(next);
        // The child's own angle needs only be near for its parent's to be told.
        let n = (span / (2.0 * self.settings.sweep_step[0])).ceil().max(1.0) as usize;
        let child = (0..=n).map(|k| {
            trial.posture[next] = low + span * k as f64 / n as f64;
            self.off(&trial, next)
        });
        own + child.fold(f64::INFINITY, f64::min)
    }

    /// Mean distance of the visible samples of a joint's links from what was measured, metres.
    fn off(&self, h: &Hypothesis, joint: usize) -> f64 {
        let poses = self.prepared.model.poses(&h.posture);
        let links = &self.prepared.placed_by[joint];
        self.off_links(links.iter().map(|&l| (l, h.local_from_base * poses[l])), N_SAMPLES)
    }

    /// That of the base.
    pub(super) fn off_base(&self, local_from_base: &Pose) -> f64 {
        self.off_links([(self.base, local_from_base * self.base_pose())].into_iter(), 8 * N_SAMPLES)
    }

    /// Mean distance of the visible samples of links at poses from what was measured, metres.
    fn off_links(&self, links: impl Iterator<Item = (usize, Pose)>, n_samples: usize) -> f64 {
        let (mut sum, mut n) = (0.0, 0_usize);
        for (link, pose) in links {
            let (points, normals) = self.prepared.samples(link, n_samples);
            for (p, normal) in points.iter().zip(normals) {
                let at = pose * Point::from(p.map(f64::from));
                let facing = pose.rotation * Vector::from(normal.map(f64::from));
                let found = self.lattices.nearest(&at, &facing, self.settings.window, CAP);
                if let Some(d) = found {
                    sum += d;
                    n += 1;
                }
            }
        }
        if n == 0 { CAP } else { sum / n as f64 }
    }

    /// Whether few samples of the joint's links leave their surface in a quarter turn.
    fn is_near_symmetric(&self, joint: usize) -> bool {
        let model = self.prepared.model;
        let index = model.free[joint];
        if model.joints[index].kind == JointKind::Prismatic {
            return false;
        }
        let home = model.home();
        let mut turned = home.clone();
        turned[joint] += FRAC_PI_2;
        let (a, b) = (model.poses(&home), model.poses(&turned));
        let (mut off, mut n) = (0_usize, 0_usize);
        for &link in &self.prepared.placed_by[joint] {
            let motion = a[link].inverse() * b[link];
            let (points, _) = self.prepared.samples(link, 300);
            for p in points {
                let q = motion * Point::from(p.map(f64::from));
                let q = [q.x as f32, q.y as f32, q.z as f32];
                let fields = &self.prepared.links[link].fields;
                let near = fields.fine.nearest(q).is_some_and(|at| {
                    let d: f32 = (0..3).map(|i| (fields.facets[at].x[i] - q[i]).powi(2)).sum();
                    d.sqrt() < OFF_SURFACE
                });
                off += usize::from(!near);
                n += 1;
            }
        }
        (off as f64) < self.settings.near_symmetric * n as f64
    }
}

fn least(values: impl Iterator<Item = f64>, cost: &impl Fn(f64) -> f64) -> f64 {
    values.map(|v| (cost(v), v)).min_by(|a, b| a.0.total_cmp(&b.0)).map_or(0.0, |(_, v)| v)
}
