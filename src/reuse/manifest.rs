//! What a run has written in, the list of it out (`manifest.json`); and that list again in, what is missing or changed out.
//!
//! Outputs are written beside the old ones and take their places together: the list is the last to be written there and
//! the last to move, so that a run that is cut short while they move is finished by the next one.

use super::contents::{Algorithm, Contents, walk};
use crate::engine::Engine;
use crate::job::Outcome;
use contract::{Error, Kind, Result};
use export::FileSum;
use export::atomic;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Name of the list.
const LIST: &str = "manifest.json";
/// The file that vouches for all others: it goes first and comes last.
const RESULT: &str = "result.json";
/// Where files lie that are made of a result afterwards; the list does not name them.
pub(crate) const EXPORT: &str = "export";
/// What the list's format is called.
const SCHEMA: &str = "stillpoint.manifest/1";

/// All that a run has written, and what it was made from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Name and version of this format.
    pub schema: String,
    /// Digest of inputs, library, settings and program.
    pub key: String,
    /// What people read at the end of the run.
    pub summary: String,
    /// What the run warned of.
    pub warnings: Vec<String>,
    /// Whether something was skipped or refused.
    pub partial: bool,
    /// Files but this one, by name.
    pub files: Vec<OutputFile>,
}

/// One file of a result.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct OutputFile {
    /// Relative to the output folder, with `/`.
    pub path: String,
    /// Its length.
    pub n_bytes: u64,
    /// BLAKE3 of its bytes.
    pub digest: String,
}

/// What a look at a result's files finds.
#[derive(Debug, Clone, PartialEq)]
pub struct Checked {
    /// The list.
    pub manifest: Manifest,
    /// Files that are missing or not what they were, in words.
    pub wrong: Vec<String>,
}

impl OutputFile {
    /// A file below `next` whose checksum was taken while it was written.
    pub(crate) fn of(next: &Path, sum: &FileSum) -> Self {
        let (path, n_bytes) = (name(next, &sum.path), sum.n_bytes);
        Self { path, n_bytes, digest: Algorithm::Crc32c.word(&format!("{:08x}", sum.crc32c)) }
    }
}

impl Manifest {
    /// The list of an output folder.
    ///
    /// # Errors
    /// There is none, or it cannot be read.
    pub fn read(out: &Path) -> Result<Self> {
        let path = out.join(LIST);
        let text = std::fs::read_to_string(&path).map_err(|e| {
            let hint = "give the --out folder of a run that has ended";
            Error::bad_input("this is no result: it has no list of its files")
                .because(e)
                .hint(hint)
                .at(path.display())
        })?;
        let broken = |what: &str| Error::bad_input(what.to_owned()).at(path.display());
        let manifest: Self = serde_json::from_str(&text)
            .map_err(|e| broken("the list of files cannot be read").because(e))?;
        let is_inside = |file: &OutputFile| {
            let parts = Path::new(&file.path).components();
            parts.into_iter().all(|part| matches!(part, std::path::Component::Normal(_)))
        };
        match manifest.files.iter().find(|file| !is_inside(file)) {
            None => Ok(manifest),
            Some(file) => {
                Err(broken("the list names a file outside of its folder")
                    .because(file.path.clone()))
            }
        }
    }

    /// Digest of the list of an output folder: it names every byte of the result.
    pub(crate) fn digest(out: &Path) -> Result<String> {
        Algorithm::Blake3.read(&out.join(LIST))
    }

    /// Lists what lies in `next`, files that are known as they are `known`, and writes the list there.
    pub(crate) fn write(
        next: &Path,
        key: Option<super::Key>,
        (outcome, known): (&Outcome, Vec<OutputFile>),
        engine: &Engine,
    ) -> Result<Self> {
        let key = key.ok_or_else(|| Error::new(Kind::Bug, "an input has no digest"))?;
        let mut paths = Vec::new();
        walk(next, &mut paths)?;
        paths.sort();
        let known: HashMap<&str, &OutputFile> =
            known.iter().map(|f| (f.path.as_str(), f)).collect();
        let files = engine.fan_out("list", paths, |path| {
            let listed = known.get(name(next, &path).as_str()).map(|file| (*file).clone());
            listed.map_or_else(|| output(next, &path, Algorithm::Blake3), Ok)
        })?;
        let manifest = Self {
            schema: SCHEMA.into(),
            key: key.name().into(),
            summary: outcome.summary.clone(),
            warnings: outcome.warnings.clone(),
            partial: outcome.partial,
            files,
        };
        let text = serde_json::to_string_pretty(&manifest)
            .map_err(|e| Error::new(Kind::Bug, "the list of files cannot be written").because(e))?;
        atomic::write(&next.join(LIST), text.as_bytes())?;
        Ok(manifest)
    }

    /// Moves what lies in `next`, as its list says, to `out`, and takes away what only the old list of `out` names. May be
    /// cut short anywhere and done again.
    pub(crate) fn publish(next: &Path, out: &Path) -> Result<Self> {
        let manifest = Self::read(next)?;
        let old = Self::read(out).map(|old| old.files).unwrap_or_default();
        // Where it has moved already, all but the list has: a run was cut short between the two.
        if next.join(RESULT).exists() {
            remove(&out.join(RESULT))?;
        }
        for file in &manifest.files {
            if file.path != RESULT {
                shift(&next.join(&file.path), &out.join(&file.path))?;
            }
        }
        let stays = |path: &str| manifest.files.iter().any(|file| file.path == path);
        for file in old.iter().filter(|file| !stays(&file.path)) {
            remove(&out.join(&file.path))?;
        }
        forget_exports(out);
        shift(&next.join(RESULT), &out.join(RESULT))?;
        shift(&next.join(LIST), &out.join(LIST))?;
        // Empty folders; where they stay the next run takes them away.
        let _ = std::fs::remove_dir_all(next);
        Ok(manifest)
    }

    /// Whether a list lies in `next`: all of it is written, and some of it may have moved.
    pub(crate) fn waits(next: &Path) -> bool {
        next.join(LIST).is_file()
    }

    /// The outcome of the run that wrote it.
    pub(crate) fn outcome(&self) -> Outcome {
        Outcome {
            summary: self.summary.clone(),
            warnings: self.warnings.clone(),
            partial: self.partial,
            reused: vec![
                "everything: neither inputs, library, settings nor program have changed".into(),
            ],
        }
    }
}

/// Takes away what was made of the result that was there; nothing else that lies beside it. What cannot be taken away must not keep a
/// result that is whole from its place.
fn forget_exports(out: &Path) {
    let folder = out.join(EXPORT);
    for name in crate::conversion::names() {
        let _ = std::fs::remove_file(folder.join(name));
    }
    let _ = std::fs::remove_dir(folder);
}

/// Whether the files of a result are what they were when they were written; all of them are read.
///
/// # Errors
/// There is no list.
pub fn check(out: &Path, engine: &Engine) -> Result<Checked> {
    let manifest = Manifest::read(out)?;
    let look = |file: &OutputFile| -> Result<Option<String>> {
        let path = out.join(&file.path);
        let Some(algorithm) = Algorithm::of(&file.digest) else {
            return Ok(Some(format!(
                "{}: its checksum is of no kind that is known",
                path.display()
            )));
        };
        Ok(match output(out, &path, algorithm) {
            Ok(now) if now == *file => None,
            Ok(now) if now.n_bytes != file.n_bytes => Some(format!(
                "{}: {} bytes long, not {}",
                path.display(),
                now.n_bytes,
                file.n_bytes
            )),
            Ok(_) => Some(format!("{}: its bytes are not those that were written", path.display())),
            Err(e) => Some(format!("{e}")),
        })
    };
    let wrong = engine.fan_out("verify", manifest.files.iter().collect(), look)?;
    Ok(Checked { manifest, wrong: wrong.into_iter().flatten().collect() })
}

/// The list of `out`, if it is of `key` and every file is what it was, as far as lengths, times and known digests tell.
pub(super) fn unchanged(
    contents: &Contents,
    out: &Path,
    key: &super::Key,
) -> Result<Option<Manifest>> {
    let Ok(manifest) = Manifest::read(out) else { return Ok(None) };
    if manifest.key != key.name() {
        return Ok(None);
    }
    let same = |file: &OutputFile| {
        let path = out.join(&file.path);
        let now = Algorithm::of(&file.digest).map(|algorithm| contents.digest(&path, algorithm));
        now.is_some_and(|digest| digest.is_ok_and(|digest| digest == file.digest))
    };
    let all = manifest.files.iter().all(same);
    contents.keep()?;
    Ok(all.then_some(manifest))
}

fn output(root: &Path, path: &Path, algorithm: Algorithm) -> Result<OutputFile> {
    let failed = |e: std::io::Error| Error::from(e).at(path.display());
    let n_bytes = std::fs::metadata(path).map_err(failed)?.len();
    Ok(OutputFile { path: name(root, path), n_bytes, digest: algorithm.read(path)? })
}

/// Path within the folder, with `/` on every system.
fn name(root: &Path, path: &Path) -> String {
    let parts = path.strip_prefix(root).unwrap_or(path).components();
    let parts: Vec<String> =
        parts.map(|part| part.as_os_str().to_string_lossy().into_owned()).collect();
    parts.join("/")
}

/// Moves a file unless it has moved already.
fn shift(from: &Path, to: &Path) -> Result<()> {
    if !from.exists() && to.exists() {
        return Ok(());
    }
    let made = to.parent().map_or(Ok(()), std::fs::create_dir_all);
    made.and_then(|()| std::fs::rename(from, to)).map_err(|e| {
        Error::new(Kind::Io, "a finished file cannot be moved to its place")
            .because(e)
            .hint("make the folder writable and start the same run again: it goes on from here")
            .at(to.display())
    })
}

fn remove(path: &PathBuf) -> Result<()> {
    match std::fs::remove_file(path) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => {
            Err(Error::from(e).at(path.display()))
        }
        _ => Ok(()),
    }
}
