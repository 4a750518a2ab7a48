//! The crate that runs Stillpoint: plan, engine, store, command line, configuration and progress.
//! It takes scans and a robot library, and writes postures and masks. The geometry is computed in
//! `stages/`.
//!
//! Rooms import only rooms to their left:
//!
//! ```text
//! engine  io  job  store  cache  positions  detect  label  result  estimate  rescan  check
//! arrays  plan  shards  eval  cli
//! ```
//!
//! Only the command line imports `eval`. `tests/house.rs` holds the order, and that no files import
//! each other in a circle; `src/ARCHITECTURE.md` says what each room does.

pub mod arrays;
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
pub mod positions;
pub mod rescan;
pub mod result;
pub mod shards;
pub mod store;
