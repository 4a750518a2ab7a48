//! Kinematics against yourdfpy, twists against differences, loops against their descriptions.
#![allow(missing_docs, clippy::unwrap_used, clippy::print_stdout)]

mod common;

use ::robot::{Form, Library, Model, Motion, Role, Settings};
use common::{Dice, Folder, LIMIT, arm, joint, link, robot};
use geometry::{Point, Vector};

const RPR: &[(&str, &str)] = &[
    ("abb_irb6640_205_275", "urdf = 'robot_loop.urdf'
        [[sub_chain]]
        name = 'balancer'
        kind = 'RPR'
        passive = ['joint_cylinder', 'joint_piston']
        closures = [{ link_a = 'link_piston', xyz_a = [0, -0.194, 0], link_b = 'link_2', xyz_b = [-0.22, -0.194, -0.0673] }]"),
    ("abb_irb7600_150_350", "urdf = 'robot_loop.urdf'
        [[sub_chain]]
        name = 'balancer'
        kind = 'RPR'
        passive = ['balancer_cylinder_joint', 'balancer_rod_joint']
        closures = [{ link_a = 'balancer_rod', xyz_a = [0, -0.2155, 0], link_b = 'link_2', xyz_b = [-0.1385, -0.2155, -0.022] }]"),
    ("fanuc_m900ib_700", "urdf = 'robot_loop.urdf'
        [[sub_chain]]
        name = 'parallelogram'
        kind = 'RRR'
        passive = ['pjoint_1', 'pjoint_2']
        closures = [{ link_a = 'plink_2', xyz_a = [0, 0, -1.12], link_b = 'plink_1', xyz_b = [-0.75, 0.08, 0] }]
        [[sub_chain]]
        name = 'springs'
        kind = 'RPR'
        passive = ['piston_left_joint', 'balancer_left_joint', 'piston_right_joint', 'balancer_right_joint']
        closures = [
          { link_a = 'balancer_left', xyz_a = [0, 0.3957, 0], link_b = 'link_2', xyz_b = [0, 0.3957, 1.12] },
          { link_a = 'balancer_right', xyz_a = [0, -0.3957, 0], link_b = 'link_2', xyz_b = [0, -0.3957, 1.12] },
        ]"),
    ("fanuc_r2000ic_165f", "urdf = 'robot_loop.urdf'
        [[sub_chain]]
        name = 'balancer'
        passive = ['balancer_cylinder_joint', 'balancer_rod_joint']
        closures = [{ link_a = 'balancer_rod', xyz_a = [0, 0, 0], link_b = 'J2_link', xyz_b = [-0.2142, 0.189, -0.0176] }]"),
    ("yaskawa_es165", "urdf = 'robot_loop.urdf'
        [[sub_chain]]
        name = 'balancer'
        passive = ['joint_balancer_piston', 'joint_balancer_rod']
        closures = [{ link_a = 'balancer_rod', xyz_a = [0, -0.19, 0], link_b = 'link_l', xyz_b = [0.126187, -0.19, 0.180213] }]"),
];

const RRR: &[(&str, &str)] = &[
    ("abb_irb2400_12_155", "[[sub_chain]]
        name = 'parallelogram'
        kind = 'RRR'
        passive = ['joint_lever_a', 'joint_lever_b']
        closures = [{ link_a = 'link_lever_b', xyz_a = [0, -0.06, -0.705], link_b = 'link_lever_a', xyz_b = [-0.18, -0.06, 0] }]"),
    ("robotiq_2f_85", "[[sub_chain]]
        name = 'fingers'
        kind = 'RRR'
        passive = ['left_inner_knuckle_joint', 'left_inner_finger_joint', 'right_inner_knuckle_joint', 'right_inner_finger_joint']
        closures = [
          { link_a = 'left_inner_knuckle', xyz_a = [0, 0.0372, 0.0435], link_b = 'left_inner_finger', xyz_b = [0, -0.018, 0.0065] },
          { link_a = 'right_inner_knuckle', xyz_a = [0, 0.0372, 0.0435], link_b = 'right_inner_finger', xyz_b = [0, -0.018, 0.0065] },
        ]"),
];

fn looped(name: &str, sheet: &str) -> Option<Model> {
    let (model, findings) = Folder::of(name)?.with("robot.toml", sheet).load();
    for f in findings {
        println!("{f:?}");
    }
    Some(model)
}

fn value(model: &Model, posture: &[f64], joint: &str) -> f64 {
    model.joint_values(posture)[model.joints.iter().position(|j| j.name == joint).unwrap()]
}

fn free(model: &Model, joint: &str) -> usize {
    model.free.iter().position(|&j| model.joints[j].name == joint).unwrap()
}

/// Twists against central differences of poses, at random postures.
fn check_twists(model: &Model, seed: u64) {
    let mut dice = Dice::new(seed);
    let step = 1e-6;
    for _ in 0..4 {
        let posture = dice.posture(model);
        let at = model.kinematics(&posture);
        assert_eq!(at.base_from_link, model.poses(&posture));
        for k in 0..posture.len() {
            let moved = |by: f64| {
                let mut posture = posture.clone();
                posture[k] += by;
                model.poses(&posture)
            };
            let (before, after) = (moved(-step), moved(step));
            for (l, link) in model.links.iter().enumerate() {
                let [a, b, c, d, e, f] = at.twists[l][k];
                let (v, w) = (Vector::new(a, b, c), Vector::new(d, e, f));
                for p in [Point::origin(), Point::new(0.3, -0.2, 0.5)] {
                    let expected = (after[l] * p - before[l] * p) / (2.0 * step);
                    let got = v + w.cross(&(at.base_from_link[l] * p).coords);
                    let error = (expected - got).norm();
                    assert!(
                        error < 1e-6,
                        "{} {} free {k}: {expected} {got}",
                        model.name,
                        link.name
                    );
                }
            }
        }
    }
}

/// Poses of tip links at random postures, by yourdfpy 0.0.60 (Python), an independent reader of URDF. Made once: three postures
/// a model, uniform within the limits.
const POSES: &str = include_str!("common/yourdfpy.jsonl");

/// One of them: radians or metres by joint; the upper three rows of the matrix.
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
fn loops_close_over_the_whole_range() {
    for (name, sheet) in RPR.iter().chain(RRR) {
        let Some(model) = looped(name, sheet) else {
            return;
        };
        assert!(model.loops.iter().all(|l| l.form != Form::General), "{name}");
        let mut dice = Dice::new(3);
        for _ in 0..200 {
            let posture = dice.posture(&model);
            let gap = model.loop_gap(&posture);
            assert!(gap < 1e-9, "{name} {posture:?} {gap}");
        }
        for l in &model.loops {
            for &j in &l.passive {
                assert_eq!(
                    model.links[model.joints[j].child].role,
                    expected_role(&model, j),
                    "{name}"
                );
            }
        }
    }
}

fn expected_role(model: &Model, joint: usize) -> Role {
    if model.main_chain.contains(&joint) { Role::Main } else { Role::Sub }
}

#[test]
fn balancers_follow_their_tables() {
    for (name, sheet) in RPR {
        let Some(dir) = common::shared("robots") else {
            return;
        };
        let text = std::fs::read_to_string(dir.join(name).join("loops.md")).unwrap();
        let driver = text.split("Driver: `").nth(1).unwrap().split('`').next().unwrap();
        let model = looped(name, sheet).unwrap();
        let spring = model.loops.iter().find(|l| matches!(l.form, Form::Rpr { .. })).unwrap();
        let mut n = 0;
        for line in text.lines().filter(|l| l.starts_with("| -") || l.starts_with("| +")) {
            let row: Vec<f64> = line.split('|').filter_map(|c| c.trim().parse().ok()).collect();
            let [q, _, phi, _, stroke, _] = row[..] else {
                continue;
            };
            let mut posture = model.home();
            posture[free(&model, driver)] = q;
            let values = model.joint_values(&posture);
            let got = [values[spring.passive[0]], values[spring.passive[1]]];
            assert!(
                (got[0] - phi).abs() < 2e-4 && (got[1] - stroke).abs() < 2e-4,
                "{name} {line} {got:?}"
            );
            n += 1;
        }
        assert_eq!(n, 7, "{name}");
    }
}

#[test]
fn parallelograms_follow_their_mimic_and_fingers_nearly() {
    let Some(model) = looped(RRR[0].0, RRR[0].1) else {
        return;
    };
    let m900 = looped(RPR[2].0, RPR[2].1).unwrap();
    let gripper = looped(RRR[1].0, RRR[1].1).unwrap();
    let mut dice = Dice::new(5);
    for _ in 0..50 {
        let q = dice.posture(&model);
        let q3 = q[free(&model, "joint_3")];
        assert!((value(&model, &q, "joint_lever_a") - q3).abs() < 1e-9);
        assert!((value(&model, &q, "joint_lever_b") + q3).abs() < 1e-9);
        let mut q = dice.posture(&m900);
        // Beyond −π/2 the bars have passed through one line and the other solution is as good; the real machine's
        // coupled limits end before.
        let q3 = &mut q[free(&m900, "joint_3")];
        *q3 = q3.max(-1.5);
        let q3 = *q3;
        assert!((value(&m900, &q, "pjoint_1") + q3).abs() < 1e-9);
        assert!((value(&m900, &q, "pjoint_2") - q3).abs() < 1e-9);
        let q = dice.posture(&gripper);
        assert!((value(&gripper, &q, "left_inner_knuckle_joint") - q[0]).abs() < 0.1);
        assert!((value(&gripper, &q, "right_inner_finger_joint") + q[0]).abs() < 0.1);
    }
    assert!(gripper.is_tool() && !model.is_tool());
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
fn newton_agrees_with_the_closed_forms() {
    for (name, sheet) in RPR.iter().chain(RRR) {
        let Some(exact) = looped(name, sheet) else {
            return;
        };
        let sheet = sheet.replace("kind = 'RPR'", "").replace("kind = 'RRR'", "");
        let sheet = sheet.replace("passive =", "kind = 'general'\npassive =");
        let newton = looped(name, &sheet).unwrap();
        assert!(newton.loops.iter().all(|l| l.form == Form::General), "{name}");
        let mut dice = Dice::new(6);
        for _ in 0..10 {
            let q = dice.posture(&exact);
            for (a, b) in exact.joint_values(&q).iter().zip(newton.joint_values(&q)) {
                // A turn more or less is the same pose.
                let apart = (a - b).abs() % std::f64::consts::TAU;
                assert!(apart.min(std::f64::consts::TAU - apart) < 1e-8, "{name} {q:?} {a} {b}");
            }
        }
        check_twists(&newton, 7);
    }
}

/// Two parallelograms on a two-link arm keep a wrist plate level; the second stands on the first.
fn palletiser() -> Folder {
    let mut text = arm(2);
    for name in ["plate", "tool"] {
        text += &link(name);
    }
    text += &joint("plate_joint", "continuous", "l2", "plate", "0 0 1", "");
    text += &joint("tool_joint", "revolute", "plate", "tool", "0 0 0", LIMIT);
    let sub = link("l0")
        + &link("bar_1")
        + &joint("bar_1_joint", "continuous", "l0", "bar_1", "-0.3 0 1", "");
    let sub_2 = link("l1")
        + &link("triangle")
        + &link("bar_2")
        + &joint("triangle_joint", "continuous", "l1", "triangle", "0 0 1", "")
        + &joint("bar_2_joint", "continuous", "triangle", "bar_2", "0.3 0 0", "");
    Folder::new().with("robot.urdf", robot(&text)).with("sub_1.urdf", robot(&sub)).with("sub_2.urdf", robot(&sub_2)).with(
        "robot.toml",
        "[main_chain]
        tip = 'tool'
        [[sub_chain]]
        name = 'second'
        passive = ['bar_2_joint', 'plate_joint']
        closures = [{ link_a = 'bar_2', xyz_a = [0, 0, 1], link_b = 'plate', xyz_b = [0.3, 0, 0] }]
        [[sub_chain]]
        name = 'bars'
        urdf = 'sub_2.urdf'
        passive = []
        [[sub_chain]]
        name = 'first'
        urdf = 'sub_1.urdf'
        passive = ['bar_1_joint', 'triangle_joint']
        closures = [{ link_a = 'bar_1', xyz_a = [0, 0, 1], link_b = 'triangle', xyz_b = [-0.3, 0, 0] }]",
    )
}

#[test]
fn loops_on_loops_keep_the_plate_level() {
    let folder = palletiser();
    println!("{:?}", folder.lint());
    let (model, _) = folder.load();
    assert_eq!(model.free.len(), 3);
    assert_eq!(model.loops[0].name, "first");
    let plate = model.link("plate").unwrap();
    assert_eq!(model.links[plate].role, Role::Main);
    assert_eq!(model.links[model.link("bar_2").unwrap()].role, Role::Sub);
    for (a, b) in [(0.3, -0.4), (-0.6, 0.5), (0.9, -0.2)] {
        let pose = model.poses(&[a, b, 0.1])[plate];
        assert!(pose.rotation.angle() < 1e-9, "{a} {b} {}", pose.rotation.angle());
        assert!(model.loop_gap(&[a, b, 0.1]) < 1e-9);
    }
    // Random postures may stretch the bars, where the derivative has no bound: stay inside.
    let mut model = model;
    for joint in &mut model.joints {
        joint.limits = joint.limits.map(|_| [-0.6, 0.6]);
    }
    check_twists(&model, 8);
}

#[test]
fn a_bar_points_at_its_pin_and_says_how_far_it_misses() {
    let bar =
        link("l0") + &link("bar") + &joint("bar_joint", "revolute", "l0", "bar", "0.4 0 0", LIMIT);
    let folder =
        Folder::new().with("robot.urdf", robot(&arm(2))).with("bar.urdf", robot(&bar)).with(
            "robot.toml",
            "[[sub_chain]]
        name = 'bar'
        urdf = 'bar.urdf'
        kind = 'RR'
        closures = [{ link_a = 'bar', xyz_a = [0, 0, 1.0], link_b = 'l1', xyz_b = [0.4, 0, 0] }]",
        );
    let (model, _) = folder.load();
    assert_eq!(model.loops[0].form, Form::Rr);
    assert!(model.loop_gap(&[0.0, 0.3]) < 1e-12);
    let q = [0.4, 0.3];
    let poses = model.poses(&q);
    let (bar, l1) = (poses[model.link("bar").unwrap()], poses[model.link("l1").unwrap()]);
    let (origin, end, pin) =
        (bar * Point::origin(), bar * Point::new(0.0, 0.0, 1.0), l1 * Point::new(0.4, 0.0, 0.0));
    assert!((end - origin).cross(&(pin - origin)).norm() < 1e-12);
    assert!((model.loop_gap(&q) - (pin - end).norm()).abs() < 1e-12);
    check_twists(&model, 9);
}

#[test]
fn out_of_reach_takes_the_nearest_pose() {
    // Bars of 0.5 m each must span from the foot to a point that goes further than 1 m away.
    let bars = link("l0")
        + &link("a")
        + &link("b")
        + &joint("a_joint", "revolute", "l0", "a", "0.2 0 1", LIMIT)
        + &joint("b_joint", "revolute", "a", "b", "0.4 0 0.3", LIMIT);
    let folder = Folder::new().with("robot.urdf", robot(&arm(2))).with("bars.urdf", robot(&bars)).with(
        "robot.toml",
        "[[sub_chain]]
        urdf = 'bars.urdf'
        closures = [{ link_a = 'b', xyz_a = [-0.4, 0, 0.3], link_b = 'l1', xyz_b = [0.2, 0, 0.6] }]",
    );
    let (model, findings) = folder.load();
    assert!(matches!(model.loops[0].form, Form::RrrSerial { .. }));
    assert!(model.loop_gap(&[0.0, 0.0]) < 1e-9);
    assert!(!findings.iter().any(|f| f.what.contains("stays open")), "{findings:?}");
    let far = Folder::new().with("robot.urdf", robot(&arm(2))).with("bars.urdf", robot(&bars)).with(
        "robot.toml",
        "[[sub_chain]]
        urdf = 'bars.urdf'
        closures = [{ link_a = 'b', xyz_a = [-0.4, 0, 0.3], link_b = 'l1', xyz_b = [0.7, 0, 0.9] }]",
    );
    let (model, findings) = far.load();
    assert!(findings.iter().any(|f| f.what.contains("stays open")), "{findings:?}");
    let q = [0.0, 0.0];
    let distance = (0.5_f64 * 0.5 + 0.9 * 0.9).sqrt();
    assert!((model.loop_gap(&q) - (distance - 1.0)).abs() < 1e-9, "{}", model.loop_gap(&q));
    check_twists(&model, 10);
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
