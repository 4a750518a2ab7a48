//! Free space from the beams of scans: whether beams passed through a place, ended on it or never
//! reached it, and a voxel grid of the known space around a robot.
//!
//! A place counts as free only if a beam ended beyond it. What is hidden behind an object is
//! unknown.
#![forbid(unsafe_code)]

mod known_space;
mod visibility;

pub use known_space::{PassedVoxels, mark_body, mark_free};
pub use visibility::{Visibility, VisibilityQuery};

/// The settings of the grids of known space around robots.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Edge of the voxels of a grid, metres.
    pub edge: f64,
    /// Whether grids of known space are made.
    pub enabled: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self { edge: 0.05, enabled: true }
    }
}
