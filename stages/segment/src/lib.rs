//! Labels the points of one tile that are near fitted robots, and gives the default label of all
//! other points. The crate never looks at other tiles: `attach` decides what belongs to a robot,
//! from the voxels that remain here.
//!
//! # Example
//! ```
//! use contract::{Fit, Floor, FloorLevel, OneByOne, PointKind, Scan};
//! use geometry::{Plane, Pose, Vector};
//!
//! // A floor of 10 m × 10 m at height 0.
//! let cells = (-20..20).flat_map(|i| (-20..20).map(move |j| ([i, j], 0.0)));
//! let level = FloorLevel {
//!     plane: Plane { normal: Vector::z(), offset: 0.0 },
//!     waviness: 0.0, scatter: 0.002, area: 100.0, cell: 0.25, heights: cells.collect(),
//! };
//! let floor = Floor { levels: vec![level], planes: vec![] };
//! let settings = segment::Settings::default();
//!
//! // Away from robots the place of a point decides.
//! let ground = segment::FloorHeights::new(&floor, &settings);
//! assert_eq!(ground.label([1.0, 2.0, 0.003]).kind, PointKind::Floor);
//! assert_eq!(ground.label([1.0, 2.0, 0.5]).kind, PointKind::Fixed);
//!
//! // Near robots the step labels the points, tile by tile; without fits it has no region.
//! let (fits, scans): (Vec<Fit>, Vec<Scan>) = (vec![], vec![]);
//! let step = segment::Segment::new(&fits, &[], &floor, &scans, settings, &OneByOne);
//! assert!(step.regions().is_empty());
//! ```
#![forbid(unsafe_code)]

mod body;
mod field;
mod ground;
mod raster;
mod step;

pub use ground::FloorHeights;
pub use step::{Segment, SegmentScratch};

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

#[cfg(test)]
mod tests;
