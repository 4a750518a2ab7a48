//! A folder of results in; which sessions of a plant lie in it, which goes on from which, and how
//! much room each takes by itself, out. Results share files that are the same, so that any of them
//! can be taken away without harm to the others.

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

/// One result.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PlantSession {
    /// Name of its folder.
    pub name: String,
    /// The session that it goes on from, where that lies here, too.
    pub base: Option<String>,
    /// Scan files, of all sessions up to this one.
    pub n_inputs: usize,
    /// Robots that stand.
    pub n_robots: usize,
    /// Bytes of its files and its store, and those of them that no other session shares.
    pub n_bytes: u64,
    /// See `n_bytes`.
    pub n_own_bytes: u64,
}

/// What lies in a folder.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SessionHistory {
    /// Each after the one that it goes on from, then by name.
    pub sessions: Vec<PlantSession>,
    /// Results that are not what was written, in words.
    pub damaged: Vec<String>,
}

/// The sessions below a folder. Links in it are not followed: what they lead to lies elsewhere.
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
    // Roots first; what goes on from nothing that is listed, as after a removal, is a root, too.
    while !left.is_empty() {
        let is_next = |s: &PlantSession| {
            s.base.as_ref().is_none_or(|base| out.iter().any(|o| o.name == *base))
        };
        let at = left.iter().position(is_next).unwrap_or(0);
        out.push(left.remove(at));
    }
    Ok(SessionHistory { sessions: out, damaged })
}

/// The error for a folder that holds no results.
#[must_use]
pub fn no_results(folder: &Path) -> Error {
    Error::bad_input("there is no result in this folder")
        .at(folder.display())
        .hint("give the folder that output folders of runs lie in")
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

/// Under how many names a file is known.
#[cfg(unix)]
fn n_names(meta: &Metadata) -> u64 {
    std::os::unix::fs::MetadataExt::nlink(meta)
}

#[cfg(not(unix))]
fn n_names(_: &Metadata) -> u64 {
    1
}

/// Takes a session away. What others share with it stays theirs. A name is the name of a folder and
/// nothing else, and a link is not followed.
///
/// # Errors
/// No result of that name, a link, a result at which a run is at work, or what the system refuses.
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
    // A result that was copied without its store has nobody at work in it.
    let lock = path.join("store").is_dir().then(|| Job::hold(&path)).transpose()?;
    // Without its list it is no result any more, however far the rest of this comes.
    let failed = |e: std::io::Error| Error::from(e).at(path.display());
    let without = |name: &str| match std::fs::remove_file(path.join(name)) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(failed(e)),
        _ => Ok(()),
    };
    without("result.json")?;
    without("manifest.json")?;
    drop(lock);
    // Of links in it the links go, not what they lead to.
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
