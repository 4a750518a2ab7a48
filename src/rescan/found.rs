//! All findings of a rescan, for the modules that write them.

use super::earlier_result::EarlierResult;
use super::frame::CarriedSession;
use super::session::{CellComparison, CellLabels, ComparedRobots};
use contract::Fit;
use robot::Model;

/// The earlier result, the comparison of both sessions in the cell, and the robots as they stand
/// now.
pub(crate) struct RescanFindings<'a, 's> {
    pub(crate) base: &'a EarlierResult,
    pub(crate) session: &'a CellComparison<'s>,
    pub(crate) robots: &'a ComparedRobots,
    pub(crate) labels: &'a CellLabels,
    pub(crate) models: &'a [Model],
    pub(crate) fits: &'a [Fit],
    pub(crate) carried: &'a CarriedSession,
}
