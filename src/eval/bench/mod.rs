//! Benches: random cells and plants are scanned and processed; tables compare results with the
//! truth, and speed and memory with the limits of the machine.

pub mod accuracy;
mod carried_items;
mod cases;
mod cell;
pub mod check;
mod condition;
mod draw;
pub mod frames;
mod journal;
mod kinds;
mod labels;
mod machine_limits;
mod obstacles;
mod other_tables;
pub mod plan;
pub mod plant;
mod plot;
mod process_watch;
pub mod request;
pub mod rescan;
pub mod scanners;
mod score;
mod shape;
mod sheet;
mod shift_table;
pub mod shifts;
mod table;
pub mod throughput;
mod time_plot;
