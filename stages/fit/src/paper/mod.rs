//! A region's points, the planes under it and a model in; the fit of the method's source out, link
//! after link, as it is described there (§§3–6): the baseline that the other method is measured
//! against.
//!
//! Installation plane, geodesic candidates of the base (`graph`), boxes and equal steps of yaw
//! (`rough`), sparse ICP (`sparse`), then for each joint a sweep with nearest neighbours on the
//! angular lattices (`lattice`, `sweep`) and the registration of its link tied to two points of the
//! joint's axis, Eq. 4.1 (`axis`). Links of sub chains follow by the model's own inverse kinematics
//! of loops. No free space, no joint adjustment.

mod axis;
mod graph;
mod lattice;
mod rough;
mod settings;
mod sparse;
mod sweep;

use contract::{Fit, InstallationPlane, JointFit};
use geometry::{Plane, Point, Pose, Vector};
use nalgebra::{Translation3, UnitQuaternion};

pub use settings::Settings as PaperSettings;

use crate::judge::{evidence, judge};
use crate::state::Hypothesis;
use crate::verdict::{self, VerdictEvent};
use crate::{Prepared, Scene, Settings};
use lattice::Lattices;

/// Stated for each joint: the source's own worst joint (Table 1), since the method gives no
/// uncertainty.
const SIGMA: f64 = 0.0094;
/// Steps to each side when a base is settled.
const N_SETTLE: i32 = 10;
/// A fit with this score ends the search for planes.
const GOOD_SCORE: f64 = 0.5;
/// Tolerance of the judgement, metres.
const JUDGE_TOLERANCE: f64 = 0.015;

/// One model in one scene.
pub(crate) struct Paper<'a> {
    pub(crate) prepared: &'a Prepared<'a>,
    pub(crate) scene: &'a Scene<'a>,
    pub(crate) settings: &'a PaperSettings,
    pub(crate) lattices: &'a Lattices,
    /// The link that stands on the plane.
    pub(crate) base: usize,
}

/// The fits of a model on each plane that carries something like its base, best first.
#[must_use]
pub fn fit(
    prepared: &Prepared<'_>,
    scene: &Scene<'_>,
    planes: &[InstallationPlane],
    (settings, own): (&Settings, &PaperSettings),
) -> Vec<Fit> {
    let Some(&base) = prepared.fixed.first() else { return Vec::new() };
    let lattices = Lattices::new(&scene.views);
    let paper = Paper { prepared, scene, settings: own, lattices: &lattices, base };
    let mut out: Vec<Fit> = Vec::new();
    let mut planes: Vec<&InstallationPlane> = planes.iter().collect();
    planes.sort_by(|a, b| a.plane.offset.total_cmp(&b.plane.offset));
    for plane in planes {
        // The lowest plane that carries the robot is its own.
        if out.iter().any(|f: &Fit| f.score > GOOD_SCORE) {
            break;
        }
        let local = Plane {
            normal: plane.plane.normal,
            offset: plane.plane.offset - plane.plane.normal.dot(&scene.region.origin.coords),
        };
        for pose in paper.bases(&local) {
            let (rough, precise) = paper.posture(&pose);
            out.extend(paper.report(&pose, rough, precise, settings));
        }
    }
    out.sort_by(|a, b| b.explained.total_cmp(&a.explained));
    out
}

impl Paper<'_> {
    /// Poses of the base on a plane: one for each connected set of points that is as near to the
    /// plane, along the surface, as the base is high.
    fn bases(&self, plane: &Plane) -> Vec<Pose> {
        let s = self.settings;
        let points: Vec<Vector> = self
            .scene
            .thin
            .iter()
            .map(|&i| Vector::from(self.scene.points[i as usize].p.map(f64::from)))
            .filter(|p| (s.foot_low..s.max_height).contains(&plane.distance(p)))
            .collect();
        let cad = self.base_samples();
        let foot = cad.iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
        let standing: Vec<Vector> = cad.iter().map(|p| p - Vector::z() * foot).collect();
        let limit =
            graph::farthest(&standing, s, |p| p.z) * s.geodesic_slack[0] + s.geodesic_slack[1];
        let sets = graph::near_plane(&points, s, |p| plane.distance(p), limit);
        let mut out = Vec::new();
        for set in sets.into_iter().take(s.max_bases) {
            let candidates: Vec<Vector> = set.iter().map(|&i| points[i]).collect();
            let starts = rough::places(self, plane, &candidates, foot);
            let ends = starts.iter().map(|start| self.settle_base(start, &candidates));
            // The candidates hold points of the next link too: the base's own samples decide.
            let judged = ends.map(|pose| (self.off_base(&pose), pose));
            out.extend(judged.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, pose)| pose));
        }
        out
    }

    /// Sparse registration; then the place and the yaw about it at which the base's own samples lie
    /// best, in equal steps, and registration again.
    fn settle_base(&self, start: &Pose, candidates: &[Vector]) -> Pose {
        let mut pose = sparse::register(self, start, candidates);
        for [shift, turn] in self.settings.settle_steps {
            let moves = [
                (Vector::x() * shift, Vector::zeros()),
                (Vector::y() * shift, Vector::zeros()),
                (Vector::zeros(), Vector::z() * turn),
            ];
            for (shift, turn) in moves {
                let step = |k: i32| pose * Pose::new(shift * f64::from(k), turn * f64::from(k));
                let tried = (-N_SETTLE..=N_SETTLE).map(step).map(|p| (self.off_base(&p), p));
                pose = tried.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(pose, |(_, p)| p);
            }
            pose = sparse::register(self, &pose, candidates);
        }
        pose
    }

    /// Samples of the base, root frame, thinned like the points.
    fn base_samples(&self) -> Vec<Vector> {
        let pose = self.prepared.model.poses(&self.prepared.model.home())[self.base];
        let cad = &self.prepared.model.links[self.base].cad;
        let edge = self.settings.voxel;
        let mut seen = std::collections::BTreeSet::new();
        let all = cad.points.iter().map(|p| (pose * Point::from(p.map(f64::from))).coords);
        all.filter(|p| seen.insert([p.x, p.y, p.z].map(|v| (v / edge).floor() as i64))).collect()
    }

    /// Joint after joint: the value of the sweep, then that of the registration.
    fn posture(&self, base: &Pose) -> (Vec<f64>, Vec<f64>) {
        let mut h =
            Hypothesis { local_from_base: *base, posture: self.prepared.model.home(), score: 0.0 };
        let mut rough = h.posture.clone();
        for joint in 0..h.posture.len() {
            if self.prepared.placed_by[joint].is_empty() {
                continue;
            }
            h.posture[joint] = self.sweep(&h, joint);
            rough[joint] = h.posture[joint];
            h.posture[joint] = self.register(&h, joint);
        }
        (rough, h.posture)
    }

    fn report(
        &self,
        base: &Pose,
        rough: Vec<f64>,
        posture: Vec<f64>,
        settings: &Settings,
    ) -> Option<Fit> {
        let model = self.prepared.model;
        let h = Hypothesis { local_from_base: *base, posture, score: 0.0 };
        let judgement = judge(self.prepared, self.scene, settings, &h, JUDGE_TOLERANCE);
        if judgement.score < settings.min_score || judgement.violation > settings.max_violation {
            return None;
        }
        let joints = h.posture.iter().enumerate().map(|(j, value)| JointFit {
            name: model.joints[model.free[j]].name.clone(),
            value: *value,
            sigma: SIGMA,
            // It does not ask.
            certainty: contract::Certainty::Undetermined,
            ..JointFit::default()
        });
        let none = vec![0; model.links.len()];
        let rms = vec![0.0; model.links.len()];
        let origin = Translation3::from(self.scene.region.origin.coords);
        let mut fit = Fit {
            model: self.prepared.index,
            model_name: model.name.clone(),
            world_from_base: Pose::from_parts(origin, UnitQuaternion::identity()) * base,
            base_sigma: [SIGMA; 6],
            joints: joints.collect(),
            score: judgement.score,
            explained: judgement.explained,
            links: evidence(self.prepared, &judgement, &none, &rms),
            rough,
            ..Fit::default()
        };
        verdict::apply(&mut fit, &VerdictEvent::LinkAfterLink);
        Some(fit)
    }
}
