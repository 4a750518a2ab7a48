//! A region in, the fits of all models in it out: reads the tiles that the region's views need, and sends every model
//! of the library through base search and fit.

use crate::engine::AllThreads;
use crate::job::Settings;
use crate::store::Store;
use crate::surfaces::Ground;
use contract::{Fit, InstallationPlane, Region, Result, Scan, Verdict, View};
use fit::{Method, Prepared, Scene};
use geometry::Pose;
use identify::BaseSearch;
use lattice::ViewBuilder;
use rayon::prelude::*;
use robot::Model;
use std::sync::OnceLock;

/// A library with what fits of its models need, made when the first of them asks for it.
pub(crate) struct Shelf<'a> {
    models: &'a [Model],
    prepared: Vec<OnceLock<Prepared<'a>>>,
}

impl<'a> Shelf<'a> {
    pub(crate) fn new(models: &'a [Model]) -> Self {
        Self { models, prepared: models.iter().map(|_| OnceLock::new()).collect() }
    }

    /// Makes all of it now.
    pub(crate) fn prepare(&self) {
        (0..self.models.len()).into_par_iter().for_each(|i| {
            self.prepared(i);
        });
    }

    /// Serial inside: a thread that waits for it never holds up its own work.
    fn prepared(&self, index: usize) -> &Prepared<'a> {
        self.prepared[index].get_or_init(|| Prepared::new(index, &self.models[index]))
    }
}

/// Everything that the search of a region reads.
pub(crate) struct Search<'a> {
    shelf: &'a Shelf<'a>,
    scans: &'a [Scan],
    store: &'a Store,
    ground: &'a Ground,
    settings: &'a Settings,
}

/// Score of a base on a wall or a ceiling from which on it is looked at: a plant has many walls, and few carry robots.
const MIN_MOUNT_SCORE: f64 = 0.15;
/// Beams farther apart than this at a region, metres, say nothing of use about a robot's posture.
const MAX_SPACING: f64 = 0.05;

impl<'a> Search<'a> {
    pub(crate) fn new(
        shelf: &'a Shelf<'a>,
        scans: &'a [Scan],
        store: &'a Store,
        ground: &'a Ground,
        settings: &'a Settings,
    ) -> Self {
        Self { shelf, scans, store, ground, settings }
    }

    /// Fits of all models in one region, whatever their verdict.
    pub(crate) fn region(&self, region: &Region) -> Result<Vec<Fit>> {
        let views: Vec<View> = self
            .scans
            .par_iter()
            .filter_map(|scan| self.view(scan, region).transpose())
            .collect::<Result<_>>()?;
        let planes = self.planes(region);
        let scene = Scene::new(region, &views, &planes, &self.settings.fit);
        let on = |planes: &[InstallationPlane], least: f64| -> Vec<Fit> {
            let models = (0..self.shelf.models.len()).into_par_iter();
            let fits: Vec<Vec<Fit>> =
                models.map(|model| self.model(model, &scene, (planes, least))).collect();
            fits.into_iter().flatten().collect()
        };
        let mut fits = on(&planes, 0.0);
        // What stands on the floor explains most regions; ceilings and walls are asked where nothing does.
        let is_explained = fits.iter().any(|f| f.verdict == Verdict::Trusted);
        if !is_explained && self.settings.fit.method != Method::Paper {
            fits.extend(on(&self.mounts(region), MIN_MOUNT_SCORE));
        }
        Ok(fits)
    }

    /// Ceilings, walls and tilted plates about the region.
    fn mounts(&self, region: &Region) -> Vec<InstallationPlane> {
        let world = region.world_bounds().grown(0.3);
        let sides = self.ground.surfaces.sides.iter();
        floor::mounts(&sides.filter(|p| p.bounds.touches(&world)).collect::<Vec<_>>())
    }

    /// Does something with the scene that a fit stands in; `None` where it stands in none of the regions.
    pub(crate) fn with_scene<T>(
        &self,
        fit: &Fit,
        regions: &[Region],
        work: impl FnOnce(&Scene<'_>, &fit::Settings) -> T,
    ) -> Result<Option<T>> {
        let at = fit.world_from_base.translation.vector;
        let home = regions.iter().find(|r| r.world_bounds().grown(0.3).contains(at.into()));
        let Some(region) = home else { return Ok(None) };
        let views: Vec<View> = self
            .scans
            .par_iter()
            .filter_map(|scan| self.view(scan, region).transpose())
            .collect::<Result<_>>()?;
        let planes = self.planes(region);
        let scene = Scene::new(region, &views, &planes, &self.settings.fit);
        Ok(Some(work(&scene, &self.settings.fit)))
    }

    /// Where the refinement of a model alone ends from each of the starts.
    pub(crate) fn converge(
        &self,
        region: &Region,
        model: usize,
        starts: &[(Pose, Vec<f64>)],
    ) -> Result<Vec<(Pose, Vec<f64>)>> {
        let views: Vec<View> = self
            .scans
            .iter()
            .filter_map(|scan| self.view(scan, region).transpose())
            .collect::<Result<_>>()?;
        let planes = self.planes(region);
        let settings = &self.settings.fit;
        let scene = Scene::new(region, &views, &planes, settings);
        let prepared = self.shelf.prepared(model);
        let end = |s: &(Pose, Vec<f64>)| fit::converge(prepared, &scene, settings, (&s.0, &s.1));
        Ok(starts.par_iter().map(end).collect())
    }

    /// One scan's view of the region; `None` where it sees nothing of it.
    fn view(&self, scan: &Scan, region: &Region) -> Result<Option<View>> {
        let extent = self.ground.extents[scan.id.0 as usize];
        if extent.is_none() {
            return Ok(None);
        }
        if let Some(lattice) = &scan.lattice {
            let near = distance(scan, region);
            if near * lattice.row_step.max(lattice.col_step) > MAX_SPACING {
                return Ok(None);
            }
        }
        let mut builder = ViewBuilder::new(scan, region, extent, &self.settings.view);
        for (i, entry) in self.store.entries().iter().enumerate() {
            if builder.wants(entry.at) {
                builder.add(&self.store.tile(i)?);
            }
        }
        let view = builder.finish();
        Ok((!view.points.is_empty() || !view.images.is_empty()).then_some(view))
    }

    /// Planes that a robot of this region may stand on; heights guessed all over the region where the plant has no
    /// floor to go by (a camera's view, a cut-out).
    fn planes(&self, region: &Region) -> Vec<InstallationPlane> {
        let world = region.world_bounds();
        let floor = &self.ground.surfaces.floor;
        // Without beams nothing contradicts a wrong height, and every one of them would have to be tried out.
        let has_beams = self.scans.iter().any(Scan::has_beams);
        if floor.levels.is_empty() && has_beams {
            return identify::guessed_planes(&world);
        }
        floor.planes.iter().filter(|p| p.bounds.grown(0.3).touches(&world)).cloned().collect()
    }

    /// Fits of one model on some planes, from bases with at least such a score.
    fn model(
        &self,
        index: usize,
        scene: &Scene<'_>,
        (planes, least): (&[InstallationPlane], f64),
    ) -> Vec<Fit> {
        let model = &self.shelf.models[index];
        let settings = self.settings;
        if settings.fit.method == Method::Paper {
            let prepared = self.shelf.prepared(index);
            let means = (&settings.fit, &settings.paper);
            return if model.is_tool() {
                Vec::new()
            } else {
                fit::paper::fit(prepared, scene, planes, means)
            };
        }
        let Some(search) = BaseSearch::new(
            (index, model),
            scene.region,
            scene.views,
            &scene.evidence,
            &settings.identify,
        ) else {
            return Vec::new();
        };
        let mut candidates = search.run(planes, &AllThreads);
        candidates.retain(|c| c.bases.first().is_some_and(|b| b.1 >= least));
        if candidates.is_empty() {
            return Vec::new();
        }
        let prepared = self.shelf.prepared(index);
        candidates
            .iter()
            .filter_map(|c| fit::fit(c, prepared, scene, &settings.fit, &AllThreads))
            .collect()
    }
}

/// Distance from a scan's scanner to the nearest point of a region, metres.
fn distance(scan: &Scan, region: &Region) -> f64 {
    let scanner = scan.world_from_scan.translation.vector - region.origin.coords;
    (0..3)
        .map(|i| {
            (region.bounds.min[i] - scanner[i])
                .max(scanner[i] - region.bounds.max[i])
                .max(0.0)
                .powi(2)
        })
        .sum::<f64>()
        .sqrt()
}
