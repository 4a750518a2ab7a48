//! What samples of inputs have told, as pieces of the store: processes that do a job together
//! sample each input once.

use super::digests::Digests;
use super::pieces::Cache;
use crate::job::Settings;
use ingest::{InputLooks, KeepLooks};
use std::path::PathBuf;

/// Name of each piece.
const LOOK: &str = "look";

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
}

impl KeepLooks for KeptLooks<'_> {
    fn known(&self, at: usize) -> Option<InputLooks> {
        self.of(at).get(LOOK)
    }

    fn keep(&self, at: usize, looks: &InputLooks) {
        let _ = self.of(at).keep(LOOK, looks);
    }
}
