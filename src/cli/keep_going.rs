//! Runs a job with `--keep-going`: inputs that cannot be read are left out and named, so that one
//! broken file does not cost the run of a whole plant.

use crate::engine::Engine;
use crate::job::{Job, Outcome};
use crate::plan;
use contract::{Error, Kind, Result};

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
        let Some(at) = failed(&job, error) else { return done };
        let path = job.inputs.remove(at);
        engine.progress.say(&format!("{} is left out: {error}", path.display()));
        job.left_out.push(format!("left out: {error}"));
    }
}

/// Index of the input that an error is about, if the job can go on without it.
fn failed(job: &Job, error: &Error) -> Option<usize> {
    let is_of_file = matches!(error.kind(), Kind::BadInput | Kind::Unsupported | Kind::Io);
    if !job.keep_going || !is_of_file || job.inputs.len() < 2 {
        return None;
    }
    let place = error.place()?;
    job.inputs.iter().position(|path| place.starts_with(&path.display().to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::{FlagValues, Means};

    fn job(keep_going: bool) -> Job {
        let means = Means::of(&FlagValues::default()).expect("defaults");
        let inputs = vec!["a/one.e57".into(), "a/two.e57".into()];
        Job { keep_going, ..Job::new(inputs, "r".into(), "o".into(), means) }
    }

    #[test]
    fn only_errors_of_an_input_are_forgiven() {
        let broken = Error::bad_input("damaged").at("page 3").at("a/two.e57");
        assert_eq!(failed(&job(true), &broken), Some(1));
        assert_eq!(failed(&job(false), &broken), None);
        assert_eq!(failed(&job(true), &Error::bad_input("damaged").at("b/two.e57")), None);
        let full = Error::new(Kind::OverBudget, "the disk is full").at("a/two.e57");
        assert_eq!(failed(&job(true), &full), None);
    }
}
