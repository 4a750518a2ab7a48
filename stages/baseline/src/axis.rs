//! Registers the links of one joint with the measured points, tied to two points of the joint's
//! axis: from the joint's rough value to its precise one (the source, Eq. 4.1; METHOD.md §10).

use geometry::{Point, Pose, Vector, robust};
use robot::JointKind;

use crate::context::SequentialFit;
use crate::posture::Placement;
use crate::sparse::rigid;

/// Most points of a registration.
const MAX_POINTS: usize = 12_000;
/// Fewest: with fewer the rough value is kept.
const MIN_POINTS: usize = 20;
/// A step below this ends the iterations, radians: 1e-4°.
const STOP: f64 = 1.7e-6;
/// Largest step, radians or metres: a rough value is not farther off.
const MAX_STEP: f64 = 0.03;
/// Closest points creep along smooth links: a step is stretched as its ratio to the one before
/// tells, at most so much.
const MAX_STRETCH: f64 = 12.0;
/// A normal must face the scanner by this cosine.
const MIN_FACING: f64 = 0.15;

/// A measured point that may lie on the joint's links.
struct NearbyPoint {
    /// Local frame.
    at: Point,
    /// Scanner that measured it, local frame; `None` where unknown.
    scanner: Option<Point>,
    /// Distance from the link that carries the joint, metres.
    parent: f64,
}

/// What a joint's links are registered with.
#[derive(Clone, Copy)]
struct RegisteredPoints<'a> {
    points: &'a [NearbyPoint],
    /// Farther points do not belong to the links, metres.
    gate: f64,
}

/// Two points of a joint's axis, which a registration keeps where they are.
struct AxisEnds {
    ends: [Vector; 2],
    /// Weight of each end, as a multiple of the weight of all correspondences together.
    weight: f64,
}

impl SequentialFit<'_> {
    /// The joint's value after registration.
    pub(crate) fn register(&self, h: &Placement, joint: usize) -> f64 {
        let s = self.settings;
        let [low, high] = self.prepared.model.limits(joint);
        let near = self.near(h, joint);
        let mut trial = h.clone();
        let mut before: Option<f64> = None;
        for round in 0..s.n_rounds {
            let share = round as f64 / (s.n_rounds / 2).max(1) as f64;
            let gate = (s.gate[0] * (1.0 - share)).max(s.gate[1]);
            let near = RegisteredPoints { points: &near, gate };
            let Some(step) = self.step(&trial, joint, near) else { break };
            // Steps of a creeping iteration shrink by one ratio: their sum is known (Aitken).
            let ratio = before.map_or(0.0, |b| step / b);
            let creeps = (0.2..1.0).contains(&ratio);
            let stretch = if creeps { (1.0 / (1.0 - ratio)).min(MAX_STRETCH) } else { 1.0 };
            let taken = (step * stretch).clamp(-MAX_STEP, MAX_STEP);
            before = (stretch == 1.0).then_some(step);
            trial.posture[joint] = (trial.posture[joint] + taken).clamp(low, high);
            if step.abs() < STOP && gate <= s.gate[1] {
                break;
            }
        }
        trial.posture[joint]
    }

    /// How much further the joint turns (or slides) by one solution of Eq. 4.1.
    fn step(&self, h: &Placement, joint: usize, near: RegisteredPoints<'_>) -> Option<f64> {
        let model = self.prepared.model;
        let index = model.free[joint];
        let poses = model.poses(&h.posture);
        let parent = h.local_from_base * poses[model.joints[index].parent];
        let frame = parent * model.joints[index].parent_from_joint;
        let axis = frame.rotation * model.joints[index].axis.into_inner();
        let (from, to) = self.pairs(h, joint, &poses, near);
        if from.len() < MIN_POINTS {
            return None;
        }
        if model.joints[index].kind == JointKind::Prismatic {
            let along = from.iter().zip(&to).map(|(p, q)| axis.dot(&(q - p)));
            return Some(along.sum::<f64>() / from.len() as f64);
        }
        let ends = frame.translation.vector;
        let half = axis * (0.5 * self.settings.axis_span);
        let weight = self.settings.axis_weight;
        Some(about_axis(&from, &to, AxisEnds { ends: [ends - half, ends + half], weight }))
    }

    /// Closest points of the joint's links, and the measured points that they belong to, local
    /// frame; the farther half of a skewed lot is left out.
    fn pairs(
        &self,
        h: &Placement,
        joint: usize,
        poses: &[Pose],
        RegisteredPoints { points, gate }: RegisteredPoints<'_>,
    ) -> (Vec<Vector>, Vec<Vector>) {
        let mut found: Vec<(Vector, Vector, f64)> = Vec::new();
        for &link in &self.prepared.placed_by[joint] {
            let local_from_link = h.local_from_base * poses[link];
            let link_from_local = local_from_link.inverse();
            let bounds = self.prepared.model.links[link].bounds.grown(gate);
            for m in points {
                let in_link = link_from_local * m.at;
                if !bounds.contains(in_link.coords.into()) {
                    continue;
                }
                let Some((x, n)) = self.closest(link, &in_link) else { continue };
                let d = (in_link - x).norm();
                if d > gate || d > m.parent {
                    continue;
                }
                let faces = m.scanner.is_none_or(|scanner| {
                    let ray = link_from_local * scanner - x;
                    n.dot(&ray) > MIN_FACING * ray.norm()
                });
                if faces {
                    found.push(((local_from_link * x).coords, m.at.coords, d));
                }
            }
        }
        let mut distances: Vec<f64> = found.iter().map(|f| f.2).collect();
        let limit = robust::median(&mut distances).map_or(gate, |m| (3.0 * m).max(0.005));
        found.retain(|f| f.2 <= limit);
        found.into_iter().map(|f| (f.0, f.1)).unzip()
    }

    /// Measured points about the joint's links where they stand now, thinned.
    fn near(&self, h: &Placement, joint: usize) -> Vec<NearbyPoint> {
        let model = self.prepared.model;
        let poses = model.poses(&h.posture);
        let reach = 2.0 * self.settings.gate[0];
        let moved = &self.prepared.placed_by[joint];
        let places = moved.iter().map(|&l| {
            ((h.local_from_base * poses[l]).inverse(), model.links[l].bounds.grown(reach))
        });
        let places: Vec<_> = places.collect();
        let inside = |q: &Point| places.iter().any(|(t, b)| b.contains((t * q).coords.into()));
        let all: Vec<(Point, u16)> = self.scene.local_points().filter(|(q, _)| inside(q)).collect();
        let parent = model.joints[model.free[joint]].parent;
        let link_from_local = (h.local_from_base * poses[parent]).inverse();
        let distance = |q: &Point| {
            let at = link_from_local * q;
            let known = self.prepared.has_surface(parent);
            let found = if known { self.closest(parent, &at) } else { None };
            found.map_or(f64::INFINITY, |(x, _)| (at - x).norm())
        };
        let step = all.len().div_ceil(MAX_POINTS).max(1);
        let thin = all.into_iter().step_by(step);
        thin.map(|(at, view)| NearbyPoint {
            at,
            scanner: self.scene.scanner(view),
            parent: distance(&at),
        })
        .collect()
    }
}

/// Eq. 4.1 in closed form: the turn about an axis that best brings points onto others, radians. It
/// is the twist about that axis of the rigid motion that also keeps two points of the axis.
fn about_axis(from: &[Vector], to: &[Vector], AxisEnds { ends, weight }: AxisEnds) -> f64 {
    let each = weight * from.len() as f64;
    let (mut a, mut b, mut weights) = (from.to_vec(), to.to_vec(), vec![1.0; from.len()]);
    for end in ends {
        a.push(end);
        b.push(end);
        weights.push(each);
    }
    let motion = rigid(&a, &b, &weights);
    let r = motion.rotation.to_rotation_matrix();
    let m = r.matrix();
    let axis = (ends[1] - ends[0]).normalize();
    let vee = Vector::new(m[(2, 1)] - m[(1, 2)], m[(0, 2)] - m[(2, 0)], m[(1, 0)] - m[(0, 1)]);
    let sin = axis.dot(&vee) / 2.0;
    let cos = (m.trace() - axis.dot(&(m * axis))) / 2.0;
    sin.atan2(cos)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Rotation3, Unit};

    #[test]
    fn the_turn_about_a_known_axis_comes_out_whatever_the_points_weigh() {
        let axis = Unit::new_normalize(Vector::new(0.3, -0.5, 0.8));
        let origin = Vector::new(1.0, 2.0, 0.5);
        let turn = Rotation3::from_axis_angle(&axis, 0.0345);
        let from: Vec<Vector> = (0..50)
            .map(|k| {
                let k = f64::from(k);
                origin + Vector::new((k * 0.7).sin(), (k * 1.3).cos(), (k * 0.37).sin()) * 0.3
            })
            .collect();
        let to: Vec<Vector> = from.iter().map(|p| origin + turn * (p - origin)).collect();
        let ends = [origin - axis.into_inner() * 0.25, origin + axis.into_inner() * 0.25];
        for weight in [0.01, 0.5, 50.0] {
            let found = about_axis(&from, &to, AxisEnds { ends, weight });
            assert!((found - 0.0345).abs() < 1e-9, "{found} at weight {weight}");
        }
        // Points that are off along the axis do not turn it when the axis weighs enough.
        let off: Vec<Vector> = to.iter().map(|p| p + axis.into_inner() * 0.004).collect();
        let found = about_axis(&from, &off, AxisEnds { ends, weight: 50.0 });
        assert!((found - 0.0345).abs() < 1e-4, "{found}");
    }
}
