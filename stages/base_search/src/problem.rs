//! The search problem: one model and the evidence of one region, as all steps of the search read
//! them.

use geometry::{Plane, Point, Pose, Vector};
use nalgebra::{Translation3, UnitQuaternion};
use robot::Model;

use crate::first_link::FirstLink;
use crate::region_evidence::RegionEvidence;
use crate::settings::{GUESSING, Settings, THOROUGH, THRIFTY, Thrift};
use crate::trial::{BaseTrial, SampleScore, Samples, base_link};

/// The search for one model's base in one region.
#[derive(Debug)]
pub struct BaseSearch<'a> {
    pub(crate) model: &'a Model,
    pub(crate) index: usize,
    pub(crate) region: &'a RegionEvidence<'a>,
    pub(crate) settings: &'a Settings,
    /// Largest distance of a sample of the base from its upright axis, metres.
    pub(crate) radius: f64,
    /// Height of the lowest sample of the base in the root's frame, metres.
    foot: f64,
    /// The link that stands on the plane, and its pose in the root's frame.
    pub(crate) base: usize,
    pub(crate) root_from_base: Pose,
    /// The first link that moves and has a surface.
    pub(crate) first: Option<FirstLink>,
    /// Whether the planes are guessed heights, stacked closely.
    pub(crate) is_guess: bool,
    /// Least mean score of base and first link for a candidate.
    pub(crate) min_score: f64,
    /// Factor on the number of base poses that are kept at each level.
    pub(crate) breadth: usize,
    /// How much of the search space is left out.
    pub(crate) thrift: Thrift,
    /// Number of places that are wanted, if not that of the settings.
    pub(crate) places: Option<usize>,
}

impl<'a> BaseSearch<'a> {
    /// Prepares the search for model `index` of the library. `None` if the model has no base
    /// surface or is a tool.
    #[must_use]
    pub fn new(
        index: usize,
        model: &'a Model,
        region: &'a RegionEvidence<'a>,
        settings: &'a Settings,
    ) -> Option<Self> {
        let base = base_link(model)?;
        if model.is_tool() {
            return None;
        }
        let root_from_base = model.poses(&model.home())[base];
        let rooted = model.links[base]
            .cad
            .points
            .iter()
            .map(|p| root_from_base * Point::from(p.map(f64::from)));
        let (mut radius, mut foot) = (0.0_f64, f64::INFINITY);
        for p in rooted {
            radius = radius.max(p.x.hypot(p.y));
            foot = foot.min(p.z);
        }
        let first = FirstLink::of(model);
        let is_guess = false;
        Some(Self {
            model,
            index,
            region,
            settings,
            radius,
            foot,
            base,
            root_from_base,
            first,
            is_guess,
            min_score: settings.min_score,
            breadth: 1,
            thrift: THRIFTY,
            places: None,
        })
    }

    /// The same search on guessed planes, stacked closely: only some of them are searched at the
    /// coarse level.
    #[must_use]
    pub fn on_guessed_planes(self) -> Self {
        Self { is_guess: true, thrift: GUESSING, ..self }
    }

    /// The same search with `breadth` times as many base poses at each level.
    #[must_use]
    pub fn with_breadth(self, breadth: usize) -> Self {
        Self { breadth, ..self }
    }

    /// The same search with less of the search space left out.
    #[must_use]
    pub fn thoroughly(self) -> Self {
        Self { thrift: THOROUGH, ..self }
    }

    /// The same search for the best few places only.
    #[must_use]
    pub fn with_places(self, places: usize) -> Self {
        Self { places: Some(places), ..self }
    }

    /// The same search for candidates with at least this score, or the least score of the settings
    /// if that is higher.
    #[must_use]
    pub fn with_min_score(self, score: f64) -> Self {
        Self { min_score: self.min_score.max(score), ..self }
    }

    /// The score of the first samples of the base at a trial's pose; `tolerance` in metres.
    pub(crate) fn score_base(
        &self,
        plane: &Plane,
        trial: &BaseTrial,
        tolerance: f32,
        n_samples: usize,
    ) -> SampleScore {
        let samples = Samples::first(self.model, self.base, n_samples);
        let pose = self.pose(plane, trial.x, trial.y, trial.yaw) * self.root_from_base;
        self.region.rating(&samples.probe(self.region.evidence, &pose, tolerance))
    }

    /// Quick score of surface samples, to exclude most poses; `tolerance` in metres. A thorough
    /// search looks at fine poses in the depth images themselves. So does any other where the
    /// tolerance is finer than the grid's: with the least one of the grid 2 of 201 robots were
    /// lost.
    pub(crate) fn quick_score(
        &self,
        samples: Samples<'_>,
        local_from_body: &Pose,
        tolerance: f32,
    ) -> SampleScore {
        if self.thrift.is_best_first || self.region.is_coarse(tolerance) {
            return self.region.quick_score(samples, local_from_body, tolerance);
        }
        self.region.rating(&samples.probe(self.region.evidence, local_from_body, tolerance))
    }

    /// The pose of the root link in the region's frame, for a base that stands on the plane at (x,
    /// y) of the plane's own coordinates (metres), turned by `yaw` (radians) about the plane's
    /// normal.
    pub(crate) fn pose(&self, plane: &Plane, x: f64, y: f64, yaw: f64) -> Pose {
        let frame = plane.frame();
        let foot = frame * Vector::new(x, y, plane.offset - self.foot);
        let turn = UnitQuaternion::from_axis_angle(&Vector::z_axis(), yaw);
        Pose::from_parts(Translation3::from(foot), frame * turn)
    }
}
