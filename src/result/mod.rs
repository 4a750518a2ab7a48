//! What a run found in; the result as files and words, what a later session goes on from, and how
//! results differ, follow one another and are converted, out.

pub(crate) mod advice;
pub(crate) mod changed_things;
pub mod changes;
pub mod conversion;
pub(crate) mod copc;
pub mod history;
#[cfg(fuzzing)]
pub(crate) mod plant_probe;
pub(crate) mod plant_state;
pub(crate) mod report;
