//! Searches for the bases of robots: for each model of a library, the places and yaw angles at
//! which its base may stand on the planes of a region.
//!
//! The search does not need clean clusters. It scores base poses by the free-space evidence of the
//! scans' beams (METHOD.md §5–§7). Its results are [`contract::Candidate`]s, which are refined by
//! the fit.
#![forbid(unsafe_code)]

mod body_boxes;
mod coarse_level;
mod evidence_grid;
mod first_link;
mod first_link_score;
mod first_link_stencils;
mod hill_climb;
mod outscored;
mod problem;
mod region_evidence;
mod regions;
mod score_grid;
mod search;
mod settings;
mod trial;

pub use outscored::{RatedBases, drop_outscored};
pub use problem::BaseSearch;
pub use region_evidence::RegionEvidence;
pub use regions::{guessed_planes, level_planes, raised_planes, regions, stand_planes};
pub use settings::{RegionSettings, Settings};
