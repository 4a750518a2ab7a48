//! A job in; digests of all files that it reads, and keys of the pieces that are made from them,
//! out.

use super::file_digests::{Algorithm, FileDigests, Pace, Stamp};
use super::key::Key;
use super::manifest;
use super::manifest::Manifest;
use super::output::OutputDir;
use crate::engine::Engine;
use crate::io::hash_tree::HashTree;
use crate::job::{Job, Settings};
use contract::{Error, Input, Kind, Result, Scan};
use std::fmt::Debug;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// Digests of all that a run reads.
pub(crate) struct Digests {
    contents: FileDigests,
    /// Of each input; one that nobody has ever read gets its digest while it is decoded.
    inputs: Vec<OnceLock<String>>,
    /// Places of inputs, and what they were before anything of them was read.
    files: Vec<(PathBuf, Stamp)>,
    library: String,
    others: String,
    /// Number of the first input: those before it were read by an earlier run.
    first: usize,
    /// Digest of the result that this run goes on from, and what is asked of it.
    base: String,
}

impl Digests {
    /// Reads every file of the job once, except those that are known and unchanged since, and
    /// inputs that are new.
    pub(crate) fn of(job: &Job, output: &OutputDir, engine: &Engine) -> Result<Self> {
        let contents = FileDigests::open(output.store());
        let stamped = |path: &PathBuf| Ok((path.clone(), Stamp::of(path)?));
        let files = job.inputs.iter().map(stamped).collect::<Result<_>>()?;
        let digest = |path: &PathBuf| -> Result<OnceLock<String>> {
            let is_new =
                contents.known(path, Algorithm::Blake3)?.is_none() && !contents.may_know(path)?;
            Ok(if is_new {
                OnceLock::new()
            } else {
                OnceLock::from(contents.digest(path, Algorithm::Blake3)?)
            })
        };
        let inputs = engine.fan_out("digest", job.inputs.iter().collect(), digest)?;
        let library = contents.folder(&job.robots)?;
        let others = job.scanners.iter().chain(&job.review);
        let others: Vec<String> =
            others.map(|p| contents.digest(p, Algorithm::Blake3)).collect::<Result<_>>()?;
        contents.keep()?;
        let (others, base) = (others.join(" "), String::new());
        Ok(Self { contents, inputs, files, library, others, first: 0, base })
    }

    /// The same for a run that goes on from a result with this digest, and so many inputs.
    #[must_use]
    pub(crate) fn after(self, first: usize, base: String) -> Self {
        Self { first, base, ..self }
    }

    fn at(&self, input: &Input) -> usize {
        input.id.0 as usize - self.first
    }

    /// Digest of an input's bytes, where it is known yet.
    pub(crate) fn input(&self, input: &Input) -> Option<&str> {
        self.inputs[self.at(input)].get().map(String::as_str)
    }

    /// Reads an input whose digest is not known, beside the one who decodes it and tells how far he
    /// is.
    pub(crate) fn read(&self, input: &Input, pace: &Pace) -> Result<()> {
        let at = self.at(input);
        let digest = self.contents.read(&self.files[at].0, Algorithm::Blake3, pace)?;
        let _ = self.inputs[at].set(digest);
        self.contents.keep()
    }

    /// The tree of an input whose digest is not known, for who reads it in pieces.
    pub(crate) fn tree(&self, input: &Input) -> Option<HashTree> {
        self.input(input).is_none().then(|| HashTree::new(self.files[self.at(input)].1.n_bytes()))
    }

    /// Takes what an input came to that was read in pieces.
    pub(crate) fn take(&self, input: &Input, tree: HashTree) -> Result<()> {
        let at = self.at(input);
        let (path, stamp) = &self.files[at];
        let digest =
            tree.finish().ok_or_else(|| Error::new(Kind::Bug, "a file was not summed up"))?;
        let digest = Algorithm::Blake3.word(&digest.to_hex());
        self.contents.take(path, *stamp, &digest)?;
        let _ = self.inputs[at].set(digest);
        self.contents.keep()
    }

    /// Refuses an input that is not the one any more that the run began with: what was read of it
    /// may be of either.
    pub(crate) fn check(&self, input: &Input) -> Result<()> {
        let (path, stamp) = &self.files[self.at(input)];
        stamp.check(path)
    }

    /// The list of an earlier run, if it was of the same job and its files are what they were.
    pub(crate) fn unchanged(&self, job: &Job, output: &OutputDir) -> Result<Option<Manifest>> {
        let key = self.whole(job);
        key.map_or(Ok(None), |key| manifest::unchanged(&self.contents, output.out(), &key))
    }

    /// Remembers outputs as they were written, so that the next run need not read them to see that
    /// nothing has changed.
    pub(crate) fn remember(&self, manifest: &Manifest, out: &Path) -> Result<()> {
        for file in &manifest.files {
            self.contents.believe(&out.join(&file.path), &file.digest)?;
        }
        self.contents.keep()
    }

    /// The tiles of one input, where its digest is known yet.
    pub(crate) fn tiles(&self, input: &Input, scans: &[Scan], settings: &Settings) -> Option<Key> {
        let own = scans.iter().filter(|s| s.input == input.id);
        let own = own.map(|s| words(&(s.source_id, s.world_from_scan, s.lattice)));
        let own: Vec<String> = own.collect();
        Some(Key::of("tiles", &[self.input(input)?, &own.join("\n"), &words(&settings.ingest)]))
    }

    /// Floor, planes and occupied space of a plant whose tiles have these names.
    pub(crate) fn ground(&self, tiles: &[Key], settings: &Settings) -> Key {
        Key::of("ground", &[&words(&tiles), &words(&(&settings.lattice, &settings.floor))])
    }

    /// Fits of the regions of a plant whose tiles have these names.
    pub(crate) fn fits(&self, tiles: &[Key], settings: &Settings) -> Key {
        let s = settings;
        let ground = words(&(&s.lattice, &s.floor, &s.cluster, &s.region));
        let search = words(&(&s.view, &s.base_search, &s.method, &s.fit, &s.paper, &s.robot));
        Key::of("fits", &[&words(&tiles), &self.library, &ground, &search])
    }

    /// Models of the library, as they are loaded with these settings.
    pub(crate) fn models(&self, settings: &Settings) -> Key {
        Key::of("models", &[&self.library, &words(&settings.robot)])
    }

    /// All that a job writes, where the digests of all inputs are known yet. Names of files are
    /// part of it: results name their inputs.
    pub(crate) fn whole(&self, job: &Job) -> Option<Key> {
        let names: Vec<_> = job.inputs.iter().map(|p| p.display().to_string()).collect();
        let digests: Option<Vec<&String>> = self.inputs.iter().map(OnceLock::get).collect();
        let inputs = words(&(&names, digests?));
        let settings = words(&(&job.means.settings, job.keep_going, &job.left_out));
        Some(Key::of("run", &[&inputs, &self.library, &self.others, &self.base, &settings]))
    }
}

/// Values as they print: floats print so that they read back the same.
fn words(value: &impl Debug) -> String {
    format!("{value:?}")
}
