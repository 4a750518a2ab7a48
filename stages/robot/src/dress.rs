//! Mounts a tool on an arm: two models become one model.

use crate::model::{Joint, JointKind, Link, Model, Motion, Role};
use geometry::{Pose, Vector};
use nalgebra::{Translation3, UnitQuaternion};
use std::f64::consts::PI;

/// Names of frames that tools are bolted to (ROS-Industrial, REP 199), in order of preference.
const FLANGES: [&str; 3] = ["tool0", "flange", "tool"];
/// Frames that differ by less are the same, metres and radians.
const SAME_FRAME: f64 = 1e-3;

impl Model {
    /// Indices of the links that a tool may be bolted to, without those at the same pose: frames
    /// that are rigidly connected to the last link that moves, those with the usual names first,
    /// then the tip of the main chain and other frames without a body, and last that link itself.
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

    /// The rotation `link_from_tool` with which a tool is mounted on this link before it is rotated
    /// about its own z: the tool's z runs along the axis of the robot's last joint, away from the
    /// body that carries the link, whichever way the link's own frame looks. Also returns whether
    /// the last joint turns the same way about that z (1) or the other (−1).
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

    /// This robot with a tool's root link on the link `flange`, oriented by [`Self::mount`] and
    /// then rotated by `mount` radians about its own z. The tool's joints follow the robot's own;
    /// where the robot has a joint of the same name, the tool's name is put in front.
    ///
    /// # Panics
    /// If the robot has no link `flange`.
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
        // The mounting joint comes first, since parents go before children.
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
