//! The settings of this crate, each with its unit and reason.

/// Settings of the cluster stage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Number of empty voxels that a cluster may bridge. The default of 1 allows for the holes
    /// that thin and distant parts have at 5 cm.
    pub gap: i32,
    /// Smallest height of a voxel's bottom above the floor, metres; the default is three times the
    /// noise of a common scanner.
    pub clearance: f64,
    /// Depth below a level down to which a voxel counts as noise or dirt of that level, metres.
    pub slack: f64,
    /// Smallest number of points of a cluster; fewer are dust.
    pub min_points: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Self { gap: 1, clearance: 0.012, slack: 0.15, min_points: 10 }
    }
}
