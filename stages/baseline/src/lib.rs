//! The method that the fit started from, as its source describes it (§§3–6): link after link, the
//! baseline that the stage `fit` is measured against. It is chosen by `--method paper` and is not
//! meant for use.
//!
//! On an installation plane, candidates of the base are found by distances along surfaces
//! (`graph`), placed by boxes and equal steps of yaw (`rough`), and registered by sparse ICP
//! (`sparse`). Then each joint is swept with nearest neighbours on angular grids of the scans
//! (`direction_grid`, `sweep`), and its links are registered, tied to two points of the joint's
//! axis, Eq. 4.1 (`axis`). Links of closed loops follow by the model's own inverse kinematics. The
//! method uses no free space and adjusts no joints together; beams only decide whether a finished
//! fit is kept ([`fit::report_estimate`]).
//!
//! Lengths are metres, angles radians. Method and maths: METHOD.md §10 of the stage `fit`.
#![forbid(unsafe_code)]

mod axis;
mod context;
mod direction_grid;
mod graph;
mod posture;
mod rough;
mod settings;
mod sparse;
mod sweep;

use contract::{Certainty, Fit, InstallationPlane};
use fit::verdict::{self, VerdictEvent};
use fit::{MeasuredScene, PostureEstimate, Prepared};
use geometry::{Plane, Point, Pose, Vector};

pub use settings::Settings;

use context::SequentialFit;
use direction_grid::DirectionGrids;
use posture::Placement;

/// Standard deviation that is stated for each joint, radians: the source's own worst joint
/// (Table 1), since the method gives no uncertainty.
const SIGMA: f64 = 0.0094;
/// Steps to each side when a base is settled.
const N_SETTLE: i32 = 10;
/// A fit with this score ends the search for planes.
const GOOD_SCORE: f64 = 0.5;
/// Tolerance of the judgement, metres.
const JUDGE_TOLERANCE: f64 = 0.015;

/// The fits of a model on each plane (world frame) that carries something like its base, the one
/// that explains most surface first. `judging` says which fits are reported at all.
#[must_use]
pub fn fit(
    prepared: &Prepared<'_>,
    scene: &MeasuredScene<'_>,
    planes: &[InstallationPlane],
    judging: &fit::Settings,
    settings: &Settings,
) -> Vec<Fit> {
    let Some(&base) = prepared.fixed.first() else { return Vec::new() };
    let grids = DirectionGrids::new(&scene.views);
    let robot = SequentialFit { prepared, scene, settings, grids: &grids, base };
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
        for pose in robot.bases(&local) {
            let (rough, precise) = robot.posture(&pose);
            out.extend(robot.report(&pose, rough, precise, judging));
        }
    }
    out.sort_by(|a, b| b.explained.total_cmp(&a.explained));
    out
}

impl SequentialFit<'_> {
    /// Poses of the base on a plane: one for each connected set of points that is as near to the
    /// plane, along the surface, as the base is high.
    fn bases(&self, plane: &Plane) -> Vec<Pose> {
        let s = self.settings;
        let points: Vec<Vector> = self
            .scene
            .thinned_local_points()
            .map(|p| p.coords)
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
        let mut h = Placement { local_from_base: *base, posture: self.prepared.model.home() };
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

    /// The fit that is reported; `None` where the beams contradict it. All joints have the standard
    /// deviation that the source states, and count as undetermined: the method does not ask which
    /// of them the points determine.
    fn report(
        &self,
        base: &Pose,
        rough: Vec<f64>,
        posture: Vec<f64>,
        judging: &fit::Settings,
    ) -> Option<Fit> {
        let (local_from_base, tolerance) = (*base, JUDGE_TOLERANCE);
        let estimate = PostureEstimate { local_from_base, posture, tolerance };
        let mut fit = fit::report_estimate(self.prepared, self.scene, judging, &estimate)?;
        fit.base_sigma = [SIGMA; 6];
        for joint in &mut fit.joints {
            joint.sigma = SIGMA;
            joint.certainty = Certainty::Undetermined;
        }
        fit.rough = rough;
        verdict::apply(&mut fit, &VerdictEvent::LinkAfterLink);
        Some(fit)
    }
}
