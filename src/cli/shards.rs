//! The commands `shards`, `shard` and `gather`: a job that many processes do.

use super::common::Common;
use super::exit;
use super::flags::{RunFlags, ShardFlags, ShardsFlags};
use super::run::{ended, job};
use super::say::{Say, json};
use crate::estimate::with_missing;
use crate::shards::{self, HowDone};
use contract::Result;
use std::time::Instant;

pub(super) fn list(flags: &ShardsFlags, common: &Common, say: &Say) -> Result<u8> {
    let (job, engine) = job(&flags.run, common)?;
    let list = shards::list(&job, &engine)?;
    if flags.json {
        say.result(&json(&list)?);
    } else {
        say.result(list.to_string().trim_end());
    }
    Ok(exit::OK)
}

pub(super) fn make(flags: &ShardFlags, common: &Common, say: &Say) -> Result<u8> {
    let (job, engine) = job(&flags.run, common)?;
    let started = Instant::now();
    let done = match &flags.leave_out {
        Some(why) => shards::leave_out(&job, &flags.id, why, &engine),
        None => shards::make(&job, &flags.id, &engine),
    };
    let done = done.map_err(|e| with_missing(e, &job, &engine))?;
    if flags.json {
        say.result(&json(&done)?);
    } else {
        let how = match done.how {
            HowDone::LeftOut => "left out",
            HowDone::Before => "was made before",
            HowDone::Made | HowDone::Ready => "made",
        };
        let what = done.shard.as_ref().map_or("a job that is finished", |shard| &shard.what);
        say.result(&format!("{}: {what}: {how}", done.id));
    }
    if let Some(outcome) = done.outcome {
        return Ok(ended(&job, &engine, started, outcome, say));
    }
    Ok(if done.how == HowDone::LeftOut { exit::PARTIAL } else { exit::OK })
}

pub(super) fn gather(flags: &RunFlags, common: &Common, say: &Say) -> Result<u8> {
    let (job, engine) = job(flags, common)?;
    let started = Instant::now();
    let outcome = shards::gather(&job, &engine).map_err(|e| with_missing(e, &job, &engine))?;
    Ok(ended(&job, &engine, started, outcome, say))
}
