//! Digests of all files that a run reads, and the keys of the pieces that are computed from them.

use super::file_digests::{Algorithm, FileDigests, Pace, SETTLED, Stamp};
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

/// Digests of all files that a run reads.
pub(crate) struct Digests {
    contents: FileDigests,
    /// Digest of each input; that of a new input is set when it is decoded.
    inputs: Vec<OnceLock<String>>,
    /// Paths of the inputs, and their stamps from before anything of them was read.
    files: Vec<(PathBuf, Stamp)>,
    library: String,
    others: String,
    /// Number of the first input; inputs before it were read by an earlier run.
    first: usize,
    /// Digest of the earlier result that this run starts from, and of the arguments of the rescan.
    base: String,
}

impl Digests {
    /// Reads every file of the job once, except files that are known and unchanged, and new inputs,
    /// which are digested while they are decoded.
    pub(crate) fn of(job: &Job, output: &OutputDir, engine: &Engine) -> Result<Self> {
        let is_shared = output.is_shared();
        let contents =
            if is_shared { FileDigests::open_shared } else { FileDigests::open }(output.store());
        let stamped = |path: &PathBuf| Ok((path.clone(), Stamp::of(path)?));
        let files = job.inputs.iter().map(stamped).collect::<Result<_>>()?;
        let digest = |path: &PathBuf| -> Result<OnceLock<String>> {
            // Each of many processes would read all inputs that are perhaps known.
            let is_new = contents.known(path, Algorithm::Blake3)?.is_none()
                && (is_shared || !contents.may_know(path)?);
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

    /// The same digests for a run that starts from a result with the digest `base` and `first`
    /// inputs.
    #[must_use]
    pub(crate) fn after(self, first: usize, base: String) -> Self {
        Self { first, base, ..self }
    }

    fn at(&self, input: &Input) -> usize {
        input.id.0 as usize - self.first
    }

    /// Digest of an input's bytes; `None` while it is not known.
    pub(crate) fn input(&self, input: &Input) -> Option<&str> {
        self.inputs[self.at(input)].get().map(String::as_str)
    }

    /// Reads an input to compute its digest, at the pace of the thread that decodes it.
    pub(crate) fn read(&self, input: &Input, pace: &Pace) -> Result<()> {
        let at = self.at(input);
        let digest = self.contents.read(&self.files[at].0, Algorithm::Blake3, pace)?;
        let _ = self.inputs[at].set(digest);
        self.contents.keep()
    }

    /// The hash tree for an input whose digest is not known and that is read in pieces.
    pub(crate) fn tree(&self, input: &Input) -> Option<HashTree> {
        self.input(input).is_none().then(|| HashTree::new(self.files[self.at(input)].1.n_bytes()))
    }

    /// Sets the digest of an input that was read in pieces.
    pub(crate) fn take(&self, input: &Input, tree: HashTree) -> Result<()> {
        let at = self.at(input);
        let (path, stamp) = &self.files[at];
        let digest = tree.finish().ok_or_else(|| {
            Error::new(Kind::Bug, "an input was read in pieces, but not all of them were digested")
        })?;
        let digest = Algorithm::Blake3.word(&digest.to_hex());
        self.contents.take(path, *stamp, &digest)?;
        let _ = self.inputs[at].set(digest);
        self.contents.keep()
    }

    /// Refuses an input that was changed since the run began: what was read of it may mix both
    /// versions.
    pub(crate) fn check(&self, input: &Input) -> Result<()> {
        let (path, stamp) = &self.files[self.at(input)];
        stamp.check(path)
    }

    /// The manifest of an earlier run, if that run had the same job and its files are unchanged.
    pub(crate) fn unchanged(&self, job: &Job, output: &OutputDir) -> Result<Option<Manifest>> {
        let key = self.result_key(job);
        key.map_or(Ok(None), |key| manifest::unchanged(&self.contents, output.out(), &key))
    }

    /// Records stamps and digests of the outputs, so that the next run can tell that they are
    /// unchanged without reading them.
    pub(crate) fn remember(&self, manifest: &Manifest, out: &Path) -> Result<()> {
        for file in &manifest.files {
            self.contents.believe(&out.join(&file.path), &file.digest)?;
        }
        self.contents.keep()
    }

    /// Key of the tiles of one input; `None` while its digest is not known.
    pub(crate) fn tiles_key(
        &self,
        input: &Input,
        scans: &[Scan],
        settings: &Settings,
    ) -> Option<Key> {
        let own = scans.iter().filter(|s| s.input == input.id);
        let own =
            own.map(|s| words(&(s.source_id, &s.places, &s.raster, s.world_from_scan, s.lattice)));
        let own: Vec<String> = own.collect();
        Some(Key::of("tiles", &[self.input(input)?, &own.join("\n"), &words(&settings.ingest)]))
    }

    /// Key of floor, planes and occupied space of a plant with these tiles.
    pub(crate) fn ground_key(&self, tiles: &[Key], settings: &Settings) -> Key {
        Key::of("ground", &[&words(&tiles), &words(&(&settings.lattice, &settings.floor))])
    }

    /// Key of the fits of all regions of a plant with these tiles.
    pub(crate) fn fits_key(&self, tiles: &[Key], settings: &Settings) -> Key {
        let s = settings;
        let ground = words(&(&s.lattice, &s.floor, &s.cluster, &s.region));
        let search = words(&(&s.view, &s.base_search, &s.method, &s.fit, &s.paper, &s.robot));
        Key::of("fits", &[&words(&tiles), &self.library, &ground, &search])
    }

    /// Key of what one input adds to floor, planes and occupied space.
    pub(crate) fn ground_part_key(
        &self,
        input: &Input,
        scans: &[Scan],
        settings: &Settings,
    ) -> Option<Key> {
        let tiles = self.tiles_key(input, scans, settings)?;
        let stages = words(&(&settings.lattice, &settings.floor));
        Some(Key::of("ground part", &[tiles.name(), &words(&(input.id, scans)), &stages]))
    }

    /// Key of the chosen robots and of all that follows from them: known space and labels. Regions
    /// that were left out are part of it.
    pub(crate) fn robots_key(
        &self,
        tiles: &[Key],
        settings: &Settings,
        left_out: &impl Debug,
    ) -> Key {
        let fits = self.fits_key(tiles, settings);
        Key::of("chosen", &[fits.name(), &self.others, &words(&(settings, left_out))])
    }

    /// Key of the labels of one input of a plant with these robots.
    pub(crate) fn labels_key(robots: &Key, input: &Input) -> Key {
        Key::of("labels", &[robots.name(), &words(&input.id)])
    }

    /// Key of a group of files of the result with the robots of this key.
    pub(crate) fn files_key(robots: &Key, group: &impl Debug) -> Key {
        Key::of("files", &[robots.name(), &words(group)])
    }

    /// Identity of a shard: it stays the same while the job and its files do. Contents of inputs
    /// are not part of it, since it is known before they are read.
    pub(crate) fn shard_key(&self, job: &Job, kind: &str, of: &impl Debug) -> Key {
        let job = words(&(&self.files, &job.inputs, &job.means.settings, job.keep_going));
        Key::of("shard", &[&job, &self.library, &self.others, kind, &words(of)])
    }

    /// Key of what samples tell of the input at this position, whose content need not be known.
    pub(crate) fn look_key(&self, at: usize, settings: &Settings) -> Key {
        let file = words(&self.files[at]);
        Key::of("look", &[&file, &self.others, &words(&settings.ingest)])
    }

    /// Key of what samples tell of all inputs together.
    pub(crate) fn looks_key(&self, settings: &Settings) -> Key {
        Key::of("looks", &[&words(&self.files), &self.others, &words(&settings.ingest)])
    }

    /// Waits until the modification time of each input is old enough to tell of later changes.
    pub(crate) fn settle(&self) {
        let is_young = |(_, stamp): &(PathBuf, Stamp)| !stamp.is_settled();
        if self.files.iter().any(is_young) {
            std::thread::sleep(SETTLED);
        }
    }

    /// Key of the models of the library as they are loaded with these settings.
    pub(crate) fn models_key(&self, settings: &Settings) -> Key {
        Key::of("models", &[&self.library, &words(&settings.robot)])
    }

    /// Key of the whole result of a job; `None` while an input's digest is not known. File names
    /// are part of it, since results name their inputs.
    pub(crate) fn result_key(&self, job: &Job) -> Option<Key> {
        let names: Vec<_> = job.inputs.iter().map(|p| p.display().to_string()).collect();
        let digests: Option<Vec<&String>> = self.inputs.iter().map(OnceLock::get).collect();
        let inputs = words(&(&names, digests?));
        let settings =
            words(&(&job.means.settings, job.keep_going, &job.left_out, job.find_scanners));
        Some(Key::of("run", &[&inputs, &self.library, &self.others, &self.base, &settings]))
    }
}

/// Values in debug format, in which floats read back to the same bits.
fn words(value: &impl Debug) -> String {
    format!("{value:?}")
}
