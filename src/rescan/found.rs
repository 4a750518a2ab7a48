//! All that a rescan has found, for those that write it.

use super::earlier_result::EarlierResult;
use super::frame::CarriedSession;
use super::session::{CellComparison, CellLabels, ComparedRobots};
use contract::Fit;
use robot::Model;

/// The earlier result, what both sessions saw of the cell, and how its robots stand now.
pub(crate) struct Found<'a, 's> {
    pub(crate) base: &'a EarlierResult,
    pub(crate) session: &'a CellComparison<'s>,
    pub(crate) robots: &'a ComparedRobots,
    pub(crate) labels: &'a CellLabels,
    pub(crate) models: &'a [Model],
    pub(crate) fits: &'a [Fit],
    pub(crate) carried: &'a CarriedSession,
}
