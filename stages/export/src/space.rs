//! Writes and reads the voxels of the space around a robot, as a NumPy array and as octrees.
//!
//! ```text
//! robots/R1/space.npy      states by [x][y][z]: 0 unknown, 1 free, 2 fixed, 3 robot, 4 other robot
//! robots/R1/space.bt       OctoMap: fixed and other robots occupied, free and robot free
//! robots/R1/unknown.bt     OctoMap: unknown occupied, all else free; to be avoided like obstacles
//! ```

use crate::npy::{self, NpyWriter};
use crate::octomap::{self, HALF, OctomapGrid};
use contract::{Error, Result, Space, SpaceGrid, SpaceKind};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// The known space around a robot, and the paths of its files.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SpaceEntry {
    /// Path of the array of states, by `[x][y][z]`, relative to the output folder: 0 unknown, 1
    /// free, 2 fixed, 3 the robot, 4 another robot.
    pub grid: String,
    /// Path of the octree in which fixed things and other robots are occupied.
    pub octomap: String,
    /// Path of the octree in which unknown voxels are occupied.
    pub unknown: String,
    /// Edge of a voxel, metres.
    pub edge: f64,
    /// Lowest corner of the first voxel, world, metres.
    pub origin: [f64; 3],
    /// Number of voxels along x, y and z.
    pub size: [usize; 3],
    /// Translation from the octrees' frame to the world, metres; zero unless the plant is far from
    /// its origin.
    pub octomap_shift: [f64; 3],
    /// Volume of unknown voxels, m³.
    pub unknown_m3: f64,
    /// Volume of free voxels, m³.
    pub free_m3: f64,
}

impl SpaceEntry {
    /// Placement of the voxels.
    #[must_use]
    pub fn voxels(&self) -> SpaceGrid {
        let first = self.origin.map(|v| (v / self.edge).round() as i64);
        SpaceGrid { edge: self.edge, first, size: self.size }
    }

    /// Reads the voxels from the output folder `out`.
    ///
    /// # Errors
    /// If the file cannot be read, or if it has another number of voxels.
    pub fn read(&self, out: &Path) -> Result<Space> {
        let path = out.join(&self.grid);
        let bad = |what: &str| {
            let hint = "`stillpoint verify` checks whether the result is complete";
            Error::bad_input(what.to_owned()).at(path.display()).hint(hint)
        };
        let grid = self.voxels();
        let n = self.size.iter().try_fold(1_usize, |n, s| n.checked_mul(*s));
        // The stated size is believed only if the file has that length; a file of no voxels may be
        // no array at all.
        let n = n.filter(|n| *n > 0 && npy::n_bytes(&path).is_ok_and(|there| there == *n as u64));
        let n = n.ok_or_else(|| {
            bad("the number of voxels of a robot's space differs from the size of its grid")
        })?;
        let mut space = Space::unknown(grid);
        for (voxel, byte) in space.voxels_mut().iter_mut().zip(npy::read_bytes(&path, 0, n, 1)?) {
            let kind = SpaceKind::ALL.into_iter().find(|kind| *kind as u8 == byte);
            *voxel =
                kind.ok_or_else(|| bad("a voxel of a robot's space holds an unknown state"))?;
        }
        Ok(space)
    }
}

/// Writes the space of the robot with this id.
///
/// # Errors
/// If a file cannot be written.
pub fn write_space(out: &Path, id: &str, space: &Space) -> Result<SpaceEntry> {
    let folder = format!("robots/{id}");
    let name = |file: &str| format!("{folder}/{file}");
    let grid = *space.grid();
    let mut array = NpyWriter::create(out.join(name("space.npy")))?;
    let kinds: Vec<u8> = space.voxels().iter().map(|v| *v as u8).collect();
    array.push(&kinds)?;
    array.finish_as(&grid.size)?;
    // An octree covers 32768 voxels to each side of its origin.
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
