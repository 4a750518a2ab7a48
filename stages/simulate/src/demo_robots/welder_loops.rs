//! The sub chains of the spot welder: balancer (RPR) and parallelogram (RRR).

use super::axes::{X, Y};
use super::castings::{bar, cheek, hub};
use super::design::{DesignPart, DesignSubChain, Hinge};
use super::welder_dimensions::{CYLINDER_PIN, LEVER, ROD_PIN, SHOULDER, UPPER};
use crate::solid::{Solid, cuboid, disc, lathe};

/// Plane of the lever, and of the rod beside it, metres.
const LEVER_Y: f64 = 0.24;
/// Plane of the parallelogram's rod, metres.
const ROD_Y: f64 = 0.315;

pub(super) fn balancer() -> DesignSubChain {
    let pin = [0, 1, 2].map(|i| SHOULDER[i] + ROD_PIN[i] - CYLINDER_PIN[i]);
    let length = pin[0].hypot(pin[2]);
    // The cylinder's x axis points at the rod's pin in the zero posture.
    let tilt = -pin[2].atan2(pin[0]);
    let cylinder = Solid::of([
        hub([0.0, 0.0], 0.05, [-0.045, 0.045]),
        lathe(
            &[
                [0.05, 0.03],
                [0.078, 0.05],
                [0.085, 0.07],
                [0.085, 0.36],
                [0.075, 0.375],
                [0.06, 0.385],
                [0.05, 0.40],
            ],
            48,
        )
        .along_x(),
        cuboid([0.16, 0.05, 0.04], 0.006).at([0.2, 0.0, 0.09]),
        disc(0.012, 0.0, 0.05, 0.002, 16).at([0.1, 0.0, 0.08]),
    ]);
    let rod = Solid::of([
        lathe(&[[0.028, -0.48], [0.028, -0.06], [0.04, -0.055], [0.04, -0.03]], 32).along_x(),
        hub([0.0, 0.0], 0.052, [-0.03, 0.03]),
    ]);
    let to_rod = Hinge::turn(
        "joint_balancer_rod",
        "balancer_cylinder",
        "balancer_rod",
        [length, 0.0, 0.0],
        X,
        [-0.15, 0.35],
    );
    let to_cylinder = Hinge {
        rpy: [0.0, tilt, 0.0],
        ..Hinge::turn(
            "joint_balancer_cylinder",
            "link_1",
            "balancer_cylinder",
            CYLINDER_PIN,
            Y,
            [-1.0, 1.0],
        )
    };
    DesignSubChain {
        name: "balancer",
        kind: "RPR",
        root: "link_1",
        parts: vec![
            DesignPart { name: "balancer_cylinder", body: Some(cylinder) },
            DesignPart { name: "balancer_rod", body: Some(rod) },
        ],
        hinges: vec![to_cylinder, to_rod.slide()],
        pin: ("balancer_rod", [0.0; 3], "link_2", ROD_PIN),
    }
}

pub(super) fn parallelogram() -> DesignSubChain {
    let lever = Solid::of([
        hub([0.0, 0.0], 0.14, [-0.035, 0.035]),
        cheek(&[([0.0, 0.0], 0.11), ([-LEVER, 0.0], 0.055)], [-0.03, 0.03], 0.008),
        hub([-LEVER, 0.0], 0.052, [-0.034, 0.034]),
    ]);
    let dy = ROD_Y - LEVER_Y;
    let rod = bar([0.0, 0.0], [0.0, UPPER], 0.0, 0.034);
    DesignSubChain {
        name: "parallelogram",
        kind: "RRR",
        root: "link_2",
        parts: vec![
            DesignPart { name: "lever", body: Some(lever) },
            DesignPart { name: "rod", body: Some(rod) },
        ],
        hinges: vec![
            Hinge::turn("joint_lever", "link_2", "lever", [0.0, LEVER_Y, 0.0], Y, [-1.6, 1.6]),
            Hinge::turn("joint_rod", "lever", "rod", [-LEVER, dy, 0.0], Y, [-1.6, 1.6]),
        ],
        pin: ("rod", [0.0, 0.0, UPPER], "link_3", [-LEVER, ROD_Y, 0.0]),
    }
}
