//! Nothing in; a library of three robots of our own, drawn by code, out: the files of
//! `<model>/robot.urdf`, meshes, sub chains and `robot.toml`. Writes nothing itself.

mod arm;
mod castings;
mod design;
mod gun;
mod palletiser;
mod welder;
mod welder_dimensions;
mod welder_loops;

pub use design::LibraryFile;

/// Name of the small six-axis robot, 1.1 m reach.
pub const ARM: &str = "demo_arm_1100";
/// Name of the seven-joint spot welder, 2.6 m reach, with balancer (RPR), parallelogram (RRR) and
/// gun.
pub const WELDER: &str = "demo_welder_2600";
/// Name of the four-axis palletiser, 2.0 m reach, whose bars (RR) keep the wrist level.
pub const PALLETISER: &str = "demo_palletiser_2000";

/// All files of the library, paths relative to its folder with `/` between parts; by robot, then
/// file.
#[must_use]
pub fn files() -> Vec<LibraryFile> {
    [arm::design(), palletiser::design(), welder::design()]
        .iter()
        .flat_map(design::Design::files)
        .collect()
}

/// One joint axis and another: about y (pitch), about x (roll), about z (yaw).
const X: [f64; 3] = [1.0, 0.0, 0.0];
const Y: [f64; 3] = [0.0, 1.0, 0.0];
const Z: [f64; 3] = [0.0, 0.0, 1.0];
/// Limits of a joint that turns all round, short of a second way to the same pose, radians.
const FULL_TURN: [f64; 2] = [-3.1, 3.1];
