//! Residual voxels of all tiles in, which of them hang on a robot out: hoses, cables, brackets,
//! tools, workpieces; and convex pieces of them for a planner.
//!
//! A component of residual voxels that touches a moving link and nothing fixed is an attachment.
//! One that touches both is cut where the ways to link and to fixed thing are equally long; what is
//! not clearly the robot's is fixed or uncertain, never lost.
#![forbid(unsafe_code)]

mod decide;
mod hulls;
mod voxel_graph;

pub use decide::{Attach, Attached, Group};
pub use hulls::{Hanging, hang};

/// What may be tuned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// A voxel with a point this close to a link touches it, metres: a voxel's edge and a gate.
    pub contact: f32,
    /// Where a component also reaches something fixed: farthest from a link that it may count as
    /// attached, metres.
    pub hold: f32,
    /// Widest cut between robot and fixed thing that is still a hose or a cable, metres of surface
    /// around it: wider ones are a wall or a jig that the robot touches, and uncertain.
    pub cut: f64,
    /// Components with fewer voxels are specks, and uncertain.
    pub min_voxels: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self { contact: 0.025, hold: 0.15, cut: 0.3, min_voxels: 3 }
    }
}
