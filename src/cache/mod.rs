//! What a run is made from in, names for its pieces out: a piece whose name is there already need
//! not be made again.
//!
//! A key is a digest of all that a piece depends on: contents of files, settings, the program
//! itself. Places, times and the number of threads are no part of it. A piece is looked at before
//! it is believed: a store has its catalogue, kept fits their checksum, outputs their length and
//! time.

pub(crate) mod file_digests;
pub(crate) mod input_tiles;
pub(crate) mod manifest;
pub(crate) mod output;
pub(crate) mod pieces;
pub(crate) mod verified;

pub use manifest::{Checked, Manifest, OutputFile, check};
pub use output::OutputDir;

use crate::engine::Engine;
use crate::io::hash_tree::Tree;
use crate::job::{Job, Outcome, Settings};
use contract::{Error, Input, Kind, Result, Scan};
use file_digests::{Algorithm, Contents, Stamp};
use serde::{Deserialize, Serialize};
use std::fmt::Debug;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

pub(crate) use file_digests::Pace;
pub(crate) use manifest::EXPORT;
#[cfg(fuzzing)]
pub(crate) use manifest::sealed;
pub(crate) use pieces::{Cache, read, written};
pub(crate) use verified::{Vouched, result_of};

/// A digest of what a piece is made from, as 32 hexadecimal digits: the name of its file.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String")]
pub(crate) struct Key(String);

/// Digits of a key.
const KEY_DIGITS: usize = 32;

impl TryFrom<String> for Key {
    type Error = String;

    /// A key that is read from a file becomes the name of a folder: it has to be one.
    fn try_from(name: String) -> std::result::Result<Self, String> {
        let is_key = name.len() == KEY_DIGITS && name.bytes().all(|b| b.is_ascii_hexdigit());
        if is_key {
            Ok(Self(name))
        } else {
            Err("a key of a piece has 32 hexadecimal digits".into())
        }
    }
}

impl Key {
    /// Of a kind of piece and all that it depends on, part by part.
    pub(crate) fn of(kind: &str, parts: &[&str]) -> Self {
        let mut hasher = blake3::Hasher::new();
        for part in [kind, env!("STILLPOINT_CODE")].iter().chain(parts) {
            // The length before each part: no two lists of parts run into the same bytes.
            hasher.update(&(part.len() as u64).to_le_bytes());
            hasher.update(part.as_bytes());
        }
        Self(hasher.finalize().to_hex()[..KEY_DIGITS].into())
    }

    pub(crate) fn name(&self) -> &str {
        &self.0
    }
}

/// Digests of all that a run reads.
pub(crate) struct Digests {
    contents: Contents,
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

/// Gives a whole result, whose files lie beside the output folder, its place there, and remembers
/// what was read for it; what was taken away beside it, in words.
pub(crate) fn publish(
    job: &Job,
    (output, digests): (&OutputDir, &Digests),
    (outcome, files): (&Outcome, Vec<OutputFile>),
    engine: &Engine,
) -> Result<Vec<String>> {
    Manifest::write(output.next(), digests.whole(job), (outcome, files), engine)?;
    let (manifest, told) = Manifest::publish(output.next(), output.out())?;
    digests.remember(&manifest, output.out())?;
    Ok(told)
}

impl Digests {
    /// Reads every file of the job once, except those that are known and unchanged since, and
    /// inputs that are new.
    pub(crate) fn of(job: &Job, output: &OutputDir, engine: &Engine) -> Result<Self> {
        let contents = Contents::open(output.store());
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
    pub(crate) fn tree(&self, input: &Input) -> Option<Tree> {
        self.input(input).is_none().then(|| Tree::new(self.files[self.at(input)].1.n_bytes()))
    }

    /// Takes what an input came to that was read in pieces.
    pub(crate) fn take(&self, input: &Input, tree: Tree) -> Result<()> {
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
        let search = words(&(&s.view, &s.base_search, &s.fit, &s.paper, &s.robot));
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

/// What was kept of what was asked for, in words; nothing of what was all new.
pub(crate) fn said(pieces: &[(&str, [usize; 2])]) -> Vec<String> {
    let kept = pieces.iter().filter(|(_, [kept, _])| *kept > 0);
    kept.map(|(name, [kept, all])| format!("{name}: {kept} of {all}")).collect()
}

/// Removes what lies in a folder of pieces and is none of `used`.
pub(crate) fn prune(folder: &Path, used: &[String]) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        if !used.iter().any(|u| name.to_str().is_some_and(|n| n.starts_with(u.as_str()))) {
            let path = entry.path();
            // Only space is lost where it stays.
            let _ = if path.is_dir() {
                std::fs::remove_dir_all(&path)
            } else {
                std::fs::remove_file(&path)
            };
        }
    }
}
