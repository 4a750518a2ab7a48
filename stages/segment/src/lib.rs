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
mod curves;
mod field;
mod gather;
mod ground;
mod raster;
mod settings;
mod step;

pub use ground::FloorHeights;
pub use settings::Settings;
pub use step::{Segment, SegmentScratch};

#[cfg(test)]
mod tests;
