//! A posture that is compared with the best one.

use crate::refine::Refined;

/// Another posture, and how clearly the best is better.
pub(super) struct Rival<'a> {
    pub(super) margin: f64,
    pub(super) other: &'a Refined,
}
