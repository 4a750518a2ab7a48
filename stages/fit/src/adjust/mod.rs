//! Third phase: adjusts base, joints and the scans' own errors of a refined posture together
//! ([`Adjusted`]). One robust least-squares adjustment gives a covariance that holds although the
//! errors of points are correlated (METHOD.md §11, §14).
//!
//! Each scan has a shift, a turn about its scanner and a range bias, all with priors: scans are
//! registered to millimetres, and a fit that ignores that bends the robot. Each patch of the
//! model's surface has an offset along its normals, `u ~ N(0, σ_u²)`, which is taken out in closed
//! form; σ_u is estimated from the patches. Models are drawn to millimetres, and without the
//! patches the scans would be bent to fit a wrong shape.

mod adjustment;
mod footprint;
mod normal;
mod tallies;

pub(crate) use adjustment::{Adjust, Adjusted, kernel_scale};
pub(crate) use footprint::on_whole_beams;
pub(crate) use normal::Normal;
