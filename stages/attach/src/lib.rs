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
mod settings;
mod voxel_graph;

pub use decide::{Attach, Attached, Group};
pub use hulls::{AttachedPieces, attached_pieces};
pub use settings::Settings;
