//! Tiles in, surfaces out: veils, normals, planar patches and occupied space of one tile at a time.
//! Knows nothing of other tiles; what spans them is joined by floor and cluster.
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
