//! Clusters, planes and a library of models in; candidates out: where each model's foot may stand,
//! and how turned.
//!
//! The search needs no clean cluster: it asks the beams, on the planes that something may stand on
//! (METHOD.md §5–§7).
#![forbid(unsafe_code)]

mod body_boxes;
mod evidence_grid;
mod first_link;
mod hill_climb;
mod regions;
mod score_grid;
mod search;
mod trial;

pub use evidence_grid::Sight;
pub use regions::{RegionSettings, guessed_planes, raised_planes, regions, stand_planes};
pub use search::{BaseSearch, Settings};
