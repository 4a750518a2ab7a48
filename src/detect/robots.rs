//! The fits of a plant, with the models that they are of.

use contract::Fit;
use robot::Model;

/// Robots of a plant, to be read.
#[derive(Clone, Copy)]
pub(crate) struct FittedRobots<'a> {
    pub(crate) fits: &'a [Fit],
    /// Models of the library and, after them, those with a tool, other loops or calibrated joints.
    pub(crate) models: &'a [Model],
}

/// Robots of a plant, to be changed: a fit of a model of its own adds that model.
pub(crate) struct RobotList {
    pub(crate) fits: Vec<Fit>,
    pub(crate) models: Vec<Model>,
}

impl RobotList {
    /// The same, to be read.
    pub(crate) fn view(&self) -> FittedRobots<'_> {
        FittedRobots { fits: &self.fits, models: &self.models }
    }
}
