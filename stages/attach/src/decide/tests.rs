//! Hoses, tools, workpieces and walls beside a two-link robot.

use super::*;
use contract::{JointFit, Verdict};
use geometry::{Aabb, Pose, Vector};
use robot::{Joint, JointKind, Link, Motion, Role};
use std::sync::Arc;

fn model() -> Model {
    let link = |name: &str, parent_joint| Link {
        name: name.into(),
        role: Role::Main,
        parent_joint,
        mesh: Arc::default(),
        cad: Arc::default(),
        bounds: Aabb::EMPTY,
    };
    let joint = Joint {
        name: "j1".into(),
        kind: JointKind::Revolute,
        parent: 0,
        child: 1,
        parent_from_joint: Pose::identity(),
        axis: Vector::z_axis(),
        limits: None,
        motion: Motion::Free(0),
    };
    Model {
        name: "m".into(),
        links: vec![link("base", None), link("arm", Some(0))],
        joints: vec![joint],
        free: vec![0],
        loops: Vec::new(),
        main_chain: vec![0],
        symmetries: Vec::new(),
        mesh_sigmas: Vec::new(),
    }
}

fn fit() -> Fit {
    Fit {
        model: 0,
        model_name: "m".into(),
        world_from_base: Pose::identity(),
        base_sigma: [0.0; 6],
        joints: vec![JointFit {
            name: "j1".into(),
            value: 0.0,
            sigma: 0.0,
            certainty: contract::Certainty::Determined,
            ..JointFit::default()
        }],
        verdict: Verdict::Trusted,
        ..Fit::default()
    }
}

/// One voxel whose distance from link `link` is given in voxels.
fn voxel(at: Voxel, link: u16, n_away: i32) -> ResidualVoxel {
    ResidualVoxel {
        voxel: at,
        n_residual: 5,
        n_link: 0,
        nearest: LinkAt { robot: 0, link },
        distance: n_away as f32 * 0.02 + 0.01,
        at_border: false,
        grounded: false,
    }
}

fn attached(parts: &[Vec<ResidualVoxel>]) -> Attached {
    let attach = Attach::new(&[fit()], &[model()], Settings::default());
    let mut sum = attach.empty();
    for part in parts {
        attach.add(&mut sum, part.clone()).expect("add");
    }
    attach.finish(sum).expect("finish")
}

#[test]
fn a_workpiece_in_the_gripper_is_carried_whole() {
    let piece: Vec<_> =
        (0..40).flat_map(|x| (0..80).map(move |z| voxel([x, 0, z], 1, z))).collect();
    let out = attached(&[piece]);
    assert_eq!(out.voxels.len(), 40 * 80);
    assert_eq!(out.label([3, 0, 79]), Label { kind: PointKind::Attachment, robot: 0, link: 1 });
    assert_eq!(out.label([3, 1, 79]), Label::FIXED);
}

#[test]
fn a_hose_to_the_floor_is_cut_and_a_touched_wall_is_not_lost() {
    let mut hose: Vec<_> = (0..60).map(|z| voxel([0, 0, z], 1, z)).collect();
    hose[59].grounded = true;
    let out = attached(&[hose]);
    let n = out.voxels.iter().filter(|v| v.1.kind == PointKind::Attachment).count();
    assert_eq!(n, 8, "15 cm of it stay with the robot");
    let mut wall = Vec::new();
    for x in -30_i32..=30 {
        for y in -30_i32..=30 {
            let mut v = voxel([x, y, 0], 1, f64::from(x * x + y * y).sqrt() as i32);
            v.at_border = x.abs() == 30;
            wall.push(v);
        }
    }
    let out = attached(&[wall]);
    assert!(!out.voxels.is_empty());
    assert!(out.voxels.iter().all(|v| v.1 == Label::UNCERTAIN));
}

#[test]
fn voxels_that_touch_only_the_base_or_nothing_are_fixed() {
    let box_on_base: Vec<_> = (0..10).map(|z| voxel([0, 0, z], 0, z)).collect();
    let alone: Vec<_> = (0..10).map(|z| voxel([50, 0, z], 1, z + 10)).collect();
    let out = attached(&[box_on_base, alone]);
    assert!(out.voxels.is_empty());
}

#[test]
fn a_cable_between_base_and_arm_is_shared() {
    let cable: Vec<_> = (0..12)
        .map(|z| if z < 6 { voxel([0, 0, z], 0, z) } else { voxel([0, 0, z], 1, 11 - z) })
        .collect();
    let out = attached(&[cable]);
    assert_eq!(out.label([0, 0, 0]), Label::FIXED);
    assert_eq!(out.label([0, 0, 11]).kind, PointKind::Attachment);
}

#[test]
fn the_result_does_not_depend_on_the_order_of_parts() {
    let attach = Attach::new(&[fit()], &[model()], Settings::default());
    let part = |k: i32| -> Vec<ResidualVoxel> {
        (0..40).map(|z| voxel([(z * 7 + k) % 3, k % 2, z], 1, (z * 13 + k * 5) % 37)).collect()
    };
    let parts: Vec<_> = (0..9).map(part).collect();
    let whole = attached(&parts);
    for cut in 0..=parts.len() {
        let (mut a, mut b) = (attach.empty(), attach.empty());
        for (i, part) in parts.iter().enumerate() {
            attach.add(if i < cut { &mut a } else { &mut b }, part.clone()).expect("add");
        }
        attach.join(&mut a, b).expect("join");
        assert_eq!(attach.finish(a).expect("finish"), whole);
    }
}
