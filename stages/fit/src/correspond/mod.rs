//! Which measured point belongs to which place on the model's surface, and the other way round: the
//! correspondences that refinement, adjustment and comparison of postures are made of.

mod distances;
mod matching;
mod pairs;
mod pierced;
mod placed;
mod sampled;
mod strata;

pub(crate) use distances::{Apart, CAP, MIN_POINTS, distances, spheres, squares, swept, worsening};
pub(crate) use matching::Matching;
pub(crate) use pairs::{MetTriangle, Pairing, SurfacePair};
pub(crate) use pierced::pierced;
pub(crate) use sampled::AdjustPoints;
pub(crate) use strata::{PerLink, adjusted_points, some, stratified};

/// Distance from which the coarse field answers, metres: just inside the fine field's reach.
const FINE_REACH: f64 = 0.026;

/// Points that one thread works on at a time, of `n`: few enough that threads end together, as many
/// as make what is joined after them worth it. Sums are taken chunk by chunk, so it does not depend
/// on the threads.
pub(crate) fn chunk(n: usize) -> usize {
    (n / 16).clamp(1024, 8192)
}
