//! Sweeps one joint in equal steps, the joints before it set: the rough value of the joint (the
//! source, §4).

use geometry::{Point, Pose, Vector};
use robot::JointKind;
use std::f64::consts::{FRAC_PI_2, TAU};

use crate::context::SequentialFit;
use crate::posture::Placement;

/// How closely a link is compared with what was measured.
#[derive(Clone, Copy)]
struct LinkSampling {
    /// Samples of it.
    n_samples: usize,
    /// Distances count up to this, metres: beyond, one place is as wrong as another.
    cap: f64,
}

/// Over all of a joint's range, and round the best.
const SWEEPS: [LinkSampling; 2] =
    [LinkSampling { n_samples: 240, cap: 0.05 }, LinkSampling { n_samples: 800, cap: 0.02 }];
/// How closely the base is compared.
const BASE: LinkSampling = LinkSampling { n_samples: 960, cap: 0.05 };
/// A sample moves off its surface if a quarter turn takes it farther than this from it, metres.
const OFF_SURFACE: f32 = 0.012;

/// Values of one joint that are tried.
struct TriedValues {
    joint: usize,
    /// Radians or metres.
    values: Vec<f64>,
}

impl SequentialFit<'_> {
    /// The value with the smallest mean distance: that of the joint's own link, or, where that is
    /// nearly symmetric about the joint's axis, together with the next one's best.
    pub(crate) fn sweep(&self, h: &Placement, joint: usize) -> f64 {
        let next = (joint + 1..h.posture.len()).find(|&j| !self.prepared.placed_by[j].is_empty());
        let ahead = next.filter(|_| self.is_near_symmetric(joint));
        let mut best: Option<[f64; 2]> = None;
        let mut before = f64::INFINITY;
        for (step, sampling) in self.settings.sweep_step.into_iter().zip(SWEEPS) {
            // Round the best so far, two steps of the round before to each side.
            let near = |which: usize| best.map(|b| (b[which], 2.0 * before));
            let own = self.values(joint, near(0), step);
            // The child's own angle needs only be near for its parent's to be told.
            let values = |next: usize| self.values(next, near(1), 2.0 * step);
            let child = ahead.map(|next| TriedValues { joint: next, values: values(next) });
            let tried = own.into_iter().map(|value| {
                let mut trial = h.clone();
                trial.posture[joint] = value;
                self.tried(trial, joint, child.as_ref(), sampling)
            });
            best = tried.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, at)| at);
            before = step;
        }
        best.map_or(0.0, |b| b[0])
    }

    /// Values of a joint in equal steps: all of its range, or near a value.
    fn values(&self, joint: usize, near: Option<(f64, f64)>, step: f64) -> Vec<f64> {
        let (low, span) = self.span(joint);
        let [from, to] = near.map_or([low, low + span], |(at, reach)| [at - reach, at + reach]);
        let n = ((to - from) / step).ceil().max(1.0);
        let value = |k: usize| (from + (to - from) * k as f64 / n).clamp(low, low + span);
        (0..=n as usize).map(value).collect()
    }

    /// Mean distance with a joint as a posture has it, with the best value of its child where that
    /// is tried, too; and the values of the joint and of its child.
    fn tried(
        &self,
        mut trial: Placement,
        joint: usize,
        child: Option<&TriedValues>,
        sampling: LinkSampling,
    ) -> (f64, [f64; 2]) {
        let value = trial.posture[joint];
        let own = self.off(&trial, joint, sampling);
        let Some(child) = child else { return (own, [value, 0.0]) };
        let turned = child.values.iter().map(|&v| {
            trial.posture[child.joint] = v;
            (self.off(&trial, child.joint, sampling), v)
        });
        let (least, at) = turned.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((0.0, 0.0));
        (own + least, [value, at])
    }

    /// Smallest value and width of a joint's sweep.
    fn span(&self, joint: usize) -> (f64, f64) {
        let [low, high] = self.prepared.model.limits(joint);
        let index = self.prepared.model.free[joint];
        let turns = self.prepared.model.joints[index].kind != JointKind::Prismatic;
        (low, if turns { (high - low).min(TAU) } else { high - low })
    }

    /// Mean distance of the visible samples of a joint's links from what was measured, metres.
    fn off(&self, h: &Placement, joint: usize, sampling: LinkSampling) -> f64 {
        let model = self.prepared.model;
        let poses = model.poses(&h.posture);
        let placed = |l: usize| (l, h.local_from_base * poses[l]);
        let parent = placed(model.joints[model.free[joint]].parent);
        let links = &self.prepared.placed_by[joint];
        self.off_links(links.iter().map(|&l| placed(l)), Some(parent), sampling)
    }

    /// Mean distance of the visible samples of the base from what was measured, metres.
    pub(crate) fn off_base(&self, local_from_base: &Pose) -> f64 {
        let base = (self.base, local_from_base * self.base_pose());
        self.off_links([base].into_iter(), None, BASE)
    }

    /// Mean distance of the visible samples of links at poses from what was measured, metres: those
    /// that face a scanner and are not within the link that carries them.
    fn off_links(
        &self,
        links: impl Iterator<Item = (usize, Pose)>,
        parent: Option<(usize, Pose)>,
        sampling: LinkSampling,
    ) -> f64 {
        let (mut sum, mut n) = (0.0, 0_usize);
        let is_within = |at: &Point| {
            parent.is_some_and(|(link, pose)| {
                let q = pose.inverse_transform_point(at);
                self.closest(link, &q).is_some_and(|(x, n)| n.dot(&(q - x)) < 0.0)
            })
        };
        for (link, pose) in links {
            let (points, normals) = self.prepared.samples(link, sampling.n_samples);
            for (p, normal) in points.iter().zip(normals) {
                let at = pose * Point::from(p.map(f64::from));
                if is_within(&at) {
                    continue;
                }
                let facing = pose.rotation * Vector::from(normal.map(f64::from));
                let found = self.grids.nearest(&at, &facing, self.settings.window, sampling.cap);
                if let Some(d) = found {
                    sum += d;
                    n += 1;
                }
            }
        }
        if n == 0 { sampling.cap } else { sum / n as f64 }
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
                let near = self.prepared.facet_near(link, q).is_some_and(|facet| {
                    let d: f32 = (0..3).map(|i| (facet.x[i] - q[i]).powi(2)).sum();
                    d.sqrt() < OFF_SURFACE
                });
                off += usize::from(!near);
                n += 1;
            }
        }
        (off as f64) < self.settings.near_symmetric * n as f64
    }
}
