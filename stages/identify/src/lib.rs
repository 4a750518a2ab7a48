//! Clusters, planes and a library of models in; candidates out: where each model's foot may stand,
//! and how turned.
//!
//! The search needs no clean cluster: it asks the beams, on the planes that something may stand on
//! (METHOD.md §5–§7).
#![forbid(unsafe_code)]

mod base;
mod bodies;
mod climb;
mod first;
mod graded;
mod sites;
mod trial;
mod volume;

pub use base::{BaseSearch, Settings};
pub use sites::{RegionSettings, guessed_planes, raised_planes, regions, stand_planes};
pub use volume::Sight;
