//! One model and the evidence of one region in; what all steps of the search for the model's base
//! read, out.

use geometry::{Plane, Point, Pose, Vector};
use nalgebra::{Translation3, UnitQuaternion};
use robot::Model;

use crate::first_link::FirstLink;
use crate::region_evidence::RegionEvidence;
use crate::settings::Settings;
use crate::trial::{BaseTrial, SampleScore, Samples, base_link};

/// The search for one model's base in one region.
#[derive(Debug)]
pub struct BaseSearch<'a> {
    pub(crate) model: &'a Model,
    pub(crate) index: usize,
    pub(crate) region: &'a RegionEvidence<'a>,
    pub(crate) settings: &'a Settings,
    /// Farthest sample of the base from its upright axis, metres.
    pub(crate) radius: f64,
    /// Height of the base's lowest sample in the root's frame, metres.
    foot: f64,
    /// The link that stands on the plane, and its pose in the root's frame.
    pub(crate) base: usize,
    pub(crate) root_from_base: Pose,
    /// The first link that moves and has a surface.
    pub(crate) first: Option<FirstLink>,
    /// Whether the planes are guesses, one close above the other.
    pub(crate) is_guess: bool,
    /// Lowest mean score of base and first link that counts.
    pub(crate) min_score: f64,
    /// So many times the usual number of base poses are kept at each level.
    pub(crate) breadth: usize,
}

impl<'a> BaseSearch<'a> {
    /// Prepares the search; `None` for a model without a base surface, or one that is only a tool.
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
        })
    }

    /// The same on planes that are guesses, one close above the other: a few of them tell where to
    /// look at the others.
    #[must_use]
    pub fn on_guesses(self) -> Self {
        Self { is_guess: true, ..self }
    }

    /// The same with so many times the base poses at each level.
    #[must_use]
    pub fn broad(self, breadth: usize) -> Self {
        Self { breadth, ..self }
    }

    /// The same for bases that score so much at least.
    #[must_use]
    pub fn at_least(self, score: f64) -> Self {
        Self { min_score: self.min_score.max(score), ..self }
    }

    /// What the first samples of the base say where it stands as in a trial, `tolerance` in metres.
    pub(crate) fn score_base(
        &self,
        plane: &Plane,
        trial: &BaseTrial,
        tolerance: f32,
        n_samples: usize,
    ) -> SampleScore {
        let samples = Samples::first(self.model, self.base, n_samples);
        let pose = self.pose(plane, trial.x, trial.y, trial.yaw) * self.root_from_base;
        self.region.said(&samples.probe(self.region.evidence, &pose, tolerance))
    }

    /// The base standing on the plane at a place (its own coordinates), turned by `yaw` about the
    /// plane's normal.
    pub(crate) fn pose(&self, plane: &Plane, x: f64, y: f64, yaw: f64) -> Pose {
        let frame = plane.frame();
        let foot = frame * Vector::new(x, y, plane.offset - self.foot);
        let turn = UnitQuaternion::from_axis_angle(&Vector::z_axis(), yaw);
        Pose::from_parts(Translation3::from(foot), frame * turn)
    }
}
