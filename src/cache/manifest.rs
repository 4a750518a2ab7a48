//! What a run has written in, the list of it out (`manifest.json`); and that list again in, what is
//! missing or changed out.
//!
//! Outputs are written beside the old ones and take their places together: the list is the last to
//! be written there and the last to move, so that a run that is cut short while they move is
//! finished by the next one.

use super::file_digests::{Algorithm, FileDigests, walk};
use crate::engine::Engine;
use crate::io::own_paths::{is_own, without_links};
use crate::job::Outcome;
use contract::{Error, Kind, Result};
use export::{COPC, FileSum, PLY, atomic};
use geometry::Aabb;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};

/// Name of the list.
pub(super) const LIST: &str = "manifest.json";
/// The file that vouches for all others: it goes first and comes last.
pub(super) const RESULT: &str = "result.json";
/// Where files lie that are made of a result afterwards; the list does not name them.
pub(crate) const EXPORT: &str = "export";
/// What the list's format is called.
const SCHEMA: &str = "stillpoint.manifest/2";
/// What stands before the digest of all that comes before it, and behind it: the end of the list.
const BEFORE_DIGEST: &str = ",\n  \"digest\": \"";
const BEHIND_DIGEST: &str = "\"\n}";

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
    /// Digest of the list: kept elsewhere, it tells a list that was made anew, too.
    pub digest: String,
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
    /// There is none, it is not what was written, or it names what is no file of a result.
    pub fn read(out: &Path) -> Result<Self> {
        Self::read_with_digest(out).map(|(manifest, _)| manifest)
    }

    /// The same, with the digest of the list: it names every byte of the result.
    pub(super) fn read_with_digest(out: &Path) -> Result<(Self, String)> {
        let path = without_links(out, LIST)?;
        let text = std::fs::read_to_string(&path).map_err(|e| {
            let hint = "give the --out folder of a run that has ended";
            Error::bad_input("this is no result: it has no list of its files")
                .because(e)
                .hint(hint)
                .at(path.display())
        })?;
        let broken = |what: &str| Error::bad_input(what.to_owned()).at(path.display());
        let anew = "run the same job again; `stillpoint verify` works by this list";
        let manifest: Self = serde_json::from_str(&text)
            .map_err(|e| broken("the list of files cannot be read").because(e).hint(anew))?;
        if manifest.schema != SCHEMA {
            return Err(broken("the list of files was written by another version").hint(anew));
        }
        let is_whole = text.rsplit_once(BEFORE_DIGEST).is_some_and(|(body, end)| {
            end.strip_suffix(BEHIND_DIGEST) == Some(&*Algorithm::Blake3.of_bytes(body.as_bytes()))
        });
        if !is_whole {
            let what = "the list of files is not what was written: its digest is another";
            return Err(broken(what).hint(anew));
        }
        match manifest.files.iter().find(|file| !is_own(&file.path)) {
            None => Ok((manifest, Algorithm::Blake3.of_bytes(text.as_bytes()))),
            Some(file) => {
                Err(broken("the list names what is no file of a result").because(&*file.path))
            }
        }
    }

    /// Whether a list lies in a folder, whole or not.
    pub(crate) fn is_beside(out: &Path) -> bool {
        out.join(LIST).symlink_metadata().is_ok_and(|meta| meta.is_file())
    }

    /// Files that the list of an output folder names, if there is a list, whatever version wrote
    /// it: those that a result has.
    fn named(out: &Path) -> Vec<OutputFile> {
        let text = without_links(out, LIST).ok().and_then(|path| std::fs::read(path).ok());
        let manifest = text.and_then(|text| serde_json::from_slice::<Self>(&text).ok());
        let mut files = manifest.map_or_else(Vec::new, |manifest| manifest.files);
        files.retain(|file| is_own(&file.path));
        files
    }

    /// Lists what lies in `next`, files that are known as they are `known`, and writes the list
    /// there.
    pub(crate) fn write(
        next: &Path,
        key: Option<super::Key>,
        outcome: &Outcome,
        known: Vec<OutputFile>,
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
        atomic::write(&next.join(LIST), sealed(&text).as_bytes())?;
        Ok(manifest)
    }

    /// Moves what lies in `next`, as its list says, to `out`, and takes away what only the old list
    /// of `out` names. May be cut short anywhere and done again. Beside the list: what was made
    /// of the old result and is true no longer, in words.
    pub(crate) fn publish(next: &Path, out: &Path) -> Result<(Self, Vec<String>)> {
        let manifest = Self::read(next)?;
        let old = Self::named(out);
        // Nothing is moved or taken away through a link.
        for file in manifest.files.iter().chain(&old) {
            without_links(out, &file.path)?;
        }
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
        let told =
            if same_points(&old, &manifest.files) { Vec::new() } else { forget_exports(out) };
        shift(&next.join(RESULT), &out.join(RESULT))?;
        shift(&next.join(LIST), &out.join(LIST))?;
        // Empty folders; where they stay the next run takes them away.
        let _ = std::fs::remove_dir_all(next);
        Ok((manifest, told))
    }

    /// Whether a whole list lies in `next`: all of it is written, and some of it may have moved.
    pub(crate) fn waits(next: &Path) -> bool {
        Self::read(next).is_ok()
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
            told: Vec::new(),
        }
    }
}

/// A list in JSON with its own digest behind all else.
pub(crate) fn sealed(text: &str) -> String {
    let text = text.trim_end();
    let body = text.strip_suffix('}').unwrap_or(text).trim_end();
    let digest = Algorithm::Blake3.of_bytes(body.as_bytes());
    format!("{body}{BEFORE_DIGEST}{digest}{BEHIND_DIGEST}")
}

/// Whether two results have the same tiles: what was made of their points is true of both.
fn same_points(old: &[OutputFile], new: &[OutputFile]) -> bool {
    let tiles = |files: &[OutputFile]| -> BTreeSet<(String, String)> {
        let tiles = files.iter().filter(|file| file.path.starts_with("tiles/"));
        tiles.map(|file| (file.path.clone(), file.digest.clone())).collect()
    };
    tiles(old) == tiles(new)
}

/// Takes away what was made of the result that was there, and says so; nothing else that lies
/// beside it. What cannot be taken away must not keep a result that is whole from its place, and is
/// named, too.
fn forget_exports(out: &Path) -> Vec<String> {
    let mut told = Vec::new();
    for name in export_names() {
        let Ok(path) = without_links(out, &format!("{EXPORT}/{name}")) else { continue };
        let went = match std::fs::remove_file(&path) {
            Ok(()) => "was taken away",
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => continue,
            Err(_) => "is to be taken away",
        };
        told.push(format!(
            "{} {went}: it was made of the points of the earlier result, and these are others; `stillpoint export` makes it anew",
            path.display()
        ));
    }
    let _ = std::fs::remove_dir(out.join(EXPORT));
    told
}

/// Whether the files of a result are what they were when they were written; all of them are read.
///
/// # Errors
/// There is no list.
pub fn check(out: &Path, engine: &Engine) -> Result<Checked> {
    let (manifest, digest) = Manifest::read_with_digest(out)?;
    let look = |file: &OutputFile| -> Result<Option<String>> {
        let path = match without_links(out, &file.path) {
            Ok(path) => path,
            Err(link) => return Ok(Some(link.to_string())),
        };
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
    Ok(Checked { manifest, digest, wrong: wrong.into_iter().flatten().collect() })
}

/// The list of `out`, if it is of `key` and every file is what it was, as far as lengths, times and
/// known digests tell.
pub(super) fn unchanged(
    contents: &FileDigests,
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

/// Names of all files that points are written to.
fn export_names() -> impl Iterator<Item = &'static str> {
    PLY.into_iter().chain([copc_name()])
}

/// The name of a COPC file without its folder.
pub(crate) fn copc_name() -> &'static str {
    COPC.rsplit('/').next().unwrap_or(COPC)
}

/// Names of spatial tiles of this edge, of all files of a result, that some boxes touch.
pub(crate) fn tiles_of(files: &[OutputFile], edge: f64, touched: &[&Aabb]) -> Vec<String> {
    let corner = |name: &str| {
        let (x, y) = name.strip_prefix("tiles/")?.split_once('.')?.0.split_once('_')?;
        let [x, y]: [i32; 2] = [x.parse().ok()?, y.parse().ok()?];
        Some([x, y].map(|i| f64::from(i) * edge))
    };
    let is_touched = |at: [f64; 2]| {
        let touches = |b: &&Aabb| (0..2).all(|i| b.max[i] >= at[i] && b.min[i] <= at[i] + edge);
        touched.iter().any(touches)
    };
    let names = files.iter().map(|file| &file.path);
    names.filter(|name| corner(name).is_some_and(is_touched)).cloned().collect()
}
