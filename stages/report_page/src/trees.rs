//! Links, joints and loops of robots, from which the page computes where links are at any posture.

use crate::input::{PageLoop, PagePin};
use robot::{Joint, JointKind, Model, Motion};
use serde::Serialize;

/// A kinematic tree, as the page has it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct TreeEntry {
    links: Vec<String>,
    /// Parents before children.
    joints: Vec<TreeJoint>,
    loops: Vec<TreeLoop>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct TreeJoint {
    name: String,
    kind: &'static str,
    parent: usize,
    child: usize,
    /// Pose in the parent link's frame at value zero, metres.
    xyz: [f64; 3],
    quat_wxyz: [f64; 4],
    axis: [f64; 3],
    /// Radians or metres.
    limits: Option<[f64; 2]>,
    /// Joint that it follows, factor, offset.
    mimic: Option<(usize, f64, f64)>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct TreeLoop {
    /// Indices of joints.
    passive: Vec<usize>,
    pins: Vec<TreePin>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct TreePin {
    /// Indices of links.
    links: [usize; 2],
    points: [[f64; 3]; 2],
}

impl TreeEntry {
    pub(crate) fn new(model: &Model, loops: &[PageLoop]) -> Self {
        let links = model.links.iter().map(|link| link.name.clone()).collect();
        let joints = model.joints.iter().map(|joint| TreeJoint::new(model, joint)).collect();
        let loops = loops.iter().filter_map(|own| TreeLoop::new(model, own)).collect();
        Self { links, joints, loops }
    }
}

impl TreeJoint {
    fn new(model: &Model, joint: &Joint) -> Self {
        let (p, q) = (joint.parent_from_joint.translation, joint.parent_from_joint.rotation);
        let mimic = match joint.motion {
            Motion::Mimic { free, multiplier, offset } => {
                Some((model.free[free], multiplier, offset))
            }
            _ => None,
        };
        Self {
            name: joint.name.clone(),
            kind: match joint.kind {
                JointKind::Revolute => "revolute",
                JointKind::Continuous => "continuous",
                JointKind::Prismatic => "prismatic",
                JointKind::Fixed => "fixed",
            },
            parent: joint.parent,
            child: joint.child,
            xyz: [p.x, p.y, p.z],
            quat_wxyz: [q.w, q.i, q.j, q.k],
            axis: joint.axis.into_inner().into(),
            limits: joint.limits,
            mimic,
        }
    }
}

impl TreeLoop {
    /// The loop by indices; `None` where the model lacks one of its parts.
    fn new(model: &Model, own: &PageLoop) -> Option<Self> {
        let joint = |name: &String| model.joints.iter().position(|j| j.name == *name);
        let pin = |pin: &PagePin| {
            let [a, b] = &pin.links;
            Some(TreePin { links: [model.link(a)?, model.link(b)?], points: pin.points })
        };
        let passive = own.passive.iter().map(joint).collect::<Option<_>>()?;
        Some(Self { passive, pins: own.pins.iter().map(pin).collect::<Option<_>>()? })
    }
}
