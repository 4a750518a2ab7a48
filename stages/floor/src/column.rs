//! What occupied space lies above and below a surface, by ground cell.

use crate::pieces::{GROUND, GroundNode};
use contract::Occupancy;

/// Shares of a surface's cells with occupied space in bands below and above it, 0..1.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct SpaceAround {
    /// Anything lower than [`NEAR`] below the surface.
    pub(crate) below: f64,
    /// Anything between [`NEAR`] and [`TALL`] below the surface.
    pub(crate) near_below: f64,
    /// Anything between [`NEAR`] and [`TALL`] above the surface.
    pub(crate) near_above: f64,
    /// Anything higher than [`NEAR`] above the surface.
    pub(crate) above: f64,
}

/// Distance from the surface at which its surroundings begin, metres: beyond noise and waviness.
const NEAR: f64 = 0.15;
/// Height of the space that a person needs, metres.
const TALL: f64 = 1.5;
/// Smallest number of points of a voxel that counts; fewer may be stray points.
const MIN_POINTS: u32 = 3;

/// Occupied voxels by ground cell, for look-ups under many surfaces.
#[derive(Debug)]
pub(crate) struct GroundColumns {
    /// Ground cell and height of the voxel's centre (metres), sorted.
    voxels: Vec<([i32; 2], f32)>,
}

impl GroundColumns {
    /// Sorts the voxels by ground cell.
    pub(crate) fn new(occupancy: &Occupancy) -> Self {
        let middle = |i: i32| (f64::from(i) + 0.5) * occupancy.edge;
        let mut voxels: Vec<([i32; 2], f32)> = occupancy
            .voxels
            .iter()
            .filter(|v| v.1 >= MIN_POINTS)
            .map(|(v, _)| {
                let cell = [v[0], v[1]].map(|i| (middle(i) / GROUND).floor() as i32);
                (cell, middle(v[2]) as f32)
            })
            .collect();
        voxels.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        voxels.dedup();
        Self { voxels }
    }

    /// The occupied space around a surface.
    pub(crate) fn around(&self, nodes: &[GroundNode]) -> SpaceAround {
        let mut n = [0_u32; 4];
        for node in nodes {
            let from = self.voxels.partition_point(|v| v.0 < node.cell);
            let mut seen = [false; 4];
            for v in self.voxels[from..].iter().take_while(|v| v.0 == node.cell) {
                let up = f64::from(v.1) - node.z;
                seen[0] |= up < -NEAR;
                seen[1] |= up < -NEAR && up > -TALL;
                seen[2] |= up > NEAR && up < TALL;
                seen[3] |= up > NEAR;
            }
            for k in 0..4 {
                n[k] += u32::from(seen[k]);
            }
        }
        let share = |k: usize| f64::from(n[k]) / nodes.len().max(1) as f64;
        SpaceAround { below: share(0), near_below: share(1), near_above: share(2), above: share(3) }
    }
}
