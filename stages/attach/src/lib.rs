//! Decides which residual voxels of all tiles are attached to a robot (hoses, cables, brackets,
//! tools, workpieces), and makes convex pieces of them for a motion planner.
//!
//! A residual voxel is a cube that holds points near a robot that no link explains. Residual voxels
//! are connected to components over all tiles.
//!
//! A component that touches a moving link and nothing fixed is an attachment. A component that
//! touches both is cut where the paths along it to the link and to the fixed object are equally
//! long. What does not clearly belong to the robot is labelled as fixed or uncertain.
#![forbid(unsafe_code)]

mod decide;
mod hulls;
mod voxel_graph;

pub use decide::{Attach, Attached, Group};
pub use hulls::{AttachedPieces, attached_pieces};

/// The settings of this crate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Contact: a voxel touches a link if one of its points is at most this far from the link,
    /// metres. It is the edge of a voxel plus the gate of the segmentation.
    pub contact: f32,
    /// Largest distance from a link at which a voxel counts as attached, metres. It applies to
    /// components that also reach something fixed.
    pub hold: f32,
    /// Widest cut through a component between robot and fixed object, metres of voxel edges along
    /// the cut. A hose or a cable has a smaller cut. A larger one indicates a wall or a jig that
    /// the robot touches, and the voxels become uncertain.
    pub cut: f64,
    /// Components with fewer voxels are too small to judge; their voxels become uncertain.
    pub min_voxels: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self { contact: 0.025, hold: 0.15, cut: 0.3, min_voxels: 3 }
    }
}
