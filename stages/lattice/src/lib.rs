//! Extracts surfaces from one tile at a time: veil points, normals, planar patches and occupied
//! space. Also builds the views of regions. The crate never looks across tiles; surfaces that span
//! several are joined by floor and cluster.
//!
//! # Example
//! ```
//! use contract::{Lattice, Map, Mask, MaskId, Pixel, Scan, ScanId, Tile, TileAt};
//! use geometry::{Aabb, Pose};
//!
//! // A scanner at the origin sees a floor 1.5 m below, in steps of 0.25°.
//! let step = 0.25_f64.to_radians();
//! let lattice = Lattice::new(step, step, 0.0, 0.0);
//! let (at, mut xyz, mut pixel) = (TileAt { scan: ScanId(0), row: 0, col: 0 }, vec![], vec![]);
//! for (row, col) in (160..240_u32).flat_map(|row| (0..80_u32).map(move |col| (row, col))) {
//!     let d = lattice.direction(Pixel { row, col });
//!     xyz.push(d.map(|v| (v * -1.5 / d[2]) as f32));
//!     pixel.push((row * 256 + col) as u16);
//! }
//! # let scan = Scan { id: ScanId(0), input: contract::InputId(0), mask: MaskId(0), notes: vec![],
//! #     name: String::new(), source_id: None, places: vec![], raster: None, world_from_scan: Pose::identity(),
//! #     scanner: contract::ScannerPosition::Stated,
//! #     lattice: Some(lattice), stated_bounds: None, stated_points: None };
//! let n_all = xyz.len() as u64;
//! let tile = Tile { at, first_place: 0, place: (0..n_all as u32).collect(), pixel, xyz,
//!     bounds: Aabb::EMPTY, skip: 0, n_all };
//! let stage = lattice::Summarise::new(&[scan], &lattice::Settings::default());
//! let summary = stage.apply(tile, &mut lattice::LatticeScratch::default())?;
//! assert!(summary.patches[0].plane.normal.z > 0.999); // the floor faces up
//! # Ok::<(), contract::Error>(())
//! ```
#![forbid(unsafe_code)]

mod accord;
mod fill;
mod links;
mod noise;
mod normals;
mod occupied;
mod patch;
mod raster;
mod regions;
mod settings;
mod summarise;
mod tile_normals;
mod view;
mod voxels;

pub use accord::{agree, disagreement};
pub use fill::veils;
pub use settings::Settings;
pub use summarise::{LatticeScratch, Summarise};
pub use tile_normals::normals;
pub use view::{LatticeExtent, ViewBuilder, ViewSettings};
