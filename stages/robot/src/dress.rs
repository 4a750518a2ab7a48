//! An arm and a tool in; the arm that carries the tool out.

use crate::model::{Joint, JointKind, Link, Model, Motion, Role};
use geometry::{Pose, Vector};
use nalgebra::{Translation3, UnitQuaternion};
use std::f64::consts::PI;

/// Frames that tools are bolted to, by convention (ROS-Industrial, REP 199), best first.
const FLANGES: [&str; 3] = ["tool0", "flange", "tool"];
/// Frames that differ by less are one, metres and radians.
const SAME_FRAME: f64 = 1e-3;

impl Model {
    /// Links that a tool may be bolted to: frames that hang rigidly on the last link that moves,
    /// those of the usual names first, then the tip of the main chain and others without a
    /// body, and that link itself; those that stand alike once.
    #[must_use]
    pub fn flanges(&self) -> Vec<usize> {
        let moves = |j: &&usize| self.joints[**j].kind != JointKind::Fixed;
        let Some(&last) = self.main_chain.iter().rev().find(moves) else { return Vec::new() };
        let carrier = self.joints[last].child;
        let is_rigid = |mut at: usize| {
            while at != carrier {
                let Some(j) = self.links[at].parent_joint else { return false };
                if self.joints[j].kind != JointKind::Fixed {
                    return false;
                }
                at = self.joints[j].parent;
            }
            true
        };
        let tip = self.main_chain.last().map(|&j| self.joints[j].child);
        let named = FLANGES.iter().filter_map(|name| self.link(name));
        let frames = (0..self.links.len()).filter(|&l| self.links[l].bounds.is_empty());
        let poses = self.poses(&self.home());
        let mut out: Vec<usize> = Vec::new();
        for link in named.chain(tip).chain(frames).chain([carrier]).filter(|&l| is_rigid(l)) {
            let apart = |k: &usize| {
                let off = poses[*k].inverse() * poses[link];
                off.translation.vector.norm() > SAME_FRAME || off.rotation.angle() > SAME_FRAME
            };
            if out.iter().all(apart) {
                out.push(link);
            }
        }
        out
    }

    /// How a tool stands on this link before it is turned: its z along the axis of the robot's last
    /// joint, away from the body that carries the link, whichever way the link's own frame
    /// looks; and whether that joint turns the same way about z (1) or the other (−1).
    #[must_use]
    pub fn mount(&self, flange: usize) -> (UnitQuaternion<f64>, f64) {
        let poses = self.poses(&self.home());
        let flange_from_world = poses[flange].inverse();
        let up = |l: &usize| self.links[*l].parent_joint.map(|j| self.joints[j].parent);
        let carriers = || std::iter::successors(Some(flange), up);
        let turns = |l: &usize| {
            let joint = &self.joints[self.links[*l].parent_joint?];
            let axis = flange_from_world * (poses[*l] * joint.axis.into_inner());
            (joint.kind != JointKind::Fixed).then_some(axis)
        };
        let axis = carriers().find_map(|l| turns(&l)).unwrap_or_else(Vector::z);
        let body = carriers().find(|l| !self.links[*l].bounds.is_empty());
        let inward = body.map_or_else(Vector::zeros, |l| {
            (flange_from_world * (poses[l] * self.links[l].bounds.center())).coords
        });
        let way = if inward.dot(&axis) > 0.0 { -1.0 } else { 1.0 };
        let turn = UnitQuaternion::rotation_between(&Vector::z(), &(axis * way))
            .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector::x_axis(), PI));
        (turn, way)
    }

    /// This robot with a tool's root link on one of its links, as [`Self::mount`] has it and turned
    /// by `mount` about its own z, radians. A joint of the tool whose name the robot has
    /// already gets the tool's before it; its joints come after the robot's own.
    ///
    /// # Panics
    /// If there is no such link.
    #[must_use]
    pub fn with_tool(&self, tool: &Self, flange: usize, mount: f64) -> Self {
        assert!(flange < self.links.len(), "a tool hangs on a link of its robot");
        let (n_links, n_joints, n_free) = (self.links.len(), self.joints.len(), self.free.len());
        let mut out = self.clone();
        let moved = |joint: &Joint| {
            let motion = match joint.motion {
                Motion::Free(free) => Motion::Free(free + n_free),
                Motion::Mimic { free, multiplier, offset } => {
                    Motion::Mimic { free: free + n_free, multiplier, offset }
                }
                Motion::Loop(at) => Motion::Loop(at + self.loops.len()),
                Motion::Fixed => Motion::Fixed,
            };
            let (parent, child) = (joint.parent + n_links, joint.child + n_links);
            let is_taken = self.joints.iter().any(|j| j.name == joint.name);
            let name =
                if is_taken { format!("{}/{}", tool.name, joint.name) } else { joint.name.clone() };
            Joint { name, parent, child, motion, ..joint.clone() }
        };
        // Its own joint first: parents before children.
        out.joints.push(Joint {
            name: format!("{}_mount", tool.name),
            kind: JointKind::Fixed,
            parent: flange,
            child: n_links,
            parent_from_joint: Pose::from_parts(
                Translation3::identity(),
                self.mount(flange).0 * UnitQuaternion::from_axis_angle(&Vector::z_axis(), mount),
            ),
            axis: Vector::z_axis(),
            limits: None,
            motion: Motion::Fixed,
        });
        out.joints.extend(tool.joints.iter().map(moved));
        let at = |joint: usize| joint + n_joints + 1;
        out.links.extend(tool.links.iter().map(|link| Link {
            role: Role::Effector,
            parent_joint: Some(link.parent_joint.map_or(n_joints, at)),
            ..link.clone()
        }));
        out.free.extend(tool.free.iter().map(|&j| at(j)));
        for own in &tool.loops {
            let mut own = own.clone();
            own.passive.iter_mut().for_each(|j| *j = at(*j));
            for pin in &mut own.closures {
                (pin.link_a, pin.link_b) = (pin.link_a + n_links, pin.link_b + n_links);
            }
            out.loops.push(own);
        }
        out.mesh_sigmas.extend(tool.mesh_sigmas.iter().map(|(l, s)| (l + n_links, *s)));
        let turned = tool.symmetries.iter().map(|s| {
            let mut own = *s;
            own.link += n_links;
            own
        });
        out.symmetries.extend(turned);
        out
    }
}
