//! A robot of two boxes that is built without files.

use geometry::{Aabb, Pose, Vector};
use nalgebra::Unit;
use robot::{Joint, JointKind, Link, Mesh, Model, Motion, Role};
use simulate::solid::cuboid;
use std::sync::Arc;

/// A foot of 0.4 m and, on a joint about z at its top, an arm of 1 m along x.
pub(crate) fn two_boxes() -> Model {
    let link = |name: &str, mesh: Mesh, parent_joint| Link {
        name: name.into(),
        role: Role::Main,
        parent_joint,
        bounds: Aabb::of(mesh.vertices.iter().map(|v| v.map(f64::from))),
        mesh: mesh.into(),
        cad: Arc::default(),
    };
    Model {
        name: "two_boxes".into(),
        links: vec![
            link("foot", cuboid([0.4, 0.4, 0.4], 0.0).at([0.0, 0.0, 0.2]).mesh(), None),
            link("arm", cuboid([1.0, 0.2, 0.2], 0.0).at([0.5, 0.0, 0.1]).mesh(), Some(0)),
        ],
        joints: vec![Joint {
            name: "turn".into(),
            kind: JointKind::Revolute,
            parent: 0,
            child: 1,
            parent_from_joint: Pose::translation(0.0, 0.0, 0.4),
            axis: Unit::new_normalize(Vector::z()),
            limits: Some([-3.0, 3.0]),
            motion: Motion::Free(0),
        }],
        free: vec![0],
        ..Model::default()
    }
}
