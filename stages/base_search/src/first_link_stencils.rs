//! The samples of the first moving link as cells of the grid of scores, at each yaw of the coarse
//! level and each value of its joint: thousands of bases differ in nothing but their place.

use geometry::{Plane, Pose, Vector};
use std::sync::OnceLock;

use crate::first_link::FirstLink;
use crate::problem::BaseSearch;
use crate::score_grid::{RowAxis, Stencil};
use crate::trial::{BaseTrial, SampleScore, Samples, coarse_yaw};

/// Stencils of the first link for the trials of the coarse level.
pub(crate) struct FirstLinkStencils<'s> {
    search: &'s BaseSearch<'s>,
    /// One for each direction of the planes; empty where the grid does not serve the trials.
    origins: Vec<StencilOrigin<'s>>,
    tolerance: f32,
}

/// The place that stencils are made at, and the stencils, each made when first requested.
struct StencilOrigin<'s> {
    normal: Vector,
    /// The root's pose there, without yaw; region frame, metres.
    local_from_root: Pose,
    /// By yaw, then by value of the joint.
    stencils: Vec<OnceLock<Option<Stencil<'s>>>>,
}

/// A trial as a shift from the place of the stencils of its yaw.
pub(crate) struct StencilShift<'t, 's> {
    stencils: &'t FirstLinkStencils<'s>,
    origin: &'t StencilOrigin<'s>,
    first: &'t FirstLink,
    n_yaw: usize,
    /// Region frame, metres.
    shift: [f32; 3],
}

impl<'s> FirstLinkStencils<'s> {
    /// Stencils for trials of the coarse level on planes of the region's frame; `tolerance` in
    /// metres. A thorough search uses none.
    pub(crate) fn new(
        search: &'s BaseSearch<'s>,
        planes: &[Plane],
        trials: &[BaseTrial],
        tolerance: f32,
    ) -> Self {
        let mut origins: Vec<StencilOrigin<'s>> = Vec::new();
        let n_values = search.first.as_ref().map_or(0, |first| first.root_from_link.len());
        let trials = trials.iter().filter(|_| search.thrift.is_best_first);
        for trial in trials {
            let plane = &planes[trial.plane];
            if origins.iter().all(|origin| origin.normal != plane.normal) {
                origins.push(StencilOrigin {
                    normal: plane.normal,
                    local_from_root: search.pose(plane, trial.x, trial.y, 0.0),
                    stencils: (0..N_YAWS * n_values).map(|_| OnceLock::new()).collect(),
                });
            }
        }
        Self { search, origins, tolerance }
    }

    /// The trial, whose root stands at `local_from_root`, as a shift; `None` where there are no
    /// stencils.
    pub(crate) fn shift<'t>(
        &'t self,
        trial: &BaseTrial,
        local_from_root: &Pose,
    ) -> Option<StencilShift<'t, 's>> {
        let first = self.search.first.as_ref()?;
        let n_yaw = (trial.yaw / coarse_yaw()).round() as usize % N_YAWS;
        let up = local_from_root.rotation * Vector::z();
        let nearest = |origin: &&StencilOrigin<'s>| (origin.normal - up).norm() < SAME_NORMAL;
        let origin = self.origins.iter().find(nearest)?;
        let at = &origin.local_from_root.translation.vector;
        let shift = (local_from_root.translation.vector - at).cast::<f32>().into();
        Some(StencilShift { stencils: self, origin, first, n_yaw, shift })
    }
}

/// Number of yaw angles of the coarse level.
const N_YAWS: usize = 24;
/// Largest difference of two unit normals of one direction: rounding.
const SAME_NORMAL: f64 = 1e-9;

impl StencilShift<'_, '_> {
    /// Score of the first `n_samples` samples of the link at the joint's value `k`; `None` if the
    /// grid does not serve the tolerance, or if a sample would lie outside of it.
    pub(crate) fn look_up(&self, k: usize, n_samples: usize) -> Option<SampleScore> {
        let FirstLinkStencils { search, tolerance, .. } = self.stencils;
        let n_values = self.first.root_from_link.len();
        let make = || {
            let samples = Samples::first(search.model, self.first.link, search.settings.n_coarse);
            let yaw = Pose::rotation(Vector::z() * (self.n_yaw as f64 * coarse_yaw()));
            let pose = self.origin.local_from_root * yaw * self.first.root_from_link[k];
            search.region.stencil(RowAxis::X, samples.points, &pose, *tolerance)
        };
        let stencil = self.origin.stencils[self.n_yaw * n_values + k].get_or_init(make);
        stencil.as_ref().and_then(|stencil| stencil.look_up(self.shift, n_samples))
    }
}
