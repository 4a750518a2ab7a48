//! Files in, digests of their bytes out. A file that was read before and has since kept its length, time and place on disk
//! is not read again.

use crate::atomic;
use contract::{Error, Result};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::{File, Metadata};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, SystemTime};

/// Name of the list in the store.
const LIST: &str = "contents.json";
/// Bytes that are read at a time.
const PIECE: usize = 1 << 20;
/// How far a file may be read ahead of the one that decodes it, bytes: the system still has it in memory then.
const AHEAD: u64 = 256 << 20;
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

    /// The digest of a file, read where it is not known.
    pub(super) fn digest(&self, path: &Path, sum: Sum) -> Result<String> {
        match self.known(path, sum)? {
            Some(digest) => Ok(digest),
            None => self.read(path, sum, &Pace::default()),
        }
    }

    /// Takes the word of the one who wrote a file.
    pub(super) fn believe(&self, path: &Path, digest: &str) -> Result<()> {
        let (name, now) = look(path)?;
        self.lock().insert(name, Seen::of(&now, digest.to_owned()));
        Ok(())
    }

    /// The digest of a file that has not changed since it was read.
    pub(super) fn known(&self, path: &Path, sum: Sum) -> Result<Option<String>> {
        let (name, now) = look(path)?;
        let is_known = |s: &&Seen| s.is(&now) && Sum::of(&s.digest) == Some(sum);
        Ok(self.lock().get(&name).filter(is_known).map(|s| s.digest.clone()))
    }

    /// Whether a file may be one that was read before, under another name or time: it has the length of one.
    pub(super) fn may_know(&self, path: &Path) -> Result<bool> {
        let (_, now) = look(path)?;
        Ok(self.lock().values().any(|s| s.n_bytes == now.len()))
    }

    /// Reads a file, not faster than `pace` allows.
    pub(super) fn read(&self, path: &Path, sum: Sum, pace: &Pace) -> Result<String> {
        let (name, before) = look(path)?;
        let digest = sum.of_file(path, pace)?;
        let (_, after) = look(path)?;
        let seen = Seen::of(&before, digest.clone());
        // Within the resolution of a file's time, a later change would not show.
        let is_settled = after
            .modified()
            .is_ok_and(|at| SystemTime::now().duration_since(at).is_ok_and(|age| age > SETTLED));
        if !seen.is(&after) {
            let error = Error::bad_input("the file was changed while it was read");
            return Err(error.at(path.display()).hint("start again once it is whole"));
        }
        if is_settled {
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
            hasher.update(self.digest(path, Sum::Blake3)?.as_bytes());
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

/// How the bytes of a file are summed up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Sum {
    /// Names contents: no two files share it.
    Blake3,
    /// Tells damage: what is written bit by bit can be summed bit by bit.
    Crc32c,
}

impl Sum {
    /// The kind of a digest as [`Sum::word`] writes it.
    pub(super) fn of(digest: &str) -> Option<Self> {
        [Self::Blake3, Self::Crc32c].into_iter().find(|sum| digest.starts_with(sum.name()))
    }

    fn name(self) -> &'static str {
        match self {
            Self::Blake3 => "blake3:",
            Self::Crc32c => "crc32c:",
        }
    }

    /// A digest with its kind.
    pub(super) fn word(self, digits: &str) -> String {
        format!("{}{digits}", self.name())
    }

    /// Reads a file.
    pub(super) fn read(self, path: &Path) -> Result<String> {
        self.of_file(path, &Pace::default())
    }

    fn of_file(self, path: &Path, pace: &Pace) -> Result<String> {
        let failed = |e: std::io::Error| Error::from(e).at(path.display());
        let mut file = File::open(path).map_err(failed)?;
        let n_bytes = file.metadata().map_err(failed)?.len();
        let (mut hasher, mut crc) = (blake3::Hasher::new(), 0);
        let mut piece = vec![0; PIECE.min(n_bytes as usize + 1)];
        let mut at = 0;
        loop {
            let n = file.read(&mut piece).map_err(failed)?;
            match self {
                _ if n == 0 => break,
                Self::Blake3 => {
                    hasher.update(&piece[..n]);
                }
                Self::Crc32c => crc = crc32c::crc32c_append(crc, &piece[..n]),
            }
            at += n as u64;
            pace.wait(at, n_bytes);
        }
        Ok(match self {
            Self::Blake3 => self.word(&hasher.finalize().to_hex()),
            Self::Crc32c => self.word(&format!("{crc:08x}")),
        })
    }
}

/// Where a file is known by, and what the system says of it now.
fn look(path: &Path) -> Result<(String, Metadata)> {
    let failed = |e: std::io::Error| Error::from(e).at(path.display());
    let name = std::path::absolute(path).map_err(failed)?.display().to_string();
    Ok((name, std::fs::metadata(path).map_err(failed)?))
}

/// How far another reader of the same file has come: both read it from disk only once if they stay near each other.
#[derive(Debug, Default)]
pub(crate) struct Pace {
    /// Of all its points, and how many there are; no pace where that is 0.
    pub(crate) done: AtomicU64,
    pub(crate) all: u64,
}

impl Pace {
    fn wait(&self, at: u64, n_bytes: u64) {
        let may = |done: u64| {
            let share = done as f64 / self.all as f64;
            at <= (share * n_bytes as f64) as u64 + AHEAD
        };
        while self.all > 0 && !may(self.done.load(Ordering::Relaxed)) {
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Nobody waits any longer.
    pub(crate) fn end(&self) {
        self.done.store(self.all.max(1) * 2, Ordering::Relaxed);
    }
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
        let one = contents.digest(&path, Sum::Blake3).expect("reads");
        contents.keep().expect("writes");
        // Another content under the same length, time and number: believed, not read.
        std::fs::write(&path, b"two").expect("writes");
        set(old).expect("a time");
        let again = Contents::open(dir.path());
        assert_eq!(again.digest(&path, Sum::Blake3).expect("reads"), one);
        // Its time tells: read again.
        set(old + Duration::from_secs(1)).expect("a time");
        assert_ne!(again.digest(&path, Sum::Blake3).expect("reads"), one);
        assert!(contents.digest(&dir.path().join("none"), Sum::Blake3).is_err());
    }
}
