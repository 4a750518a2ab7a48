//! A region and the fits of what stands plainly in it in; the fits of what is harder to find out:
//! on walls and ceilings, behind other things, on stands that nobody sees, moved between scans.

use super::tried::TriedBases;
use super::{GUESS_BREADTH, MAX_SUNK, SAME_BASE, Search, base, breadth};
use crate::engine::AllThreads;
use base_search::RegionEvidence;
use contract::{Candidate, Fit, InstallationPlane, Region, Result, Verdict};
use fit::{MeasuredScene, ScansOfRegion};
use geometry::{Aabb, Point};
use robot::Model;
use std::collections::BTreeMap;

/// Score of a base on a wall or a ceiling from which on it is looked at: a plant has many walls,
/// and few carry robots.
const MIN_MOUNT_SCORE: f64 = 0.15;
/// The same of a base on a stand of which nothing is seen.
const MIN_STAND_SCORE: f64 = 0.10;
/// Such stands are looked for where at least so many points are left over, so far above the
/// region's lowest, metres: a stand with an arm that may reach down from it; benches and most
/// conveyors are no higher.
const MIN_LEFT: usize = 500;
const MIN_STANDING: f64 = 0.9;
/// How far beyond the box of a link points may be its own, metres.
const BOX_MARGIN: f64 = 0.08;
/// Places on walls, ceilings and such stands that are looked at for each model.
const MAX_MOUNTS: usize = 2;
/// So many times the base poses are looked at where a region is searched for what is left over; and
/// so many places for each model.
const BREADTH: usize = 3;
const MAX_LEFT_OVER: usize = 4;
/// So many times the base poses are looked at before walls and the like, where a place is there at
/// five heights at most.
const RAISED_BREADTH: usize = 2;
/// What hangs on a wall keeps its base so far above the floor, metres.
const FLOOR_SLACK: f64 = 0.05;
/// Score of a base from which on it is asked whether its robot moved between scans, and so many of
/// a region are.
const MIN_FOOT: f64 = 0.12;
const MAX_FEET: usize = 8;
/// Share of what was here and gone that must be within its reach: two robots may have moved.
const GONE_IN_REACH: f64 = 0.3;
/// Cells of what was here for one scan and gone for another from which on a robot may have moved: a
/// small arm has 100.
const MIN_GONE: usize = 80;

impl Search<'_, '_> {
    /// Fits of robots on ceilings, walls and tilted plates.
    pub(super) fn on_mounts(
        &self,
        scene: &MeasuredScene<'_>,
        sight: &RegionEvidence<'_>,
        is_wanted: &impl Fn(&Candidate) -> bool,
        tried: &mut TriedBases,
    ) -> Result<Vec<Fit>> {
        self.hung(scene, sight, "mounts", is_wanted, tried)
    }

    /// Fits of robots that hang beside trusted ones, where much is left that those do not explain.
    pub(super) fn hung_beside(
        &self,
        scene: &MeasuredScene<'_>,
        sight: &mut RegionEvidence<'_>,
        fits: &[Fit],
        tried: &mut TriedBases,
    ) -> Result<Vec<Fit>> {
        if fits.iter().all(|f| f.verdict != Verdict::Trusted) {
            // They were asked for in all of the region.
            return Ok(Vec::new());
        }
        let Some(feet) = self.pass_over(scene, sight, fits) else { return Ok(Vec::new()) };
        self.hung(scene, sight, "mounts beside", &|c: &Candidate| is_apart(c, &feet), tried)
    }

    /// Fits on the region's ceilings, walls and tilted plates, of what is wanted of these
    /// candidates; kept under a name. Where none of them is trusted, before these planes, too:
    /// what stands there may be bolted to a plate.
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
            let find = || self.candidates(sight, &planes, MIN_MOUNT_SCORE, breadth);
            let mut hung = self.piece(scene.region, &name, find)?;
            hung.retain(|c| self.is_above_floor(c) && is_wanted(c));
            fits.extend(self.fits(scene, &few(hung, MAX_MOUNTS), tried)?);
            if fits.iter().any(|fit: &Fit| fit.verdict == Verdict::Trusted) {
                break;
            }
        }
        Ok(fits)
    }

    /// Ceilings, walls and tilted plates about the region.
    fn mounts(&self, region: &Region) -> Vec<InstallationPlane> {
        let world = region.world_bounds().grown(0.3);
        let sides = self.ground.surfaces.sides.iter();
        floor::mounts(&sides.filter(|p| p.bounds.touches(&world)).collect::<Vec<_>>())
    }

    /// Whether no base of a candidate reaches into the floor.
    fn is_above_floor(&self, candidate: &Candidate) -> bool {
        let at = candidate.bases[0].0.translation.vector;
        let height = self.ground.surfaces.floor.height_above(at.into(), MAX_SUNK);
        height.is_none_or(|h| h > FLOOR_SLACK)
    }

    /// Fits of robots that less is seen of than of what stands about those that were found: without
    /// that, more bases of each model are looked at.
    pub(super) fn left_over(
        &self,
        scene: &MeasuredScene<'_>,
        sight: &mut RegionEvidence<'_>,
        planes: &[InstallationPlane],
        fits: &[Fit],
        tried: &mut TriedBases,
    ) -> Result<Vec<Fit>> {
        let Some(feet) = self.pass_over(scene, sight, fits) else { return Ok(Vec::new()) };
        let find = || self.candidates(sight, planes, 0.0, BREADTH.max(breadth(planes)));
        let mut found = self.piece(scene.region, "left over", find)?;
        found.retain(|c| is_apart(c, &feet));
        self.fits(scene, &few(found, MAX_LEFT_OVER), tried)
    }

    /// Fits of robots that hide all of the stand under their feet: where much is left that no
    /// trusted robot explains, all heights are tried.
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
        let find = || self.candidates(sight, &planes, MIN_STAND_SCORE, GUESS_BREADTH);
        let mut found = self.piece(region, "stands", find)?;
        found.retain(|c| is_apart(c, &feet) && is_wanted(c));
        self.fits(scene, &few(found, MAX_MOUNTS), tried)
    }

    /// Lets only points count that are on no trusted robot; returns the bases of those robots where
    /// much is left, `None` where little is.
    fn pass_over(
        &self,
        scene: &MeasuredScene<'_>,
        sight: &mut RegionEvidence<'_>,
        fits: &[Fit],
    ) -> Option<Vec<Point>> {
        // Without beams nothing contradicts a wrong base.
        if !scene.evidence.has_beams() {
            return None;
        }
        let trusted = || fits.iter().filter(|f| f.verdict == Verdict::Trusted);
        let taken: Vec<Aabb> =
            trusted().flat_map(|f| boxes(f, &self.library.models[f.model])).collect();
        let is_much = sight.exclude_boxes(&taken, MIN_STANDING) >= MIN_LEFT;
        is_much.then(|| trusted().map(|f| base(&f.world_from_base)).collect())
    }

    /// Robots that moved between scans: where no robot is trusted, but something stands like a
    /// robot's foot within whose reach things were here and gone (region's frame).
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
        let feet = self.candidates(&sight.scan_by_scan(), scans.floors, 0.0, breadth(scans.floors));
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
            let trusted = fits.iter().chain(&out).filter(|f| f.verdict == Verdict::Trusted);
            if trusted.map(|f| base(&f.world_from_base)).any(|at| (at - here).norm() < SAME_BASE) {
                continue;
            }
            let prepared = self.library.prepared(candidate.model);
            let settings = &self.settings.fit;
            out.extend(fit::stays(candidate, prepared, scans, settings, &AllThreads));
        }
        out
    }
}

/// Whether a candidate stands at none of these bases.
fn is_apart(candidate: &Candidate, feet: &[Point]) -> bool {
    let here = base(&candidate.bases[0].0);
    !feet.iter().any(|at| (at - here).norm() < SAME_BASE)
}

/// The best candidates of each model, few.
fn few(mut candidates: Vec<Candidate>, most: usize) -> Vec<Candidate> {
    let mut n: BTreeMap<usize, usize> = BTreeMap::new();
    candidates.retain(|c| {
        let n = n.entry(c.model).or_default();
        *n += 1;
        *n <= most
    });
    candidates
}

/// Boxes of the links of a robot, world, metres.
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
