//! The whole way of the data on one page: a job in, everything found and written, its outcome out. Nothing else
//! decides order.

use crate::calibrate::calibrate;
use crate::copc;
use crate::engine::{AllThreads, Engine, Task};
use crate::estimate::Estimate;
use crate::filling::Filling;
use crate::job::{Job, Outcome};
use crate::labelling::{Labelling, Scope};
use crate::lenient::Failures;
use crate::library;
use crate::report::Report;
use crate::rescan::{Records, State};
use crate::reuse::{self, Kept, Key, Manifest, OutputFile, Sums};
use crate::review::Review;
use crate::search::{Search, Shelf};
use crate::spaces;
use crate::store::Store;
use crate::surfaces::{Gather, Surfaces};
use crate::tools;
use contract::{Input, Result};
use ingest::Scanners;
use std::path::PathBuf;

/// Does the main job.
pub fn run(job: &Job, engine: &Engine) -> Result<Outcome> {
    let settings = &job.means.settings;
    let room = job.room()?;
    let sums = Sums::of(job, &room, engine)?;
    if let Some(manifest) = sums.unchanged(job, &room)? {
        return Ok(manifest.outcome());
    }
    let shelved = Kept::new(room.models(), sums.models(settings));
    let library = library::load(&job.robots, &settings.robot, Some(&shelved), engine)?;
    let read = |path: &PathBuf| Review::read(path, &library.models);
    let review = job.review.as_ref().map(read).transpose()?.unwrap_or_default();
    let scanners = job.scanners.as_deref().map(Scanners::read).transpose()?;
    let open = || ingest::open(&job.inputs, scanners.as_ref(), &settings.ingest, &AllThreads);
    let sources = engine.pool()?.install(open)?;
    let scans = &sources.scans;
    let has_tiles =
        |i: &Input| sums.tiles(i, scans, settings).is_some_and(|key| room.has_tiles(&key));
    Estimate::of(job, &sources, library.models.len(), has_tiles).checked(room.out())?;

    // First pass: every point once, from the files into the lattice tiles of the store; inputs whose tiles are there are
    // not read.
    let filling = Filling::new(&sources, &job.means, room.tiles(), engine);
    let filled = sources.inputs.iter().map(|i| filling.tiles_of(i, &sums));
    let (tiles, stores): (Vec<Key>, Vec<Store>) = filled.collect::<Result<_>>()?;
    let store = Store::join(stores);

    // On the tiles: local planes and occupied space, joined over tiles and scans; from here on nothing is as large as
    // the cloud.
    let (surfaces, gather) =
        (Surfaces::new(scans, &settings.lattice), Gather::new(scans, &settings.floor));
    let grounds = Kept::new(room.fits(), sums.ground(&tiles, settings));
    let ground = grounds.or_find("ground", || {
        let (source, reads) = (store.picks(|entry| surfaces.skip(entry)), store.reads());
        engine.pass(crate::report::tiles("surfaces", &store), source, |f| {
            f.map(&reads).map(&surfaces).fold(&gather)
        })
    })?;
    let clusters =
        cluster::split(&ground.surfaces.occupancy, &ground.surfaces.floor, &settings.cluster);
    let regions = identify::regions(&clusters, &settings.region);

    // One task a region, and in it one a model: base poses, then postures; then those that can stand together.
    let shelf = Shelf::new(&library.models);
    let of_plant = || Kept::new(room.fits(), sums.fits(&tiles, settings));
    let (kept, pieces) = (of_plant(), of_plant());
    let search = Search::new(&shelf, scans, &store, &ground, settings).keeping(&pieces);
    let failures = Failures::of(job);
    let fits = engine.fan_out(Task::new("fit").large(), regions.clone(), |region| {
        let find = || kept.or_find(&format!("{region:?}"), || search.region(&region));
        failures.spare(&region, find)
    })?;
    let fits = fits.into_iter().flatten().collect();
    let (fits, wrong) = review.correct(fits, (&search, &regions), &library.models, engine)?;
    let (fits, unmet) = review.apply(fits);
    let fits = fit::choose(fits, &library.models, |fit| review.accepts(fit));
    let mut models = library.models.clone();
    let mut fits = tools::dress(fits, &mut models, (&search, &regions), engine)?;
    if settings.fit.calibrate {
        fits = calibrate(fits, &mut models, (&search, &regions), engine)?;
    }
    review.accept(&mut fits);
    if settings.fit.together {
        let still = &ground.surfaces.overlaps;
        fit::together(&mut fits, &models, (scans, still), &settings.fit);
    }

    // Tiles near robots once more: which points are links, which hang on them.
    let floor = &ground.surfaces.floor;
    let labelling = Labelling::new(&fits, &models, &sources, (&store, floor, &clusters), settings);
    let near = labelling.near_robots(&store, engine)?;

    // What nobody saw around them; second pass: every point once more, in the order of its file, to label and to
    // write.
    let spaces = spaces::around(&fits, &models, (&search, settings), engine)?;
    drop(shelf);
    let written = labelling
        .write((&near, spaces), &Scope::default(), (room.next(), room.next()), engine)?
        .finish(engine)?;
    if settings.export.copc {
        copc::write(room.next(), &room.scratch(), engine)?;
    }
    let mut outcome = Report {
        sums: &sums,
        sources: &sources,
        library: &library,
        models: &models,
        fits: &fits,
        clusters: &clusters,
        written: &written,
        unmet: [wrong, unmet].concat(),
        left_out: failures.said(job),
    }
    .finish(&room)?;

    // All is whole, and of the inputs that the run began with: it takes the place of what was there. What this run did not use is not kept.
    sources.inputs.iter().try_for_each(|input| sums.check(input))?;
    State {
        inputs: sources.inputs.clone(),
        masks: sources.masks.clone(),
        scans: sources.scans.clone(),
        tiles: tiles.clone(),
        floor: ground.surfaces.floor,
        fits,
        robots: job.robots.clone(),
        records: Records::of(&written.las, &settings.export),
    }
    .write(room.next())?;
    let known = written.sums.iter().map(|sum| OutputFile::of(room.next(), sum)).collect();
    Manifest::write(room.next(), sums.whole(job), (&outcome, known), engine)?;
    sums.remember(&Manifest::publish(room.next(), room.out())?, room.out())?;
    room.prune(&tiles, &[&grounds, &kept], &shelved);
    outcome.reused = reuse::said(&[
        ("models", shelved.n_kept()),
        ("tiles", filling.n_kept()),
        ("fits", kept.n_kept()),
    ]);
    Ok(outcome)
}
