//! Reads point files (E57, PTX, LAS, LAZ, PTS, text, PLY, PCD) as strips of points. No other crate
//! knows these formats, and this crate knows nothing of what the points show.
//!
//! # Example
//! ```
//! use contract::{InputId, OneByOne};
//! use ingest::{Settings, Want, open};
//!
//! // A PTX file of one column and two rows, whose scanner stands at (10, 20, 30).
//! let pose = "10 20 30\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n10 20 30 1\n";
//! let points = "1.0 2.0 3.0 0.5\n4.0 5.0 6.0 0.5\n";
//! let folder = tempfile::tempdir()?;
//! let path = folder.path().join("scan.ptx");
//! std::fs::write(&path, format!("1\n2\n{pose}{points}"))?;
//!
//! let sources = open(&[path], None, &Settings::default(), &OneByOne)?;
//! let scanner = sources.scans[0].world_from_scan.translation.vector;
//! assert_eq!((scanner.x, scanner.y, scanner.z), (10.0, 20.0, 30.0));
//! for strip in sources.strips(InputId(0), Want::Coordinates)? {
//!     assert_eq!(strip?.xyz, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]); // scan frame, metres
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![deny(unsafe_code)]

mod angular_grid;
mod arrays;
mod bounds;
#[cfg(test)]
mod check;
mod cloud;
mod e57;
mod file;
mod format;
mod frame;
mod glance;
mod inspect;
mod las;
mod las_header;
mod las_layout;
mod las_record;
mod las_runs;
mod las_scans;
mod laz;
mod levels;
mod looked;
mod map;
mod new_scan;
mod oddities;
mod picture;
mod place_look;
mod poses;
mod position;
mod ptx;
mod raster;
mod raster_free;
mod raster_native;
mod rasters_of_scans;
mod reader;
mod regular;
mod sampling;
mod scan_of_point;
mod scanners;
mod settings;
mod size;
mod source_census;
mod sources;
mod steps;
mod text;
mod units;
mod windows;

pub use arrays::{ArrayScan, open_arrays};
pub use glance::{Glance, GlanceSample};
pub use inspect::{
    BoundsText, Fact, InputDescription, LatticeText, PoseText, ScanDescription, describe,
};
pub use looked::{InputLooks, KeepLooks};
pub use map::{Mapped, map};
pub use position::MISPLACED;
pub use reader::{Extent, PointWindow, Want, WindowSample};
pub use regular::{read_text, regular};
pub use scanners::{KnownScanner, KnownScanners};
pub use settings::Settings;
pub use sources::{Before, InputPiece, InputPieces, Sources, Strips, open, open_after, open_known};
pub use units::{LengthUnit, Origin, ReferenceSystem, Units};
