//! The settings of this crate, each with its unit and reason.

/// The settings of this crate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// TouchesRobot: a voxel touches a link if one of its points is at most this far from the link,
    /// metres. It is the edge of a voxel plus the gate of the segmentation.
    pub contact: f32,
    /// Largest circumference of a thin part of a body, metres: a hose of 60 mm. Such a part moves
    /// or stands still as a whole between the bodies at its ends.
    pub thin: f64,
    /// Largest distance between a hand, or what it carries, and a body that hangs in the air
    /// beside it, metres: the length of a tool that no scan saw.
    pub gap: f64,
    /// Components with fewer voxels are too small to judge; their voxels become uncertain.
    pub min_voxels: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self { contact: 0.025, thin: 0.19, gap: 0.35, min_voxels: 3 }
    }
}
