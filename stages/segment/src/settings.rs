//! The settings of the segmentation, each with its unit and reason.

/// Settings of the segmentation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Standard deviation of a range, metres; 2 mm for a phase scanner on dark steel (METHOD.md
    /// §3).
    pub sigma_range: f64,
    /// Standard deviation of the real casting from its mesh, metres.
    pub sigma_cad: f64,
    /// Lower limit of the gate, the distance from a link up to which a point belongs to it,
    /// metres.
    pub min_gate: f64,
    /// Upper limit of the gate, metres; beyond it a hose may lie on the link.
    pub max_gate: f64,
    /// Upper limit of the floor's half-thickness above its height map, metres; below the limit it
    /// is four standard deviations of the floor's points.
    pub floor_band: f64,
    /// Depth below the floor down to which a point counts as floor, metres (mixed pixels,
    /// reflections).
    pub floor_depth: f64,
    /// Height above the floor below which a point is floor unless it lies on the side of a link,
    /// and height above the underside of a robot below which a point is no part of its foot,
    /// metres.
    pub foot_band: f64,
    /// Distance around a link up to which points are examined, metres.
    pub reach: f64,
    /// The same at the end of a chain, metres: half of a car's side carried by a gripper.
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
