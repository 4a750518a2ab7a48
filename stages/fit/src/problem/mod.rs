//! What a fit is asked: one model in one scene, with the points about it, the settings, what is
//! known of its base beforehand, and the threads to work on.
//!
//! Every phase takes the same [`Problem`] and reads what the phase before it returned. Nothing
//! here searches or solves; `judgement` says what the beams make of a posture, for any phase that
//! has to choose among several.

mod adjust_state;
mod base_prior;
mod context;
mod derivatives;
mod judgement;
mod priors;
mod sweep_steps;
#[cfg(test)]
mod test_problems;

pub(crate) use adjust_state::AdjustState;
pub(crate) use base_prior::Prior;
pub(crate) use context::Problem;
pub(crate) use derivatives::{JointPlaces, residual_row};
pub(crate) use judgement::{
    JudgedPosture, Judgement, judge, judged, link_evidence, links_apart, margin,
};
pub(crate) use priors::{add_priors, keep_slides, scan_priors};
pub(crate) use sweep_steps::SweepSteps;
#[cfg(test)]
pub(crate) use test_problems::{bar, before_front, before_plate, seen, with_jaw};
