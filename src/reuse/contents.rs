//! Files in, digests of their bytes out. A file that was read before and has since kept its length, time and place on disk
//! is not read again.

use crate::atomic;
use contract::{Error, Result};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::{File, Metadata};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::{Duration, SystemTime};

/// Name of the list in the store.
const LIST: &str = "contents.json";
/// A file that changed so recently may change again without its time telling.
const SETTLED: Duration = Duration::from_secs(2);

/// What a file looked like when it was read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct Seen {
    n_bytes: u64,
    /// Time of its last change, nanoseconds since 1970.
    changed: u128,
    /// Its number on its disk, where it has one.
    number: u64,
    digest: String,
}

/// Digests that are known.
pub(super) struct Contents {
    list: PathBuf,
    seen: Mutex<BTreeMap<String, Seen>>,
}

impl Contents {
    /// What an earlier run left in the store; nothing where it left nothing that can be read.
    pub(super) fn open(store: &Path) -> Self {
        let list = store.join(LIST);
        let text = std::fs::read_to_string(&list).unwrap_or_default();
        let seen = serde_json::from_str(&text).unwrap_or_default();
        Self { list, seen: Mutex::new(seen) }
    }

    /// Writes what is known for the next run.
    pub(super) fn keep(&self) -> Result<()> {
        let seen = self.seen.lock().expect("no thread panics while it holds the list");
        let text = serde_json::to_string_pretty(&*seen)
            .map_err(|e| Error::new(contract::Kind::Bug, "a list cannot be written").because(e))?;
        atomic::write(&self.list, text.as_bytes())
    }

    /// Digest of the bytes of a file.
    pub(super) fn digest(&self, path: &Path) -> Result<String> {
        let failed = |e: std::io::Error| Error::from(e).at(path.display());
        let name = std::path::absolute(path).map_err(failed)?.display().to_string();
        let before = std::fs::metadata(path).map_err(failed)?;
        let known = |seen: &BTreeMap<String, Seen>| {
            seen.get(&name).filter(|s| s.is(&before)).map(|s| s.digest.clone())
        };
        if let Some(digest) = known(&self.lock()) {
            return Ok(digest);
        }
        let digest = digest_of(path)?;
        let after = std::fs::metadata(path).map_err(failed)?;
        let seen = Seen::of(&before, digest.clone());
        let is_settled = after
            .modified()
            .is_ok_and(|at| SystemTime::now().duration_since(at).is_ok_and(|age| age > SETTLED));
        if seen.is(&after) && is_settled {
            self.lock().insert(name, seen);
        }
        Ok(digest)
    }

    /// Digest of names and bytes of all files below a folder, in the order of their names.
    pub(super) fn folder(&self, folder: &Path) -> Result<String> {
        let mut files = Vec::new();
        walk(folder, &mut files)?;
        files.sort();
        let mut hasher = blake3::Hasher::new();
        for path in &files {
            let name = path.strip_prefix(folder).unwrap_or(path).display().to_string();
            hasher.update(name.as_bytes());
            hasher.update(&[0]);
            hasher.update(self.digest(path)?.as_bytes());
        }
        Ok(format!("blake3:{}", hasher.finalize().to_hex()))
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, BTreeMap<String, Seen>> {
        self.seen.lock().expect("no thread panics while it holds the list")
    }
}

impl Seen {
    fn of(meta: &Metadata, digest: String) -> Self {
        Self { n_bytes: meta.len(), changed: changed(meta), number: number(meta), digest }
    }

    fn is(&self, meta: &Metadata) -> bool {
        *self == Self::of(meta, self.digest.clone())
    }
}

/// Digest of a file's bytes, all of them read.
pub(super) fn digest_of(path: &Path) -> Result<String> {
    let failed = |e: std::io::Error| Error::from(e).at(path.display());
    let mut hasher = blake3::Hasher::new();
    hasher.update_reader(File::open(path).map_err(failed)?).map_err(failed)?;
    Ok(format!("blake3:{}", hasher.finalize().to_hex()))
}

/// Time of the last change, nanoseconds since 1970; zero where the system does not tell.
fn changed(meta: &Metadata) -> u128 {
    let since = meta.modified().ok().and_then(|at| at.duration_since(SystemTime::UNIX_EPOCH).ok());
    since.map_or(0, |since| since.as_nanos())
}

#[cfg(unix)]
fn number(meta: &Metadata) -> u64 {
    std::os::unix::fs::MetadataExt::ino(meta)
}

#[cfg(not(unix))]
fn number(_: &Metadata) -> u64 {
    0
}

/// All files below a folder. Links to folders are followed by name only once: a loop of links ends at the system's limit.
pub(super) fn walk(folder: &Path, files: &mut Vec<PathBuf>) -> Result<()> {
    let failed = |e: std::io::Error| Error::from(e).at(folder.display());
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        if path.is_dir() {
            walk(&path, files)?;
        } else if path.is_file() {
            files.push(path);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_changed_file_is_read_again_and_a_known_one_is_not() {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("scan.e57");
        std::fs::write(&path, b"one").expect("writes");
        let old = SystemTime::now() - Duration::from_secs(60);
        let set = |at| File::options().write(true).open(&path).and_then(|f| f.set_modified(at));
        set(old).expect("a time");
        let contents = Contents::open(dir.path());
        let one = contents.digest(&path).expect("reads");
        contents.keep().expect("writes");
        // Another content under the same length, time and number: believed, not read.
        std::fs::write(&path, b"two").expect("writes");
        set(old).expect("a time");
        let again = Contents::open(dir.path());
        assert_eq!(again.digest(&path).expect("reads"), one);
        // Its time tells: read again.
        set(old + Duration::from_secs(1)).expect("a time");
        assert_ne!(again.digest(&path).expect("reads"), one);
        assert!(contents.digest(&dir.path().join("none")).is_err());
    }
}
