//! The space around a robot in; its voxels as a NumPy array and as octrees out.
//!
//! ```text
//! robots/R1/space.npy      kinds by [x][y][z]: 0 unknown, 1 free, 2 fixed, 3 the robot
//! robots/R1/space.bt       OctoMap: fixed is occupied, free and the robot are free, unknown is not in the tree
//! robots/R1/unknown.bt     OctoMap: unknown is occupied, all else is free: what a planner must not take for free
//! ```

use crate::npy::NpyWriter;
use crate::octomap::{self, Grid, HALF};
use contract::{Result, Space, SpaceKind};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// What is known of the space around a robot, and where it is written.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SpaceEntry {
    /// Kinds of voxels, by `[x][y][z]`, relative to the output folder: 0 unknown, 1 free, 2 fixed, 3 the robot.
    pub grid: String,
    /// Octree of what is fixed and what is free.
    pub octomap: String,
    /// Octree in which what is unknown is occupied.
    pub unknown: String,
    /// Edge of a voxel, metres.
    pub edge: f64,
    /// Corner of the first voxel, world, metres.
    pub origin: [f64; 3],
    /// Number of voxels on each axis.
    pub size: [usize; 3],
    /// World from the octrees' frame: a shift, metres; zero unless the plant is far from its origin.
    pub octomap_shift: [f64; 3],
    /// Volume that no beam has seen, m³.
    pub unknown_m3: f64,
    /// Volume that beams went through, m³.
    pub free_m3: f64,
}

/// Writes the space of the robot with this id.
pub fn write_space(out: &Path, id: &str, space: &Space) -> Result<SpaceEntry> {
    let folder = format!("robots/{id}");
    let name = |file: &str| format!("{folder}/{file}");
    let grid = *space.grid();
    let mut array = NpyWriter::create(out.join(name("space.npy")))?;
    let kinds: Vec<u8> = space.voxels().iter().map(|v| *v as u8).collect();
    array.push(&kinds)?;
    array.finish_as(&grid.size)?;
    // An octree reaches 32768 voxels to each side of its origin.
    let is_near = (0..3).all(|i| grid.first[i].abs() + (grid.size[i] as i64) < HALF);
    let shift = if is_near { [0; 3] } else { grid.first };
    let first = std::array::from_fn(|i| grid.first[i] - shift[i]);
    let voxels = space.voxels();
    let tree = |known: &dyn Fn(usize) -> Option<bool>, file: &str| {
        octomap::write(
            &out.join(name(file)),
            &Grid { first, size: grid.size, edge: grid.edge, known },
        )
    };
    let known = |at: usize| match voxels[at] {
        SpaceKind::Unknown => None,
        kind => Some(kind == SpaceKind::Fixed),
    };
    tree(&known, "space.bt")?;
    tree(&|at| Some(voxels[at] == SpaceKind::Unknown), "unknown.bt")?;
    Ok(SpaceEntry {
        grid: name("space.npy"),
        octomap: name("space.bt"),
        unknown: name("unknown.bt"),
        edge: grid.edge,
        origin: grid.first.map(|v| v as f64 * grid.edge),
        size: grid.size,
        octomap_shift: shift.map(|v| v as f64 * grid.edge),
        unknown_m3: space.volume(SpaceKind::Unknown),
        free_m3: space.volume(SpaceKind::Free),
    })
}
