//! What several scans or several robots say together, once single fits are made: in which scans a
//! robot that was moved stood where (`stays`), which of the fits that claim the same points stands
//! (`choose`), and what all robots of a plant say of the errors of the scans that they share
//! (`common_adjustment`).

mod choose;
mod common_adjustment;
mod stays;

pub use choose::choose;
pub use common_adjustment::together;
pub use stays::{ScansOfRegion, stays};
