//! Fourth phase: which other postures explain the points as well as the adjusted one?
//!
//! - A *mode* is a posture, or a value of one joint, at which the points fit about as well as at
//!   the best one; [`JointModes`] are those of a joint.
//! - A *profile* is the cost of the points over the values of one joint (`profile`).
//! - A *spread* is what modes and flat valleys add to the covariance, which takes the sum of
//!   squares for a parabola.
//!
//! Modes of leaf joints are found by their profiles (`leaf`), those of the joint before the last
//! and of slides likewise (`bends`), together with an open flange on all its points (`wrist`);
//! loops may stand on their other solution (`branches`). Spreads come from the base's yaw (`foot`),
//! from joints that give way to open ones (`coupled`), from joints that few points hold
//! (`marginal`), and from what depth cameras bend (`camera`). Whole postures are compared in
//! `compare`. All limits stand in `settings`; `trade_off` puts the weakest direction into words.

mod bends;
mod branches;
mod camera;
mod compare;
mod coupled;
mod foot;
mod leaf;
mod marginal;
mod profile;
mod settings;
mod settled;
mod trade_off;
mod wrist;

pub(crate) use bends::{bends, slides};
pub(crate) use branches::{OtherLoops, other_loops};
pub(crate) use camera::{camera_spread, reach_of_others};
pub(crate) use compare::{ahead, close_rivals, closes_tool, is_on_its_way, lead};
pub(crate) use coupled::coupled_spread;
pub(crate) use foot::with_foot;
pub(crate) use leaf::leaf_modes;
pub(crate) use marginal::marginal_spread;
pub(crate) use profile::JointProfile;
pub(crate) use settings::{AsGood, MODES};
pub(crate) use settled::{JointModes, Settled, better_leaves};
pub(crate) use trade_off::trade_off;
pub(crate) use wrist::{OtherEnd, WristModes, gain};

use crate::correspond::AdjustPoints;
use crate::refine::Refined;

/// The best posture and all that explains the points about as well: what a report is made of.
pub(crate) struct PostureModes {
    pub(crate) best: Settled,
    /// The points of its adjustment, with what their beams met.
    pub(crate) points: AdjustPoints,
    /// Other bends of the joint before an open flange, where those are asked.
    pub(crate) wrist: Option<WristModes>,
    /// Other postures that were looked at.
    pub(crate) others: Vec<Refined>,
}
