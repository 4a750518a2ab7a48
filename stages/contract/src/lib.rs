//! The types that stages share (scan, lattice, strip, tile, planes, cluster, candidate, fit, label,
//! errors), the traits of a step, and helpers to quote names and to catch panics.
//!
//! No algorithm is in this crate: those are in `geometry` or in the stage that uses them.
//!
//! # Example
//! A lattice converts points of a scan to pixels and back to directions:
//! ```
//! use contract::Lattice;
//!
//! let step = 0.1_f64.to_radians(); // between rows and between columns
//! let lattice = Lattice::new(step, step, 0.0, 0.0);
//! let (pixel, range) = lattice.pixel([3.0, 4.0, 0.0]); // scan frame, metres
//! assert_eq!(range, 5.0);
//! let direction = lattice.direction(pixel); // unit vector, scan frame
//! let cosine = direction[0] * 0.6 + direction[1] * 0.8;
//! assert!(cosine > step.cos());
//! ```
#![forbid(unsafe_code)]

mod candidate;
mod certainty;
mod error;
pub mod fence;
mod fit;
mod label;
mod lattice;
mod point_raster;
mod ptx;
pub mod quote;
mod residual;
mod scan;
mod space;
mod step;
mod strip;
mod surface;
mod tile;
mod view;
pub mod words;
mod xml;

pub use candidate::{Candidate, Cluster, Voxel};
pub use certainty::{Certainty, DETERMINED_SIGMA, UNDETERMINED_SIGMA};
pub use error::{Error, Kind, Result};
pub use fit::{
    Calibration, Equal, Fit, JointFit, JointFrame, LinkEvidence, Mounted, RunnerUp, ScanShare,
    ScanShift, Verdict,
};
pub use label::{Label, PointKind};
pub use lattice::{Lattice, Pixel};
pub use point_raster::{OnRaster, PointRaster};
pub use ptx::is_ptx_no_return;
pub use residual::{LinkAt, PlaceRun, RESIDUAL_EDGE, ResidualVoxel, SurfaceSums, TileLabels};
pub use scan::{Format, Input, InputId, Mask, MaskId, Scan, ScanId, ScannerPosition};
pub use space::{Space, SpaceGrid, SpaceKind};
pub use step::{Fan, Fold, Map, OneByOne, Weigh};
pub use strip::{Attributes, Strip};
pub use surface::{
    Floor, FloorLevel, InstallationPlane, Occupancy, Overlap, PlanePatch, TileSummary,
};
pub use tile::{MAX_SKIP, TILE_SIDE, Tile, TileAt, TilePoints};
pub use view::{Region, View};
pub use xml::{XmlLimits, check_xml};
