//! Brings one cell of a plant up to date: from an earlier result and new scans of the cell to a
//! complete result and a list of changes. Files that the new scans do not affect are shared with
//! the earlier result, byte for byte.

mod appeared_robots;
mod earlier_points;
mod earlier_result;
mod found;
mod frame;
mod known_space;
mod new_points;
mod other_model;
mod output;
mod picture;
mod report;
mod robots;
mod session;
mod superseded;
mod thing_points;
mod voxel_fates;

pub use frame::Frame;
pub use session::Cell;

use crate::cache::input_tiles::InputTiles;
use crate::cache::{self, Cache, Digests, Key, OutputDir, OutputFile, VerifiedFiles, WholeResult};
use crate::detect::library;
use crate::detect::robots::RobotList;
use crate::detect::search::PreparedLibrary;

use crate::engine::Engine;
use crate::job::{Job, Outcome, units};
use crate::positions::{self, CloudOrder};
use crate::result::page;
use crate::result::plant_state::PlantState;
use crate::store::Store;
use contract::{Error, Fit, Input, Kind, OneByOne, Result};
use earlier_points::EarlierPoints;
use earlier_result::EarlierResult;
use found::RescanFindings;
use geometry::{Aabb, Pose};
use ingest::Sources;
use robot::Library;
use session::{BothScans, CellComparison, ComparedRobots};
use std::path::PathBuf;

/// Request of a rescan.
#[derive(Debug, Clone)]
pub struct RescanRequest {
    /// Output folder of the earlier result.
    pub base: PathBuf,
    /// The part of the plant that was scanned again.
    pub cell: Cell,
    /// The frame of the new scans.
    pub frame: Frame,
    /// New scans, output folder, memory, threads and settings; an empty library path means the
    /// library of the earlier result.
    pub job: Job,
}

/// Brings a cell up to date.
///
/// # Errors
/// `base` is not a complete result, an input is part of it already, or an error of a run.
pub fn rescan(request: &RescanRequest, engine: &Engine) -> Result<Outcome> {
    let base = EarlierResult::open(&request.base)?;
    let job = job(request, &base)?;
    let output = job.output()?;
    let digests = Digests::of(&job, &output, engine)?
        .after(base.state.inputs.len(), request_text(request, &base));
    if let Some(manifest) = digests.unchanged(&job, &output)? {
        return Ok(manifest.outcome());
    }
    Rescan { base: &base, job: &job, output: &output, digests: &digests, engine }.execute(request)
}

/// A rescan that is not answered by an unchanged result.
struct Rescan<'a> {
    base: &'a EarlierResult,
    /// The job with library and export settings of the earlier result.
    job: &'a Job,
    output: &'a OutputDir,
    digests: &'a Digests,
    engine: &'a Engine,
}

impl Rescan<'_> {
    fn execute(&self, request: &RescanRequest) -> Result<Outcome> {
        let &Rescan { base, job, output, digests, engine } = self;
        let settings = &job.means.settings;
        base.share_store(output)?;
        let models_kept = Cache::new(output.models(), digests.models_key(settings));
        let (library, mut sources) = self.given(&models_kept)?;

        // The new scans are read into tiles; those of the plant exist already.
        let (tiles, mut new, n_kept) = self.tiles(&sources)?;
        let contents = [base.state.contents.clone(), new.contents()].concat();
        let old = base.store(output, job.means.store_bytes())?;

        // The new scans are carried to the frame of the plant.
        let mut plant = library::robots_of(base.state.fits.clone(), &library)?;
        let scans = base.state.scans.clone();
        let past = EarlierPoints::new(base, &scans, &old, Aabb::EMPTY)?;
        let stood = session::earlier_bounds(plant.view());
        let wish = &request.frame;
        let carried = frame::carry(wish, &past, stood, &mut sources, &mut new, engine)?;

        // The cell is determined, and the new scans are registered to the earlier surfaces.
        let cell = session::bounds(&request.cell, base, plant.view(), &sources, &new)?;
        let past = &past.of_cell(cell);
        let prepared = &PreparedLibrary::new(&library.models);
        let names = session::model_names(plant.view(), &cell);
        let (floor, hangs) = (&base.state.floor, robots::hang(&plant.fits, &past.cell));
        let known = || {
            prepared.prepare(&names, &OneByOne);
            Ok(())
        };
        let (sources_laid, store) = (&mut sources, &new);
        // Reading waits for disks, so the models of the cell's robots are prepared at the same
        // time.
        let ((), (registered, session)) = engine.join("models", known, move || {
            let registered = session::register(past, store, sources_laid, engine)?;
            let (sources, library) = (&*sources_laid, prepared);
            let both = BothScans { floor, hangs, sources, past, store, library };
            Ok((registered, CellComparison::new(both, settings, engine)?))
        })?;

        // Robots and other bodies of the cell, then and now.
        let (robots, labels) = session.compare(&mut plant, engine)?;

        // Masks and records of the new scans and tiles of the cell are written; all other files are
        // shared.
        let (session, robots, labels, carried) = (&session, &robots, &labels, &carried);
        let RobotList { fits, models } = &plant;
        let found = RescanFindings { base, session, robots, labels, models, fits, carried };
        let written = found.write(&registered, output, digests, engine)?;
        let all: Vec<Key> = base.state.tiles.iter().chain(&tiles).cloned().collect();
        let mut outcome = written.outcome;
        let frame = carried.plant_from_new;
        let made = MadeAnew { robots, sources: &sources, tiles: &all, contents, frame };
        outcome.notes = self.conclude(plant.fits, made, written.known, &outcome)?;
        output.prune_tiles(&all, &models_kept);
        let names = ["models", "tiles of new scans", "files of the earlier result"];
        let n_kept = [models_kept.n_kept(), n_kept, written.n_shared];
        outcome.reused = cache::reused_in_words(names, n_kept);
        Ok(outcome)
    }

    /// Tiles of the new scans: their keys, one store of all, and how many existed already.
    fn tiles(&self, sources: &Sources) -> Result<(Vec<Key>, Store, [usize; 2])> {
        let &Rescan { base, job, output, digests, engine } = self;
        let input_tiles = InputTiles::new(sources, &job.means, output.tiles(), engine);
        let (tiles, store) = input_tiles.of_all(sources.opened(), digests)?;
        sources.opened().iter().try_for_each(|input| fresh(input, base, digests))?;
        Ok((tiles, store, input_tiles.n_kept()))
    }

    /// Reads the library, and opens the new scans, numbered after those of the earlier result.
    fn given(&self, models_kept: &Cache) -> Result<(Library, Sources)> {
        let &Rescan { base, job, engine, .. } = self;
        let settings = &job.means.settings;
        let library = library::load(&job.robots, &settings.robot, Some(models_kept), engine)?;
        let sources =
            positions::open(job, base.state.before(), None, CloudOrder::Used, engine)?.sources;
        units::check_sizes(&library, &sources)?;
        sources.check_steps()?;
        Ok((library, sources))
    }

    /// Publishes the complete result after a check that the inputs are unchanged. Unchanged robots
    /// are passed on as the earlier result has them.
    fn conclude(
        &self,
        mut fits: Vec<Fit>,
        made: MadeAnew<'_>,
        files: Vec<OutputFile>,
        outcome: &Outcome,
    ) -> Result<Vec<String>> {
        let &Rescan { base, job, output, digests, engine } = self;
        let MadeAnew { robots, sources, tiles, contents, frame } = made;
        sources.opened().iter().try_for_each(|input| digests.check(input))?;
        let stays = |i: &usize| !robots.changed.contains(i) && !robots.gone.contains(i);
        for i in (0..base.state.fits.len()).filter(stays) {
            fits[i].clone_from(&base.state.fits[i]);
        }
        let mut frames = base.state.frames.clone();
        frames.resize(base.state.inputs.len(), None);
        frames.resize(sources.inputs.len(), frame);
        let state = PlantState {
            frames,
            inputs: sources.inputs.clone(),
            masks: sources.masks.clone(),
            scans: sources.scans.clone(),
            tiles: tiles.to_vec(),
            contents,
            fits,
            robots: job.robots.clone(),
            ..base.state.clone()
        };
        state.write(output.next())?;
        // The only step that reads all tiles of the plant; the settings can leave it out.
        let next = output.next();
        let page = |files: &VerifiedFiles| page::of_run(next, files, &[], (&job.means, engine));
        WholeResult { job, output, digests, outcome, files }.publish(page, engine)
    }
}

/// The parts of the state that differ from the earlier result.
struct MadeAnew<'a> {
    robots: &'a ComparedRobots,
    sources: &'a Sources,
    /// Keys of the tiles of all inputs, and digests of their stores.
    tiles: &'a [Key],
    contents: Vec<String>,
    /// Pose that carried the new scans to the plant's frame.
    frame: Option<Pose>,
}

/// Text of the request besides inputs and settings, for its digest.
fn request_text(request: &RescanRequest, base: &EarlierResult) -> String {
    let frame = match request.frame {
        Frame::Find => String::new(),
        other => format!(" {other:?}"),
    };
    format!("{} {:?}{frame}", base.files.digest(), request.cell)
}

/// The job with library and export settings of the earlier result.
fn job(request: &RescanRequest, base: &EarlierResult) -> Result<Job> {
    let mut job = request.job.clone();
    if job.robots.as_os_str().is_empty() {
        job.robots.clone_from(&base.state.robots);
    }
    if !job.robots.is_dir() {
        return Err(Error::bad_input("the robot library of the earlier result is missing")
            .at(job.robots.display())
            .hint("name it with --robots"));
    }
    job.refuse_base_overlap(&request.base)?;
    job.means.settings.export = base.state.records.export(&job.means.settings.export);
    Ok(job)
}

/// Refuses an input that is part of the earlier result.
fn fresh(input: &Input, base: &EarlierResult, digests: &Digests) -> Result<()> {
    let own = digests.input(input).unwrap_or_default();
    match base.result.inputs.iter().find(|i| i.digest == own) {
        None => Ok(()),
        Some(known) => {
            Err(Error::new(Kind::Usage, "this scan is part of the earlier result already")
                .because(format!("it was read as {}", known.path))
                .at(input.path.display())
                .hint("give the scans of the new session only"))
        }
    }
}
