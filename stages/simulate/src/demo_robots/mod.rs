//! A library of three demo robots that are drawn by code: the files of `<model>/robot.urdf`,
//! meshes, sub chains and `robot.toml`. The caller writes them to disk.

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

/// All files of the library, sorted by robot, then file. Paths are relative to its folder, with `/`
/// between parts.
#[must_use]
pub fn files() -> Vec<LibraryFile> {
    [arm::design(), palletiser::design(), welder::design()]
        .iter()
        .flat_map(design::Design::files)
        .collect()
}

/// Axes of joints: roll about x, pitch about y, yaw about z.
const X: [f64; 3] = [1.0, 0.0, 0.0];
const Y: [f64; 3] = [0.0, 1.0, 0.0];
const Z: [f64; 3] = [0.0, 0.0, 1.0];
/// Limits of a joint that turns almost a full turn, so that no pose is reached twice, radians.
const FULL_TURN: [f64; 2] = [-3.1, 3.1];
