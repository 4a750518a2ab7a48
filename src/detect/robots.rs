//! The fits of a plant together with their models.

use contract::Fit;
use robot::Model;

/// Fits of a plant and their models, borrowed.
#[derive(Clone, Copy)]
pub(crate) struct FittedRobots<'a> {
    pub(crate) fits: &'a [Fit],
    /// Models of the library, followed by models with a tool, with loops in another solution, or
    /// with calibrated joints.
    pub(crate) models: &'a [Model],
}

/// Fits of a plant and their models, owned; a fit with a model of its own appends that model.
pub(crate) struct RobotList {
    pub(crate) fits: Vec<Fit>,
    pub(crate) models: Vec<Model>,
}

impl RobotList {
    /// Borrows fits and models.
    pub(crate) fn view(&self) -> FittedRobots<'_> {
        FittedRobots { fits: &self.fits, models: &self.models }
    }
}
