//! A candidate in, a fit out: which posture, where exactly, how sure.
//!
//! The way: beam search over the joints on the depth images (`beam`), joint Gauss–Newton over base
//! and all joints on the points (`refine`), evidence and covariance (`judge`, `report`), verdict in
//! words (`verdict`), and the choice among candidates that claim the same points (`choose`). Method
//! and maths: METHOD.md §8–§14. Beside it stands the method of the source (METHOD.md §10, §21),
//! link after link (`paper`).
#![forbid(unsafe_code)]

mod adjust;
mod alternatives;
mod beam;
mod bend;
mod branch;
mod calibrate;
mod camera;
mod choose;
#[cfg(test)]
mod cubes;
mod exact;
mod face;
mod facets;
mod foot;
mod footprint;
mod judge;
mod matching;
mod mount;
mod noise;
mod normal;
mod pairs;
pub mod paper;
mod pierced;
mod placed;
mod prepared;
mod profile;
mod refine;
mod report;
mod rivals;
mod sampled;
mod scene;
mod settings;
mod settle;
mod solve;
mod spin;
mod stays;
mod strata;
mod sway;
mod sweep;
mod tallies;
mod together;
mod tool;
pub mod turns;
pub mod verdict;
mod weak;
mod wrist;

pub use calibrate::{calibrate, combine};
pub use choose::choose;
pub use mount::Bolt;
pub use prepared::Prepared;
pub use scene::Scene;
pub use settings::{Method, Settings};
pub use solve::{again, converge, fit};
pub use stays::{Sights, stays};
pub use together::together;
pub use tool::{Tooled, bolt, fit_tool, try_tool};
