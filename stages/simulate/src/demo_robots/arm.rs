//! The small six-axis demo robot: a bench-top arm of 1.1 m reach with its upper arm on one side.

use super::axes::{FULL_TURN, X, Y, Z};
use super::castings::{boom, cheek, foot, hub, motor, pipe, rib, tool_plate, trunk};
use super::design::{Design, DesignPart, Hinge};
use super::names::ARM;
use crate::solid::{Solid, bolts, cuboid, disc};

/// Height of joint 1 above the foot, metres.
const NECK: f64 = 0.21;
/// Joint 2 from joint 1, metres.
const SHOULDER: [f64; 3] = [0.05, 0.0, 0.19];
/// Length of the upper arm, metres.
const UPPER: f64 = 0.46;
/// Joint 4 from joint 3, metres.
const ELBOW: [f64; 3] = [0.15, 0.0, 0.045];
/// Length of the forearm, metres.
const FORE: f64 = 0.37;
/// Joint 6 from joint 5, metres.
const WRIST: f64 = 0.075;

pub(super) fn design() -> Design {
    let part = |name, body| DesignPart { name, body: Some(body) };
    Design {
        name: ARM,
        parts: vec![
            part("base_link", base()),
            part("link_1", shoulder()),
            part("link_2", upper_arm()),
            part("link_3", elbow()),
            part("link_4", forearm()),
            part("link_5", wrist()),
            part("link_6", Solid::of([tool_plate(0.036, 0.022), sensor()])),
            DesignPart { name: "tool0", body: None },
        ],
        hinges: vec![
            Hinge::turn("joint_1", "base_link", "link_1", [0.0, 0.0, NECK], Z, [-2.96, 2.96]),
            Hinge::turn("joint_2", "link_1", "link_2", SHOULDER, Y, [-1.66, 1.83]),
            Hinge::turn("joint_3", "link_2", "link_3", [0.0, 0.0, UPPER], Y, [-1.22, 2.44]),
            Hinge::turn("joint_4", "link_3", "link_4", ELBOW, X, [-3.22, 3.22]),
            Hinge::turn("joint_5", "link_4", "link_5", [FORE, 0.0, 0.0], Y, [-2.09, 2.09]),
            Hinge::turn("joint_6", "link_5", "link_6", [WRIST, 0.0, 0.0], X, FULL_TURN),
            Hinge::fixed("joint_tool0", "link_6", "tool0", [0.022, 0.0, 0.0]),
        ],
        tip: "tool0",
        sub_chains: vec![],
        effector: None,
    }
}

fn base() -> Solid {
    Solid::of([
        foot([0.30, 0.26], 0.022),
        trunk(&[
            (0.015, [0.0; 2], [0.24, 0.21], 0.05),
            (0.05, [0.0; 2], [0.20, 0.19], 0.07),
            (0.13, [0.0; 2], [0.19, 0.19], 0.094),
            (0.185, [0.0; 2], [0.20, 0.20], 0.099),
            (0.20, [0.0; 2], [0.20, 0.20], 0.099),
        ]),
        bolts(12, 0.092, 0.196, 0.009),
        // Plug panel at the back.
        cuboid([0.09, 0.13, 0.11], 0.01).at([-0.13, 0.0, 0.08]),
        disc(0.018, 0.0, 0.05, 0.004, 20)
            .along_x()
            .turned([0.0, 0.0, 180.0])
            .at([-0.17, 0.03, 0.085]),
        disc(0.013, 0.0, 0.04, 0.003, 20)
            .along_x()
            .turned([0.0, 0.0, 180.0])
            .at([-0.17, -0.03, 0.07]),
        rib(&[[0.07, 0.02], [0.135, 0.02], [0.08, 0.14]], 0.06, 0.012),
        rib(&[[0.07, 0.02], [0.135, 0.02], [0.08, 0.14]], -0.06, 0.012),
    ])
}

fn shoulder() -> Solid {
    let [x, _, z] = SHOULDER;
    Solid::of([
        disc(0.098, -0.006, 0.035, 0.006, 56),
        trunk(&[
            (0.03, [0.0, -0.005], [0.18, 0.17], 0.08),
            (0.07, [0.012, -0.02], [0.17, 0.13], 0.06),
            (0.12, [0.03, -0.032], [0.155, 0.095], 0.04),
        ]),
        cheek(&[([x, z], 0.086), ([0.0, 0.09], 0.07)], [-0.075, 0.005], 0.008),
        hub([x, z], 0.088, [-0.085, 0.012]),
        motor(0.05, 0.12).along_y().turned([0.0, 0.0, 180.0]).at([x, -0.08, z]),
        // The motor of axis 1 stands behind, beside the arm.
        motor(0.043, 0.15).at([-0.075, -0.045, 0.02]),
    ])
}

fn upper_arm() -> Solid {
    Solid::of([
        hub([0.0, 0.0], 0.083, [0.015, 0.10]),
        hub([0.0, UPPER], 0.066, [0.018, 0.092]),
        cheek(&[([0.0, 0.0], 0.074), ([0.0, UPPER], 0.055)], [0.028, 0.085], 0.012),
        cheek(&[([0.012, 0.13], 0.030), ([0.008, UPPER - 0.10], 0.024)], [0.08, 0.098], 0.006),
        rib(&[[-0.085, 0.09], [-0.04, 0.06], [-0.035, 0.32], [-0.06, 0.30]], 0.055, 0.03),
        pipe(
            &[
                [-0.06, 0.095, 0.0],
                [-0.07, 0.105, 0.12],
                [-0.065, 0.105, 0.32],
                [-0.03, 0.095, 0.45],
            ],
            0.011,
        ),
        cuboid([0.04, 0.02, 0.03], 0.003).at([-0.068, 0.1, 0.2]),
    ])
}

fn elbow() -> Solid {
    let [x, _, z] = ELBOW;
    Solid::of([
        hub([0.0, 0.0], 0.068, [-0.075, 0.012]),
        cheek(
            &[([0.0, 0.0], 0.062), ([0.05, z], 0.058), ([-0.05, z + 0.01], 0.05)],
            [-0.068, 0.0],
            0.01,
        ),
        boom(&[
            (-0.075, [-0.02, z], [0.10, 0.085], 0.03),
            (-0.03, [-0.02, z], [0.115, 0.10], 0.035),
            (0.06, [-0.012, z], [0.115, 0.11], 0.05),
            (0.11, [0.0, z], [0.112, 0.112], 0.0555),
            (x - 0.004, [0.0, z], [0.106, 0.106], 0.0525),
        ]),
        bolts(8, 0.045, 0.0, 0.008).along_x().at([x - 0.004, 0.0, z]),
        motor(0.037, 0.10).turned([0.0, -90.0, 0.0]).at([-0.07, -0.02, z]),
        motor(0.045, 0.085).along_y().turned([0.0, 0.0, 180.0]).at([0.0, -0.07, 0.0]),
        pipe(
            &[
                [-0.11, 0.03, z],
                [-0.09, 0.06, z + 0.02],
                [-0.03, 0.055, z + 0.01],
                [0.02, 0.03, z + 0.02],
            ],
            0.010,
        ),
    ])
}

fn forearm() -> Solid {
    let fork = |side: f64| {
        let y = [0.032, 0.054].map(|v| side * v);
        let y = [y[0].min(y[1]), y[0].max(y[1])];
        let flat = cheek(&[([FORE - 0.11, 0.0], 0.036), ([FORE, 0.0], 0.037)], y, 0.005);
        Solid::of([flat, hub([FORE, 0.0], 0.034, y)])
    };
    Solid::of([
        disc(0.051, 0.002, 0.03, 0.004, 48).along_x(),
        boom(&[
            (0.02, [0.0, 0.0], [0.096, 0.096], 0.047),
            (0.07, [0.0, 0.002], [0.088, 0.092], 0.035),
            (0.17, [0.0, 0.004], [0.086, 0.084], 0.025),
            (FORE - 0.13, [0.0, 0.0], [0.10, 0.075], 0.022),
            (FORE - 0.07, [0.0, 0.0], [0.108, 0.066], 0.02),
        ]),
        fork(1.0),
        fork(-1.0),
        // Belt cover of axes 5 and 6 on the right, cable dome on top.
        cheek(&[([0.13, 0.0], 0.028), ([FORE, 0.0], 0.026)], [-0.066, -0.05], 0.006),
        boom(&[
            (0.06, [0.01, 0.045], [0.05, 0.02], 0.009),
            (0.10, [0.01, 0.052], [0.055, 0.035], 0.012),
            (0.16, [0.01, 0.046], [0.05, 0.02], 0.009),
        ]),
    ])
}

fn wrist() -> Solid {
    Solid::of([
        hub([0.0, 0.0], 0.035, [-0.03, 0.03]),
        boom(&[
            (-0.01, [0.0, 0.0], [0.055, 0.058], 0.02),
            (0.03, [0.0, 0.0], [0.056, 0.06], 0.025),
            (WRIST - 0.012, [0.0, 0.0], [0.062, 0.062], 0.0305),
            (WRIST - 0.002, [0.0, 0.0], [0.056, 0.056], 0.0275),
        ]),
        cuboid([0.03, 0.03, 0.018], 0.003).at([0.032, 0.0, 0.034]),
    ])
}

/// A camera on a bracket, which makes the rotation of axis 6 visible.
fn sensor() -> Solid {
    Solid::of([
        cuboid([0.012, 0.10, 0.03], 0.002).at([0.012, -0.05, -0.012]),
        cuboid([0.07, 0.035, 0.045], 0.006).at([0.04, -0.095, -0.012]),
        disc(0.016, 0.0, 0.03, 0.003, 24).along_x().at([0.072, -0.095, -0.012]),
    ])
}
