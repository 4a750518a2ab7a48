//! What samples of inputs have told, as pieces of the store: processes that do a job together
//! sample each input once.

use super::digests::Digests;
use super::pieces::Cache;
use crate::job::Settings;
use ingest::{InputLooks, KeepLooks};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::path::PathBuf;

/// Names of the pieces.
const LOOK: &str = "look";
const SCANNERS: &str = "scanners";

/// The pieces of the inputs of a job.
pub(crate) struct KeptLooks<'a> {
    pub(crate) digests: &'a Digests,
    pub(crate) settings: &'a Settings,
    pub(crate) folder: PathBuf,
}

impl KeptLooks<'_> {
    fn of(&self, at: usize) -> Cache {
        Cache::new(self.folder.clone(), self.digests.look_key(at, self.settings))
    }

    fn of_all(&self) -> Cache {
        Cache::new(self.folder.clone(), self.digests.looks_key(self.settings))
    }

    /// What was found of the scanners of all inputs.
    pub(crate) fn scanners<T: DeserializeOwned>(&self) -> Option<T> {
        self.of_all().get(SCANNERS)
    }

    /// Keeps what was found of the scanners of all inputs. What cannot be kept is found again.
    pub(crate) fn keep_scanners(&self, found: &impl Serialize) {
        let _ = self.of_all().keep(SCANNERS, found);
    }
}

impl KeepLooks for KeptLooks<'_> {
    fn known(&self, at: usize) -> Option<InputLooks> {
        self.of(at).get(LOOK)
    }

    fn keep(&self, at: usize, looks: &InputLooks) {
        let _ = self.of(at).keep(LOOK, looks);
    }
}
