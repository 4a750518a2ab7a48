//! Closed loops of real models over their whole range and out of reach.
#![allow(missing_docs, clippy::unwrap_used, clippy::print_stdout)]

mod common;

use ::robot::{Form, Model, Role};
use common::sheets::{RPR, RRR, looped};
use common::{Dice, Folder, LIMIT, arm, check_twists, free, joint, link, robot};
use geometry::Point;

fn value(model: &Model, posture: &[f64], joint: &str) -> f64 {
    model.joint_values(posture)[model.joints.iter().position(|j| j.name == joint).unwrap()]
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
        // Beyond −π/2 the bars have passed through one line and both solutions are valid; the
        // coupled limits of the real machine end before.
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
                // Whole turns apart is the same pose.
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
    // At random postures the bars may be stretched out, where the derivative is unbounded.
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
    // Bars of 0.5 m each must span from the base to a point that moves farther than 1 m away.
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
