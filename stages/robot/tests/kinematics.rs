//! Kinematics against yourdfpy, twists against finite differences, and tools on flanges.
#![allow(missing_docs, clippy::unwrap_used, clippy::print_stdout)]

mod common;

use ::robot::{Library, Motion, Settings};
use common::sheets::{RPR, RRR, looped};
use common::{Dice, Folder, arm, check_twists, free, joint, link, robot};

/// Poses of tip links at random postures, by yourdfpy 0.0.60 (Python), an independent reader of
/// URDF. Made once: three postures a model, uniform within the limits.
const POSES: &str = include_str!("common/yourdfpy.jsonl");

/// One reference pose: joint values in radians or metres, and the upper three rows of the matrix.
#[derive(serde::Deserialize)]
struct Placed {
    model: String,
    link: String,
    posture: std::collections::BTreeMap<String, f64>,
    base_from_link: [f64; 12],
}

#[test]
fn poses_agree_with_yourdfpy() {
    let Some(dir) = common::shared("robots") else {
        return;
    };
    let library = Library::load(&dir, &Settings::without_clouds()).unwrap();
    let mut worst = 0.0_f64;
    let poses: Vec<Placed> = POSES.lines().map(|row| serde_json::from_str(row).unwrap()).collect();
    for Placed { model: name, link, posture, base_from_link } in &poses {
        let model = &library.models[library.model(name).unwrap()];
        let mut q = vec![f64::NAN; model.free.len()];
        for (joint, value) in posture {
            q[free(model, joint)] = *value;
        }
        let got = model.poses(&q)[model.link(link).unwrap()].to_homogeneous();
        for r in 0..3 {
            for c in 0..4 {
                worst = worst.max((got[(r, c)] - base_from_link[4 * r + c]).abs());
            }
        }
        assert!(worst < 1e-9, "{name} {link} {worst}");
    }
    println!("{} poses, worst difference {worst:.1e}", poses.len());
}

#[test]
fn twists_are_derivatives_of_poses() {
    let Some(dir) = common::shared("robots") else {
        return;
    };
    for model in &Library::load(&dir, &Settings::without_clouds()).unwrap().models {
        check_twists(model, 1);
    }
    for (name, sheet) in RPR.iter().chain(RRR) {
        check_twists(&looped(name, sheet).unwrap(), 2);
    }
}

#[test]
fn a_tool_on_a_flange_moves_as_its_own_chain_does_there() {
    let Some(mut arm) = looped(RRR[0].0, RRR[0].1) else { return };
    let gripper = looped(RRR[1].0, RRR[1].1).expect("the gripper loads");
    let flange = arm.flanges()[0];
    let mount = 0.4;
    let both = arm.with_tool(&gripper, flange, mount);
    assert_eq!(both.free.len(), arm.free.len() + gripper.free.len());
    let mut dice = Dice::new(8);
    for _ in 0..20 {
        let (q, grip) = (dice.posture(&arm), dice.posture(&gripper));
        let whole: Vec<f64> = q.iter().chain(&grip).copied().collect();
        let (own, tool, poses) = (arm.poses(&q), gripper.poses(&grip), both.poses(&whole));
        let turn = geometry::Pose::rotation(geometry::Vector::z() * mount);
        for (l, pose) in tool.iter().enumerate() {
            let off = (own[flange] * turn * pose).inverse() * poses[own.len() + l];
            assert!(
                off.translation.vector.norm() < 1e-9 && off.rotation.angle() < 1e-9,
                "link {l}"
            );
        }
        assert!(both.loop_gap(&whole) < 1e-9);
    }
    arm.main_chain.clear();
    assert!(arm.flanges().is_empty());
}

#[test]
fn a_tool_looks_away_from_the_arm_whichever_way_the_frame_of_its_flange_looks() {
    let z = geometry::Vector::z();
    for (name, ahead) in [
        ("abb_irb4600_20_250", [0.0, 0.0, 1.0]),
        ("fanuc_r2000ic_165f", [1.0, 0.0, 0.0]), // its only frame is a REP 199 `flange`, x ahead
        ("yaskawa_mpl80", [0.0, 0.0, -1.0]),     // its tool0 looks into the wrist
    ] {
        let Some(model) = looped(name, "") else { return };
        let (turn, _) = model.mount(model.flanges()[0]);
        assert!((turn * z - geometry::Vector::from(ahead)).norm() < 1e-9, "{name}");
    }
}

#[test]
fn mimics_follow_without_limits() {
    let text = arm(1)
        + &link("m")
        + &link("mm")
        + &joint(
            "mj",
            "revolute",
            "l1",
            "m",
            "0 0 1",
            "<limit lower='0' upper='0.1'/><mimic joint='j1' multiplier='-2' offset='0.5'/>",
        )
        + &joint("mmj", "prismatic", "m", "mm", "0 0 1", "<mimic joint='mj' multiplier='0.5'/>");
    let (model, _) = Folder::new().with("robot.urdf", robot(&text)).load();
    let values = model.joint_values(&[0.7]);
    assert!((values[1] + 0.9).abs() < 1e-12 && (values[2] + 0.45).abs() < 1e-12, "{values:?}");
    assert!(matches!(model.joints[2].motion, Motion::Mimic { free: 0, .. }));
    check_twists(&model, 11);
}
