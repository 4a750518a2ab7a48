//! A tile and the fits in, labels of its points near robots out; beside it, the label that a point
//! has by its place alone. Knows nothing of other tiles: what hangs on a robot is told by `attach`
//! from the voxels left here.
#![forbid(unsafe_code)]

mod body;
mod field;
mod ground;
mod raster;
mod step;

pub use ground::FloorHeights;
pub use step::{Segment, SegmentScratch};

/// What may be tuned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Standard deviation of a range, metres: 2 mm is a phase scanner on dark steel (METHOD.md
    /// §3).
    pub sigma_range: f64,
    /// Standard deviation of a mesh from the real casting, metres.
    pub sigma_cad: f64,
    /// Smallest distance from a link at which a point still belongs to it, metres.
    pub min_gate: f64,
    /// Largest such distance, metres: beyond it a hose may lie on the link.
    pub max_gate: f64,
    /// Largest half thickness of the floor above its height map, metres: else four times what its
    /// points scatter.
    pub floor_band: f64,
    /// How far below the floor a point still counts as floor, metres (mixed pixels, reflections).
    pub floor_depth: f64,
    /// Below this height above the floor a point is floor unless it lies on the side of a link,
    /// and above the plane that a robot stands on it is no part of the foot, metres.
    pub foot_band: f64,
    /// How far around a link points are looked at, metres.
    pub reach: f64,
    /// The same at the end of a chain, metres: half a car side carried by a gripper.
    pub hand_reach: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            sigma_range: 0.002,
            sigma_cad: 0.001,
            min_gate: 0.006,
            max_gate: 0.012,
            floor_band: 0.012,
            floor_depth: 0.03,
            foot_band: 0.005,
            reach: 0.4,
            hand_reach: 1.2,
        }
    }
}

#[cfg(test)]
mod tests;
