//! A model in; out comes the face of its flange, and which points lie in front of it: what a robot holds hangs there and
//! nowhere else, so such points say nothing of the arm, and others beside the wrist speak against a posture.

use geometry::Point;
use robot::{JointKind, Model, Role};

/// What hangs on a face is seen from this far behind it on, metres: twice the noise of a common scanner.
const THICK: f32 = -0.005;

/// The face of a flange.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Face {
    /// The link that has it.
    pub(crate) link: usize,
    /// Away from the arm, link frame, unit length.
    outward: [f32; 3],
    /// Distance from the link's origin along it, metres.
    height: f32,
}

impl Face {
    /// The face of the last link that a model's last joint places; `None` where that joint slides or a tool hangs there.
    pub(crate) fn of(model: &Model, placed: &[usize]) -> Option<Self> {
        let &link = placed.last()?;
        let joint = &model.joints[*model.free.last()?];
        let has_tool = model.links.iter().any(|l| l.role == Role::Effector && !l.bounds.is_empty());
        if has_tool || joint.kind == JointKind::Prismatic {
            return None;
        }
        let poses = model.poses(&model.home());
        let axis = poses[link].inverse() * (poses[joint.child] * joint.axis.into_inner());
        // The body before it is on the other side.
        let others = (0..model.links.len()).rev();
        let before =
            others.filter(|l| !placed.contains(l) && !model.links[*l].bounds.is_empty()).max()?;
        let before: Point =
            poses[link].inverse() * (poses[before] * model.links[before].bounds.center());
        let middle: Point = model.links[link].bounds.center();
        let outward = if axis.dot(&(middle - before)) < 0.0 { -axis } else { axis };
        let outward: [f32; 3] = outward.cast::<f32>().into();
        let along = |p: &[f32; 3]| (0..3).map(|k| p[k] * outward[k]).sum::<f32>();
        let height = model.links[link].cad.points.iter().map(along).fold(f32::MIN, f32::max);
        Some(Self { link, outward, height })
    }

    /// Whether a point, link frame, may be of what hangs on it.
    pub(crate) fn is_held(&self, q: [f32; 3]) -> bool {
        (0..3).map(|k| q[k] * self.outward[k]).sum::<f32>() > self.height + THICK
    }
}
