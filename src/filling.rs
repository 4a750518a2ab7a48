//! An input in, the store of its tiles out: the one that is there from an earlier run, or a new one.

use crate::engine::{Engine, Task};
use crate::job::Means;
use crate::reuse::Key;
use crate::store::{Scatter, Store};
use contract::{Input, Result};
use ingest::{Sources, Want};
use std::cell::Cell;
use std::path::PathBuf;

/// What filling stores takes.
pub(crate) struct Filling<'a> {
    sources: &'a Sources,
    means: &'a Means,
    /// Where stores lie, each in a folder with the name of its key.
    folder: PathBuf,
    engine: &'a Engine,
    /// Inputs whose tiles were there, and all that were asked for.
    n_kept: Cell<[usize; 2]>,
}

impl<'a> Filling<'a> {
    pub(crate) fn new(
        sources: &'a Sources,
        means: &'a Means,
        folder: PathBuf,
        engine: &'a Engine,
    ) -> Self {
        Self { sources, means, folder, engine, n_kept: Cell::default() }
    }

    /// Inputs whose tiles were there, of all that were asked for.
    pub(crate) fn n_kept(&self) -> [usize; 2] {
        self.n_kept.get()
    }

    /// The tiles of one input. A store that is there and whole is believed; one that is damaged is made again.
    pub(crate) fn tiles_of(&self, input: &Input, key: &Key) -> Result<Store> {
        let scans = &self.sources.scans;
        let first = scans.iter().find(|s| s.input == input.id).map_or(0, |s| s.id.0);
        let n_inputs = self.sources.inputs.len();
        let resident_bytes = self.means.store_bytes() / n_inputs.max(1);
        let dir = self.folder.join(key.name());
        let [n_kept, n] = self.n_kept.get();
        self.n_kept.set([n_kept, n + 1]);
        if let Ok(store) = Store::open(&dir, first, resident_bytes) {
            self.n_kept.set([n_kept + 1, n + 1]);
            return Ok(store);
        }
        let scatter = Scatter::new(scans);
        let mut sink = Store::create(&dir, scans, first, self.means.ingest_bytes())?;
        let task = Task::new("ingest").of(crate::report::amount(self.sources, input.id));
        let strips = self.sources.strips(input.id, Want::Coordinates)?;
        self.engine.pass(task, strips, |f| f.map(&scatter).for_each(|s| sink.add(&s)))?;
        sink.finish(self.engine, resident_bytes)
    }
}
