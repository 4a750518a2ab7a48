//! A library of three demo robots that are drawn by code: the files of `<model>/robot.urdf`,
//! meshes, sub chains and `robot.toml`. The caller writes them to disk.

mod arm;
mod axes;
mod castings;
mod design;
mod gun;
mod names;
mod palletiser;
mod welder;
mod welder_dimensions;
mod welder_loops;

pub use design::LibraryFile;
pub use names::{ARM, PALLETISER, WELDER};

/// All files of the library, sorted by robot, then file. Paths are relative to its folder, with `/`
/// between parts.
#[must_use]
pub fn files() -> Vec<LibraryFile> {
    [arm::design(), palletiser::design(), welder::design()]
        .iter()
        .flat_map(design::Design::files)
        .collect()
}
