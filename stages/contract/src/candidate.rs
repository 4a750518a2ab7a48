//! Clusters (connected bodies above the floor) and candidates (a robot model with a place and the
//! base poses at which it is worth fitting).

use crate::InstallationPlane;
use geometry::{Aabb, Pose};
use serde::{Deserialize, Serialize};

/// Index of a voxel of the occupied space: voxel `[i, j, k]` of edge `e` spans
/// `[i·e, (i+1)·e)` along world x, and likewise along y and z.
pub type Voxel = [i32; 3];

/// A connected set of occupied voxels above the floor, over all scans.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Cluster {
    /// Number of the cluster; clusters are numbered by size, the largest first.
    pub id: u32,
    /// Occupied voxels, sorted by (z, y, x).
    pub voxels: Vec<Voxel>,
    /// Edge of a voxel, metres.
    pub edge: f64,
    /// Number of points in the voxels.
    pub n_points: u64,
    /// Bounds of the voxels in the world, metres.
    pub bounds: Aabb,
}

/// A place where one robot of the library may stand.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Candidate {
    /// Index of the model in the library.
    pub model: usize,
    /// Bounds of the points that may belong to the robot, world, metres.
    pub bounds: Aabb,
    /// The plane that the robot would stand on.
    pub plane: InstallationPlane,
    /// Base poses worth a fit (`world_from_base`, metres) with their scores, best first.
    pub bases: Vec<(Pose, f64)>,
}
