//! The settings of this crate, each with its unit and reason.

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
