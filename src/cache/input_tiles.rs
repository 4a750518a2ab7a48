//! The store of tiles of each input: that of an earlier run where it is valid, else a new one.

use super::digests::Digests;
use super::file_digests::Pace;
use super::key::Key;
use super::output::settle_folder;
use crate::engine::{Engine, Task};
use crate::io::read_parts::InputReader;
use crate::job::Means;
use crate::store::{Scatter, Store, TileSink};
use contract::{Error, Input, Kind, Result, Weigh};
use export::atomic;
use ingest::{Sources, Want};
use std::cell::Cell;
use std::path::{Path, PathBuf};

/// Prefix of the folder of a store that is being filled; the number of its input and a word of the
/// process follow.
const NEW: &str = "new-";

/// Job, engine and folders for filling the stores of inputs.
pub(crate) struct InputTiles<'a> {
    sources: &'a Sources,
    means: &'a Means,
    /// Folder of all stores, each in a subfolder named by its key.
    folder: PathBuf,
    engine: &'a Engine,
    /// Number of inputs whose tiles were used again, and of all inputs.
    n_kept: Cell<[usize; 2]>,
}

impl<'a> InputTiles<'a> {
    pub(crate) fn new(
        sources: &'a Sources,
        means: &'a Means,
        folder: PathBuf,
        engine: &'a Engine,
    ) -> Self {
        Self { sources, means, folder, engine, n_kept: Cell::default() }
    }

    /// Number of inputs whose tiles were used again, and of all inputs.
    pub(crate) fn n_kept(&self) -> [usize; 2] {
        self.n_kept.get()
    }

    /// Keys of the tiles of some inputs, and one store of all.
    pub(crate) fn of_all(&self, inputs: &[Input], digests: &Digests) -> Result<(Vec<Key>, Store)> {
        let filled = inputs.iter().map(|input| self.of_one(input, digests));
        let (keys, stores): (Vec<Key>, Vec<Store>) = filled.collect::<Result<_>>()?;
        Ok((keys, Store::join(stores)))
    }

    /// Key and store of one input. A store that opens is used again; a damaged one is made anew.
    pub(crate) fn of_one(&self, input: &Input, digests: &Digests) -> Result<(Key, Store)> {
        let scans = &self.sources.scans;
        let first = scans.iter().find(|s| s.input == input.id).map_or(0, |s| s.id.0);
        let resident_bytes = self.means.store_bytes() / self.sources.inputs.len().max(1);
        let key = || digests.tiles_key(input, scans, &self.means.settings);
        let [n_kept, n] = self.n_kept.get();
        self.n_kept.set([n_kept, n + 1]);
        let open = |key: &Key| Store::open(&self.folder.join(key.name()), first, resident_bytes);
        if let Some((key, Ok(store))) = key().map(|key| (key.clone(), open(&key))) {
            self.n_kept.set([n_kept + 1, n + 1]);
            return Ok((key, store));
        }
        let prefix = format!("{NEW}{}-", input.id.0);
        let new = self.folder.join(format!("{prefix}{}", atomic::own_word()));
        let filled = self.fill(&new, input, first, resident_bytes, digests);
        if let Err(error) = filled {
            let _ = std::fs::remove_dir_all(&new);
            return Err(error);
        }
        let key = key().ok_or_else(|| Error::new(Kind::Bug, "an input was not read"))?;
        let is_whole = |place: &Path| Store::open(place, first, resident_bytes).is_ok();
        settle_folder(&new, &self.folder.join(key.name()), &prefix, is_whole)?;
        Ok((key.clone(), open(&key)?))
    }

    /// Reads an input into a new store, and digests it at the same time where its digest is not
    /// known.
    fn fill(
        &self,
        dir: &Path,
        input: &Input,
        first: u32,
        resident_bytes: usize,
        digests: &Digests,
    ) -> Result<()> {
        let scans = &self.sources.scans;
        let mut sink = TileSink::create(dir, scans, first, self.means.ingest_bytes())?;
        let scatter = Scatter::new(scans);
        let reading = InputReader { sources: self.sources, input, want: Want::Coordinates };
        let amount = reading.amount();
        let pace = Pace::of(amount.points);
        let lead = pace.lead();
        let mut tree = digests.tree(input).filter(|_| self.sources.file(input.id).is_some());
        let ingest = || {
            let task = Task::new("ingest").of(amount);
            reading.each(task, &scatter, tree.as_mut(), self.engine, |strip| {
                lead.has_decoded(strip.n_points());
                sink.add(&strip)
            })?;
            lead.end();
            tree.take().map_or(Ok(()), |tree| digests.take(input, tree))
        };
        if digests.input(input).is_some() || self.sources.file(input.id).is_some() {
            ingest()?;
        } else {
            self.engine.join("digest", || digests.read(input, &pace), ingest)?;
        }
        digests.check(input)?;
        sink.finish(self.engine, resident_bytes).map(drop)
    }
}
