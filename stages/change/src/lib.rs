//! Compares two sessions of a plant: things that appeared, went or moved between them, and regions
//! that could not be compared.
//!
//! The input is the points of each session that do not belong to robots, each with what the beams
//! of the other session show about its place.
#![forbid(unsafe_code)]

mod occupancy;
mod shift;
mod solid;
mod split;
mod things;
mod unobserved;

pub use occupancy::{OccupancyBuilder, SessionEvidence, SessionOccupancy};
pub use shift::{SessionBeams, ThingMotion, ThingPoints, ThingVoxels, UnknownMotion, find_motions};
pub use things::{Thing, ThingChange, ThingSettings, things};
pub use unobserved::{UnobservedRegion, unobserved_regions};
