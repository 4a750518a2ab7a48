//! The commands `run`, `plan` and `rescan`.

use super::common::Common;
use super::flags::{PlanFlags, RescanFlags, RunFlags, present};
use super::say::Say;
use super::{exit, keep_going};
use crate::engine::Engine;
use crate::estimate::{estimate_on, with_missing};
use crate::eval::demo::peak_memory;
use crate::job::{Job, Means, Outcome};
use crate::rescan::{self, Cell, Frame, RescanRequest};
use crate::result::run_record::{MeasuredRun, RunRecord};
use contract::{Error, Kind, Result};
use geometry::Aabb;
use std::num::NonZeroUsize;
use std::time::Instant;

pub(super) fn run(flags: &RunFlags, common: &Common, say: &Say) -> Result<u8> {
    let (job, engine) = job(flags, common)?;
    let started = Instant::now();
    let outcome = keep_going::run(&job, &engine).map_err(|e| with_missing(e, &job, &engine))?;
    Ok(ended(&job, &engine, started, outcome, say))
}

/// Says what a run has found, keeps its times, and returns the exit code.
pub(super) fn ended(
    job: &Job,
    engine: &Engine,
    started: Instant,
    mut outcome: Outcome,
    say: &Say,
) -> u8 {
    record(job, engine, started, &outcome, say);
    outcome.summary += &where_to_look(job);
    say.outcome(&outcome);
    if outcome.partial { exit::PARTIAL } else { exit::OK }
}

pub(super) fn plan(flags: &PlanFlags, common: &Common, say: &Say) -> Result<u8> {
    let (job, engine) = job(&flags.run, common)?;
    let estimate = estimate_on(&job, flags.nodes.map(NonZeroUsize::get), &engine)?;
    if flags.json {
        say.result(&super::say::json(&estimate)?);
    } else {
        say.result(&estimate.to_string());
    }
    estimate.checked(&job.out)?;
    Ok(exit::OK)
}

pub(super) fn rescan(flags: &RescanFlags, common: &Common, say: &Say) -> Result<u8> {
    let means = common.means()?;
    present(&flags.inputs)?;
    let engine = common.engine(&means)?;
    let request = RescanRequest {
        base: flags.base.clone(),
        cell: cell(flags)?,
        frame: frame(flags.frame.as_deref())?,
        job: Job {
            scanners: common.scanners(&means),
            find_scanners: common.finds_scanners(),
            ..Job::new(
                flags.inputs.clone(),
                flags.robots.clone().unwrap_or_default(),
                flags.out.clone(),
                means,
            )
        },
    };
    let started = Instant::now();
    let mut outcome = rescan::rescan(&request, &engine)?;
    record(&request.job, &engine, started, &outcome, say);
    outcome.summary += &where_to_look(&request.job);
    say.outcome(&outcome);
    Ok(if outcome.partial { exit::PARTIAL } else { exit::OK })
}

/// Where data are for programs, and the page for people.
fn where_to_look(job: &Job) -> String {
    let data = format!("result in {}\n", job.out.join("result.json").display());
    let page = job.means.settings.export.page.then(|| job.out.join(crate::cache::PAGE));
    page.iter()
        .fold(data, |data, page| format!("{data}to look at in a browser: {}\n", page.display()))
}

/// Keeps times and memory of a run beside its result. A run whose record cannot be kept is as good.
fn record(job: &Job, engine: &Engine, started: Instant, outcome: &Outcome, say: &Say) {
    let run = MeasuredRun {
        seconds: started.elapsed().as_secs_f64(),
        peak_memory_bytes: peak_memory(),
        stages: &engine.progress.reports(),
    };
    if let Err(error) = RunRecord::keep(&job.out, &run, &job.means, outcome) {
        say.warning(&format!("times of the run are not kept: {error}"));
    }
}

/// Sets what `--lean` is short for, except what is set by itself.
fn make_lean(means: &mut Means) {
    let export = &mut means.settings.export;
    let is_open = |key: &str| means.origins.of(key).is_none();
    export.compress |= is_open("export.compress");
    export.fixed_cloud &= !is_open("export.fixed_cloud");
}

fn cell(flags: &RescanFlags) -> Result<Cell> {
    if !flags.robot.is_empty() {
        return Ok(Cell::Robots(flags.robot.clone()));
    }
    match flags.cell[..] {
        [] => Ok(Cell::Seen),
        [x, y, z, u, v, w] if x < u && y < v && z < w => {
            Ok(Cell::Box(Aabb { min: [x, y, z], max: [u, v, w] }))
        }
        _ => {
            let what = "--cell takes six numbers, the least corner first";
            Err(Error::new(Kind::Usage, what).hint("for example --cell 2,1,0,8,6,4"))
        }
    }
}

fn frame(wish: Option<&str>) -> Result<Frame> {
    let numbers = |text: &str| {
        let all: Vec<f64> = text.split(',').map_while(|v| v.trim().parse().ok()).collect();
        let is_place = all.iter().all(|v: &f64| v.is_finite()) && text.split(',').count() == 4;
        <[f64; 4]>::try_from(all).ok().filter(|_| is_place)
    };
    match wish {
        None => Ok(Frame::Find),
        Some("same") => Ok(Frame::Stated),
        Some(text) => numbers(text).map(Frame::Rough).ok_or_else(|| {
            let what = "--frame takes \"same\", or four numbers: x, y, z in metres, yaw in degrees";
            Error::new(Kind::Usage, what).hint("for example --frame 12.5,-3.0,1.6,90")
        }),
    }
}

pub(super) fn job(flags: &RunFlags, common: &Common) -> Result<(Job, Engine)> {
    let mut means = common.means()?;
    means.settings.fit.calibrate |= flags.calibrate;
    if flags.lean {
        make_lean(&mut means);
    }
    present(&flags.inputs)?;
    let engine = common.engine(&means)?;
    let job = Job {
        scanners: common.scanners(&means),
        find_scanners: common.finds_scanners(),
        review: flags.review.clone(),
        keep_going: flags.keep_going,
        ..Job::new(flags.inputs.clone(), flags.robots.clone(), flags.out.clone(), means)
    };
    Ok((job, engine))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_is_stated_by_a_word_or_by_four_numbers() {
        let told = |text: &str| frame(Some(text)).map_err(|e| e.kind());
        assert_eq!(told("same"), Ok(Frame::Stated));
        assert_eq!(told("12.5, -3,1.6,90"), Ok(Frame::Rough([12.5, -3.0, 1.6, 90.0])));
        for wrong in ["1,2,3", "1,2,3,4,5", "1,2,,4", "1,2,3,inf", "there", ""] {
            assert_eq!(told(wrong), Err(Kind::Usage), "{wrong}");
        }
    }
}
