//! Views of a region in; what their beams say of its space out: which places they went through,
//! which they ended on, and which they never reached; and a grid of known space about a robot.
//!
//! A place counts as free only where a beam went on beyond it: what something hides is unknown.
#![forbid(unsafe_code)]

mod known_space;
mod visibility;

pub use known_space::{Passed, see, stand};
pub use visibility::{Visibility, VisibilityQuery};

/// Tunables of the grids of known space about robots.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Edge of the voxels that tell seen from unseen space around robots, metres.
    pub edge: f64,
    /// Whether grids of known space are made at all.
    pub enabled: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self { edge: 0.05, enabled: true }
    }
}
