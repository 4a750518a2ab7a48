//! What is checked before a file is written, since readers accept it silently and go wrong.

use crate::plant_scene::{FixedBox, PlantRobot, PlantScene};
use contract::{Error, Kind, Result};
use geometry::Pose;
use robot::{JointKind, Mesh, Motion};

/// Deviation of a unit vector or quaternion from length one that is only rounding.
const UNIT: f64 = 1e-9;

impl PlantScene {
    /// Refuses a scene that formats would accept and readers misread: limits in the wrong order,
    /// quaternions and axes that are no units, triangles of vertices that are not there, values
    /// that are not finite, postures of another length, robots of the same name.
    ///
    /// # Errors
    /// The first fault, with robot and link or joint.
    pub fn check(&self) -> Result<()> {
        for (at, robot) in self.robots.iter().enumerate() {
            if robot.id.is_empty() || self.robots[..at].iter().any(|other| other.id == robot.id) {
                return Err(fault(robot, "", "its name is empty or that of another robot"));
            }
            check_robot(robot)?;
        }
        let is_box = |b: &FixedBox| {
            b.center.iter().all(|v| v.is_finite())
                && b.size.iter().all(|v| v.is_finite() && *v > 0.0)
        };
        if !self.fixed.iter().chain(self.touching.iter().flat_map(|t| &t.boxes)).all(is_box) {
            return Err(Error::new(Kind::Bug, "a box of the fixed world has no extent"));
        }
        let is_there = |[robot, link]: &[usize; 2]| {
            self.robots.get(*robot).is_some_and(|robot| *link < robot.model.links.len())
        };
        if !self.touching.iter().all(|t| t.links.iter().all(is_there) && !t.boxes.is_empty()) {
            return Err(Error::new(Kind::Bug, "the fixed world meets a link that is not there"));
        }
        Ok(())
    }
}

fn fault(robot: &PlantRobot, part: &str, what: &str) -> Error {
    Error::bad_input(what.to_owned())
        .at(format!("{} {} {part}", robot.id, robot.model.name).trim_end())
        .hint("`stillpoint robots lint` reports problems of the library")
}

fn is_pose(pose: &Pose) -> bool {
    let norm = pose.rotation.coords.norm();
    pose.translation.vector.iter().all(|v| v.is_finite()) && (norm - 1.0).abs() <= UNIT
}

fn is_whole(mesh: &Mesh) -> bool {
    let n = mesh.vertices.len();
    mesh.vertices.iter().flatten().all(|v| v.is_finite())
        && mesh.triangles.iter().flatten().all(|i| (*i as usize) < n)
}

fn check_robot(robot: &PlantRobot) -> Result<()> {
    let model = &robot.model;
    let (n_links, n_joints) = (model.links.len(), model.joints.len());
    if robot.posture.len() != model.free.len() || !robot.posture.iter().all(|v| v.is_finite()) {
        return Err(fault(robot, "", "its posture is not one finite value for each free joint"));
    }
    if robot.details.links.len() != n_links || robot.details.joints.len() != n_joints {
        return Err(fault(robot, "", "its URDF has other links or joints than its model"));
    }
    if !is_pose(&robot.world_from_base) {
        return Err(fault(robot, "", "its base has no finite pose with a unit quaternion"));
    }
    for joint in &model.joints {
        let bad = |what: &str| Err(fault(robot, &joint.name, what));
        if joint.parent >= n_links || joint.child >= n_links || joint.parent >= joint.child {
            return bad("the joint does not lead from a link to a later one");
        }
        if !is_pose(&joint.parent_from_joint) {
            return bad("the joint has no finite origin with a unit quaternion");
        }
        if (joint.axis.norm() - 1.0).abs() > UNIT {
            return bad("the axis of the joint has not length one");
        }
        let is_range = |[low, high]: [f64; 2]| low.is_finite() && high.is_finite() && low <= high;
        if !joint.limits.is_none_or(is_range) {
            return bad("the lower limit of the joint is above the upper one, or no number");
        }
        let is_free = matches!(joint.motion, Motion::Free(_)) && joint.kind != JointKind::Fixed;
        if is_free && joint.kind != JointKind::Continuous && joint.limits.is_none() {
            return bad("the joint has no limits and is not continuous");
        }
    }
    for link in 0..n_links {
        if !robot.bodies(link).iter().all(|body| is_whole(body.mesh)) {
            let what = "a mesh of the link names vertices that are not there, or not finite";
            return Err(fault(robot, robot.link_name(link), what));
        }
    }
    if !robot.values().iter().all(|v| v.is_finite()) {
        return Err(fault(robot, "", "a joint that follows others has no finite value"));
    }
    Ok(())
}
