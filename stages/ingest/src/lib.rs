//! Files in, strips out: the only reader of point formats. Knows how files are read, and nothing of
//! what is in them.
#![deny(unsafe_code)]

mod angular_grid;
mod bounds;
#[cfg(test)]
mod check;
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
mod oddities;
mod picture;
mod poses;
mod position;
mod ptx;
mod raster;
mod raster_free;
mod raster_native;
mod reader;
mod regular;
mod scanners;
mod settings;
mod size;
mod sources;
mod steps;
mod text;
mod units;

pub use glance::{Glance, GlanceSample};
pub use inspect::{
    BoundsText, Fact, InputDescription, LatticeText, PoseText, ScanDescription, describe,
};
pub use map::{Mapped, map};
pub use position::MISPLACED;
pub use reader::{Extent, Want};
pub use regular::{read_text, regular};
pub use scanners::{KnownScanner, KnownScanners};
pub use settings::Settings;
pub use sources::{Before, InputPiece, InputPieces, Sources, Strips, open, open_after};
pub use units::{LengthUnit, Origin, Units};
