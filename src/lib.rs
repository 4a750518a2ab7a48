//! How a run goes: plan, engine, store, command line, configuration, progress. Scans and a robot
//! library in, postures and masks out. Knows no geometry: what is done stands in `stages/`.

pub mod cache;
pub mod check;
pub mod cli;
pub mod detect;
pub mod engine;
pub mod estimate;
pub mod eval;
mod io;
pub mod job;
mod label;
pub mod plan;
pub mod rescan;
pub mod result;
pub mod store;
