//! The store of lattice tiles on disk. Strips are added in the order of the input, and tiles are
//! read in any order. A store is a folder with two files: the catalogue, and the memory-mapped
//! tiles. It knows no geometry beyond bounds.

mod buffer;
mod catalogue;
mod encode;
mod file;
#[cfg(test)]
mod laws;
mod layout;
mod map;
mod parts;
mod reader;
mod record;
mod scatter;
mod sink;
pub(crate) mod spatial_tiles;
mod spill;
#[cfg(test)]
mod tests;
mod writer;

pub use buffer::TILE_POINTS;
pub use catalogue::TileEntry;
pub use reader::{Pick, Reads, Store};
pub use scatter::{Scatter, Scattered};
pub use sink::TileSink;
