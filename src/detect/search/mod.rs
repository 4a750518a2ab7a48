//! The search of a region: reads the tiles that the region's views need, and sends every model of
//! the library through base search and fit.

mod extent;
mod fallback;
pub(crate) mod hint;
mod tried;
mod views;

use super::ground::Ground;
use crate::cache::Cache;

use crate::engine::AllThreads;
use crate::engine::progress::Pieces;
use crate::job::{Method, Settings};
use crate::store::Store;
use base_search::{BaseSearch, RatedBases, RegionEvidence};
use contract::{Candidate, Fan, Fit, InstallationPlane, OneByOne, Region, Result, Scan, Verdict};
use extent::{MIN_SHARE_OF_LEVEL, SAME_BASE, SPARE_PLACES, SearchExtent, base};
use fit::{MeasuredScene, Prepared, ScansOfRegion};
use geometry::{Aabb, Plane, Point, Pose, Vector};
use rayon::prelude::*;
use robot::Model;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::collections::BTreeSet;
use std::sync::OnceLock;
use tried::TriedBases;

/// A library and, for each model, data that fits of it need, prepared at first use.
pub(crate) struct PreparedLibrary<'a> {
    models: &'a [Model],
    prepared: Vec<OnceLock<Prepared<'a>>>,
}

impl<'a> PreparedLibrary<'a> {
    pub(crate) fn new(models: &'a [Model]) -> Self {
        Self { models, prepared: models.iter().map(|_| OnceLock::new()).collect() }
    }

    /// The models of the library.
    pub(crate) fn models(&self) -> &'a [Model] {
        self.models
    }

    /// Prepares these models now, in parallel.
    pub(crate) fn prepare(&self, names: &BTreeSet<&str>, fan: &dyn Fan) {
        for (i, own) in self.prepared.iter().enumerate() {
            if own.get().is_none() && names.contains(self.models[i].name.as_str()) {
                let prepared = Prepared::new(i, &self.models[i], fan);
                prepared.make_triangles(fan);
                // If another thread was faster, its value is kept.
                own.set(prepared).ok();
            }
        }
    }

    /// The prepared model. Preparing it here is serial, so that a thread that waits for it never
    /// delays its own work.
    pub(crate) fn prepared(&self, index: usize) -> &Prepared<'a> {
        self.prepared[index].get_or_init(|| Prepared::new(index, &self.models[index], &OneByOne))
    }
}

/// Scans, store, ground, library and settings that the search of a region reads.
pub(crate) struct Search<'a, 'm> {
    library: &'a PreparedLibrary<'m>,
    scans: &'a [Scan],
    store: &'a Store,
    ground: &'a Ground,
    settings: &'a Settings,
    /// Regions of the plant, in which a robot at the border of one region is looked up whole.
    regions: &'a [Region],
    /// Cache of the fits of single candidates, with which an interrupted run continues.
    kept: Option<&'a Cache>,
    /// Progress of models that are searched and candidates that are fitted.
    pieces: Pieces,
}

/// Depth below the floor beyond which a base belongs to a lower level, metres.
const MAX_SUNK: f64 = 2.0;
/// Number of candidates that are fitted at once, before candidates that their fits make needless
/// are dropped.
const BATCH: usize = 6;
/// Distance from a base within which points are used to find it, metres: foot and shoulder.
const FOOT: f64 = 1.5;
/// Distance from the seen points of a robot at which its base may lie, metres.
const FOOT_BESIDE: f64 = 0.3;
/// Share of the score of a trusted robot's base below which another base at its place is not
/// fitted.
const FAR_WORSE: f64 = 0.7;

impl<'a, 'm> Search<'a, 'm> {
    pub(crate) fn new(
        library: &'a PreparedLibrary<'m>,
        scans: &'a [Scan],
        store: &'a Store,
        ground: &'a Ground,
        settings: &'a Settings,
    ) -> Self {
        let (regions, kept, pieces) = (&[][..], None, Pieces::default());
        Self { library, scans, store, ground, settings, regions, kept, pieces }
    }

    /// Sets the regions of the plant.
    #[must_use]
    pub(crate) fn over(self, regions: &'a [Region]) -> Self {
        Self { regions, ..self }
    }

    /// Sets the cache for fits of single candidates.
    #[must_use]
    pub(crate) fn keeping(self, kept: &'a Cache) -> Self {
        Self { kept: Some(kept), ..self }
    }

    /// Progress of models that are searched and candidates that are fitted.
    pub(crate) fn pieces(&self) -> &Pieces {
        &self.pieces
    }

    /// The cached piece of this name for a region; otherwise `find` computes it.
    fn piece<T: Serialize + DeserializeOwned>(
        &self,
        region: &Region,
        name: &str,
        find: impl FnOnce() -> T,
    ) -> Result<T> {
        self.get_or_compute(&format!("{region:?} {name}"), || Ok(find()))
    }

    /// The cached piece of this name; otherwise `find` computes it.
    pub(crate) fn get_or_compute<T: Serialize + DeserializeOwned>(
        &self,
        name: &str,
        find: impl FnOnce() -> Result<T>,
    ) -> Result<T> {
        match self.kept {
            Some(kept) => kept.get_or_compute(name, find),
            None => find(),
        }
    }

    /// The library with its prepared models.
    pub(crate) fn library(&self) -> &'a PreparedLibrary<'m> {
        self.library
    }

    /// Bounds of all points, world frame, metres.
    pub(crate) fn bounds(&self) -> Aabb {
        self.store.entries().iter().fold(Aabb::EMPTY, |all, entry| all.union(&entry.bounds))
    }

    /// Fits of all models in one region, with every verdict.
    pub(crate) fn region(&self, region: &Region) -> Result<Vec<Fit>> {
        self.region_about(region, None)
    }

    /// Like [`Search::region`]; where `about` is given (world frame, metres), only for bases within
    /// that radius of the place.
    pub(crate) fn region_about(
        &self,
        region: &Region,
        about: Option<(Point, f64)>,
    ) -> Result<Vec<Fit>> {
        let wants = |at: &Point| about.is_none_or(|(place, radius)| (at - place).norm() < radius);
        let is_wanted = |c: &Candidate| c.bases.first().is_some_and(|b| wants(&base(&b.0)));
        let views = self.views(region)?;
        let planes = self.planes(region);
        let scene = MeasuredScene::new(region, &views, &planes, &self.settings.fit, &AllThreads);
        if self.settings.method == Method::Paper {
            return Ok(self.by_baseline(&scene, &planes));
        }
        let feet = about.map_or(*region, |(place, radius)| feet(region, &place, radius));
        let mut sight =
            RegionEvidence::new(&feet, &views, &scene.evidence, &scene.scouts, &AllThreads);
        let find = || self.candidates(&sight, &planes, SearchExtent::plain(&planes));
        let mut candidates = self.piece(region, "candidates", find)?;
        candidates.retain(is_wanted);
        let candidates = extent::best_of_place(candidates, &planes);
        let mut tried = TriedBases::default();
        let mut fits = self.fits(&scene, &candidates, &mut tried)?;
        // Robots on the floor explain most regions; ceilings and walls are searched where there is
        // none.
        if fits.iter().all(|f| f.verdict != Verdict::Trusted) {
            fits.extend(self.on_mounts(&scene, &sight, &is_wanted, &mut tried)?);
        }
        // A search at one place has examined all points there already.
        if about.is_none() {
            fits.extend(self.left_over(&scene, &mut sight, &planes, &fits, &mut tried)?);
            fits.extend(self.hung_beside(&scene, &mut sight, &fits, &mut tried)?);
        }
        fits.extend(self.on_stands(&scene, &mut sight, &fits, &is_wanted, &mut tried)?);
        let scans = ScansOfRegion { region, views: &views, floors: &planes };
        fits.extend(self.moved(&fits, sight, &scans));
        fits.retain(|fit| wants(&base(&fit.world_from_base)));
        Ok(fits)
    }

    /// Fits all robots of the library by the baseline method.
    fn by_baseline(&self, scene: &MeasuredScene<'_>, planes: &[InstallationPlane]) -> Vec<Fit> {
        let (judging, settings) = (&self.settings.fit, &self.settings.paper);
        let fit =
            |m: usize| baseline::fit(self.library.prepared(m), scene, planes, judging, settings);
        let models = (0..self.library.models.len()).into_par_iter();
        let robots = models.filter(|&m| !self.library.models[m].is_tool());
        robots.map(fit).collect::<Vec<_>>().into_iter().flatten().collect()
    }

    /// Candidates of all models on some planes, best base first. After the coarse level and after
    /// the middle one, models are dropped at places where others score far higher.
    fn candidates(
        &self,
        sight: &RegionEvidence<'_>,
        planes: &[InstallationPlane],
        extent: SearchExtent,
    ) -> Vec<Candidate> {
        let n = self.library.models.len();
        let models = (0..n).into_par_iter();
        let searches: Vec<BaseSearch<'_>> =
            models.filter_map(|index| self.search_of(index, sight, planes, extent)).collect();
        self.pieces.expect(searches.len());
        let compete = |bases: Vec<RatedBases>| match extent.competes {
            true => base_search::drop_outscored(bases, MIN_SHARE_OF_LEVEL),
            false => bases,
        };
        let coarse = searches.par_iter().map(|s| s.coarse_bases(planes, &AllThreads));
        let coarse = compete(coarse.collect());
        let middle = searches.par_iter().zip(&coarse);
        let middle = middle.map(|(s, bases)| s.middle_bases(planes, bases, &AllThreads));
        let middle = compete(middle.collect());
        let refined = |(search, bases): (&BaseSearch<'_>, &RatedBases)| {
            let found = search.refine(planes, bases, &AllThreads);
            self.pieces.done();
            found
        };
        let found: Vec<Vec<Candidate>> = searches.par_iter().zip(&middle).map(refined).collect();
        let mut out: Vec<Candidate> =
            found.into_iter().flatten().filter(|c| !c.bases.is_empty()).collect();
        out.sort_by(|a, b| b.bases[0].1.total_cmp(&a.bases[0].1).then(a.model.cmp(&b.model)));
        out
    }

    /// The search for the bases of one model; `None` for tools.
    fn search_of<'s>(
        &'s self,
        index: usize,
        sight: &'s RegionEvidence<'s>,
        planes: &[InstallationPlane],
        extent: SearchExtent,
    ) -> Option<BaseSearch<'s>> {
        let SearchExtent { min_score, breadth, places, is_thorough, .. } = extent;
        let guessed = planes.iter().all(InstallationPlane::is_guess);
        let model = &self.library.models[index];
        let search = BaseSearch::new(index, model, sight, &self.settings.base_search)?;
        let search = if guessed { search.on_guessed_planes() } else { search };
        let search = search.with_min_score(min_score).with_breadth(breadth);
        let search = match places {
            Some(places) => search.with_places(places + SPARE_PLACES),
            None => search,
        };
        Some(if is_thorough { search.thoroughly() } else { search })
    }

    /// Fits of candidates, which are sorted by the score of their base. Where a robot is trusted,
    /// bases that score far less at its place are not fitted, nor are bases that were fitted
    /// before.
    fn fits(
        &self,
        scene: &MeasuredScene<'_>,
        candidates: &[Candidate],
        tried: &mut TriedBases,
    ) -> Result<Vec<Fit>> {
        let (mut out, mut taken): (Vec<Fit>, Vec<(Point, f64)>) = (Vec::new(), Vec::new());
        let new: Vec<&Candidate> = candidates.iter().filter(|c| !tried.knows(c)).collect();
        for batch in new.chunks(BATCH) {
            let is_open = |c: &&Candidate| {
                let here = base(&c.bases[0].0);
                !taken.iter().any(|(at, score)| {
                    (at - here).norm() < SAME_BASE && c.bases[0].1 < FAR_WORSE * score
                })
            };
            let open: Vec<&Candidate> = batch.iter().copied().filter(is_open).collect();
            open.iter().for_each(|c| tried.add(c));
            let fit = |c: &&Candidate| {
                let find = || {
                    let prepared = self.library.prepared(c.model);
                    fit::fit(c, prepared, scene, &self.settings.fit, &AllThreads)
                };
                let fit = self.piece(scene.region, &format!("{} {:?}", c.model, c.bases), find);
                self.pieces.done();
                fit
            };
            self.pieces.expect(open.len());
            let found: Result<Vec<Option<Fit>>> = open.par_iter().map(fit).collect();
            let found = found?;
            for (fit, candidate) in found.into_iter().zip(open) {
                let Some(fit) = fit else { continue };
                tried.add_end(&fit);
                if fit.verdict == Verdict::Trusted {
                    taken.push((base(&fit.world_from_base), candidate.bases[0].1));
                }
                out.push(fit);
            }
        }
        Ok(out)
    }

    /// Fits a robot of an earlier fit again; `None` where it is not in the region.
    pub(crate) fn again(
        &self,
        region: &Region,
        before: &Fit,
        model: &Model,
    ) -> Result<Option<Fit>> {
        let known = |name: &str| self.library.models.iter().position(|m| m.name == name);
        let tool = before.tool.as_ref().map(|tool| tool.model.as_str());
        let parts = [before.model_name.as_str()].into_iter().chain(tool).filter_map(known);
        let parts: Vec<&Prepared<'_>> = parts.map(|part| self.library.prepared(part)).collect();
        let prepared = Prepared::joined(&parts, before.model, model);
        self.in_scene(region, |scene, settings| {
            fit::again(before, &prepared, scene, settings, &AllThreads)
        })
    }

    /// Fits a model on a known base, in the scene of the region around it.
    pub(crate) fn on_base(
        &self,
        scene: &MeasuredScene<'_>,
        model: usize,
        base: &Pose,
    ) -> Option<Fit> {
        let bounds = scene.region.world_bounds();
        let normal = base.rotation * Vector::z();
        let offset = normal.dot(&base.translation.vector);
        let plane = Plane { normal, offset };
        let plane = InstallationPlane { plane, bounds, area: 1.0, is_floor: false };
        let candidate = Candidate { model, bounds, plane, bases: vec![(*base, 1.0)] };
        let prepared = self.library.prepared(model);
        fit::fit(&candidate, prepared, scene, &self.settings.fit, &AllThreads)
    }

    /// Calls `work` with the scene of a region.
    pub(crate) fn in_scene<T>(
        &self,
        region: &Region,
        work: impl FnOnce(&MeasuredScene<'_>, &fit::Settings) -> T,
    ) -> Result<T> {
        let views = self.views(region)?;
        let planes = self.planes(region);
        let scene = MeasuredScene::new(region, &views, &planes, &self.settings.fit, &AllThreads);
        Ok(work(&scene, &self.settings.fit))
    }

    /// Calls `work` with the scene that contains a fit; `None` where no region contains it.
    pub(crate) fn with_scene<T>(
        &self,
        fit: &Fit,
        work: impl FnOnce(&MeasuredScene<'_>, &fit::Settings) -> T,
    ) -> Result<Option<T>> {
        let at = base(&fit.world_from_base);
        // Large regions overlap: an arm at the border of one region is whole in the other.
        let within = |r: &Region| {
            let Aabb { min, max } = r.world_bounds();
            (0..2).map(|i| (at[i] - min[i]).min(max[i] - at[i])).fold(f64::INFINITY, f64::min)
        };
        let holds = |r: &&Region| r.world_bounds().grown(FOOT_BESIDE).contains(at.into());
        let homes = self.regions.iter().filter(holds);
        let home = homes.max_by(|a, b| within(a).total_cmp(&within(b)));
        home.map(|region| self.in_scene(region, work)).transpose()
    }

    /// End points of the refinement of a model from each of the starts.
    pub(crate) fn converge(
        &self,
        region: &Region,
        model: usize,
        starts: &[(Pose, Vec<f64>)],
    ) -> Result<Vec<(Pose, Vec<f64>)>> {
        let prepared = self.library.prepared(model);
        self.in_scene(region, |scene, settings| {
            let end = |s: &(Pose, Vec<f64>)| fit::converge(prepared, scene, settings, &s.0, &s.1);
            starts.par_iter().map(end).collect()
        })
    }

    /// Planes that may carry a robot of this region. Where the plant has no floor (a camera's view,
    /// a cut-out), heights all over the region are guessed.
    fn planes(&self, region: &Region) -> Vec<InstallationPlane> {
        let world = region.world_bounds();
        let floor = &self.ground.surfaces.floor;
        // Without beams there is no free space that could contradict a wrong height, and every
        // height would have to be fitted.
        let has_beams = self.scans.iter().any(Scan::has_beams);
        if floor.levels.is_empty() && has_beams {
            return base_search::guessed_planes(&world);
        }
        floor.planes.iter().filter(|p| p.bounds.grown(0.3).touches(&world)).cloned().collect()
    }
}

/// The part of a region that contains bases within `radius` of a place.
fn feet(region: &Region, place: &Point, radius: f64) -> Region {
    let (at, reach) = (place - region.origin, radius + FOOT);
    let mut bounds = region.bounds;
    for i in 0..2 {
        bounds.min[i] = bounds.min[i].max(at[i] - reach);
        bounds.max[i] = bounds.max[i].min(at[i] + reach);
    }
    Region { bounds, ..*region }
}
