//! Lists the results in a folder: sessions of a plant, the session that each one started from, and
//! the space of each. Results share identical files as hard links, so any result can be removed
//! without harm to the others.

use crate::cache::{Manifest, VerifiedFiles};
use crate::io::own_paths::refuse_link;
use crate::job::{Job, memory_words};
use contract::{Error, Kind, Result, quote};
use export::ResultFile;
use serde::Serialize;
use std::collections::HashMap;
use std::fmt::Write as _;
use std::fs::Metadata;
use std::path::{Path, PathBuf};

/// One result in the folder.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PlantSession {
    /// Name of its folder.
    pub name: String,
    /// Name of the session that it started from, where that is in the folder.
    pub base: Option<String>,
    /// Number of scan files of all sessions up to this one.
    pub n_inputs: usize,
    /// Number of reported robots.
    pub n_robots: usize,
    /// Size of its files and its store, bytes.
    pub n_bytes: u64,
    /// Size of those files that no other session shares, bytes.
    pub n_own_bytes: u64,
}

/// All results in a folder.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SessionHistory {
    /// Sessions, each after the one that it started from, then by name.
    pub sessions: Vec<PlantSession>,
    /// Messages about damaged results.
    pub damaged: Vec<String>,
}

/// Lists the sessions in a folder. Symbolic links in it are not followed, since their targets lie
/// elsewhere.
///
/// # Errors
/// A folder that cannot be read.
pub fn sessions(folder: &Path) -> Result<SessionHistory> {
    let failed = |e: std::io::Error| Error::from(e).at(folder.display());
    let mut damaged = Vec::new();
    let mut found = Vec::new();
    let mut digests = HashMap::new();
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        paths.push(entry.map_err(failed)?.path());
    }
    paths.sort();
    paths.retain(|path| refuse_link(path).is_ok() && Manifest::is_beside(path));
    for path in paths {
        let read = VerifiedFiles::open(&path)
            .and_then(|files| Ok((files.digest().to_owned(), files.result()?)));
        let (digest, result) = match read {
            Ok(read) => read,
            Err(error) => {
                damaged.push(error.to_string());
                continue;
            }
        };
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        digests.insert(digest, name.clone());
        found.push((session(&path, name, &result)?, result.rescan.map(|r| r.base)));
    }
    let mut left: Vec<PlantSession> = found
        .into_iter()
        .map(|(session, base)| {
            let base = base.and_then(|digest| digests.get(&digest).cloned());
            PlantSession { base, ..session }
        })
        .collect();
    let mut out: Vec<PlantSession> = Vec::new();
    // Roots first. A session whose base is not listed, as after a removal, is a root, too.
    while !left.is_empty() {
        let is_next = |s: &PlantSession| {
            s.base.as_ref().is_none_or(|base| out.iter().any(|o| o.name == *base))
        };
        let at = left.iter().position(is_next).unwrap_or(0);
        out.push(left.remove(at));
    }
    Ok(SessionHistory { sessions: out, damaged })
}

/// The error for a folder without results.
#[must_use]
pub fn no_results(folder: &Path) -> Error {
    Error::bad_input("there is no result in this folder")
        .at(folder.display())
        .hint("give the folder that contains the output folders of runs")
}

fn session(path: &Path, name: String, result: &ResultFile) -> Result<PlantSession> {
    let (mut n_bytes, mut n_own_bytes) = (0, 0);
    let mut folders = vec![path.to_path_buf()];
    while let Some(folder) = folders.pop() {
        let failed = |e: std::io::Error| Error::from(e).at(folder.display());
        for entry in std::fs::read_dir(&folder).map_err(failed)? {
            let entry = entry.map_err(failed)?;
            let meta = entry.metadata().map_err(failed)?;
            if meta.is_dir() {
                folders.push(entry.path());
            } else {
                n_bytes += meta.len();
                n_own_bytes += if n_names(&meta) > 1 { 0 } else { meta.len() };
            }
        }
    }
    let n_robots = result.robots.iter().filter(|r| r.verdict != "refused").count();
    let n_inputs = result.inputs.len();
    Ok(PlantSession { name, base: None, n_inputs, n_robots, n_bytes, n_own_bytes })
}

/// Number of hard links of a file.
#[cfg(unix)]
fn n_names(meta: &Metadata) -> u64 {
    std::os::unix::fs::MetadataExt::nlink(meta)
}

#[cfg(not(unix))]
fn n_names(_: &Metadata) -> u64 {
    1
}

/// Removes a session. Files that other sessions share stay with them. The name must be the plain
/// name of a folder, and a symbolic link is not followed.
///
/// # Errors
/// There is no result of that name, it is a symbolic link, a run uses it, or the system refuses.
pub fn remove(folder: &Path, name: &str) -> Result<()> {
    let path: PathBuf = folder.join(name);
    let is_name = Path::new(name).file_name().is_some_and(|own| own == name);
    if is_name {
        refuse_link(&path)?;
        refuse_link(&path.join("store"))?;
    }
    if !is_name || !Manifest::is_beside(&path) {
        let what = format!("there is no session \"{}\"", quote::shown(name));
        return Err(Error::new(Kind::Usage, what)
            .at(folder.display())
            .hint("`stillpoint history` lists them; --remove takes a name from that list"));
    }
    // No run can use a result that was copied without its store.
    let lock = path.join("store").is_dir().then(|| Job::hold(&path)).transpose()?;
    // The manifest is removed first: without it the folder is no result any more, even if the rest
    // fails.
    let failed = |e: std::io::Error| Error::from(e).at(path.display());
    let without = |name: &str| match std::fs::remove_file(path.join(name)) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(failed(e)),
        _ => Ok(()),
    };
    without("result.json")?;
    without("manifest.json")?;
    drop(lock);
    // Symbolic links are removed, not their targets.
    std::fs::remove_dir_all(&path).map_err(failed)
}

/// The sessions as a table for people.
#[must_use]
pub fn words(sessions: &[PlantSession]) -> String {
    let mut text = String::from(
        "session              goes on from         inputs  robots       size  by itself\n",
    );
    for s in sessions {
        let base = quote::shown(s.base.as_deref().unwrap_or("-"));
        let _ = writeln!(
            text,
            "{:<20} {base:<20} {:>6} {:>7} {:>10} {:>10}",
            quote::shown(&s.name),
            s.n_inputs,
            s.n_robots,
            memory_words(s.n_bytes),
            memory_words(s.n_own_bytes)
        );
    }
    text
}
