//! The store: strips in, tiles on disk, tiles out again in any order. A folder with two files: the
//! catalogue, and the tiles, memory-mapped. Knows no geometry beyond bounds.

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
