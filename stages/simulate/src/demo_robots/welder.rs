//! The large spot welder: six revolute axes, a gas-spring balancer (RPR), a parallelogram that
//! drives the forearm (RRR), and a gun whose sliding electrode is the seventh joint.

use super::axes::{FULL_TURN, X, Y, Z};
use super::castings::{boom, cheek, foot, hub, motor, pipe, rib, tool_plate, trunk};
use super::design::{Design, DesignPart, Hinge};
use super::gun::{electrode, gun};
use super::names::WELDER;
use super::welder_dimensions::{CYLINDER_PIN, LEVER, ROD_PIN, SHOULDER, UPPER};
use super::welder_loops::{balancer, parallelogram};
use crate::solid::{Solid, bolts, cuboid, disc};

/// Height of joint 1 above the foot, metres.
const NECK: f64 = 0.36;
/// Joint 4 from joint 3, metres.
const ELBOW: [f64; 3] = [0.34, 0.0, 0.23];
/// Length of the forearm, metres.
const FORE: f64 = 0.88;
/// Joint 6 from joint 5, metres.
const WRIST: f64 = 0.20;

pub(super) fn design() -> Design {
    let part = |name, body| DesignPart { name, body: Some(body) };
    Design {
        name: WELDER,
        parts: vec![
            part("base_link", base()),
            part("link_1", carousel()),
            part("link_2", upper_arm()),
            part("link_3", elbow()),
            part("link_4", forearm()),
            part("link_5", wrist()),
            part("link_6", tool_plate(0.10, 0.05)),
            part("gun_body", gun()),
            part("electrode", electrode()),
            DesignPart { name: "tool0", body: None },
        ],
        hinges: vec![
            Hinge::turn("joint_1", "base_link", "link_1", [0.0, 0.0, NECK], Z, FULL_TURN),
            Hinge::turn("joint_2", "link_1", "link_2", SHOULDER, Y, [-1.05, 1.31]),
            Hinge::turn("joint_3", "link_2", "link_3", [0.0, 0.0, UPPER], Y, [-1.05, 1.31]),
            Hinge::turn("joint_4", "link_3", "link_4", ELBOW, X, FULL_TURN),
            Hinge::turn("joint_5", "link_4", "link_5", [FORE, 0.0, 0.0], Y, [-2.18, 2.18]),
            Hinge::turn("joint_6", "link_5", "link_6", [WRIST, 0.0, 0.0], X, FULL_TURN),
            Hinge::fixed("joint_gun", "link_6", "gun_body", [0.05, 0.0, 0.0]),
            Hinge::turn("joint_7", "gun_body", "electrode", [0.68, 0.0, -0.16], Z, [0.0, 0.15])
                .slide(),
            Hinge::fixed("joint_tool0", "gun_body", "tool0", [0.68, 0.0, -0.17]),
        ],
        tip: "electrode",
        sub_chains: vec![balancer(), parallelogram()],
        effector: Some("gun_body"),
    }
}

fn base() -> Solid {
    Solid::of([
        foot([0.78, 0.70], 0.05),
        trunk(&[
            (0.04, [0.0; 2], [0.62, 0.56], 0.12),
            (0.12, [0.0; 2], [0.55, 0.52], 0.18),
            (0.26, [0.0; 2], [0.54, 0.54], 0.265),
            (0.32, [0.0; 2], [0.62, 0.62], 0.305),
            (0.345, [0.0; 2], [0.62, 0.62], 0.305),
        ]),
        bolts(16, 0.285, 0.343, 0.028),
        // Plug panel and junction box at the back, left.
        cuboid([0.20, 0.34, 0.22], 0.015).at([-0.36, 0.06, 0.18]),
        disc(0.045, 0.0, 0.12, 0.006, 24)
            .along_x()
            .turned([0.0, 0.0, 180.0])
            .at([-0.45, 0.13, 0.20]),
        disc(0.03, 0.0, 0.10, 0.006, 24).along_x().turned([0.0, 0.0, 180.0]).at([-0.45, 0.0, 0.16]),
        rib(&[[0.22, 0.04], [0.36, 0.04], [0.24, 0.24]], 0.15, 0.03),
        rib(&[[0.22, 0.04], [0.36, 0.04], [0.24, 0.24]], -0.15, 0.03),
        // Forklift pocket on the right.
        cuboid([0.22, 0.06, 0.09], 0.006).at([0.0, -0.33, 0.10]),
    ])
}

fn carousel() -> Solid {
    let [x, _, z] = SHOULDER;
    let side = |y: [f64; 2]| {
        cheek(&[([x, z], 0.19), ([-0.05, 0.12], 0.10), ([0.18, 0.08], 0.10)], y, 0.015)
    };
    Solid::of([
        disc(0.335, -0.01, 0.08, 0.012, 64),
        trunk(&[
            (0.07, [0.0, 0.0], [0.62, 0.58], 0.25),
            (0.14, [0.0, 0.0], [0.58, 0.50], 0.12),
            (0.18, [-0.02, 0.0], [0.50, 0.46], 0.08),
        ]),
        side([-0.235, -0.165]),
        side([0.165, 0.20]),
        hub([x, z], 0.16, [-0.25, -0.155]),
        motor(0.10, 0.30).along_y().turned([0.0, 0.0, 180.0]).at([x, -0.25, z]),
        // The motor of axis 1 stands behind on the left, the balancer's bracket behind on the
        // right.
        motor(0.105, 0.36).turned([0.0, 0.0, 150.0]).at([-0.18, 0.16, 0.14]),
        cheek(
            &[([CYLINDER_PIN[0], CYLINDER_PIN[2]], 0.055), ([-0.16, 0.09], 0.07)],
            [-0.245, -0.205],
            0.006,
        ),
        hub([CYLINDER_PIN[0], CYLINDER_PIN[2]], 0.035, [-0.36, -0.20]),
        pipe(
            &[[-0.05, 0.0, 0.17], [-0.05, 0.05, 0.40], [0.05, 0.12, 0.46], [0.18, 0.14, 0.42]],
            0.032,
        ),
    ])
}

fn upper_arm() -> Solid {
    let ([px, _, pz], top) = (ROD_PIN, UPPER);
    Solid::of([
        hub([0.0, 0.0], 0.19, [-0.15, 0.15]),
        hub([0.0, top], 0.155, [-0.13, 0.13]),
        cheek(&[([0.0, 0.0], 0.165), ([0.0, top], 0.125)], [-0.12, -0.075], 0.012),
        cheek(&[([0.0, 0.0], 0.165), ([0.0, top], 0.125)], [0.075, 0.12], 0.012),
        cheek(&[([0.02, 0.05], 0.12), ([0.03, top - 0.05], 0.085)], [-0.09, 0.09], 0.01),
        rib(&[[-0.14, 0.25], [-0.07, 0.22], [-0.07, 0.85], [-0.11, 0.82]], 0.0, 0.20),
        rib(&[[0.10, 0.30], [0.165, 0.34], [0.14, 0.78], [0.09, 0.80]], -0.04, 0.03),
        // Boss of the balancer's rod.
        cheek(&[([px, pz], 0.06), ([-0.05, 0.03], 0.10)], [-0.24, -0.13], 0.01),
        hub([px, pz], 0.032, [-0.345, -0.23]),
        // Shaft of the lever.
        disc(0.075, 0.14, 0.30, 0.006, 40).along_y(),
        pipe(
            &[[0.16, 0.05, 0.12], [0.20, 0.05, 0.35], [0.19, 0.04, 0.75], [0.13, 0.03, 1.0]],
            0.028,
        ),
        cuboid([0.05, 0.09, 0.05], 0.005).at([0.175, 0.05, 0.40]),
        cuboid([0.05, 0.09, 0.05], 0.005).at([0.165, 0.04, 0.72]),
    ])
}

fn elbow() -> Solid {
    let [x, _, z] = ELBOW;
    Solid::of([
        hub([0.0, 0.0], 0.165, [0.13, 0.21]),
        hub([0.0, 0.0], 0.165, [-0.21, -0.13]),
        cheek(&[([0.0, 0.0], 0.15), ([0.06, z], 0.16)], [0.135, 0.19], 0.012),
        cheek(&[([0.0, 0.0], 0.15), ([0.06, z], 0.16)], [-0.19, -0.135], 0.012),
        boom(&[
            (-0.17, [0.0, z + 0.02], [0.34, 0.24], 0.05),
            (-0.08, [0.0, z + 0.01], [0.38, 0.28], 0.06),
            (0.12, [0.0, z], [0.38, 0.30], 0.08),
            (0.24, [0.0, z], [0.31, 0.30], 0.13),
            (x - 0.01, [0.0, z], [0.28, 0.28], 0.138),
        ]),
        bolts(12, 0.122, 0.0, 0.02).along_x().at([x - 0.01, 0.0, z]),
        // Rear arm of the parallelogram.
        cheek(&[([0.0, 0.0], 0.10), ([-LEVER, 0.0], 0.055)], [0.205, 0.255], 0.008),
        hub([-LEVER, 0.0], 0.036, [0.20, 0.36]),
        // Motors of the wrist at the back.
        motor(0.075, 0.26).turned([0.0, -90.0, 0.0]).at([-0.16, 0.09, z + 0.03]),
        motor(0.075, 0.26).turned([0.0, -90.0, 0.0]).at([-0.16, -0.09, z + 0.03]),
        motor(0.062, 0.22).turned([0.0, -90.0, 0.0]).at([-0.15, -0.01, z + 0.13]),
        cuboid([0.14, 0.10, 0.08], 0.01).at([0.10, -0.06, z + 0.17]),
        pipe(
            &[
                [0.06, 0.09, z + 0.14],
                [0.12, 0.10, z + 0.24],
                [0.22, 0.08, z + 0.22],
                [0.30, 0.06, z + 0.15],
            ],
            0.03,
        ),
    ])
}

fn forearm() -> Solid {
    let fork = |y: [f64; 2]| {
        let flat = cheek(&[([FORE - 0.24, 0.0], 0.095), ([FORE, 0.0], 0.10)], y, 0.01);
        Solid::of([flat, hub([FORE, 0.0], 0.092, y)])
    };
    Solid::of([
        disc(0.138, 0.004, 0.07, 0.01, 56).along_x(),
        boom(&[
            (0.05, [0.0, 0.0], [0.25, 0.25], 0.12),
            (0.16, [0.0, 0.005], [0.22, 0.23], 0.09),
            (0.40, [0.0, 0.0], [0.20, 0.20], 0.06),
            (FORE - 0.28, [0.0, 0.0], [0.23, 0.19], 0.05),
            (FORE - 0.14, [0.0, 0.0], [0.25, 0.18], 0.045),
        ]),
        fork([-0.135, -0.085]),
        fork([0.085, 0.125]),
        cheek(&[([0.42, 0.0], 0.06), ([FORE, 0.0], 0.075)], [-0.165, -0.13], 0.01),
        // Brackets of the dress pack on top.
        cuboid([0.06, 0.14, 0.06], 0.006).at([0.18, 0.03, 0.135]),
        cuboid([0.05, 0.10, 0.08], 0.006).at([0.56, 0.03, 0.125]),
    ])
}

fn wrist() -> Solid {
    Solid::of([
        hub([0.0, 0.0], 0.095, [-0.08, 0.08]),
        boom(&[
            (-0.03, [0.0, 0.0], [0.15, 0.15], 0.04),
            (0.06, [0.0, 0.0], [0.155, 0.165], 0.05),
            (0.13, [0.0, 0.0], [0.18, 0.18], 0.088),
            (WRIST - 0.03, [0.0, 0.0], [0.19, 0.19], 0.0935),
            (WRIST - 0.004, [0.0, 0.0], [0.16, 0.16], 0.0785),
        ]),
        cuboid([0.08, 0.08, 0.05], 0.008).at([0.08, 0.0, 0.095]),
    ])
}
