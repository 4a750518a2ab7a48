//! Benches: cells and plants drawn from seeds, scanned and searched; errors against the truth, and
//! speed and memory beside the machine's limits, as tables.

pub mod accuracy;
mod carried_items;
mod cases;
mod cell;
pub mod check;
mod condition;
mod draw;
pub mod frames;
mod journal;
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
mod score;
mod shape;
mod sheet;
mod table;
pub mod throughput;
mod time_plot;
