//! The space around a robot in; its voxels as a NumPy array and as octrees out.
//!
//! ```text
//! robots/R1/space.npy      kinds by [x][y][z]: 0 unknown, 1 free, 2 fixed, 3 the robot, 4 another robot
//! robots/R1/space.bt       OctoMap: fixed and other robots are occupied, free and the robot are free, unknown is not in it
//! robots/R1/unknown.bt     OctoMap: unknown is occupied, all else is free: what a planner must not take for free
//! ```

use crate::npy::{self, NpyWriter};
use crate::octomap::{self, HALF, OctomapGrid};
use contract::{Error, Result, Space, SpaceGrid, SpaceKind};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// What is known of the space around a robot, and where it is written.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SpaceEntry {
    /// Kinds of voxels, by `[x][y][z]`, relative to the output folder: 0 unknown, 1 free, 2 fixed,
    /// 3 the robot, 4 another robot.
    pub grid: String,
    /// Octree of what is fixed or another robot, and what is free.
    pub octomap: String,
    /// Octree in which what is unknown is occupied.
    pub unknown: String,
    /// Edge of a voxel, metres.
    pub edge: f64,
    /// Corner of the first voxel, world, metres.
    pub origin: [f64; 3],
    /// Number of voxels on each axis.
    pub size: [usize; 3],
    /// World from the octrees' frame: a shift, metres; zero unless the plant is far from its
    /// origin.
    pub octomap_shift: [f64; 3],
    /// Volume that no beam has seen, m³.
    pub unknown_m3: f64,
    /// Volume that beams went through, m³.
    pub free_m3: f64,
}

impl SpaceEntry {
    /// Its voxels, as it states them.
    #[must_use]
    pub fn voxels(&self) -> SpaceGrid {
        let first = self.origin.map(|v| (v / self.edge).round() as i64);
        SpaceGrid { edge: self.edge, first, size: self.size }
    }

    /// Reads its voxels back.
    ///
    /// # Errors
    /// A file that cannot be read, or is not of these voxels.
    pub fn read(&self, out: &Path) -> Result<Space> {
        let path = out.join(&self.grid);
        let bad = |what: &str| {
            let hint = "`stillpoint verify` says whether the result is whole";
            Error::bad_input(what.to_owned()).at(path.display()).hint(hint)
        };
        let grid = self.voxels();
        let n = self.size.iter().try_fold(1_usize, |n, s| n.checked_mul(*s));
        // What the list says of its size is believed only where the file is as long.
        // A file of no voxels need not even be an array.
        let n = n.filter(|n| *n > 0 && npy::n_bytes(&path).is_ok_and(|there| there == *n as u64));
        let n = n.ok_or_else(|| {
            bad("the voxels of a robot's space are not as many as they are said to be")
        })?;
        let mut space = Space::unknown(grid);
        for (voxel, byte) in space.voxels_mut().iter_mut().zip(npy::read_bytes(&path, 0, n, 1)?) {
            let kind = SpaceKind::ALL.into_iter().find(|kind| *kind as u8 == byte);
            *voxel = kind.ok_or_else(|| bad("a voxel of a robot's space is of no kind"))?;
        }
        Ok(space)
    }
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
            &OctomapGrid { first, size: grid.size, edge: grid.edge, known },
        )
    };
    let known = |at: usize| match voxels[at] {
        SpaceKind::Unknown => None,
        kind => Some(kind.is_obstacle()),
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
