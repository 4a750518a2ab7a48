//! The order of all steps of a run, from opened inputs to the published result. No other module
//! decides order: `shards/` hands the same steps to many processes.

use crate::cache::input_tiles::InputTiles;
use crate::cache::kept_looks::KeptLooks;
use crate::cache::{self, Cache, Digests, Key, OutputDir, OutputFile, VerifiedFiles, WholeResult};
use crate::detect::calibrate::calibrate;
use crate::detect::ground::Ground;
use crate::detect::region_failures::RegionFailures;
use crate::detect::review::Review;
use crate::detect::robots::{FittedRobots, KeptRobots, RobotList};
use crate::detect::search::{PreparedLibrary, Search};
use crate::detect::{library, tools};
use crate::engine::{Engine, Task};
use crate::estimate::sizes::all_points;
use crate::estimate::{Estimate, course};
use crate::job::{Job, Outcome, Settings, units};
use crate::label::joined_files::{self, FileGroup};
use crate::label::known_space::KnownSpaces;
use crate::label::labelling::{LabelFolders, Labelling, ScansToLabel, Scope, WrittenLabels};
use crate::label::near_robots::NearRobots;
use crate::positions::{self, CloudOrder};
use crate::result::plant_state::{PlantState, Records};
use crate::result::report::Report;
use crate::result::{copc, page};
use crate::store::{Store, spatial_tiles};
use contract::{Cluster, Fit, Input, Region, Result, Space};
use export::{COPC, ReviewEntry};
use ingest::{Before, Sources};
use robot::Library;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Name of the piece of the store with the robots that were chosen.
pub(crate) const ROBOTS: &str = "robots";

/// Runs the main job: finds the robots in the scans and labels all points.
///
/// # Errors
/// Inputs, library or settings that cannot be used, too little disk space, or the error of a stage.
pub fn run(job: &Job, engine: &Engine) -> Result<Outcome> {
    let output = job.output()?;
    let digests = Digests::of(job, &output, engine)?;
    if let Some(manifest) = digests.unchanged(job, &output)? {
        return Ok(manifest.outcome());
    }
    Run::new(job, &output, &digests, engine).execute()
}

/// A run that is not answered by an unchanged result.
pub(crate) struct Run<'a> {
    pub(crate) job: &'a Job,
    pub(crate) settings: &'a Settings,
    pub(crate) output: &'a OutputDir,
    pub(crate) digests: &'a Digests,
    pub(crate) engine: &'a Engine,
    /// Where processes make the shards of the job: messages about regions that were left out. What
    /// follows the search is then taken from the store, too.
    pub(crate) shards: Option<&'a BTreeMap<String, String>>,
}

/// Library, review and opened scans, before any point is read.
pub(crate) struct Opened {
    pub(crate) library: Library,
    pub(crate) review: Review,
    pub(crate) sources: Sources,
}

/// The scanned plant, before anything is searched in it.
#[derive(Clone, Copy)]
struct ScannedPlant<'a> {
    sources: &'a Sources,
    /// Keys of the tiles of each input.
    tiles: &'a [Key],
    store: &'a Store,
    ground: &'a Ground,
    clusters: &'a [Cluster],
}

/// The robots that were found, after the review, and the effect of each of its entries.
type ReviewedRobots = (RobotList, Vec<ReviewEntry>);

impl<'a> Run<'a> {
    pub(crate) fn new(
        job: &'a Job,
        output: &'a OutputDir,
        digests: &'a Digests,
        engine: &'a Engine,
    ) -> Self {
        Self { job, settings: &job.means.settings, output, digests, engine, shards: None }
    }

    pub(crate) fn execute(&self) -> Result<Outcome> {
        let &Run { job, settings, output, digests, engine, .. } = self;
        let models_kept = Cache::new(output.models(), digests.models_key(settings));
        let opened = self.open(&models_kept)?;
        let (sources, scans) = (&opened.sources, &opened.sources.scans);

        // First pass: reads every point once into lattice tiles, unless the tiles exist already.
        let input_tiles = InputTiles::new(sources, &job.means, output.tiles(), engine);
        let (tiles, store) = input_tiles.of_all(&sources.inputs, digests)?;
        let store = spatial_tiles::checked(store, scans, &settings.export, engine)?;

        // Local planes and occupied space; nothing after this is as large as the cloud.
        let ground_kept = Cache::new(output.fits(), digests.ground_key(&tiles, settings));
        let ground = || Ground::of_tiles(scans, &store, settings, engine);
        let ground = ground_kept.get_or_compute("ground", ground)?;
        let (clusters, regions) = self.regions(&ground, opened.library.models.len());

        // Base poses and postures for each region and model; then compatible fits are chosen.
        let of_plant = || Cache::new(output.fits(), digests.fits_key(&tiles, settings));
        let (fits_kept, pieces_kept) = (of_plant(), of_plant());
        let library = PreparedLibrary::new(&opened.library.models);
        let search = Search::new(&library, scans, &store, &ground, settings);
        let search = search.over(&regions).keeping(&pieces_kept);
        let failures = self.region_failures();
        let task = Task::new("fit").large().showing(search.pieces());
        let found = engine.fan_out(task, regions.clone(), |region| {
            let find = || search.region(&region);
            failures.spare(&region, || fits_kept.get_or_compute(&format!("{region:?}"), find))
        })?;
        let chosen = self.shards.map(|_| self.chosen(&tiles));
        let find = || self.robots(found.concat(), &search, &opened, &ground);
        let (robots, review) = self.kept_robots(chosen.as_ref(), &opened.library, find)?;
        let spaces = KnownSpaces { robots: robots.view(), search: &search, settings }
            .all(chosen.as_ref(), engine)?;
        drop(library);

        // Tiles near robots are read again; then all points.
        let (tiles, clusters) = (&tiles[..], &clusters[..]);
        let plant = ScannedPlant { sources, tiles, store: &store, ground: &ground, clusters };
        let written = self.label(plant, robots.view(), spaces, chosen.as_ref())?;
        let report = Report {
            digests,
            sources,
            store: &store,
            library: &opened.library,
            robots: robots.view(),
            n_searched: [clusters.len(), regions.len()],
            written: &written,
            review,
            left_out: failures.messages(job),
        };
        let mut outcome = report.finish(output)?;
        let parts = chosen.as_ref().map(|chosen| self.page_parts(chosen, sources));
        outcome.notes =
            self.conclude(plant, robots.fits, &written, &outcome, &parts.unwrap_or_default())?;
        output.prune(tiles, &[&ground_kept, &fits_kept], &models_kept);
        let n_kept = [models_kept.n_kept(), input_tiles.n_kept(), fits_kept.n_kept()];
        outcome.reused = cache::reused_in_words(["models", "tiles", "fits"], n_kept);
        Ok(outcome)
    }

    /// What stands about in the plant, and the regions of it that are searched.
    fn regions(&self, ground: &Ground, n_models: usize) -> (Vec<Cluster>, Vec<Region>) {
        let (space, floor) = (&ground.surfaces.occupancy, &ground.surfaces.floor);
        let clusters = cluster::split(space, floor, &self.settings.cluster);
        let regions = base_search::regions(&clusters, &self.settings.region);
        course::regions(self.job, &clusters, &regions, n_models, self.engine);
        (clusters, regions)
    }

    /// Reads library and review, opens the scans, and checks disk and memory.
    pub(crate) fn open(&self, models_kept: &Cache) -> Result<Opened> {
        let &Run { job, settings, output, digests, engine, .. } = self;
        course::begin(job, engine);
        let library = library::load(&job.robots, &settings.robot, Some(models_kept), engine)?;
        let review = Review::of(job, &library.models)?;
        let looks = KeptLooks { digests, settings, folder: output.looks() };
        let looks = self.shards.is_some().then_some(&looks);
        let sources =
            positions::open(job, Before::default(), looks, CloudOrder::Used, engine)?.sources;
        units::check_sizes(&library, &sources)?;
        sources.check_steps()?;
        let has_tiles = |i: &Input| {
            let key = digests.tiles_key(i, &sources.scans, settings);
            key.is_some_and(|key| output.has_tiles(&key))
        };
        let there = self.shards.map_or(0, |_| joined_files::bytes_there(&output.labels()));
        let estimate = Estimate::of(job, &sources, library.models.len(), has_tiles);
        estimate.with_written(there).checked(output.out())?;
        course::opened(job, &sources, library.models.len(), engine);
        Ok(Opened { library, review, sources })
    }

    /// Failures of regions, with those that were left out before.
    pub(crate) fn region_failures(&self) -> RegionFailures {
        let failures = RegionFailures::of(self.job);
        match self.shards {
            Some(known) => failures.with(known),
            None => failures,
        }
    }

    /// Pieces of what follows the search, for runs whose shards many processes make.
    pub(crate) fn chosen(&self, tiles: &[Key]) -> Cache {
        let key = self.digests.robots_key(tiles, self.settings, &self.shards);
        Cache::new(self.output.fits(), key)
    }

    /// The reviewed robots of the store, where they are kept there; otherwise `find` finds them.
    pub(crate) fn kept_robots(
        &self,
        chosen: Option<&Cache>,
        library: &Library,
        find: impl FnOnce() -> Result<ReviewedRobots>,
    ) -> Result<ReviewedRobots> {
        let Some(chosen) = chosen else { return find() };
        let n = library.models.len();
        let keep = || find().map(|(robots, review)| KeptRobots::of(robots, n, review));
        let kept = chosen.get_or_compute(ROBOTS, keep)?;
        Ok(kept.with(&library.models))
    }

    /// Folders of the labels of all inputs, in their order.
    pub(crate) fn label_folders(&self, chosen: &Cache, inputs: &[Input]) -> Vec<PathBuf> {
        let key = |input: &Input| Digests::labels_key(chosen.key(), input);
        inputs.iter().map(|input| self.output.labels().join(key(input).name())).collect()
    }

    /// The groups of files that are joined from the labels of all inputs, with their folders.
    pub(crate) fn file_groups(
        &self,
        chosen: &Cache,
        sources: &Sources,
    ) -> Vec<(FileGroup, PathBuf)> {
        let key = |group: &FileGroup| Digests::files_key(chosen.key(), group);
        let folder = |group: &FileGroup| self.output.labels().join(key(group).name());
        let groups = FileGroup::all(all_points(sources)).into_iter();
        groups.map(|group| (group, folder(&group))).collect()
    }

    fn file_folders(&self, chosen: &Cache, sources: &Sources) -> Vec<PathBuf> {
        self.file_groups(chosen, sources).into_iter().map(|(_, folder)| folder).collect()
    }

    /// Files with the points of the page that were kept when its tiles were joined.
    fn page_parts(&self, chosen: &Cache, sources: &Sources) -> Vec<PathBuf> {
        joined_files::kept_page_parts(&self.file_folders(chosen, sources))
    }

    /// Chooses compatible fits, adds tools, calibrates joints on request, estimates the
    /// registration error of each scan, and applies the review.
    pub(crate) fn robots(
        &self,
        found: Vec<Fit>,
        search: &Search<'_, '_>,
        opened: &Opened,
        ground: &Ground,
    ) -> Result<ReviewedRobots> {
        let (review, settings) = (&opened.review, self.settings);
        let mut models = opened.library.models.clone();
        let without = review.without(&found, &models);
        let (fits, wrong) = review.correct(found, search, &models, self.engine)?;
        let fits = fit::choose(review.apply(fits), &models, |fit| review.accepts(fit));
        let mut fits = tools::attach_tools(fits, &mut models, search, self.engine)?;
        if settings.fit.calibrate {
            fits = calibrate(fits, &mut models, search, self.engine)?;
        }
        review.accept(&mut fits);
        if settings.fit.together {
            let (scans, still) = (&opened.sources.scans, &ground.surfaces.overlaps);
            fit::together(&mut fits, &models, scans, still, &settings.fit);
        }
        let review = review.effects(&without, &fits, &wrong);
        Ok((RobotList { fits, models }, review))
    }

    /// Labels points near robots as links or attached bodies; then the second pass labels and
    /// writes every point in the order of its file, and the known space around the robots.
    fn label(
        &self,
        plant: ScannedPlant<'_>,
        robots: FittedRobots<'_>,
        spaces: Vec<Option<Space>>,
        chosen: Option<&Cache>,
    ) -> Result<WrittenLabels> {
        let (settings, next, engine) = (self.settings, self.output.next(), self.engine);
        let ScannedPlant { sources, store, ground, clusters, .. } = plant;
        let floor = &ground.surfaces.floor;
        let scans = ScansToLabel { sources, store, floor, clusters };
        let labelling = Labelling::new(robots, &scans, settings);
        let written = if let Some(chosen) = chosen {
            let labelling = labelling.keeping(chosen);
            let near = NearRobots::kept(chosen, &sources.masks, None)?;
            let pieces = self.label_folders(chosen, &sources.inputs);
            let groups = self.file_folders(chosen, sources);
            labelling.join(&near, spaces, [&pieces, &groups], next, engine)?.finish(engine)?
        } else {
            let near = labelling.near_robots(store, engine)?;
            let to = LabelFolders { out: next, clouds: next };
            let written = labelling.write(&near, spaces, &Scope::default(), to, engine)?;
            written.finish(engine)?
        };
        if settings.export.copc {
            copc::write(&export::tiles(next)?, &next.join(COPC), &self.output.scratch(), engine)?;
        }
        Ok(written)
    }

    /// Publishes the complete result after a check that the inputs are unchanged. Returns messages
    /// about files that were removed beside it.
    fn conclude(
        &self,
        plant: ScannedPlant<'_>,
        fits: Vec<Fit>,
        written: &WrittenLabels,
        outcome: &Outcome,
        page_parts: &[PathBuf],
    ) -> Result<Vec<String>> {
        let &Run { job, settings, output, digests, engine, .. } = self;
        let (sources, next) = (plant.sources, output.next());
        sources.inputs.iter().try_for_each(|input| digests.check(input))?;
        PlantState {
            inputs: sources.inputs.clone(),
            masks: sources.masks.clone(),
            scans: sources.scans.clone(),
            frames: Vec::new(),
            tiles: plant.tiles.to_vec(),
            contents: plant.store.contents(),
            floor: plant.ground.surfaces.floor.clone(),
            fits,
            robots: job.robots.clone(),
            records: Records::of(&written.las, &settings.export),
        }
        .write(next)?;
        let files = written.digests.iter().map(|sum| OutputFile::of(next, sum)).collect();
        let page =
            |files: &VerifiedFiles| page::of_run(next, files, page_parts, (&job.means, engine));
        WholeResult { job, output, digests, outcome, files }.publish(page, engine)
    }
}
