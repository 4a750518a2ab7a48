//! One cell of a plant scanned again: an earlier result and new scans in; the same result with that
//! cell brought up to date, and what changed, out. What the new scans do not touch is shared with
//! the earlier result, byte for byte.

mod base;
mod carry;
mod exchanged;
mod fate;
mod newcomers;
mod past;
mod places;
mod present;
#[cfg(fuzzing)]
pub(crate) mod probe;
mod robots;
mod say;
mod session;
mod spaces;
mod state;
mod write;

pub use carry::Frame;

pub(crate) use base::tiles_of;
pub(crate) use robots::models_of;
pub(crate) use state::{Records, State};

use crate::engine::{AllThreads, Engine};
use crate::filling::Filling;
use crate::job::{Job, Outcome, OutputDir};
use crate::library;
use crate::reuse::{self, Cache, Digests, Key, OutputFile};
use crate::search::Shelf;
use crate::store::Store;
use crate::units;
use base::Base;
use contract::{Error, Fit, Input, Kind, OneByOne, Result};
use geometry::{Aabb, Pose};
use ingest::{KnownScanners, Sources};
use past::Past;
use robot::Library;
use session::{Robots, Session};
use std::path::PathBuf;
use write::Written;

/// What is to be done.
#[derive(Debug, Clone)]
pub struct Request {
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

/// Which part of a plant was scanned again.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// Within these bounds, world, metres.
    Box(Aabb),
    /// All that these robots reach, by their ids.
    Robots(Vec<String>),
    /// What the new scans see well.
    Seen,
}

/// Brings a cell up to date.
///
/// # Errors
/// A base that is no whole result, an input that is part of it already; what a run may end with.
pub fn rescan(request: &Request, engine: &Engine) -> Result<Outcome> {
    let base = Base::open(&request.base)?;
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
    base: &'a Base,
    /// With the base's library and ways of writing.
    job: &'a Job,
    output: &'a OutputDir,
    digests: &'a Digests,
    engine: &'a Engine,
}

impl Rescan<'_> {
    fn whole(&self, request: &Request) -> Result<Outcome> {
        let &Rescan { base, job, output, digests, engine } = self;
        let settings = &job.means.settings;
        base.share_store(output)?;
        let shelved = Cache::new(output.models(), digests.models(settings));
        let (library, mut sources) = self.given(&shelved)?;

        // The new scans into tiles; those of the plant are there.
        let (tiles, mut new, n_kept) = self.tiles(&sources)?;
        let contents = [base.state.contents.clone(), new.contents()].concat();
        let old = base.store(output, job.means.store_bytes())?;

        // Which frame the new scans are in: they are carried into that of the plant.
        let mut fits = base.state.fits.clone();
        let mut models = robots::models_of(&mut fits, &library)?;
        let scans = base.state.scans.clone();
        let past = Past::new(base, &scans, &old, Aabb::EMPTY)?;
        let stood = session::stood((&fits, &models));
        let carried =
            carry::carry(&request.frame, (&past, stood), (&mut sources, &mut new), engine)?;

        // Where the cell is; the new scans are taken back by what they are off what stood there.
        let cell = session::bounds(&request.cell, base, (&fits, &models), (&sources, &new))?;
        let past = past.of_cell(cell);
        let shelf = Shelf::new(&library.models);
        let names = session::known((&fits, &models), &cell);
        let floor = (&base.state.floor, robots::hang(&fits, &past.cell));
        let known = || {
            shelf.prepare(&names, &OneByOne);
            Ok(())
        };
        let (laid, between) = (&mut sources, (&past, &new));
        let on_shelf = &shelf;
        // Reading waits for disks: what fits of the cell's robots need is made meanwhile.
        let ((), (registered, session)) = engine.beside("models", known, move || {
            let registered = session::register(between, laid, engine)?;
            let session = Session::new(floor, laid, between, on_shelf, settings, engine)?;
            Ok((registered, session))
        })?;

        // Robots and things of the cell, then and now.
        let (robots, labels) = session.compare((&mut fits, &mut models), engine)?;

        // New masks and records of the new scans, tiles of the cell anew, all the rest as it was.
        let (session, robots) = (&session, &robots);
        let (labels, models) = (&labels, &models);
        let carried = &carried;
        let found = Written { base, session, robots, labels, models, fits: &fits, carried };
        let written = found.write(&registered, (output, digests), engine)?;
        let all: Vec<Key> = base.state.tiles.iter().chain(&tiles).cloned().collect();
        let mut outcome = written.outcome;
        let kept = (&sources, (&*all, contents, carried.plant_from_new));
        outcome.told = self.conclude((fits, robots), kept, (&outcome, written.known))?;
        output.prune_tiles(&all, &shelved);
        let (models, shared) = (shelved.n_kept(), written.n_shared);
        let tiles = ("tiles of new scans", n_kept);
        outcome.reused =
            reuse::said(&[("models", models), tiles, ("files of the earlier result", shared)]);
        Ok(outcome)
    }

    /// The tiles of the new scans: keys of their folders, one store of all, and how many were there
    /// already.
    fn tiles(&self, sources: &Sources) -> Result<(Vec<Key>, Store, [usize; 2])> {
        let &Rescan { base, job, output, digests, engine } = self;
        let filling = Filling::new(sources, &job.means, output.tiles(), engine);
        let filled = sources.opened().iter().map(|i| filling.tiles_of(i, digests));
        let (tiles, stores): (Vec<Key>, Vec<Store>) = filled.collect::<Result<_>>()?;
        sources.opened().iter().try_for_each(|input| fresh(input, base, digests))?;
        Ok((tiles, Store::join(stores), filling.n_kept()))
    }

    /// Reads the library, and opens the new scans behind those of the base.
    fn given(&self, shelved: &Cache) -> Result<(Library, Sources)> {
        let &Rescan { base, job, engine, .. } = self;
        let settings = &job.means.settings;
        let library = library::load(&job.robots, &settings.robot, Some(shelved), engine)?;
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
        (mut fits, robots): (Vec<Fit>, &Robots),
        (sources, (tiles, contents, frame)): (&Sources, Kept<'_>),
        (outcome, known): (&Outcome, Vec<OutputFile>),
    ) -> Result<Vec<String>> {
        let &Rescan { base, job, output, digests, engine } = self;
        sources.opened().iter().try_for_each(|input| digests.check(input))?;
        let stays = |i: &usize| !robots.changed.contains(i) && !robots.gone.contains(i);
        for i in (0..base.state.fits.len()).filter(stays) {
            fits[i].clone_from(&base.state.fits[i]);
        }
        let mut frames = base.state.frames.clone();
        frames.resize(base.state.inputs.len(), None);
        frames.resize(sources.inputs.len(), frame);
        let state = State {
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
        reuse::publish(job, (output, digests), (outcome, known), engine)
    }
}

/// Tiles of all inputs, what their stores hold, and what carried the new scans into the plant's
/// frame.
type Kept<'a> = (&'a [Key], Vec<String>, Option<Pose>);

/// What a rescan is asked for beside its inputs and settings, for its digest.
fn asked(request: &Request, base: &Base) -> String {
    let frame = match request.frame {
        Frame::Find => String::new(),
        other => format!(" {other:?}"),
    };
    format!("{} {:?}{frame}", base.files.digest(), request.cell)
}

/// The job with the base's library and ways of writing.
fn job(request: &Request, base: &Base) -> Result<Job> {
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
fn fresh(input: &Input, base: &Base, digests: &Digests) -> Result<()> {
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
