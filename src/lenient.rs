//! A job of which parts may fail in; its outcome without those, which are named, out: a plant that
//! runs overnight is not lost for one broken file.

use crate::engine::{Engine, guarded};
use crate::job::{Job, Outcome};
use crate::plan;
use contract::{Error, Kind, Region, Result};
use std::collections::BTreeMap;
use std::sync::Mutex;

/// Does the main job; where it is asked for, without the inputs that cannot be read. Tiles of the
/// others stay in the store, so that each is read once.
///
/// # Errors
/// As [`plan::run`]; where failures are forgiven, those of the last input that is left.
pub fn run(job: &Job, engine: &Engine) -> Result<Outcome> {
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

/// The input that an error is of, where the job can go on without it.
fn failed(job: &Job, error: &Error) -> Option<usize> {
    let is_of_file = matches!(error.kind(), Kind::BadInput | Kind::Unsupported | Kind::Io);
    if !job.keep_going || !is_of_file || job.inputs.len() < 2 {
        return None;
    }
    let place = error.place()?;
    job.inputs.iter().position(|path| place.starts_with(&path.display().to_string()))
}

/// Regions that failed, in words, by their place.
pub(crate) struct Failures {
    is_forgiving: bool,
    list: Mutex<BTreeMap<String, String>>,
}

impl Failures {
    pub(crate) fn of(job: &Job) -> Self {
        Self { is_forgiving: job.keep_going, list: Mutex::default() }
    }

    /// What `work` makes of a region; nothing where it fails by a fault of ours, and that is
    /// forgiven.
    pub(crate) fn spare<T: Default>(
        &self,
        region: &Region,
        work: impl FnOnce() -> Result<T>,
    ) -> Result<T> {
        if !self.is_forgiving {
            return work();
        }
        match guarded("fit", 0, work) {
            Err(error) if error.kind() == Kind::Bug => {
                let [x, y, z] = region.world_bounds().center().coords.into();
                let what =
                    format!("no robot is looked for near ({x:.1}, {y:.1}, {z:.1}) m: {error}");
                let mut list = self.list.lock().expect("nobody panics while he holds the list");
                list.insert(format!("{region:?}"), what);
                Ok(T::default())
            }
            done => done,
        }
    }

    /// All that was left out, in the order of inputs and places.
    pub(crate) fn said(self, job: &Job) -> Vec<String> {
        let list = self.list.into_inner().unwrap_or_default();
        job.left_out.iter().cloned().chain(list.into_values()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::{Given, Means};
    use geometry::{Aabb, Point};

    fn job(keep_going: bool) -> Job {
        let means = Means::of(&Given::default()).expect("defaults");
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

    #[test]
    fn a_fault_in_one_region_is_named_and_the_others_count() {
        let region = Region {
            origin: Point::new(4.0, 0.0, 0.0),
            bounds: Aabb { min: [-1.0; 3], max: [1.0; 3] },
        };
        let failures = Failures::of(&job(true));
        let none: Vec<u8> = failures.spare(&region, || panic!("a fault")).expect("forgiven");
        assert!(none.is_empty());
        assert!(failures.spare(&region, || Err::<u8, _>(Error::new(Kind::Io, "disk"))).is_err());
        let said = failures.said(&job(true));
        assert!(said.len() == 1 && said[0].contains("(4.0, 0.0, 0.0)"), "{said:?}");
        let strict = Failures::of(&job(false));
        assert!(strict.spare(&region, || Err::<u8, _>(Error::new(Kind::Bug, "fault"))).is_err());
    }
}
