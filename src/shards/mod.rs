//! The shards of a job: the pieces of work that many processes, on many machines with one shared
//! disk, do in place of one run. Shards are listed, each is made by one process, and the last one
//! gathers the result: the same bytes as those of a run.
//!
//! Everything that shards hand on to each other lies in the store of the output folder, named by
//! what it was made from. So a shard that is made twice, or by two processes at once, is made once;
//! a process that is killed leaves nothing behind that another one could take for a piece; and a
//! job that was interrupted is listed again and goes on with what is missing.

mod left_out;
mod list;
mod listing;
mod work;

use crate::cache::{Digests, OutputDir};
use crate::engine::Engine;
use crate::job::{Job, Outcome};
use crate::plan::Run;
use contract::{Error, Kind, Result};
use left_out::LeftOut;
use listing::Listing;
use std::time::Instant;

pub use list::{Shard, ShardKind, ShardList, ShardState};
pub use work::{DoneShard, HowDone};

/// Lists the shards of a job, as far as they are known: later ones depend on results of earlier
/// ones.
///
/// # Errors
/// Inputs, library or settings that cannot be used.
pub fn list(job: &Job, engine: &Engine) -> Result<ShardList> {
    let listed = attend(job, engine, true, |run, left| {
        run.digests.settle();
        match run.digests.unchanged(run.job, run.output)? {
            Some(_) => Ok(ShardList::finished(left.messages())),
            None => Ok(Listing::of(run)?.list(left.messages())),
        }
    })?;
    Ok(listed.0)
}

/// Makes the shard with this id, or finds that it is made.
///
/// # Errors
/// An id that the list does not have, a shard that needs others first, or the error of its work.
pub fn make(job: &Job, id: &str, engine: &Engine) -> Result<DoneShard> {
    let started = Instant::now();
    let made = attend(job, engine, true, |run, left| {
        if run.digests.unchanged(run.job, run.output)?.is_some() {
            return Ok(Some(DoneShard::late(id)));
        }
        let listing = Listing::of(run)?;
        let Some(at) = listing.find(id) else { return Ok(None) };
        let shard = listing.shards[at].0.clone();
        match shard.state {
            ShardState::Done => return Ok(Some(DoneShard::of(shard, HowDone::Before))),
            ShardState::Waiting => return Err(waits(&listing, &shard)),
            ShardState::Ready if shard.kind == ShardKind::Gather => {
                return Ok(Some(DoneShard::of(shard, HowDone::Ready)));
            }
            ShardState::Ready => {}
        }
        let did = work::work(run, &listing, at);
        // Another process may have been faster, or may have ended the job; what this one did is
        // then not needed, whatever became of it.
        match did {
            // As a run that keeps going, this job is finished without what is at fault there.
            Err(error) if is_spared(run.job, &shard, &error) => {
                left.add(run, &listing, at, &error.to_string())?;
                Ok(Some(DoneShard::of(shard, HowDone::LeftOut)))
            }
            Err(error) if is_made(job, id, engine) => {
                engine.progress.say(&format!("another process has made this shard: {error}"));
                Ok(Some(DoneShard::of(shard, HowDone::Before)))
            }
            did => did.map(|how| Some(DoneShard::of(shard, how))),
        }
    });
    let (made, left) = made?;
    let done = match made {
        Some(done) if done.how == HowDone::Ready => {
            let outcome = gather(job, engine)?;
            DoneShard { how: HowDone::Made, outcome: Some(outcome), ..done }
        }
        Some(done) => done,
        None => left.shard(id).ok_or_else(|| unknown(id))?,
    };
    Ok(DoneShard { seconds: started.elapsed().as_secs_f64(), ..done })
}

/// Records that a shard cannot be made, so that the job goes on without it: for jobs that keep
/// going.
///
/// # Errors
/// A job that does not keep going, or a shard that the result cannot do without.
pub fn leave_out(job: &Job, id: &str, why: &str, engine: &Engine) -> Result<DoneShard> {
    if !job.keep_going {
        let what = "a shard is left out only where the job keeps going";
        return Err(Error::new(Kind::Usage, what).hint("give --keep-going to all commands"));
    }
    let (done, _) = attend(job, engine, true, |run, left| {
        let listing = Listing::of(run)?;
        let Some(at) = listing.find(id) else {
            return left.shard(id).ok_or_else(|| unknown(id));
        };
        left.add(run, &listing, at, why)?;
        Ok(DoneShard::of(listing.shards[at].0.clone(), HowDone::LeftOut))
    })?;
    Ok(done)
}

/// Ends a job whose shards are all made: writes and publishes its result.
///
/// # Errors
/// A shard that is not made yet, or the error of a step.
pub fn gather(job: &Job, engine: &Engine) -> Result<Outcome> {
    let (outcome, _) = attend(job, engine, false, |run, _| {
        if let Some(manifest) = run.digests.unchanged(run.job, run.output)? {
            return Ok(manifest.outcome());
        }
        let listing = Listing::of(run)?;
        let open = listing.shards.iter().map(|(shard, _)| shard);
        let open = open.filter(|s| s.state != ShardState::Done && s.kind != ShardKind::Gather);
        let open: Vec<&Shard> = open.collect();
        if let Some(first) = open.first() {
            let what = format!("{} shards of this job are not made yet", open.len());
            return Err(Error::new(Kind::Usage, what)
                .because(format!("the first is {}", first.id))
                .hint("`stillpoint shards` lists them, `stillpoint shard` makes one"));
        }
        drop(listing);
        run.execute()
    })?;
    Ok(outcome)
}

/// Calls `work` with the job as far as it can be done. Where the job keeps going, an input that
/// fails is recorded, and `work` is called again without it. `shares` tells whether other processes
/// fill the store at the same time.
fn attend<T>(
    job: &Job,
    engine: &Engine,
    shares: bool,
    mut work: impl FnMut(&Run<'_>, &LeftOut) -> Result<T>,
) -> Result<(T, LeftOut)> {
    // An input that changes all the time is never known as the one that was left out.
    let mut n_failures = 0;
    loop {
        let left = LeftOut::read(job)?;
        let reduced = left.without(job);
        let output: OutputDir = if shares { reduced.shared_output()? } else { reduced.output()? };
        let digests = Digests::of(&reduced, &output, engine)?;
        let run = Run::new(&reduced, &output, &digests, engine);
        let run = Run { shards: Some(left.regions()), ..run };
        match work(&run, &left) {
            Ok(done) => return Ok((done, left)),
            Err(error) => {
                let failed = reduced.failed_input(&error);
                let Some(at) = failed.filter(|_| n_failures < job.inputs.len()) else {
                    return Err(error);
                };
                n_failures += 1;
                let path = &reduced.inputs[at];
                engine.progress.say(&format!("{} is left out: {error}", path.display()));
                left.add_input(job, &run, at, &error)?;
            }
        }
    }
}

/// Whether the failure of a shard is a fault of the program in one region, and the job keeps going.
fn is_spared(job: &Job, shard: &Shard, error: &Error) -> bool {
    job.keep_going && shard.kind == ShardKind::Region && error.kind() == Kind::Bug
}

/// Whether a shard is made, by a look at the store as it is now.
fn is_made(job: &Job, id: &str, engine: &Engine) -> bool {
    list(job, engine).is_ok_and(|list| {
        let known = list.shards.iter().find(|shard| shard.id == id);
        list.finished || known.is_some_and(|shard| shard.state == ShardState::Done)
    })
}

fn unknown(id: &str) -> Error {
    let what = format!("this job has no shard \"{id}\", or it is not known yet");
    let hint = "`stillpoint shards` with the same inputs, library and settings lists the ids";
    Error::new(Kind::Usage, what).hint(hint)
}

fn waits(listing: &Listing, shard: &Shard) -> Error {
    let is_open = |id: &&String| listing.find(id).is_some_and(|at| !listing.is_done(at));
    let first = shard.needs.iter().find(is_open).map_or("another one", String::as_str);
    let what = format!("shard {} needs others that are not made yet", shard.id);
    Error::new(Kind::Usage, what)
        .because(format!("the first is {first}"))
        .hint("make those shards first")
}
