//! A posture with a joint's rough value in; its value by registration of the joint's links, tied to two points of the
//! joint's axis, out (the source, Eq. 4.1; fit.md §4f).

use geometry::{Point, Pose, Vector, robust};
use robot::JointKind;

use super::Paper;
use super::sparse::rigid;
use crate::beam::Hypothesis;

/// Most points of a registration.
const MAX_POINTS: usize = 6000;
/// Fewest: with fewer the rough value is kept.
const MIN_POINTS: usize = 20;
/// A step below this ends the iterations, radians: 1e-4°.
const STOP: f64 = 1.7e-6;
/// A normal must face the scanner by this cosine.
const MIN_FACING: f64 = 0.15;

impl Paper<'_> {
    /// The joint's value after registration.
    pub(super) fn register(&self, h: &Hypothesis, joint: usize) -> f64 {
        let s = self.settings;
        let mut value = h.posture[joint];
        let [low, high] = self.prepared.model.limits(joint);
        for round in 0..s.n_rounds {
            let share = round as f64 / (s.n_rounds / 2).max(1) as f64;
            let gate = (s.gate[0] * (1.0 - share)).max(s.gate[1]);
            let mut trial = h.clone();
            trial.posture[joint] = value;
            let Some(step) = self.step(&trial, joint, gate) else { break };
            value = (value + step).clamp(low, high);
            if step.abs() < STOP && gate <= s.gate[1] {
                break;
            }
        }
        value
    }

    /// How much further the joint turns (or slides) by one solution of Eq. 4.1.
    fn step(&self, h: &Hypothesis, joint: usize, gate: f64) -> Option<f64> {
        let model = self.prepared.model;
        let index = model.free[joint];
        let poses = model.poses(&h.posture);
        let parent = h.local_from_base * poses[model.joints[index].parent];
        let frame = parent * model.joints[index].parent_from_joint;
        let axis = frame.rotation * model.joints[index].axis.into_inner();
        let (from, to) = self.pairs(h, joint, &poses, gate);
        if from.len() < MIN_POINTS {
            return None;
        }
        if model.joints[index].kind == JointKind::Prismatic {
            let along = from.iter().zip(&to).map(|(p, q)| axis.dot(&(q - p)));
            return Some(along.sum::<f64>() / from.len() as f64);
        }
        // The model moves: its points are `from`. The axis' two points stay where they are.
        let weight = self.settings.axis_weight * from.len() as f64;
        let origin = frame.translation.vector;
        let half = axis * (0.5 * self.settings.axis_span);
        let (mut a, mut b) = (from, to);
        let mut weights = vec![1.0; a.len()];
        for end in [origin - half, origin + half] {
            a.push(end);
            b.push(end);
            weights.push(weight);
        }
        let motion = rigid(&a, &b, &weights);
        // Swing and twist about the axis: the twist is the joint's.
        let r = motion.rotation.to_rotation_matrix();
        let m = r.matrix();
        let vee = Vector::new(m[(2, 1)] - m[(1, 2)], m[(0, 2)] - m[(2, 0)], m[(1, 0)] - m[(0, 1)]);
        let sin = axis.dot(&vee) / 2.0;
        let cos = (m.trace() - axis.dot(&(m * axis))) / 2.0;
        Some(sin.atan2(cos))
    }

    /// Closest points of the joint's links, and the measured points that they belong to, local frame; the farther half
    /// of a skewed lot is left out.
    fn pairs(
        &self,
        h: &Hypothesis,
        joint: usize,
        poses: &[Pose],
        gate: f64,
    ) -> (Vec<Vector>, Vec<Vector>) {
        let moved = &self.prepared.placed_by[joint];
        let mut found: Vec<(Vector, Vector, f64)> = Vec::new();
        for &link in moved {
            let local_from_link = h.local_from_base * poses[link];
            let link_from_local = local_from_link.inverse();
            let bounds = self.prepared.model.links[link].bounds.grown(gate);
            for m in &self.scene.points {
                let q = Point::from(m.p.map(f64::from));
                let in_link = link_from_local * q;
                if !bounds.contains(in_link.coords.into()) {
                    continue;
                }
                let Some((x, n)) = self.closest(link, &in_link) else { continue };
                let d = (in_link - x).norm();
                if d > gate {
                    continue;
                }
                let faces = self.scene.scanner(m.view).is_none_or(|scanner| {
                    let ray = link_from_local * scanner - x;
                    n.dot(&ray) > MIN_FACING * ray.norm()
                });
                if faces && !self.is_nearer_elsewhere(h, poses, moved, &q, d) {
                    found.push(((local_from_link * x).coords, q.coords, d));
                }
            }
        }
        let mut distances: Vec<f64> = found.iter().map(|f| f.2).collect();
        let limit = robust::median(&mut distances).map_or(gate, |m| (3.0 * m).max(0.005));
        found.retain(|f| f.2 <= limit);
        let step = found.len().div_ceil(MAX_POINTS).max(1);
        found.into_iter().step_by(step).map(|f| (f.0, f.1)).unzip()
    }

    /// Whether a link that is already placed is nearer to a point.
    fn is_nearer_elsewhere(
        &self,
        h: &Hypothesis,
        poses: &[Pose],
        moved: &[usize],
        q: &Point,
        d: f64,
    ) -> bool {
        let carrier = moved.first().and_then(|&l| self.prepared.model.links[l].parent_joint);
        let parent = carrier.map(|j| self.prepared.model.joints[j].parent);
        parent.filter(|&l| self.prepared.links[l].weight > 0.0).is_some_and(|l| {
            let at = (h.local_from_base * poses[l]).inverse() * q;
            self.closest(l, &at).is_some_and(|(x, _)| (at - x).norm() < d)
        })
    }
}
