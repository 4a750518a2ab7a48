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
//! # Example
//! ```
//! use setups::{SetupLimits, ScanWindow, find};
//!
//! // A scanner at (4, 3, 1.7) in a room of 10 m × 7 m × 4 m; each window is a column of points.
//! let at = [4.0, 3.0, 1.7];
//! let windows: Vec<ScanWindow> = (0..180).map(|col| {
//!     let azimuth = col as f64 * 0.0351;
//!     let point = |row: i32| {
//!         let (rise, flat) = (f64::from(row) * 0.004 - 0.9).sin_cos();
//!         let along = [flat * azimuth.cos(), flat * azimuth.sin(), rise];
//!         let to = |i: usize| if along[i] > 0.0 { [10.0, 7.0, 4.0][i] - at[i] } else { -at[i] };
//!         let range = (0..3).map(|i| to(i) / along[i]).fold(f64::INFINITY, f64::min);
//!         [0, 1, 2].map(|i| at[i] + range * along[i])
//!     };
//!     ScanWindow { place: col * 400, source: 0, points: (0..400).map(point).collect() }
//! }).collect();
//! let found = find(&windows, &SetupLimits::default());
//! let position = found.setups[0].position();
//! assert!((0..3).all(|i| (position[i] - at[i]).abs() < 1e-4), "{position:?}");
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

pub use find::{FoundSetups, find};
pub use owner::{is_own, owner, owners};
pub use setup::{Cause, ScanWindow, Setup, SetupEvidence, SetupLimits};
