//! One model in one scene, and the means to fit it.

use contract::Fan;

use super::base_prior::Prior;
use crate::scene::Nearby;
use crate::{MeasuredScene, Prepared, Settings};

/// A point may lie beside the nearest sample of a surface by so much and still belong to it.
struct BesideSample {
    /// In spacings of the samples.
    spacings: f64,
    /// In standard deviations of the scans' noise, added to that.
    sigmas: f64,
}

const BESIDE: BesideSample = BesideSample { spacings: 1.6, sigmas: 1.5 };

/// One model in one scene, and the means to fit it.
#[derive(Clone, Copy)]
pub(crate) struct Problem<'a> {
    pub(crate) prepared: &'a Prepared<'a>,
    pub(crate) scene: &'a MeasuredScene<'a>,
    pub(crate) settings: &'a Settings,
    /// What is known of the base beforehand.
    pub(crate) prior: Option<Prior>,
    /// Points of the scene within the robot's reach, thinned to one a grid cell and view: enough
    /// to choose by. Indices into the scene's points, ascending.
    pub(crate) thin: &'a [u32],
    /// All points of the scene within the robot's reach: for adjustments.
    pub(crate) all: &'a [u32],
    /// The threads.
    pub(crate) fan: &'a dyn Fan,
}

impl<'a> Problem<'a> {
    /// A model in a scene whose points play no part yet, without prior knowledge of its base.
    pub(crate) fn new(
        prepared: &'a Prepared<'_>,
        scene: &'a MeasuredScene<'_>,
        settings: &'a Settings,
        fan: &'a dyn Fan,
    ) -> Self {
        Self { prepared, scene, settings, prior: None, thin: &[], all: &[], fan }
    }

    /// The problem with the points about a base.
    pub(crate) fn with_points(self, nearby: &'a Nearby) -> Self {
        Self { thin: &nearby.thin, all: &nearby.all, ..self }
    }

    /// How far beside its nearest sample a point of a link may lie, metres.
    pub(crate) fn beside(&self, link: usize) -> f64 {
        let spacing = f64::from(self.prepared.model.links[link].cad.spacing);
        BESIDE.spacings * spacing + BESIDE.sigmas * self.scene.noise
    }
}
