//! Results as files and words: `result.json` and the summary, the state for later sessions, changes
//! between results, their history, their conversion, their meshes and their page.

pub(crate) mod advice;
pub(crate) mod changed_things;
pub mod changes;
pub mod conversion;
pub(crate) mod copc;
pub mod distance_export;
pub mod history;
pub mod labelled_points;
mod loose_points;
pub(crate) mod mesh_build;
mod mesh_chunks;
pub mod mesh_export;
pub(crate) mod page;
#[cfg(fuzzing)]
pub(crate) mod plant_probe;
pub(crate) mod plant_state;
pub(crate) mod report;
pub mod run_record;
pub mod scans_back;
pub mod scene_export;
pub(crate) mod text_report;
