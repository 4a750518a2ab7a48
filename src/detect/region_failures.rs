//! Handles regions whose search fails by a fault of the program: with `--keep-going` the failure
//! becomes a message and the other regions are kept.

use crate::engine::guarded;
use crate::job::Job;
use contract::{Kind, Region, Result};
use std::collections::BTreeMap;
use std::sync::Mutex;

/// Messages about failed regions, by their position.
pub(crate) struct RegionFailures {
    is_forgiving: bool,
    list: Mutex<BTreeMap<String, String>>,
}

impl RegionFailures {
    pub(crate) fn of(job: &Job) -> Self {
        Self { is_forgiving: job.keep_going, list: Mutex::default() }
    }

    /// Counts these regions as failed before: their messages, by region.
    #[must_use]
    pub(crate) fn with(self, known: &BTreeMap<String, String>) -> Self {
        Self { list: Mutex::new(known.clone()), ..self }
    }

    /// The message about a region that failed.
    pub(crate) fn message(region: &Region, error: &impl std::fmt::Display) -> String {
        let [x, y, z] = region.world_bounds().center().coords.into();
        format!(
            "the search for robots near ({x:.1}, {y:.1}, {z:.1}) m failed and was left out: {error}"
        )
    }

    /// Runs `work` for a region. If it fails by a fault of the program and the job keeps going, the
    /// failure is recorded and the default value is returned.
    pub(crate) fn spare<T: Default>(
        &self,
        region: &Region,
        work: impl FnOnce() -> Result<T>,
    ) -> Result<T> {
        if !self.is_forgiving {
            return work();
        }
        let list = || self.list.lock().expect("nobody panics while he holds the list");
        let name = format!("{region:?}");
        if list().contains_key(&name) {
            return Ok(T::default());
        }
        match guarded("fit", 0, work) {
            Err(error) if error.kind() == Kind::Bug => {
                list().insert(name, Self::message(region, &error));
                Ok(T::default())
            }
            done => done,
        }
    }

    /// Messages about everything that was left out, in the order of inputs and positions.
    pub(crate) fn messages(self, job: &Job) -> Vec<String> {
        let list = self.list.into_inner().unwrap_or_default();
        job.left_out.iter().cloned().chain(list.into_values()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::{FlagValues, Means};
    use contract::Error;
    use geometry::{Aabb, Point};

    fn job(keep_going: bool) -> Job {
        let means = Means::of(&FlagValues::default()).expect("defaults");
        let inputs = vec!["a/one.e57".into(), "a/two.e57".into()];
        Job { keep_going, ..Job::new(inputs, "r".into(), "o".into(), means) }
    }

    #[test]
    fn a_fault_in_one_region_is_named_and_the_others_count() {
        let region = Region {
            origin: Point::new(4.0, 0.0, 0.0),
            bounds: Aabb { min: [-1.0; 3], max: [1.0; 3] },
        };
        let failures = RegionFailures::of(&job(true));
        let none: Vec<u8> = failures.spare(&region, || panic!("a fault")).expect("forgiven");
        assert!(none.is_empty());
        let again: Vec<u8> = failures.spare(&region, || Ok(vec![1])).expect("left out");
        assert!(again.is_empty());
        let other = Region { origin: Point::new(9.0, 0.0, 0.0), ..region };
        assert!(failures.spare(&other, || Err::<u8, _>(Error::new(Kind::Io, "disk"))).is_err());
        let said = failures.messages(&job(true));
        assert!(said.len() == 1 && said[0].contains("(4.0, 0.0, 0.0)"), "{said:?}");
        let strict = RegionFailures::of(&job(false));
        assert!(strict.spare(&region, || Err::<u8, _>(Error::new(Kind::Bug, "fault"))).is_err());
    }
}
