//! Residual voxels of all tiles in, which of them hang on a robot out: hoses, cables, brackets,
//! tools, workpieces; and what the scans know of the space around each robot.
//!
//! A component of residual voxels that touches a moving link and nothing fixed is an attachment.
//! One that touches both is cut where the ways to link and to fixed thing are equally long; what is
//! not clearly the robot's is fixed or uncertain, never lost.
#![forbid(unsafe_code)]

mod attach;
mod closed;
mod graph;
mod hang;
mod parted;
mod register;
mod sight;
mod space;
mod tally;
mod things;
mod unseen;

pub use attach::{Attach, Attached, Group};
pub use hang::{Hanging, hang};
pub use register::{Planes, Registration, Surfaces};
pub use sight::{Sight, Watch};
pub use space::{Passed, see, stand};
pub use tally::{Seen, Tally, Tallying};
pub use things::{Thing, ThingChange, ThingSettings, things};
pub use unseen::{Unseen, unseen};

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
    /// Edge of the voxels that tell seen from unseen space around robots, metres.
    pub space_edge: f64,
    /// Whether that space is told at all.
    pub space: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self { contact: 0.025, hold: 0.15, cut: 0.3, min_voxels: 3, space_edge: 0.05, space: true }
    }
}
