//! Clusters and candidates: where a robot may stand, and which.

use crate::InstallationPlane;
use geometry::{Aabb, Pose};
use serde::{Deserialize, Serialize};

/// Index of a voxel of the occupancy.
pub type Voxel = [i32; 3];

/// A connected set of non-floor space over all scans.
#[derive(Debug, Clone, PartialEq)]
pub struct Cluster {
    /// Its number, by size, largest first.
    pub id: u32,
    /// Occupied voxels, sorted by (z, y, x).
    pub voxels: Vec<Voxel>,
    /// Edge of a voxel, metres.
    pub edge: f64,
    /// Number of points.
    pub n_points: u64,
    /// Bounds in the world, metres.
    pub bounds: Aabb,
}

/// A place where one robot of the library may stand.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Candidate {
    /// Index into the library.
    pub model: usize,
    /// Bounds of what may belong to it, world, metres.
    pub bounds: Aabb,
    /// The plane it would stand on.
    pub plane: InstallationPlane,
    /// Base poses worth a fit, world from base link, best first, with their scores.
    pub bases: Vec<(Pose, f64)>,
}
