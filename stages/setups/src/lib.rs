//! Finds where the scanners stood that measured a cloud, from runs of points in the order of
//! measurement, and how surely.
//!
//! A terrestrial scanner spins about an axis. While its mirror turns it measures one column of
//! points, in equal steps of elevation. Three facts follow, which hold at any range noise, since
//! noise moves a point along its own beam:
//!
//! 1. The points of one column lie in one plane, and the planes of all columns share the axis
//!    ([`planes`](self), `axis`).
//! 2. Seen from the scanner's place on the axis, elevations of neighbours differ by one step
//!    (`height`), and from no other place.
//! 3. All elevations of a scan lie on one comb `e0 + k · step` (`comb`). Whether they do is a test
//!    of the found position against chance: elevations seen from any other place have arbitrary
//!    phases.
//!
//! A setup is reported only where the comb is so clear that chance gives it less than once in a
//! million clouds, with all places and steps counted that were tried ([`SetupEvidence`]).
//! Otherwise the answer is *unknown*, with its [`Cause`].
//!
//! Points in no order are left to [`find_unordered`], which looks for the raster of angles itself.
//!
//! # Example
//! ```
//! use setups::{Cause, ScanWindow, SetupLimits, find};
//!
//! // One point again and again is no column of a scanner.
//! let same = ScanWindow { place: 0, source: 0, points: vec![[1.0, 2.0, 3.0]; 512] };
//! let found = find(&vec![same; 50], &SetupLimits::default());
//! assert!(found.setups.is_empty());
//! assert_eq!(found.cause, Some(Cause::NoColumns));
//! ```
#![forbid(unsafe_code)]

mod axis;
mod comb;
mod find;
mod height;
mod owner;
mod planes;
mod refine;
mod setup;
#[cfg(test)]
mod tests;
mod tune;
mod unordered;

pub use find::{FoundSetups, find};
pub use owner::{is_own, owner, owners};
pub use setup::{Cause, ScanWindow, Setup, SetupEvidence, SetupLimits};
pub use unordered::{
    CLEAR_RASTER, FoundRasters, RasterEvidence, RasterSetup, UnorderedCause, find_unordered,
};
