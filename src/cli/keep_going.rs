//! Runs a job with `--keep-going`: inputs that cannot be read are left out and named, so that one
//! broken file does not cost the run of a whole plant.

use crate::engine::Engine;
use crate::job::{Job, Outcome};
use crate::plan;
use contract::Result;

/// Runs the main job, with `--keep-going` without the inputs that cannot be read. Tiles of the
/// others stay in the store, so that each is read once.
///
/// # Errors
/// Those of [`plan::run`]; with `--keep-going`, the error of the last remaining input.
pub(super) fn run(job: &Job, engine: &Engine) -> Result<Outcome> {
    let mut job = job.clone();
    loop {
        let done = plan::run(&job, engine);
        let Err(error) = &done else { return done };
        let Some(at) = job.failed_input(error) else { return done };
        let path = job.inputs.remove(at);
        engine.progress.say(&format!("{} is left out: {error}", path.display()));
        job.left_out.push(format!("left out: {error}"));
    }
}
