//! How a run goes: plan, engine, store, command line, configuration, progress. Scans and a robot
//! library in, postures and masks out. Knows no geometry: what is done stands in `stages/`.

mod advice;
pub mod bench;
mod bodies;
pub mod calibrate;
pub mod changes;
pub mod check;
pub mod cli;
pub mod compare;
pub mod conversion;
mod copc;
pub mod demo;
pub mod engine;
pub mod estimate;
pub mod exit;
mod filling;
mod folders;
pub mod history;
pub mod job;
mod labelled;
mod labelling;
pub mod lenient;
mod library;
mod masks;
mod near;
pub mod plan;
#[cfg(fuzzing)]
pub mod probes;
pub mod progress;
mod reading;
mod report;
pub mod rescan;
pub mod reuse;
pub mod review;
pub mod scanning;
mod search;
mod spaces;
pub mod store;
mod straight;
mod surfaces;
pub mod tally;
mod things;
mod tile_bound;
mod tools;
pub mod trajectory;
mod units;
