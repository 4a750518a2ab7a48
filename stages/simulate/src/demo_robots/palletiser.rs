//! The palletiser: four axes, bars (RR) that keep elbow plate and wrist level, and a rod that
//! drives the forearm from the carousel.

use super::axes::{FULL_TURN, Y, Z};
use super::castings::{bar, boom, cheek, foot, hub, motor, pipe, rib, trunk};
use super::design::{Design, DesignPart, DesignSubChain, Hinge};
use super::names::PALLETISER;
use crate::solid::{Solid, bolts, cuboid, disc, lathe};

/// Height of joint 1 above the foot, metres.
const NECK: f64 = 0.38;
/// Joint 2 from joint 1, metres.
const SHOULDER: [f64; 3] = [0.16, 0.0, 0.42];
/// Length of the upper arm, metres.
const UPPER: f64 = 0.86;
/// Length of the forearm, metres.
const FORE: f64 = 1.02;
/// Pin of the upper arm's bar beside joint 2 and beside the elbow, metres.
const BAR_A: [f64; 3] = [-0.17, -0.19, 0.10];
/// Pin of the forearm's bar beside the elbow and beside the wrist, metres.
const BAR_B: [f64; 3] = [0.06, -0.19, 0.19];
/// Length of the drive lever and of the forearm's rear arm, metres.
const LEVER: f64 = 0.30;
/// Plane of the drive lever, metres.
const LEVER_Y: f64 = 0.20;
/// Plane of the drive rod, metres.
const ROD_Y: f64 = 0.265;
/// Limits of joints that bars set, radians.
const FREE: [f64; 2] = [-3.2, 3.2];

pub(super) fn design() -> Design {
    let part = |name, body| DesignPart { name, body: Some(body) };
    Design {
        name: PALLETISER,
        parts: vec![
            part("base_link", base()),
            part("link_1", carousel()),
            part("link_2", upper_arm()),
            part("elbow_plate", elbow_plate()),
            part("link_3", forearm()),
            part("wrist_plate", wrist_plate()),
            part("link_4", flange()),
            part("lever", lever()),
            DesignPart { name: "tool0", body: None },
        ],
        hinges: hinges(),
        tip: "tool0",
        sub_chains: bars(),
        effector: None,
    }
}

/// The joints; those of plates and lever follow those of the arm.
fn hinges() -> Vec<Hinge> {
    let turn = Hinge::turn;
    vec![
        turn("joint_1", "base_link", "link_1", [0.0, 0.0, NECK], Z, FULL_TURN),
        turn("joint_2", "link_1", "link_2", SHOULDER, Y, [-0.70, 1.20]),
        turn("joint_elbow_plate", "link_2", "elbow_plate", [0.0, 0.0, UPPER], Y, FREE)
            .following("joint_2", -1.0),
        turn("joint_3", "elbow_plate", "link_3", [0.0; 3], Y, [-0.35, 1.22]),
        turn("joint_wrist_plate", "link_3", "wrist_plate", [FORE, 0.0, 0.0], Y, FREE)
            .following("joint_3", -1.0),
        turn("joint_4", "wrist_plate", "link_4", [0.10, 0.0, -0.16], Z, FULL_TURN),
        Hinge::fixed("joint_tool0", "link_4", "tool0", [0.0, 0.0, -0.045]),
        turn("joint_lever", "link_1", "lever", [SHOULDER[0], LEVER_Y, SHOULDER[2]], Y, FREE)
            .following("joint_3", 1.0),
    ]
}

/// The bars, each a sub chain that a pin closes.
fn bars() -> Vec<DesignSubChain> {
    let bar_chain = |name, root, link: &'static str, joint, at, body, pin| DesignSubChain {
        name,
        kind: "RR",
        root,
        parts: vec![DesignPart { name: link, body: Some(body) }],
        hinges: vec![Hinge::turn(joint, root, link, at, Y, FREE)],
        pin,
    };
    let foot_of_a = [0, 1, 2].map(|i| SHOULDER[i] + BAR_A[i]);
    vec![
        bar_chain(
            "bar_a",
            "link_1",
            "bar_a",
            "joint_bar_a",
            foot_of_a,
            bar([0.0, 0.0], [0.0, UPPER], 0.0, 0.022),
            ("bar_a", [0.0, 0.0, UPPER], "elbow_plate", BAR_A),
        ),
        bar_chain(
            "bar_b",
            "elbow_plate",
            "bar_b",
            "joint_bar_b",
            BAR_B,
            bar([0.0, 0.0], [FORE, 0.0], 0.0, 0.02),
            ("bar_b", [FORE, 0.0, 0.0], "wrist_plate", BAR_B),
        ),
        bar_chain(
            "drive_rod",
            "lever",
            "drive_rod",
            "joint_drive_rod",
            [-LEVER, ROD_Y - LEVER_Y, 0.0],
            bar([0.0, 0.0], [0.0, UPPER], 0.0, 0.026),
            ("drive_rod", [0.0, 0.0, UPPER], "link_3", [-LEVER, ROD_Y, 0.0]),
        ),
    ]
}

fn base() -> Solid {
    Solid::of([
        foot([0.64, 0.58], 0.04),
        trunk(&[
            (0.03, [0.0; 2], [0.50, 0.46], 0.06),
            (0.14, [0.0; 2], [0.44, 0.42], 0.10),
            (0.30, [0.0; 2], [0.44, 0.44], 0.20),
            (0.34, [0.0; 2], [0.50, 0.50], 0.247),
            (0.37, [0.0; 2], [0.50, 0.50], 0.247),
        ]),
        bolts(14, 0.232, 0.367, 0.022),
        cuboid([0.15, 0.26, 0.20], 0.012).at([-0.28, -0.04, 0.17]),
        disc(0.035, 0.0, 0.10, 0.005, 24)
            .along_x()
            .turned([0.0, 0.0, 180.0])
            .at([-0.35, -0.10, 0.19]),
        rib(&[[0.18, 0.03], [0.29, 0.03], [0.20, 0.22]], 0.0, 0.03),
        cuboid([0.05, 0.10, 0.14], 0.006).at([0.05, 0.235, 0.14]),
    ])
}

fn carousel() -> Solid {
    let [x, _, z] = SHOULDER;
    let [ax, az] = [x + BAR_A[0], z + BAR_A[2]];
    Solid::of([
        disc(0.26, -0.008, 0.07, 0.01, 60),
        trunk(&[
            (0.06, [0.0, 0.0], [0.48, 0.44], 0.18),
            (0.16, [0.03, 0.0], [0.42, 0.36], 0.10),
            (0.24, [0.06, 0.0], [0.36, 0.30], 0.06),
        ]),
        cheek(&[([x, z], 0.13), ([0.0, 0.16], 0.10)], [-0.15, -0.105], 0.012),
        cheek(&[([x, z], 0.13), ([0.0, 0.16], 0.10)], [0.105, 0.14], 0.012),
        // Bracket of the upper arm's bar.
        cheek(&[([ax, az], 0.045), ([0.0, 0.22], 0.07)], [-0.15, -0.115], 0.008),
        hub([ax, az], 0.026, [-0.225, -0.14]),
        motor(0.08, 0.26).along_y().turned([0.0, 0.0, 180.0]).at([x, -0.145, z]),
        motor(0.08, 0.28).turned([0.0, 0.0, 200.0]).at([-0.13, 0.10, 0.14]),
        // Motor of the drive lever on the left.
        cheek(&[([x, z], 0.085), ([0.02, 0.12], 0.08)], [0.285, 0.315], 0.008),
        cuboid([0.16, 0.12, 0.05], 0.008).at([0.03, 0.24, 0.07]),
        motor(0.075, 0.22).along_y().at([x, 0.31, z]),
        pipe(
            &[[0.02, -0.05, 0.20], [-0.04, -0.05, 0.40], [0.02, -0.03, 0.52], [0.10, 0.0, 0.50]],
            0.024,
        ),
    ])
}

fn upper_arm() -> Solid {
    Solid::of([
        hub([0.0, 0.0], 0.125, [-0.10, 0.10]),
        hub([0.0, UPPER], 0.105, [-0.09, 0.09]),
        cheek(&[([0.0, 0.0], 0.11), ([0.0, UPPER], 0.085)], [-0.08, 0.08], 0.02),
        cheek(&[([0.0, 0.17], 0.055), ([0.0, UPPER - 0.16], 0.045)], [-0.093, -0.07], 0.01),
        rib(&[[0.07, 0.16], [0.125, 0.22], [0.11, 0.60], [0.06, 0.68]], 0.03, 0.025),
        pipe(
            &[[-0.09, 0.03, 0.10], [-0.12, 0.03, 0.30], [-0.115, 0.03, 0.60], [-0.07, 0.02, 0.80]],
            0.02,
        ),
    ])
}

fn elbow_plate() -> Solid {
    Solid::of([
        hub([0.0, 0.0], 0.10, [-0.15, -0.095]),
        cheek(
            &[([0.0, 0.0], 0.085), ([BAR_A[0], BAR_A[2]], 0.045), ([BAR_B[0], BAR_B[2]], 0.042)],
            [-0.145, -0.115],
            0.008,
        ),
        hub([BAR_A[0], BAR_A[2]], 0.024, [-0.225, -0.13]),
        hub([BAR_B[0], BAR_B[2]], 0.022, [-0.22, -0.13]),
    ])
}

fn forearm() -> Solid {
    Solid::of([
        hub([0.0, 0.0], 0.10, [0.095, 0.165]),
        cheek(&[([0.0, 0.0], 0.09), ([0.26, 0.02], 0.075)], [0.10, 0.145], 0.01),
        cheek(&[([0.0, 0.0], 0.085), ([-LEVER, 0.0], 0.045)], [0.165, 0.215], 0.008),
        hub([-LEVER, 0.0], 0.028, [0.18, 0.305]),
        boom(&[
            (0.16, [0.02, 0.02], [0.21, 0.17], 0.05),
            (0.28, [0.0, 0.015], [0.20, 0.17], 0.05),
            (0.60, [0.0, 0.005], [0.15, 0.13], 0.035),
            (FORE - 0.16, [0.0, 0.0], [0.13, 0.11], 0.03),
            (FORE - 0.09, [0.0, 0.0], [0.13, 0.10], 0.03),
        ]),
        cheek(&[([FORE - 0.16, 0.0], 0.05), ([FORE, 0.0], 0.055)], [-0.075, -0.05], 0.008),
        cheek(&[([FORE - 0.16, 0.0], 0.05), ([FORE, 0.0], 0.055)], [0.05, 0.085], 0.008),
        hub([FORE, 0.0], 0.05, [0.045, 0.09]),
        rib(&[[0.30, 0.08], [0.62, 0.06], [0.55, 0.11], [0.36, 0.13]], 0.03, 0.02),
        pipe(
            &[[0.24, 0.06, 0.09], [0.40, 0.06, 0.13], [0.70, 0.05, 0.11], [0.88, 0.03, 0.07]],
            0.018,
        ),
    ])
}

fn wrist_plate() -> Solid {
    Solid::of([
        hub([0.0, 0.0], 0.052, [-0.045, 0.045]),
        cheek(&[([0.0, 0.0], 0.048), ([0.10, -0.03], 0.06)], [-0.04, 0.04], 0.008),
        cheek(
            &[([0.0, 0.0], 0.05), ([BAR_B[0], BAR_B[2]], 0.036), ([0.09, 0.0], 0.04)],
            [-0.15, -0.12],
            0.006,
        ),
        cuboid([0.12, 0.12, 0.05], 0.008).at([0.055, -0.085, -0.02]),
        hub([BAR_B[0], BAR_B[2]], 0.022, [-0.22, -0.14]),
        lathe(&[[0.065, -0.16], [0.07, -0.15], [0.07, -0.06], [0.055, -0.04], [0.055, 0.02]], 40)
            .at([0.10, 0.0, 0.0]),
        motor(0.05, 0.17).turned([0.0, 0.0, 40.0]).at([0.10, 0.0, 0.01]),
    ])
}

/// A flange with a plate that is longer on one side, which makes its rotation visible.
fn flange() -> Solid {
    Solid::of([
        disc(0.06, -0.03, 0.0, 0.004, 44),
        disc(0.085, -0.045, -0.025, 0.004, 44),
        cuboid([0.30, 0.12, 0.018], 0.004).at([0.07, 0.0, -0.036]),
        cuboid([0.06, 0.05, 0.07], 0.006).at([0.19, 0.0, 0.005]),
        bolts(6, 0.072, -0.025, 0.014),
        disc(0.014, 0.0, 0.06, 0.003, 20).along_x().at([0.22, 0.0, 0.01]),
    ])
}

/// The drive lever on joint 2's axis.
fn lever() -> Solid {
    Solid::of([
        hub([0.0, 0.0], 0.10, [-0.04, 0.075]),
        cheek(&[([0.0, 0.0], 0.085), ([-LEVER, 0.0], 0.045)], [-0.025, 0.025], 0.008),
        hub([-LEVER, 0.0], 0.028, [-0.03, 0.105]),
    ])
}
