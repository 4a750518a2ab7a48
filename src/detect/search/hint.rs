//! Search for a robot that a person expects: a model and a place near its base. The yaw and the
//! height of the base are open. The place need not lie in a region of unexplained points.

use super::extent::{GUESS_BREADTH, SAME_BASE, SearchExtent, base, breadth};
use super::tried::TriedBases;
use super::{Search, feet};
use crate::detect::robots::{region, standing};
use crate::engine::AllThreads;
use base_search::RegionEvidence;
use contract::{Candidate, Fit, InstallationPlane, JointFit, Region, Result, Verdict};
use fit::MeasuredScene;
use geometry::{Aabb, NearestField, Point, Pose, Vector};
use nalgebra::{Translation3, UnitQuaternion};
use rayon::prelude::*;

/// Largest number of places whose base poses are fitted.
const MAX_PLACES: usize = 6;
/// Number of yaws at which a given posture is compared with the points: one each 5°.
const N_YAWS: usize = 72;
/// Number of these yaws, for each place, from which the posture is fitted, and the least number of
/// yaws between two of them.
const N_TURNS: usize = 3;
const TURNS_APART: usize = 3;
/// Distance from a measured point within which a sample of the surface counts as measured, metres,
/// and the edge of the voxels that tell it.
const NEAR: f32 = 0.05;
const FIELD_EDGE: f32 = 0.025;
/// Number of samples of the surface that are compared.
const N_SAMPLES: usize = 800;
/// Margin around the reach of the robot, metres.
const MARGIN: f64 = 0.3;

/// A robot that a person expects.
pub(crate) struct RobotHint {
    /// Index of the model.
    pub(crate) model: usize,
    /// Place near its base, world frame, metres.
    pub(crate) at: Point,
    /// Largest distance of the base from the place, metres.
    pub(crate) radius: f64,
    /// Values of the free joints, radians or metres, where the person knows them.
    pub(crate) posture: Option<Vec<f64>>,
}

impl Search<'_, '_> {
    /// Fits of the expected model with bases within the radius of the place, with every verdict.
    pub(crate) fn hinted(&self, hint: &RobotHint) -> Result<Vec<Fit>> {
        let region = self.region_around(hint);
        let views = self.views(&region)?;
        if views.is_empty() {
            return Ok(Vec::new());
        }
        let planes = self.planes(&region);
        let scene = MeasuredScene::new(&region, &views, &planes, &self.settings.fit, &AllThreads);
        let feet = feet(&region, &hint.at, hint.radius);
        let sight = RegionEvidence::new(&feet, &views, &scene.evidence, &scene.scouts, &AllThreads);
        let heights = hint.at.z - hint.radius..hint.at.z + hint.radius;
        let mounts = self.mounts(&region);
        let guessed = base_search::level_planes(&feet.world_bounds(), heights);
        let (mut fits, mut tried) = (Vec::new(), TriedBases::default());
        // Heights without a plane are searched where no plane has the robot.
        for (planes, breadth) in
            [(&planes, breadth(&planes)), (&mounts, 1), (&guessed, GUESS_BREADTH)]
        {
            let candidates = self.hinted_candidates(hint, &sight, planes, breadth);
            let mut found = match &hint.posture {
                None => self.fits(&scene, &candidates, &mut tried)?,
                Some(posture) => self.turned(hint, posture, &scene, &candidates),
            };
            for fit in found.iter_mut().filter(|fit| fit.verdict != Verdict::Refused) {
                self.look_closer(fit)?;
            }
            found.retain(|fit| (base(&fit.world_from_base) - hint.at).norm() <= hint.radius);
            fits.extend(found);
            if fits.iter().any(|fit| fit.verdict == Verdict::Trusted) {
                break;
            }
        }
        Ok(fits)
    }

    /// Fits a robot again among the points about it alone, as robots of regions are: what it can
    /// reach is so large that depth images of it are coarse, and its points thinned.
    fn look_closer(&self, fit: &mut Fit) -> Result<()> {
        let body = standing(fit, &self.library.models[fit.model]).grown(MARGIN);
        let around = region(&base(&fit.world_from_base), &body);
        let closer = self.in_scene(&around, |scene, settings| {
            fit::again(fit, self.library.prepared(fit.model), scene, settings, &AllThreads)
        })?;
        if let Some(closer) = closer {
            *fit = closer;
        }
        Ok(())
    }

    /// Everything that the robot can reach from around the place.
    fn region_around(&self, hint: &RobotHint) -> Region {
        let reach = self.library.prepared(hint.model).reach() + hint.radius + MARGIN;
        let all = self.bounds().grown(MARGIN);
        let about = Aabb { min: hint.at.into(), max: hint.at.into() };
        region(&hint.at, &about.grown(reach).shared(&all))
    }

    /// Bases on some planes within the radius, the best of each place, best first.
    fn hinted_candidates(
        &self,
        hint: &RobotHint,
        sight: &RegionEvidence<'_>,
        planes: &[InstallationPlane],
        breadth: usize,
    ) -> Vec<Candidate> {
        if planes.is_empty() {
            return Vec::new();
        }
        let (min_score, is_thorough, competes) = (0.0, true, false);
        let extent = SearchExtent { min_score, breadth, places: None, is_thorough, competes };
        let search = self.search_of(hint.model, sight, planes, extent);
        let mut found = search.map(|s| s.run(planes, &AllThreads)).unwrap_or_default();
        found.retain(|c| {
            let pose = c.bases.first();
            pose.is_some_and(|pose| (base(&pose.0) - hint.at).norm() <= hint.radius)
        });
        found.sort_by(|a, b| b.bases[0].1.total_cmp(&a.bases[0].1));
        found.truncate(MAX_PLACES);
        found
    }

    /// Fits that start at a given posture, on the bases of the candidates turned by those yaws at
    /// which the robot lies nearest to the points.
    fn turned(
        &self,
        hint: &RobotHint,
        posture: &[f64],
        scene: &MeasuredScene<'_>,
        candidates: &[Candidate],
    ) -> Vec<Fit> {
        let prepared = self.library.prepared(hint.model);
        let model = &self.library.models[hint.model];
        let reach = prepared.reach() + hint.radius;
        let points: Vec<[f32; 3]> = (scene.places(&hint.at, reach).iter())
            .map(|p| (p - hint.at).map(|v| v as f32).into())
            .collect();
        if points.is_empty() {
            return Vec::new();
        }
        let field = NearestField::new(&points, FIELD_EDGE, NEAR);
        let samples = self.samples(hint.model, posture);
        let mut bases: Vec<Pose> = Vec::new();
        for candidate in candidates {
            let pose = candidate.bases[0].0;
            if bases.iter().all(|other| (base(other) - base(&pose)).norm() > 0.1 * SAME_BASE) {
                bases.push(pose);
            }
        }
        let starts: Vec<Pose> = bases
            .iter()
            .flat_map(|pose| {
                let share = |world_from_base: &Pose| {
                    let is_measured = |p: &&Point| {
                        let p: [f32; 3] =
                            (world_from_base * **p - hint.at).map(|v| v as f32).into();
                        field.nearest(p).is_some()
                    };
                    samples.iter().filter(is_measured).count()
                };
                best_turns(pose, share)
            })
            .collect();
        let joint = |(&joint, &value): (&usize, &f64)| {
            let name = model.joints[joint].name.clone();
            JointFit { value, name, ..JointFit::default() }
        };
        let joints: Vec<JointFit> = model.free.iter().zip(posture).map(joint).collect();
        let fit = |world_from_base: &Pose| {
            let start = Fit {
                model: hint.model,
                model_name: model.name.clone(),
                world_from_base: *world_from_base,
                joints: joints.clone(),
                ..Fit::default()
            };
            fit::again(&start, prepared, scene, &self.settings.fit, &AllThreads)
        };
        starts.par_iter().map(fit).collect::<Vec<_>>().into_iter().flatten().collect()
    }

    /// Samples of the surface of a model in a posture, base frame, metres.
    fn samples(&self, model: usize, posture: &[f64]) -> Vec<Point> {
        let model = &self.library.models[model];
        let all: Vec<Point> = (model.links.iter().zip(model.poses(posture)))
            .flat_map(|(link, pose)| {
                link.cad.points.iter().map(move |p| pose * Point::from(p.map(f64::from)))
            })
            .collect();
        let step = (all.len() / N_SAMPLES).max(1);
        all.into_iter().step_by(step).collect()
    }
}

/// The base pose turned about its axis by those yaws whose share is largest.
fn best_turns(pose: &Pose, share: impl Fn(&Pose) -> usize) -> Vec<Pose> {
    let turned = |k: usize| {
        let yaw = k as f64 / N_YAWS as f64 * std::f64::consts::TAU;
        let turn = UnitQuaternion::from_axis_angle(&Vector::z_axis(), yaw);
        pose * Pose::from_parts(Translation3::identity(), turn)
    };
    let mut shares: Vec<(usize, usize)> = (0..N_YAWS).map(|k| (share(&turned(k)), k)).collect();
    shares.sort_by(|a, b| b.0.cmp(&a.0).then(a.1.cmp(&b.1)));
    let mut chosen: Vec<usize> = Vec::new();
    for (_, k) in shares {
        let is_apart = |other: &usize| {
            let steps = k.abs_diff(*other);
            steps.min(N_YAWS - steps) >= TURNS_APART
        };
        if chosen.len() < N_TURNS && chosen.iter().all(is_apart) {
            chosen.push(k);
        }
    }
    chosen.into_iter().map(turned).collect()
}
