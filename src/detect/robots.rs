//! The fits of a plant together with their models, and where the links of a fitted robot are.

use contract::{Fit, Region};
use export::ReviewEntry;
use geometry::{Aabb, Point, Pose};
use robot::Model;
use serde::{Deserialize, Serialize};

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

/// Reviewed robots as a piece of the store: without the models that stand in the library.
#[derive(Serialize, Deserialize)]
pub(crate) struct KeptRobots {
    pub(crate) fits: Vec<Fit>,
    /// Models that follow those of the library.
    own: Vec<Model>,
    /// Effect of each entry of the review.
    pub(crate) review: Vec<ReviewEntry>,
}

impl KeptRobots {
    /// The robots of `list`, whose first models are the `n` of the library.
    pub(crate) fn of(list: RobotList, n: usize, review: Vec<ReviewEntry>) -> Self {
        let RobotList { fits, mut models } = list;
        Self { fits, own: models.split_off(n.min(models.len())), review }
    }

    /// Fits and models, with those of the library, and the effects of the review.
    pub(crate) fn with(self, library: &[Model]) -> (RobotList, Vec<ReviewEntry>) {
        let models = library.iter().cloned().chain(self.own).collect();
        (RobotList { fits: self.fits, models }, self.review)
    }
}

impl RobotList {
    /// Borrows fits and models.
    pub(crate) fn view(&self) -> FittedRobots<'_> {
        FittedRobots { fits: &self.fits, models: &self.models }
    }
}

/// Poses of the links of a fitted robot in the world frame.
pub(crate) fn poses(fit: &Fit, model: &Model) -> Vec<Pose> {
    let posture: Vec<f64> = fit.joints.iter().map(|j| j.value).collect();
    model.poses(&posture).into_iter().map(|p| fit.world_from_base * p).collect()
}

/// Bounds of a robot in its fitted posture, world frame, metres.
pub(crate) fn standing(fit: &Fit, model: &Model) -> Aabb {
    let mut out = Aabb::EMPTY;
    for (link, pose) in model.links.iter().zip(poses(fit, model)) {
        if !link.bounds.is_empty() {
            link.bounds.corners().into_iter().for_each(|c| out.add((pose * Point::from(c)).into()));
        }
    }
    out
}

/// A region with bounds `world` and a frame whose origin is near `middle`, metres.
pub(crate) fn region(middle: &Point, world: &Aabb) -> Region {
    let origin = middle.map(f64::round);
    let shift = |p: [f64; 3]| std::array::from_fn(|i| p[i] - origin[i]);
    Region { origin, bounds: Aabb { min: shift(world.min), max: shift(world.max) } }
}
