//! Fallback passes of the search of a region, for robots that the plain search does not find: on
//! walls and ceilings, behind other objects, on hidden stands, and robots that moved between scans.

use super::extent::{SAME_BASE, SearchExtent, base, best_of_guesses, breadth};
use super::tried::TriedBases;
use super::{MAX_SUNK, Search};
use crate::engine::AllThreads;
use base_search::RegionEvidence;
use contract::{Candidate, Fit, InstallationPlane, Region, Result, Verdict};
use fit::{MeasuredScene, ScansOfRegion};
use geometry::{Aabb, Point};
use robot::Model;
use std::collections::BTreeMap;

/// Least score of a base on a wall or a ceiling that is fitted: a plant has many walls, and few
/// carry robots.
const MIN_MOUNT_SCORE: f64 = 0.15;
/// Least score of a base on a stand of which nothing is seen.
const MIN_STAND_SCORE: f64 = 0.10;
/// Least number of unexplained points for a search of hidden stands.
const MIN_LEFT: usize = 500;
/// Least height of these points above the lowest point of the region, metres: a stand with an arm
/// that reaches down from it is higher. Benches and most conveyors are lower.
const MIN_STANDING: f64 = 0.9;
/// Distance from the box of a link up to which points may belong to the link, metres.
const BOX_MARGIN: f64 = 0.08;
/// Most places on walls, ceilings and hidden stands that are fitted for each model.
const MAX_MOUNTS: usize = 2;
/// Factor on the number of base poses and places of each model when unexplained points of a region
/// are searched.
const BREADTH: usize = 3;
const MAX_LEFT_OVER: usize = 4;
/// Factor on the number of base poses in front of walls and plates, where a place occurs at five
/// heights at most.
const RAISED_BREADTH: usize = 2;
/// Factor on the number of base poses on guessed stands, since each place occurs at many heights.
const STAND_BREADTH: usize = 4;
/// Least height above the floor of a base on a wall, metres.
const FLOOR_SLACK: f64 = 0.05;
/// Least score of a base that is examined for a robot that moved between scans.
const MIN_FOOT: f64 = 0.12;
/// Most bases of a region that are examined for such a robot.
const MAX_FEET: usize = 8;
/// Least share of the vanished voxels that must lie within the reach of one robot: two robots may
/// have moved.
const GONE_IN_REACH: f64 = 0.3;
/// Least number of cells that one scan saw occupied and another empty, for a robot that moved: a
/// small arm has 100.
const MIN_GONE: usize = 80;

impl Search<'_, '_> {
    /// Fits of robots that are mounted on ceilings, walls and tilted plates.
    pub(super) fn on_mounts(
        &self,
        scene: &MeasuredScene<'_>,
        sight: &RegionEvidence<'_>,
        is_wanted: &impl Fn(&Candidate) -> bool,
        tried: &mut TriedBases,
    ) -> Result<Vec<Fit>> {
        self.hung(scene, sight, "mounts", is_wanted, tried)
    }

    /// Fits of mounted robots beside trusted ones, where those leave many points unexplained.
    pub(super) fn hung_beside(
        &self,
        scene: &MeasuredScene<'_>,
        sight: &mut RegionEvidence<'_>,
        fits: &[Fit],
        tried: &mut TriedBases,
    ) -> Result<Vec<Fit>> {
        if fits.iter().all(|f| f.verdict != Verdict::Trusted) {
            // The whole region was searched for mounted robots before.
            return Ok(Vec::new());
        }
        let Some(feet) = self.pass_over(scene, sight, fits) else { return Ok(Vec::new()) };
        self.hung(scene, sight, "mounts beside", &|c: &Candidate| is_apart(c, &feet), tried)
    }

    /// Fits on the region's ceilings, walls and tilted plates, of those candidates that `wanted`
    /// accepts; cached under `name`. If none is trusted, planes in front of these are tried as
    /// well, since a robot may be bolted to a plate.
    fn hung(
        &self,
        scene: &MeasuredScene<'_>,
        sight: &RegionEvidence<'_>,
        name: &str,
        is_wanted: &impl Fn(&Candidate) -> bool,
        tried: &mut TriedBases,
    ) -> Result<Vec<Fit>> {
        let mounts = self.mounts(scene.region);
        let mut fits = Vec::new();
        for (name, planes, breadth) in [
            (name.to_owned(), mounts.clone(), 1),
            (format!("{name} raised"), base_search::raised_planes(&mounts), RAISED_BREADTH),
        ] {
            let find = || {
                let places = Some(MAX_MOUNTS);
                let (min_score, is_thorough, competes) = (MIN_MOUNT_SCORE, false, true);
                let extent = SearchExtent { min_score, breadth, places, is_thorough, competes };
                self.candidates(sight, &planes, extent)
            };
            let mut hung = self.piece(scene.region, &name, find)?;
            hung.retain(|c| self.is_above_floor(c) && is_wanted(c));
            fits.extend(self.fits(scene, &likely(hung, MAX_MOUNTS), tried)?);
            if fits.iter().any(|fit: &Fit| fit.verdict == Verdict::Trusted) {
                break;
            }
        }
        Ok(fits)
    }

    /// Ceilings, walls and tilted plates near the region.
    pub(super) fn mounts(&self, region: &Region) -> Vec<InstallationPlane> {
        let world = region.world_bounds().grown(0.3);
        let sides = self.ground.surfaces.sides.iter();
        floor::mounts(&sides.filter(|p| p.bounds.touches(&world)).collect::<Vec<_>>())
    }

    /// Whether all bases of a candidate lie above the floor.
    fn is_above_floor(&self, candidate: &Candidate) -> bool {
        let at = candidate.bases[0].0.translation.vector;
        let height = self.ground.surfaces.floor.height_above(at.into(), MAX_SUNK);
        height.is_none_or(|h| h > FLOOR_SLACK)
    }

    /// Fits of robots that are seen less than the objects around the robots that were found; for
    /// these, more bases of each model are examined.
    pub(super) fn left_over(
        &self,
        scene: &MeasuredScene<'_>,
        sight: &mut RegionEvidence<'_>,
        planes: &[InstallationPlane],
        fits: &[Fit],
        tried: &mut TriedBases,
    ) -> Result<Vec<Fit>> {
        let Some(feet) = self.pass_over(scene, sight, fits) else { return Ok(Vec::new()) };
        let plain = SearchExtent::plain(planes);
        let find = || {
            let breadth = BREADTH.max(breadth(planes));
            let extent = SearchExtent { breadth, places: Some(MAX_LEFT_OVER), ..plain };
            self.candidates(sight, planes, extent)
        };
        let mut found = self.piece(scene.region, "left over", find)?;
        found.retain(|c| is_apart(c, &feet));
        let found = match plain.is_thorough {
            true => few(found, MAX_LEFT_OVER),
            false => likely(found, MAX_LEFT_OVER),
        };
        self.fits(scene, &found, tried)
    }

    /// Fits of robots whose feet hide their stands: where trusted robots leave many points
    /// unexplained, all heights are tried.
    pub(super) fn on_stands(
        &self,
        scene: &MeasuredScene<'_>,
        sight: &mut RegionEvidence<'_>,
        fits: &[Fit],
        is_wanted: &impl Fn(&Candidate) -> bool,
        tried: &mut TriedBases,
    ) -> Result<Vec<Fit>> {
        let region = scene.region;
        let at = region.origin;
        let height = self.ground.surfaces.floor.height_above(at.into(), MAX_SUNK);
        let Some(floor) = height.map(|h| at.z - h) else { return Ok(Vec::new()) };
        let Some(feet) = self.pass_over(scene, sight, fits) else { return Ok(Vec::new()) };
        let planes = base_search::stand_planes(&region.world_bounds(), floor);
        let find = || {
            let (breadth, places) = (STAND_BREADTH, Some(MAX_MOUNTS));
            let (min_score, is_thorough, competes) = (MIN_STAND_SCORE, false, true);
            let extent = SearchExtent { min_score, breadth, places, is_thorough, competes };
            self.candidates(sight, &planes, extent)
        };
        let mut found = self.piece(region, "stands", find)?;
        found.retain(|c| is_apart(c, &feet) && is_wanted(c));
        self.fits(scene, &likely(found, MAX_MOUNTS), tried)
    }

    /// Restricts the scene to points that are on no trusted robot. Returns the bases of those
    /// robots, or `None` where few points are left.
    fn pass_over(
        &self,
        scene: &MeasuredScene<'_>,
        sight: &mut RegionEvidence<'_>,
        fits: &[Fit],
    ) -> Option<Vec<Point>> {
        // Without beams there is no free space that could contradict a wrong base.
        if !scene.evidence.has_beams() {
            return None;
        }
        let is_much = sight.exclude_boxes(&self.taken(fits), MIN_STANDING) >= MIN_LEFT;
        is_much.then(|| trusted(fits).map(|f| base(&f.world_from_base)).collect())
    }

    /// The boxes of the links of trusted robots, world frame, metres.
    fn taken(&self, fits: &[Fit]) -> Vec<Aabb> {
        trusted(fits).flat_map(|f| boxes(f, &self.library.models[f.model])).collect()
    }

    /// Fits of robots that moved between scans: where no robot is trusted, but a base like a
    /// robot's foot is found within whose reach space was occupied for one scan and empty for
    /// another (region frame).
    pub(super) fn moved(
        &self,
        fits: &[Fit],
        sight: RegionEvidence<'_>,
        scans: &ScansOfRegion<'_>,
    ) -> Vec<Fit> {
        let gone = lattice::disagreement(scans.views, &AllThreads);
        if gone.len() < MIN_GONE {
            return Vec::new();
        }
        let extent = SearchExtent { is_thorough: true, ..SearchExtent::plain(scans.floors) };
        let mut sight = sight.scan_by_scan();
        sight.exclude_boxes(&self.taken(fits), 0.0);
        let feet = self.candidates(&sight, scans.floors, extent);
        let mut out: Vec<Fit> = Vec::new();
        let in_reach = |candidate: &&Candidate| {
            let here = base(&candidate.bases[0].0) - scans.region.origin.coords;
            let reach = self.library.prepared(candidate.model).reach();
            let near = |p: &&[f32; 3]| (Point::from(p.map(f64::from)) - here).norm() < reach;
            gone.iter().filter(near).count() as f64 >= GONE_IN_REACH * gone.len() as f64
        };
        let feet = feet.iter().filter(|c| c.bases[0].1 >= MIN_FOOT).filter(in_reach);
        for candidate in feet.take(MAX_FEET) {
            let here = base(&candidate.bases[0].0);
            let is_here = |f: &Fit| (base(&f.world_from_base) - here).norm() < SAME_BASE;
            if trusted(fits).chain(trusted(&out)).any(is_here) {
                continue;
            }
            let prepared = self.library.prepared(candidate.model);
            let settings = &self.settings.fit;
            out.extend(fit::stays(candidate, prepared, scans, settings, &AllThreads));
        }
        out
    }
}

/// The trusted ones of some fits.
fn trusted(fits: &[Fit]) -> impl Iterator<Item = &Fit> {
    fits.iter().filter(|f| f.verdict == Verdict::Trusted)
}

/// Whether a candidate lies apart from all of these bases.
fn is_apart(candidate: &Candidate, feet: &[Point]) -> bool {
    let here = base(&candidate.bases[0].0);
    !feet.iter().any(|at| (at - here).norm() < SAME_BASE)
}

/// The best candidates of each model, at most `most`, without those that others at their place
/// leave far behind.
fn likely(candidates: Vec<Candidate>, most: usize) -> Vec<Candidate> {
    best_of_guesses(few(candidates, most))
}

/// The best candidates of each model, at most `most`.
fn few(mut candidates: Vec<Candidate>, most: usize) -> Vec<Candidate> {
    let mut n: BTreeMap<usize, usize> = BTreeMap::new();
    candidates.retain(|c| {
        let n = n.entry(c.model).or_default();
        *n += 1;
        *n <= most
    });
    candidates
}

/// Bounding boxes of the links of a fitted robot, world frame, metres.
fn boxes(fit: &Fit, model: &Model) -> Vec<Aabb> {
    let posture: Vec<f64> = fit.joints.iter().map(|joint| joint.value).collect();
    let poses = model.poses(&posture);
    let links = model.links.iter().zip(&poses).filter(|(link, _)| !link.bounds.is_empty());
    let bounds = links.map(|(link, pose)| {
        let mut all = Aabb::EMPTY;
        let corners = link.bounds.corners().map(Point::from);
        corners.iter().for_each(|c| all.add((fit.world_from_base * pose * c).into()));
        all.grown(BOX_MARGIN)
    });
    bounds.collect()
}
