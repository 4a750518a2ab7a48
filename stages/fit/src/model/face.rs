//! The face of a bare flange, and which points lie in front of it. A robot holds things there and
//! nowhere else: points in front of the face say nothing of the arm, while points beside the wrist
//! speak against a posture.

use geometry::Point;
use robot::{JointKind, Model, Role};

/// What hangs on a face begins so far behind it, metres: twice the noise of a common scanner.
const BEHIND: f32 = 0.005;

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
    /// The face of the last of the links `placed` by a model's last joint; `None` where that joint
    /// slides or a tool hangs there.
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
        let mut before = joint.parent;
        while model.links[before].bounds.is_empty() {
            before = model.joints[model.links[before].parent_joint?].parent;
        }
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
        (0..3).map(|k| q[k] * self.outward[k]).sum::<f32>() > self.height - BEHIND
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Prepared;
    use contract::OneByOne;

    /// A post whose flange turns about z, so far above its middle, metres; `kind` of the joint.
    fn model(height: f64, kind: &str) -> Model {
        let body = |name: &str, size: &str| {
            format!(
                "<link name='{name}'><visual><geometry><box size='{size}'/></geometry></visual></link>"
            )
        };
        let urdf = format!(
            "<robot name='post'>{}{}<joint name='a' type='{kind}'><parent link='post'/><child link='flange'/>\
             <origin xyz='0 0 {height}'/><axis xyz='0 0 1'/><limit lower='-3' upper='3' effort='1' velocity='1'/></joint></robot>",
            body("post", "0.2 0.2 1"),
            body("flange", "0.1 0.1 0.02")
        );
        let dir = tempfile::tempdir().expect("a folder");
        std::fs::write(dir.path().join("post.urdf"), urdf).expect("is written");
        let path = dir.path().join("post.urdf");
        Model::load_urdf(&path, "post", &robot::Settings::default()).expect("loads").0
    }

    #[test]
    fn what_lies_in_front_of_a_flange_may_hang_on_it() {
        for (height, way) in [(0.6, 1.0_f32), (-0.6, -1.0)] {
            let model = model(height, "revolute");
            let face = Prepared::new(0, &model, &OneByOne).face.expect("a face");
            assert_eq!(model.links[face.link].name, "flange");
            assert!(face.is_held([0.08, 0.0, way * 0.03]), "a gripper wider than the flange");
            assert!(!face.is_held([0.08, 0.0, way * -0.01]), "beside the wrist");
        }
    }

    #[test]
    fn a_carriage_has_no_face() {
        assert!(Prepared::new(0, &model(0.6, "prismatic"), &OneByOne).face.is_none());
    }
}
