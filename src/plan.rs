//! The whole way of the data on one page: a job in, everything found and written, its outcome out.
//! Nothing else decides order.

use crate::calibrate::calibrate;
use crate::copc;
use crate::engine::{AllThreads, Engine, Task};
use crate::estimate::Estimate;
use crate::filling::Filling;
use crate::job::{Job, Outcome, OutputDir, Settings};
use crate::labelling::{Done, Labelling, Scope};
use crate::lenient::Failures;
use crate::library;
use crate::report::Report;
use crate::rescan::{Records, State};
use crate::reuse::{self, Cache, Digests, Key, OutputFile};
use crate::review::Review;
use crate::search::{Search, Shelf};
use crate::spaces::Around;
use crate::store::Store;
use crate::surfaces::{Gather, Ground, Surfaces};
use crate::tile_bound;
use crate::tools;
use crate::units;
use contract::{Cluster, Fit, Floor, Input, Region, Result, Scan, Space};
use export::{COPC, ReviewEntry};
use ingest::{KnownScanners, Sources};
use robot::{Library, Model};
use std::path::PathBuf;

/// Does the main job.
///
/// # Errors
/// Inputs, library or settings that cannot be used, too little disk, or what a stage ends with.
pub fn run(job: &Job, engine: &Engine) -> Result<Outcome> {
    let output = job.output()?;
    let digests = Digests::of(job, &output, engine)?;
    if let Some(manifest) = digests.unchanged(job, &output)? {
        return Ok(manifest.outcome());
    }
    Run { job, settings: &job.means.settings, output: &output, digests: &digests, engine }.whole()
}

/// A run that has something to do.
struct Run<'a> {
    job: &'a Job,
    settings: &'a Settings,
    output: &'a OutputDir,
    digests: &'a Digests,
    engine: &'a Engine,
}

/// What is known before any point is read.
struct Given {
    library: Library,
    review: Review,
    sources: Sources,
}

/// The robots that were found.
struct Robots {
    fits: Vec<Fit>,
    /// The library's models, and after them those with a tool, other loops or calibrated joints.
    models: Vec<Model>,
    /// What each entry of the review did.
    review: Vec<ReviewEntry>,
}

impl Run<'_> {
    fn whole(&self) -> Result<Outcome> {
        let &Run { job, settings, output, digests, engine } = self;
        let models_kept = Cache::new(output.models(), digests.models(settings));
        let given = self.given(&models_kept)?;
        let (sources, scans) = (&given.sources, &given.sources.scans);

        // First pass: every point once, from files into lattice tiles that are not there yet.
        let filling = Filling::new(sources, &job.means, output.tiles(), engine);
        let filled = sources.inputs.iter().map(|i| filling.tiles_of(i, digests));
        let (tiles, stores): (Vec<Key>, Vec<Store>) = filled.collect::<Result<_>>()?;
        let store = tile_bound::checked(Store::join(stores), scans, &settings.export, engine)?;

        // On the tiles: local planes and occupied space, joined over tiles and scans; from here on
        // nothing is as large as the cloud.
        let ground_kept = Cache::new(output.fits(), digests.ground(&tiles, settings));
        let ground = ground_kept.get_or_compute("ground", || self.ground(scans, &store))?;
        let (space, floor) = (&ground.surfaces.occupancy, &ground.surfaces.floor);
        let clusters = cluster::split(space, floor, &settings.cluster);
        let regions = base_search::regions(&clusters, &settings.region);

        // One task a region and model: base poses, postures; then those that can stand together.
        let of_plant = || Cache::new(output.fits(), digests.fits(&tiles, settings));
        let (fits_kept, pieces_kept) = (of_plant(), of_plant());
        let shelf = Shelf::new(&given.library.models);
        let search = Search::new(&shelf, scans, &store, &ground, settings).keeping(&pieces_kept);
        let failures = Failures::of(job);
        let task = Task::new("fit").large().showing(search.pieces());
        let found = engine.fan_out(task, regions.clone(), |region| {
            let find = || search.region(&region);
            failures.spare(&region, || fits_kept.get_or_compute(&format!("{region:?}"), find))
        })?;
        let found = self.robots(found.concat(), (&search, &regions), (&given, &ground))?;
        let (fits, models) = (&found.fits, &found.models);
        let spaces = Around { robots: (fits, models), search: &search, settings }.all(engine)?;
        drop(shelf);

        // Tiles near robots once more; then all points.
        let written = self.label(&found, (sources, &store), (floor, &clusters), spaces)?;
        let mut outcome = Report {
            digests,
            sources,
            store: &store,
            library: &given.library,
            models,
            fits,
            n_searched: [clusters.len(), regions.len()],
            written: &written,
            review: found.review,
            left_out: failures.said(job),
        }
        .finish(output)?;
        self.conclude((found.fits, floor), (sources, &tiles, &store), &written, &mut outcome)?;
        output.prune(&tiles, &[&ground_kept, &fits_kept], &models_kept);
        outcome.reused = reuse::said(&[
            ("models", models_kept.n_kept()),
            ("tiles", filling.n_kept()),
            ("fits", fits_kept.n_kept()),
        ]);
        Ok(outcome)
    }

    /// Reads library and review, opens the scans, and sees that disk and memory are enough.
    fn given(&self, models_kept: &Cache) -> Result<Given> {
        let &Run { job, settings, output, digests, engine } = self;
        let library = library::load(&job.robots, &settings.robot, Some(models_kept), engine)?;
        let most = settings.ingest.max_text_bytes;
        let read = |path: &PathBuf| Review::read(path, &library.models, most);
        let review = job.review.as_ref().map(read).transpose()?.unwrap_or_default();
        let read = |path| KnownScanners::read(path, &job.means.settings.ingest);
        let scanners = job.scanners.as_deref().map(read).transpose()?;
        let open = || ingest::open(&job.inputs, scanners.as_ref(), &settings.ingest, &AllThreads);
        let sources = engine.pool()?.install(open)?;
        units::check_sizes(&library, &sources)?;
        sources.check_steps()?;
        let has_tiles = |i: &Input| {
            let key = digests.tiles(i, &sources.scans, settings);
            key.is_some_and(|key| output.has_tiles(&key))
        };
        Estimate::of(job, &sources, library.models.len(), has_tiles).checked(output.out())?;
        Ok(Given { library, review, sources })
    }

    /// One pass over the tiles: floor, walls and occupied space.
    fn ground(&self, scans: &[Scan], store: &Store) -> Result<Ground> {
        let surfaces = Surfaces::new(scans, &self.settings.lattice);
        let gather = Gather::new(scans, &self.settings.floor);
        let (source, reads) = (store.picks(|entry| surfaces.skip(entry)), store.reads());
        self.engine.pass(crate::report::tiles("surfaces", store), source, |f| {
            f.map(&reads).map(&surfaces).fold(&gather)
        })
    }

    /// Of all fits those that can stand together, with tools on their flanges, their joints
    /// calibrated where that is asked for, and agreed on how far the scans are off; all as far
    /// as the review lets them.
    fn robots(
        &self,
        found: Vec<Fit>,
        place: (&Search<'_, '_>, &[Region]),
        (given, ground): (&Given, &Ground),
    ) -> Result<Robots> {
        let (review, settings, mut models) =
            (&given.review, self.settings, given.library.models.clone());
        let without = review.without(&found, &models);
        let (fits, wrong) = review.correct(found, place, &models, self.engine)?;
        let fits = fit::choose(review.apply(fits), &models, |fit| review.accepts(fit));
        let mut fits = tools::dress(fits, &mut models, place, self.engine)?;
        if settings.fit.calibrate {
            fits = calibrate(fits, &mut models, place, self.engine)?;
        }
        review.accept(&mut fits);
        if settings.fit.together {
            let (scans, still) = (&given.sources.scans[..], &ground.surfaces.overlaps);
            fit::together(&mut fits, &models, (scans, still), &settings.fit);
        }
        let review = review.did(&without, &fits, &wrong);
        Ok(Robots { fits, models, review })
    }

    /// Which points near robots are links, and which hang on them; then the second pass: every
    /// point once more, in the order of its file, to label and to write, with what nobody saw
    /// around the robots.
    fn label(
        &self,
        robots: &Robots,
        (sources, store): (&Sources, &Store),
        (floor, clusters): (&Floor, &[Cluster]),
        spaces: Vec<Option<Space>>,
    ) -> Result<Done> {
        let (settings, next, engine) = (self.settings, self.output.next(), self.engine);
        let ground = (store, floor, clusters);
        let labelling = Labelling::new(&robots.fits, &robots.models, sources, ground, settings);
        let near = labelling.near_robots(store, engine)?;
        let written = labelling
            .write((&near, spaces), &Scope::default(), (next, next), engine)?
            .finish(engine)?;
        if settings.export.copc {
            copc::write(&export::tiles(next)?, &next.join(COPC), &self.output.scratch(), engine)?;
        }
        Ok(written)
    }

    /// All is whole, and of the inputs that the run began with: it takes the place of what was
    /// there.
    fn conclude(
        &self,
        (fits, floor): (Vec<Fit>, &Floor),
        (sources, tiles, store): (&Sources, &[Key], &Store),
        written: &Done,
        outcome: &mut Outcome,
    ) -> Result<()> {
        let next = self.output.next();
        sources.inputs.iter().try_for_each(|input| self.digests.check(input))?;
        State {
            inputs: sources.inputs.clone(),
            masks: sources.masks.clone(),
            scans: sources.scans.clone(),
            frames: Vec::new(),
            tiles: tiles.to_vec(),
            contents: store.contents(),
            floor: floor.clone(),
            fits,
            robots: self.job.robots.clone(),
            records: Records::of(&written.las, &self.settings.export),
        }
        .write(next)?;
        let files = written.digests.iter().map(|sum| OutputFile::of(next, sum)).collect();
        let (to, made) = ((self.output, self.digests), (&*outcome, files));
        outcome.told = reuse::publish(self.job, to, made, self.engine)?;
        Ok(())
    }
}
