//! The manifest of a result (`manifest.json`): the list of all files that a run has written, with
//! lengths and checksums. A result is published, verified and taken up again by this list.
//!
//! Outputs are written to a folder beside the old result and moved to their places together. The
//! manifest is written last and moved last, so that the next run can complete a run that was
//! interrupted while it moved files.

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

/// Name of the manifest file.
pub(super) const LIST: &str = "manifest.json";
/// The main file of a result: the old one is removed first and the new one is moved last, so that
/// its presence means that the files beside it belong to it.
pub(crate) const RESULT: &str = "result.json";
/// Folder of files that are converted from a result afterwards; the manifest does not name them.
pub(crate) const EXPORT: &str = "export";
/// The page of a result. The manifest names it where the run has made it, but not where it was made
/// on request.
pub(crate) const PAGE: &str = "report.html";
/// Name and version of the format.
const SCHEMA: &str = "stillpoint.manifest/2";
/// Text before the digest of the manifest and after it.
const BEFORE_DIGEST: &str = ",\n  \"digest\": \"";
const BEHIND_DIGEST: &str = "\"\n}";

/// The list of all files of a result, and the key that they were made from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Name and version of this format.
    pub schema: String,
    /// Digest of inputs, library, settings and program.
    pub key: String,
    /// Summary of the run, for people.
    pub summary: String,
    /// Warnings of the run.
    pub warnings: Vec<String>,
    /// Whether something was skipped or refused.
    pub partial: bool,
    /// All files of the result except the manifest, sorted by name.
    pub files: Vec<OutputFile>,
}

/// One file of a result.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct OutputFile {
    /// Path relative to the output folder, with `/`.
    pub path: String,
    /// Length, bytes.
    pub n_bytes: u64,
    /// Checksum of its bytes, with the name of the algorithm.
    pub digest: String,
}

/// Outcome of verifying the files of a result.
#[derive(Debug, Clone, PartialEq)]
pub struct Verification {
    /// The manifest.
    pub manifest: Manifest,
    /// Digest of the manifest. A copy kept elsewhere also detects a manifest that was made anew.
    pub digest: String,
    /// Messages about files that are missing or changed.
    pub wrong: Vec<String>,
}

impl OutputFile {
    /// The entry of a file in `next` whose checksum was computed while it was written.
    pub(crate) fn of(next: &Path, sum: &FileSum) -> Self {
        let (path, n_bytes) = (name(next, &sum.path), sum.n_bytes);
        Self { path, n_bytes, digest: Algorithm::Crc32c.word(&format!("{:08x}", sum.crc32c)) }
    }
}

impl Manifest {
    /// Reads the manifest of an output folder.
    ///
    /// # Errors
    /// There is no manifest, it was changed, or it names a file that is not part of a result.
    pub fn read(out: &Path) -> Result<Self> {
        Self::read_with_digest(out).map(|(manifest, _)| manifest)
    }

    /// Like [`Manifest::read`], with the digest of the manifest, which covers every byte of the
    /// result.
    pub(super) fn read_with_digest(out: &Path) -> Result<(Self, String)> {
        let path = without_links(out, LIST)?;
        let text = std::fs::read_to_string(&path).map_err(|e| {
            let hint = "give the --out folder of a run that has ended";
            Error::bad_input("this folder is not a result: it has no list of its files")
                .because(e)
                .hint(hint)
                .at(path.display())
        })?;
        let broken = |what: &str| Error::bad_input(what.to_owned()).at(path.display());
        let anew = "run the same job again; `stillpoint verify` needs this list";
        let manifest: Self = serde_json::from_str(&text)
            .map_err(|e| broken("the list of files cannot be read").because(e).hint(anew))?;
        if manifest.schema != SCHEMA {
            return Err(broken("the list of files was written by another version").hint(anew));
        }
        let is_whole = text.rsplit_once(BEFORE_DIGEST).is_some_and(|(body, end)| {
            end.strip_suffix(BEHIND_DIGEST) == Some(&*Algorithm::Blake3.of_bytes(body.as_bytes()))
        });
        if !is_whole {
            let what = "the list of files was changed: its digest does not match";
            return Err(broken(what).hint(anew));
        }
        match manifest.files.iter().find(|file| !is_own(&file.path)) {
            None => Ok((manifest, Algorithm::Blake3.of_bytes(text.as_bytes()))),
            Some(file) => {
                Err(broken("the list of files names a file that no result has")
                    .because(&*file.path))
            }
        }
    }

    /// Whether a folder contains a manifest, valid or not.
    pub(crate) fn is_beside(out: &Path) -> bool {
        out.join(LIST).symlink_metadata().is_ok_and(|meta| meta.is_file())
    }

    /// The files of a result that the manifest of an output folder names, whatever version wrote
    /// it; empty without a manifest.
    fn named(out: &Path) -> Vec<OutputFile> {
        let text = without_links(out, LIST).ok().and_then(|path| std::fs::read(path).ok());
        let manifest = text.and_then(|text| serde_json::from_slice::<Self>(&text).ok());
        let mut files = manifest.map_or_else(Vec::new, |manifest| manifest.files);
        files.retain(|file| is_own(&file.path));
        files
    }

    /// Lists the files in `next`, with the checksums in `known` where they are given; `stage` is
    /// the name of this work.
    pub(crate) fn list(
        stage: &'static str,
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
        let files = engine.fan_out(stage, paths, |path| {
            let listed = known.get(name(next, &path).as_str()).map(|file| (*file).clone());
            listed.map_or_else(|| output(next, &path, Algorithm::Blake3), Ok)
        })?;
        Ok(Self {
            schema: SCHEMA.into(),
            key: key.name().into(),
            summary: outcome.summary.clone(),
            warnings: outcome.warnings.clone(),
            partial: outcome.partial,
            files,
        })
    }

    /// Writes the manifest to `next`, which is then complete.
    pub(crate) fn write(&self, next: &Path) -> Result<()> {
        let text = serde_json::to_string_pretty(self)
            .map_err(|e| Error::new(Kind::Bug, "the list of files cannot be written").because(e))?;
        atomic::write(&next.join(LIST), sealed(&text).as_bytes())
    }

    /// Moves the files in `next` to `out` as the manifest lists them, and removes files that only
    /// the old manifest of `out` names. It may be interrupted anywhere and repeated. Returns the
    /// manifest and messages about files that were converted from the old result and were removed.
    pub(crate) fn publish(next: &Path, out: &Path) -> Result<(Self, Vec<String>)> {
        let manifest = Self::read(next)?;
        let old = Self::named(out);
        // No file is moved or removed through a symbolic link.
        for file in manifest.files.iter().chain(&old) {
            without_links(out, &file.path)?;
        }
        // If `result.json` has moved already, a run was interrupted before it moved the manifest.
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
        let mut told =
            if same_points(&old, &manifest.files) { Vec::new() } else { forget_exports(out) };
        if digest_of(&old, RESULT) != digest_of(&manifest.files, RESULT) {
            told.extend(old_scenes(out));
        }
        if old != manifest.files && !stays(PAGE) {
            told.extend(forget(out, PAGE, "shows the earlier result; `stillpoint report --html`"));
        }
        shift(&next.join(RESULT), &out.join(RESULT))?;
        shift(&next.join(LIST), &out.join(LIST))?;
        // Only empty folders are left; the next run removes them if this fails.
        let _ = std::fs::remove_dir_all(next);
        Ok((manifest, told))
    }

    /// Whether `next` contains a valid manifest: then all files are written, and some may have
    /// moved.
    pub(crate) fn waits(next: &Path) -> bool {
        Self::read(next).is_ok()
    }

    /// The outcome of the run that wrote the manifest.
    pub(crate) fn outcome(&self) -> Outcome {
        Outcome {
            summary: self.summary.clone(),
            warnings: self.warnings.clone(),
            partial: self.partial,
            reused: vec![
                "everything: neither inputs, library, settings nor program have changed".into(),
            ],
            notes: Vec::new(),
        }
    }
}

/// A manifest in JSON with its own digest appended as the last field.
pub(crate) fn sealed(text: &str) -> String {
    let text = text.trim_end();
    let body = text.strip_suffix('}').unwrap_or(text).trim_end();
    let digest = Algorithm::Blake3.of_bytes(body.as_bytes());
    format!("{body}{BEFORE_DIGEST}{digest}{BEHIND_DIGEST}")
}

/// Whether two results have the same tiles, so that files converted from one are valid for the
/// other.
fn same_points(old: &[OutputFile], new: &[OutputFile]) -> bool {
    let tiles = |files: &[OutputFile]| -> BTreeSet<(String, String)> {
        let tiles = files.iter().filter(|file| file.path.starts_with("tiles/"));
        tiles.map(|file| (file.path.clone(), file.digest.clone())).collect()
    };
    tiles(old) == tiles(new)
}

/// Removes files that were converted from the earlier result, but nothing else beside it, and
/// returns a message for each. A file that cannot be removed is named, too, and does not prevent
/// the new result from being published.
fn forget_exports(out: &Path) -> Vec<String> {
    let why = "was converted from the points of the earlier result, which have changed; \
               `stillpoint export`";
    let told = export_names().filter_map(|name| forget(out, &format!("{EXPORT}/{name}"), why));
    let told = told.collect();
    let _ = std::fs::remove_dir(out.join(EXPORT));
    told
}

fn digest_of<'a>(files: &'a [OutputFile], name: &str) -> Option<&'a str> {
    files.iter().find(|file| file.path == name).map(|file| file.digest.as_str())
}

/// A message for each scene that was exported from the earlier result. Scenes stay: somebody may
/// have edited them.
fn old_scenes(out: &Path) -> Vec<String> {
    let Ok(folder) = without_links(out, EXPORT) else { return Vec::new() };
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let folders = entries.filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_dir()));
    let mut paths: Vec<PathBuf> = folders.map(|entry| entry.path()).collect();
    paths.sort();
    let message = |path: PathBuf| {
        format!("{} shows the earlier result: `stillpoint export` makes it again", path.display())
    };
    paths.into_iter().map(message).collect()
}

/// Removes a file that was made from the earlier result, and returns a message where it was there;
/// `why` ends with the command that makes it again.
fn forget(out: &Path, name: &str, why: &str) -> Option<String> {
    let path = without_links(out, name).ok()?;
    let went = match std::fs::remove_file(&path) {
        Ok(()) => "was taken away",
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return None,
        Err(_) => "is to be taken away",
    };
    Some(format!("{} {went}: it {why} makes it again", path.display()))
}

/// Compares all files of a result with its manifest; every file is read.
///
/// # Errors
/// There is no valid manifest.
pub fn check(out: &Path, engine: &Engine) -> Result<Verification> {
    let (manifest, digest) = Manifest::read_with_digest(out)?;
    let look = |file: &OutputFile| -> Result<Option<String>> {
        let path = match without_links(out, &file.path) {
            Ok(path) => path,
            Err(link) => return Ok(Some(link.to_string())),
        };
        let Some(algorithm) = Algorithm::of(&file.digest) else {
            return Ok(Some(format!(
                "{}: the list of files has a checksum of an unknown kind for it",
                path.display()
            )));
        };
        Ok(match output(out, &path, algorithm) {
            Ok(now) if now == *file => None,
            Ok(now) if now.n_bytes != file.n_bytes => Some(format!(
                "{}: the file has {} bytes, the list of files states {}",
                path.display(),
                now.n_bytes,
                file.n_bytes
            )),
            Ok(_) => Some(format!(
                "{}: its content differs from what the run has written",
                path.display()
            )),
            Err(e) => Some(format!("{e}")),
        })
    };
    let wrong = engine.fan_out("verify", manifest.files.iter().collect(), look)?;
    Ok(Verification { manifest, digest, wrong: wrong.into_iter().flatten().collect() })
}

/// The manifest of `out`, if it has this key and every file is unchanged as far as lengths, times
/// and known digests show.
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

/// Path relative to the folder, with `/` on every system.
fn name(root: &Path, path: &Path) -> String {
    let parts = path.strip_prefix(root).unwrap_or(path).components();
    let parts: Vec<String> =
        parts.map(|part| part.as_os_str().to_string_lossy().into_owned()).collect();
    parts.join("/")
}

/// Moves a file, unless it was moved before.
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

/// Names of all files that the points of a result can be converted to.
fn export_names() -> impl Iterator<Item = &'static str> {
    PLY.into_iter().chain([copc_name()])
}

/// Name of the COPC file, without its folder.
pub(crate) fn copc_name() -> &'static str {
    COPC.rsplit('/').next().unwrap_or(COPC)
}

/// Names of those spatial tiles (of this edge length, metres) among the files of a result that some
/// boxes touch.
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
