//! One cell of a plant scanned again: an earlier result and new scans in; the same result with that
//! cell brought up to date, and what changed, out. What the new scans do not touch is shared with
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
mod report;
mod robots;
mod session;
mod superseded;
mod voxel_fates;

pub use frame::Frame;
pub use session::Cell;

use crate::cache::input_tiles::InputTiles;
use crate::cache::{self, Cache, Digests, Key, OutputDir, OutputFile, WholeResult};
use crate::detect::library;
use crate::detect::robots::RobotList;
use crate::detect::search::PreparedLibrary;

use crate::engine::{AllThreads, Engine};
use crate::job::{Job, Outcome, units};
use crate::result::plant_state::PlantState;
use crate::store::Store;
use contract::{Error, Fit, Input, Kind, OneByOne, Result};
use earlier_points::EarlierPoints;
use earlier_result::EarlierResult;
use found::Found;
use geometry::{Aabb, Pose};
use ingest::{KnownScanners, Sources};
use robot::Library;
use session::{BothScans, CellComparison, ComparedRobots};
use std::path::PathBuf;

/// What is to be done.
#[derive(Debug, Clone)]
pub struct RescanRequest {
    /// Output folder of the result that is gone on from.
    pub base: PathBuf,
    /// Which part of the plant.
    pub cell: Cell,
    /// Which frame the new scans are in.
    pub frame: Frame,
    /// The new scans, where the result goes, and the means; the library is that of the base where
    /// its path is empty.
    pub job: Job,
}

/// Brings a cell up to date.
///
/// # Errors
/// A base that is no whole result, an input that is part of it already; what a run may end with.
pub fn rescan(request: &RescanRequest, engine: &Engine) -> Result<Outcome> {
    let base = EarlierResult::open(&request.base)?;
    let job = job(request, &base)?;
    let output = job.output()?;
    let digests =
        Digests::of(&job, &output, engine)?.after(base.state.inputs.len(), asked(request, &base));
    if let Some(manifest) = digests.unchanged(&job, &output)? {
        return Ok(manifest.outcome());
    }
    Rescan { base: &base, job: &job, output: &output, digests: &digests, engine }.whole(request)
}

/// A rescan that has something to do.
struct Rescan<'a> {
    base: &'a EarlierResult,
    /// With the base's library and ways of writing.
    job: &'a Job,
    output: &'a OutputDir,
    digests: &'a Digests,
    engine: &'a Engine,
}

impl Rescan<'_> {
    fn whole(&self, request: &RescanRequest) -> Result<Outcome> {
        let &Rescan { base, job, output, digests, engine } = self;
        let settings = &job.means.settings;
        base.share_store(output)?;
        let models_kept = Cache::new(output.models(), digests.models(settings));
        let (library, mut sources) = self.given(&models_kept)?;

        // The new scans into tiles; those of the plant are there.
        let (tiles, mut new, n_kept) = self.tiles(&sources)?;
        let contents = [base.state.contents.clone(), new.contents()].concat();
        let old = base.store(output, job.means.store_bytes())?;

        // Which frame the new scans are in: they are carried into that of the plant.
        let mut plant = library::robots_of(base.state.fits.clone(), &library)?;
        let scans = base.state.scans.clone();
        let past = EarlierPoints::new(base, &scans, &old, Aabb::EMPTY)?;
        let stood = session::stood(plant.view());
        let wish = &request.frame;
        let carried = frame::carry(wish, &past, stood, &mut sources, &mut new, engine)?;

        // Where the cell is; the new scans are taken back by what they are off what stood there.
        let cell = session::bounds(&request.cell, base, plant.view(), &sources, &new)?;
        let past = &past.of_cell(cell);
        let prepared = &PreparedLibrary::new(&library.models);
        let names = session::known(plant.view(), &cell);
        let (floor, hangs) = (&base.state.floor, robots::hang(&plant.fits, &past.cell));
        let known = || {
            prepared.prepare(&names, &OneByOne);
            Ok(())
        };
        let (sources_laid, store) = (&mut sources, &new);
        // Reading waits for disks: what fits of the cell's robots need is made meanwhile.
        let ((), (registered, session)) = engine.join("models", known, move || {
            let registered = session::register(past, store, sources_laid, engine)?;
            let (sources, library) = (&*sources_laid, prepared);
            let both = BothScans { floor, hangs, sources, past, store, library };
            Ok((registered, CellComparison::new(both, settings, engine)?))
        })?;

        // Robots and things of the cell, then and now.
        let (robots, labels) = session.compare(&mut plant, engine)?;

        // New masks and records of the new scans, tiles of the cell anew, all the rest as it was.
        let (session, robots, labels, carried) = (&session, &robots, &labels, &carried);
        let RobotList { fits, models } = &plant;
        let found = Found { base, session, robots, labels, models, fits, carried };
        let written = found.write(&registered, output, digests, engine)?;
        let all: Vec<Key> = base.state.tiles.iter().chain(&tiles).cloned().collect();
        let mut outcome = written.outcome;
        let frame = carried.plant_from_new;
        let made = MadeAnew { robots, sources: &sources, tiles: &all, contents, frame };
        outcome.told = self.conclude(plant.fits, made, written.known, &outcome)?;
        output.prune_tiles(&all, &models_kept);
        let names = ["models", "tiles of new scans", "files of the earlier result"];
        let n_kept = [models_kept.n_kept(), n_kept, written.n_shared];
        outcome.reused = cache::reused_in_words(names, n_kept);
        Ok(outcome)
    }

    /// The tiles of the new scans: keys of their folders, one store of all, and how many were there
    /// already.
    fn tiles(&self, sources: &Sources) -> Result<(Vec<Key>, Store, [usize; 2])> {
        let &Rescan { base, job, output, digests, engine } = self;
        let input_tiles = InputTiles::new(sources, &job.means, output.tiles(), engine);
        let (tiles, store) = input_tiles.of_all(sources.opened(), digests)?;
        sources.opened().iter().try_for_each(|input| fresh(input, base, digests))?;
        Ok((tiles, store, input_tiles.n_kept()))
    }

    /// Reads the library, and opens the new scans behind those of the base.
    fn given(&self, models_kept: &Cache) -> Result<(Library, Sources)> {
        let &Rescan { base, job, engine, .. } = self;
        let settings = &job.means.settings;
        let library = library::load(&job.robots, &settings.robot, Some(models_kept), engine)?;
        let read = |path| KnownScanners::read(path, &job.means.settings.ingest);
        let scanners = job.scanners.as_deref().map(read).transpose()?;
        let before = base.state.before();
        let open = || {
            let settings = &settings.ingest;
            ingest::open_after(before, &job.inputs, scanners.as_ref(), settings, &AllThreads)
        };
        let sources = engine.pool()?.install(open)?;
        units::check_sizes(&library, &sources)?;
        sources.check_steps()?;
        Ok((library, sources))
    }

    /// All is whole, and of the inputs that the rescan began with: it takes its place. Robots that
    /// stand as they stood are handed on as the base has them.
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
        WholeResult { job, output, digests, outcome, files }.publish(engine)
    }
}

/// What is not as it was in the earlier result.
struct MadeAnew<'a> {
    robots: &'a ComparedRobots,
    sources: &'a Sources,
    /// Tiles of all inputs, and what their stores hold.
    tiles: &'a [Key],
    contents: Vec<String>,
    /// What carried the new scans into the plant's frame.
    frame: Option<Pose>,
}

/// What a rescan is asked for beside its inputs and settings, for its digest.
fn asked(request: &RescanRequest, base: &EarlierResult) -> String {
    let frame = match request.frame {
        Frame::Find => String::new(),
        other => format!(" {other:?}"),
    };
    format!("{} {:?}{frame}", base.files.digest(), request.cell)
}

/// The job with the base's library and ways of writing.
fn job(request: &RescanRequest, base: &EarlierResult) -> Result<Job> {
    let mut job = request.job.clone();
    if job.robots.as_os_str().is_empty() {
        job.robots.clone_from(&base.state.robots);
    }
    if !job.robots.is_dir() {
        return Err(Error::bad_input("the robot library is not there")
            .at(job.robots.display())
            .hint("name it with --robots"));
    }
    job.apart(&request.base)?;
    job.means.settings.export = base.state.records.export(&job.means.settings.export);
    Ok(job)
}

/// Refuses an input that the base was made of.
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
