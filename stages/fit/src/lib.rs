//! Fits a robot model to the scans of a region: base pose, posture, covariance and verdict.
//!
//! [`fit`] runs through five phases, each of which reads what the one before returned: a beam
//! search over the joints on depth images (`search`), Gauss–Newton over base and joints on thinned
//! points (`refine`), one adjustment of base, joints and scan errors on many points (`adjust`), all
//! other postures that explain the points as well (`modes`), and the report with its verdict
//! (`assess`). `solve.rs` holds their order and every loop over alternatives. All phases share the
//! model made ready (`model`), the region (`scene`), what is asked and what the beams say of a
//! posture (`problem`), a posture and the errors of scans (`state`), and which point belongs to
//! which surface (`correspond`).
//!
//! Beside [`fit`] stand the fit of tools ([`fit_tool`]), the places of joints on their links
//! ([`calibrate()`]), scans in which a robot stands differently ([`stays`]), the choice among fits
//! that claim the same points ([`choose`]), and the common adjustment of all robots ([`together`]).
//! A posture that another method found is judged by [`report_estimate`]. METHOD.md §8–§18 has
//! method and maths.
//!
//! Lengths are metres, angles radians. `world_from_base` takes base to world coordinates.
//!
//! ```
//! use contract::{Candidate, Fit, InstallationPlane, OneByOne, Region, View};
//! use fit::{MeasuredScene, Prepared, Settings};
//!
//! /// The fit of a model where it may stand, by the views of a region with these planes;
//! /// `None` where nothing that was measured comes near the model.
//! fn fit_there(
//!     candidate: &Candidate,
//!     model: &robot::Model,
//!     region: &Region,
//!     views: &[View],
//!     planes: &[InstallationPlane],
//! ) -> Option<Fit> {
//!     let settings = Settings::default();
//!     let prepared = Prepared::new(candidate.model, model, &OneByOne);
//!     let scene = MeasuredScene::new(region, views, planes, &settings, &OneByOne);
//!     fit::fit(candidate, &prepared, &scene, &settings, &OneByOne)
//! }
//! ```
#![forbid(unsafe_code)]

mod adjust;
mod assess;
mod calibrate;
mod correspond;
mod model;
mod modes;
mod plant;
mod problem;
mod refine;
mod scene;
mod search;
mod settings;
mod solve;
mod state;
mod tool;
pub mod verdict;

pub use assess::{PostureEstimate, report_estimate};
pub use calibrate::{calibrate, combine};
pub use model::{Facet, Prepared};
pub use plant::{ScansOfRegion, choose, stays, together};
pub use scene::MeasuredScene;
pub use settings::Settings;
pub use solve::{again, converge, fit};
pub use tool::{ArmWithTool, Bolt, Tooled, bolt, fit_tool, try_tool};
