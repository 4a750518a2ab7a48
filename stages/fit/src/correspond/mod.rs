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
pub(crate) use sampled::{AdjustPoints, chunk};
pub(crate) use strata::{PerLink, adjusted_points, some, stratified};
