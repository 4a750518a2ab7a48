//! An arm and a tool in; the arm that carries the tool out.

use crate::model::{Joint, JointKind, Link, Model, Motion, Role};
use geometry::{Pose, Vector};

/// Frames that tools are bolted to, by convention (ROS-Industrial, REP 199), best first.
const FLANGES: [&str; 3] = ["tool0", "flange", "tool"];

impl Model {
    /// Index of the link that a tool is bolted to: a frame of one of the usual names that hangs rigidly on the tip of the
    /// main chain, else the tip itself.
    #[must_use]
    pub fn flange(&self) -> Option<usize> {
        let tip = self.joints[*self.main_chain.last()?].child;
        let is_rigid = |mut at: usize| {
            while at != tip {
                let Some(j) = self.links[at].parent_joint else { return false };
                if self.joints[j].kind != JointKind::Fixed {
                    return false;
                }
                at = self.joints[j].parent;
            }
            true
        };
        let named = FLANGES.iter().filter_map(|name| self.link(name)).find(|&l| is_rigid(l));
        Some(named.unwrap_or(tip))
    }

    /// This robot with a tool's root link on its flange, turned by `mount` about the flange's z, radians. A joint of the
    /// tool whose name the robot has already gets the tool's before it; its joints come after the robot's own.
    ///
    /// `None` for a robot without a main chain.
    #[must_use]
    pub fn with_tool(&self, tool: &Self, mount: f64) -> Option<Self> {
        let flange = self.flange()?;
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
            let name = if is_taken {
                format!("{}/{}", tool.name, joint.name)
            } else {
                joint.name.clone()
            };
            Joint { name, parent, child, motion, ..joint.clone() }
        };
        // Its own joint first: parents before children.
        out.joints.push(Joint {
            name: format!("{}_mount", tool.name),
            kind: JointKind::Fixed,
            parent: flange,
            child: n_links,
            parent_from_joint: Pose::new(Vector::zeros(), Vector::z() * mount),
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
        Some(out)
    }
}
