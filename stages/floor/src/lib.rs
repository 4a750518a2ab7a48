//! Finds floor levels, installation planes and the occupied space of a plant from the summaries of
//! all tiles. The crate sees no points: planes are joined by their moments, heights by ground
//! cells.
//!
//! # Example
//! ```
//! use contract::{Fold, ScanId, TileSummary};
//! use geometry::{Aabb, Moments, Plane, Vector};
//!
//! // A patch of floor, 4 m × 4 m at height 0, as 16 × 16 ground cells of 0.25 m.
//! let mut moments = Moments::new(Vector::zeros());
//! let cells = (0..16).flat_map(|y| (0..16).map(move |x| [x, y]));
//! for [x, y] in cells.clone() {
//!     moments.add(&Vector::new(0.25 * f64::from(x), 0.25 * f64::from(y), 0.0));
//! }
//! let patch = contract::PlanePatch {
//!     scan: ScanId(0),
//!     plane: Plane { normal: Vector::z(), offset: 0.0 },
//!     bounds: Aabb { min: [0.0; 3], max: [4.0, 4.0, 0.0] },
//!     ground: cells.map(|cell| (cell, 100, 0.0)).collect(),
//!     area: 16.0, rms: 0.0, moments,
//! };
//! let find = floor::Find::new(&[], &floor::Settings::default());
//! let mut sum = find.empty();
//! find.add(&mut sum, TileSummary { patches: vec![patch], ..Default::default() })?;
//! assert_eq!(find.finish(sum)?.floor.levels[0].area, 16.0);
//! # Ok::<(), contract::Error>(())
//! ```
#![forbid(unsafe_code)]

mod column;
mod find;
mod levels;
mod mounts;
mod overlap;
mod pieces;
mod settings;
mod stands;
mod union;

pub use find::{Find, FloorFindings, FloorSum, find};
pub use mounts::mounts;
pub use settings::Settings;
