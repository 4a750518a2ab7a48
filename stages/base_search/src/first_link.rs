//! The first moving link of a model, with the poses that it takes over the range of its joint.

use geometry::Pose;
use robot::Model;
use std::f64::consts::TAU;

use crate::trial::first_moving;

/// Step between values of the first joint, radians.
const FIRST_STEP: f64 = 0.14;

/// The first link that moves and has a surface.
#[derive(Debug)]
pub(crate) struct FirstLink {
    pub(crate) link: usize,
    /// Its poses in the root's frame over the range of its joint, at most one turn.
    pub(crate) root_from_link: Vec<Pose>,
}

impl FirstLink {
    /// The first moving link of a model; `None` if no link moves.
    pub(crate) fn of(model: &Model) -> Option<Self> {
        let (free, link) = first_moving(model)?;
        let [low, high] = model.limits(free);
        let span = (high - low).min(TAU);
        let n = (span / FIRST_STEP).ceil().max(1.0);
        let mut posture = model.home();
        let pose = |k: usize| {
            posture[free] = low + span * k as f64 / n;
            model.poses(&posture)[link]
        };
        Some(Self { link, root_from_link: (0..=n as usize).map(pose).collect() })
    }

    /// Its poses in the region's frame for a pose of the root link.
    pub(crate) fn poses(&self, local_from_root: &Pose) -> Vec<Pose> {
        self.root_from_link.iter().map(|root_from_link| local_from_root * root_from_link).collect()
    }
}
