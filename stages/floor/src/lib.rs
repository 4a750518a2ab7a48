//! Summaries of tiles in; floor levels, installation planes and the occupied space of the whole
//! out. Knows no points: planes are joined by their moments, heights by ground cells.
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
