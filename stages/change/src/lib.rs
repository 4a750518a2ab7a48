//! Points of two sessions that stand still, with what each session's beams say of the other's
//! places, in; things that appeared, went or moved, and regions that could not be compared, out.
#![forbid(unsafe_code)]

mod occupancy;
mod solid;
mod split;
mod things;
mod unobserved;

pub use occupancy::{OccupancyBuilder, SessionEvidence, SessionOccupancy};
pub use things::{Thing, ThingChange, ThingSettings, things};
pub use unobserved::{Unseen, unseen};
