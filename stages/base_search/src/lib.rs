//! Clusters, planes and a library of models in; candidates out: where each model's foot may stand,
//! and how turned.
//!
//! The search needs no clean cluster: it asks the beams, on the planes that something may stand on
//! (METHOD.md §5–§7).
#![forbid(unsafe_code)]

mod body_boxes;
mod evidence_grid;
mod first_link;
mod first_link_score;
mod hill_climb;
mod problem;
mod region_evidence;
mod regions;
mod score_grid;
mod search;
mod settings;
mod trial;

pub use problem::BaseSearch;
pub use region_evidence::RegionEvidence;
pub use regions::{RegionSettings, guessed_planes, raised_planes, regions, stand_planes};
pub use settings::Settings;
