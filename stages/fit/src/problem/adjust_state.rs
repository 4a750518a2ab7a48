//! The state of an adjustment: base, joints, the errors of the scans, and the estimates of noise
//! and shape so far.

use crate::MeasuredScene;
use crate::model::Smoothness;
use crate::state::{Hypothesis, ScanError};

/// Where an adjustment stands.
#[derive(Clone)]
pub(crate) struct AdjustState {
    pub(crate) hypothesis: Hypothesis,
    /// One for each view of the scene.
    pub(crate) scans: Vec<ScanError>,
    /// What is taken for the noise of the ranges, metres, one sigma.
    pub(crate) noise: f64,
    /// Standard deviation of the offsets of the model's surface over its patches, metres.
    pub(crate) patch_sigma: f64,
    /// How those offsets vary over a link; `None` where the residuals are to tell.
    pub(crate) smoothness: Option<Smoothness>,
}

impl AdjustState {
    /// A posture, before anything is known of the scans' errors. Offsets of patches are taken as
    /// independent: that is fast to solve, and enough to choose by.
    pub(crate) fn at(hypothesis: &Hypothesis, scene: &MeasuredScene<'_>) -> Self {
        let scans = vec![ScanError::NONE; scene.views.len()];
        let hypothesis = hypothesis.clone();
        let smoothness = Some(Smoothness::Apart);
        Self { hypothesis, scans, noise: scene.noise, patch_sigma: 0.0, smoothness }
    }

    /// The state with the smoothness of the surface's offsets to be estimated.
    pub(crate) fn with_open_smoothness(self) -> Self {
        Self { smoothness: None, ..self }
    }
}
