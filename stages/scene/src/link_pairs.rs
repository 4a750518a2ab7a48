//! Pairs of links whose collisions mean nothing: neighbours, and links whose hulls overlap in the
//! found posture, in which the robot really stood.

use crate::joint_rules::JointRules;
use crate::plant_scene::PlantRobot;
use geometry::Pose;
use glamx::{Pose3, Rot3, Vec3};
use parry3d::query::intersection_test;
use parry3d::shape::SharedShape;
use robot::hull;

/// Why collisions of two links mean nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum PairReason {
    /// One joint or pin, or none, lies between them.
    Adjacent,
    /// Their hulls overlap in the found posture.
    Overlap,
}

/// All such pairs of links with bodies, ascending.
pub(crate) fn link_pairs(
    robot: &PlantRobot,
    rules: &JointRules,
) -> Vec<(usize, usize, PairReason)> {
    let model = &robot.model;
    let mut leader: Vec<usize> = (0..model.links.len()).collect();
    for (l, link) in model.links.iter().enumerate() {
        if let Some(j) = link.parent_joint.filter(|j| !robot.moves(*j)) {
            leader[l] = leader[model.joints[j].parent];
        }
    }
    let mut near: Vec<[usize; 2]> =
        model.joints.iter().map(|j| [leader[j.parent], leader[j.child]]).collect();
    near.extend(rules.pins.iter().map(|pin| [leader[pin.link_a], leader[pin.link_b]]));
    let poses = model.poses(&robot.posture);
    let of = |l| hulls(robot, l).into_iter().map(|(shape, _)| shape).collect();
    let shapes: Vec<Vec<SharedShape>> = (0..model.links.len()).map(of).collect();
    let mut out = Vec::new();
    for a in 0..model.links.len() {
        for b in a + 1..model.links.len() {
            let (la, lb) = (leader[a], leader[b]);
            if shapes[a].is_empty() || shapes[b].is_empty() {
                continue;
            }
            if la == lb || near.contains(&[la, lb]) || near.contains(&[lb, la]) {
                out.push((a, b, PairReason::Adjacent));
            } else if overlap(&shapes[a], &poses[a], &shapes[b], &poses[b]) {
                out.push((a, b, PairReason::Overlap));
            }
        }
    }
    out
}

/// Hulls of the bodies of a link in its frame, each with its vertices.
pub(crate) fn hulls(robot: &PlantRobot, link: usize) -> Vec<(SharedShape, Vec<[f32; 3]>)> {
    let bodies = robot.bodies(link);
    let hulls = bodies.iter().filter_map(|body| hull(&body.mesh.vertices));
    hulls
        .filter_map(|mesh| {
            let points: Vec<Vec3> = mesh.vertices.iter().map(|v| Vec3::from_array(*v)).collect();
            Some((SharedShape::convex_hull(&points)?, mesh.vertices))
        })
        .collect()
}

fn overlap(a: &[SharedShape], from_a: &Pose, b: &[SharedShape], from_b: &Pose) -> bool {
    let pose = |pose: &Pose| {
        let (p, q) = (pose.translation.vector.cast::<f32>(), pose.rotation.coords.cast::<f32>());
        Pose3::from_parts(Vec3::new(p.x, p.y, p.z), Rot3::from_xyzw(q.x, q.y, q.z, q.w))
    };
    let (from_a, from_b) = (pose(from_a), pose(from_b));
    let meet = |x: &SharedShape, y: &SharedShape| {
        // What cannot be compared does not count as an overlap.
        intersection_test(&from_a, &**x, &from_b, &**y).is_ok_and(|found| found.intersecting)
    };
    a.iter().any(|x| b.iter().any(|y| meet(x, y)))
}
