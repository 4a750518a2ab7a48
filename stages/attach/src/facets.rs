//! How the surface bends from voxel to voxel: things that touch meet in inner corners and steps,
//! and the surface of one thing mostly runs on or bends outward.

use contract::{RESIDUAL_EDGE, ResidualVoxel};
use geometry::Vector;

/// Least length of the sum of unit normals in a voxel: less has no direction.
const CLEAR: f64 = 0.5;
/// Sine of the angle by which the surface turns inward between two voxels from which on they meet
/// in an inner corner (20°).
const INWARD: f64 = 0.35;
/// Sine of the angle between the surface and the way to a voxel with about the same normal from
/// which on there is a step between them (37°).
const STEP: f64 = 0.6;

/// Least cosine of the angle with the vertical of the normal of what faces up (45°).
const UP: f64 = 0.7;

/// How the surface goes on from one voxel to another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum SurfaceTurn {
    /// In an inner corner, or over a step.
    Inward,
    /// Flat, or round an outer edge.
    Outward,
    Unknown,
}

/// The surface in a voxel.
#[derive(Debug, Clone, Copy)]
pub(crate) struct VoxelFacet {
    /// Mean of its points, metres.
    middle: Vector,
    /// Mean unit normal towards the scanner.
    normal: Option<Vector>,
}

impl VoxelFacet {
    pub(crate) fn of(voxel: &ResidualVoxel) -> Self {
        let n = f64::from(voxel.n_residual.max(1));
        let within = voxel.surface.places.map(|sum| f64::from(sum) / 256.0 / n);
        let at: [f64; 3] = std::array::from_fn(|i| f64::from(voxel.voxel[i]) + within[i]);
        let sum = Vector::from(voxel.surface.normals.map(|sum| f64::from(sum) / 256.0));
        let normal = (sum.norm() >= CLEAR).then(|| sum.normalize());
        Self { middle: Vector::from(at) * RESIDUAL_EDGE, normal }
    }

    /// Whether the surface faces up, where its normal is known.
    pub(crate) fn faces_up(&self) -> Option<bool> {
        self.normal.map(|normal| normal.z > UP)
    }

    /// How the surface goes on to another voxel.
    pub(crate) fn bend_to(&self, other: &Self) -> SurfaceTurn {
        let (Some(a), Some(b)) = (self.normal, other.normal) else { return SurfaceTurn::Unknown };
        let Some(way) = (other.middle - self.middle).try_normalize(1e-9) else {
            return SurfaceTurn::Unknown;
        };
        let turn = (b - a).dot(&way);
        let rise = 0.5 * (a + b).dot(&way).abs();
        if turn < -INWARD || a.dot(&b) > 0.7 && rise > STEP {
            SurfaceTurn::Inward
        } else {
            SurfaceTurn::Outward
        }
    }
}
