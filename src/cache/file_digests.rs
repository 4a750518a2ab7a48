//! Digests of files. A file whose length, modification time and inode are those of an earlier run
//! is not read again.

use contract::{Error, Kind, Result};
use export::atomic;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::{File, Metadata};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU8, AtomicU64, Ordering};
use std::time::{Duration, SystemTime};

/// Name of the list of known digests in the store.
const LIST: &str = "contents.json";
/// Folder of lists that processes have added which fill the store together.
const ADDED: &str = "contents";
/// Number of bytes that are read at a time.
const PIECE: usize = 1 << 20;
/// Most bytes by which digesting may run ahead of decoding, so that the file is still in the page
/// cache.
const AHEAD: u64 = 256 << 20;
/// Age below which a modification time is not trusted: the file could change again without a change
/// of its time.
pub(super) const SETTLED: Duration = Duration::from_secs(2);

/// Length, modification time and inode of a file. While these stay, its bytes are taken to be
/// unchanged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Stamp {
    n_bytes: u64,
    /// Modification time, nanoseconds since 1970.
    changed: u128,
    /// Inode number, 0 where the system has none.
    number: u64,
}

/// Stamp and digest of a file that was read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct KnownFile {
    stamp: Stamp,
    digest: String,
}

/// All known digests of files.
pub(super) struct FileDigests {
    list: PathBuf,
    /// Folder of lists that processes have added.
    added: PathBuf,
    seen: Mutex<BTreeMap<String, KnownFile>>,
    /// What this process has added, where others fill the store at the same time.
    own: Option<Mutex<BTreeMap<String, KnownFile>>>,
}

impl FileDigests {
    /// Opens the list that an earlier run left in the store; an unreadable list counts as empty.
    pub(super) fn open(store: &Path) -> Self {
        let (list, added) = (store.join(LIST), store.join(ADDED));
        let mut seen = read_list(&list);
        for entry in std::fs::read_dir(&added).into_iter().flatten().flatten() {
            seen.extend(read_list(&entry.path()));
        }
        Self { list, added, seen: Mutex::new(seen), own: None }
    }

    /// Like [`FileDigests::open`], for one of many processes that fill the store: it keeps what it
    /// learns in a list of its own.
    pub(super) fn open_shared(store: &Path) -> Self {
        Self { own: Some(Mutex::default()), ..Self::open(store) }
    }

    /// Writes the list for the next run.
    pub(super) fn keep(&self) -> Result<()> {
        let Some(own) = &self.own else {
            atomic::write(&self.list, encoded(&self.lock())?.as_bytes())?;
            let _ = std::fs::remove_dir_all(&self.added);
            return Ok(());
        };
        let own = own.lock().expect("no thread panics while it holds the list");
        if own.is_empty() {
            return Ok(());
        }
        let text = encoded(&own)?;
        let name = blake3::hash(text.as_bytes()).to_hex();
        atomic::write_shared(&self.added.join(name.as_str()), text.as_bytes())
    }

    /// The digest of a file, which is read unless it is known.
    pub(super) fn digest(&self, path: &Path, algorithm: Algorithm) -> Result<String> {
        match self.known(path, algorithm)? {
            Some(digest) => Ok(digest),
            None => self.read(path, algorithm, &Pace::default()),
        }
    }

    /// Records the digest of a file that this program has written.
    pub(super) fn believe(&self, path: &Path, digest: &str) -> Result<()> {
        let seen = KnownFile { stamp: Stamp::of(path)?, digest: digest.to_owned() };
        self.add(name(path)?, seen);
        Ok(())
    }

    fn add(&self, name: String, file: KnownFile) {
        if let Some(own) = &self.own {
            let mut own = own.lock().expect("no thread panics while it holds the list");
            own.insert(name.clone(), file.clone());
        }
        self.lock().insert(name, file);
    }

    /// The digest of a file that is unchanged since it was read; `None` for other files.
    pub(super) fn known(&self, path: &Path, algorithm: Algorithm) -> Result<Option<String>> {
        let stamp = Stamp::of(path)?;
        let is_known =
            |s: &&KnownFile| s.stamp == stamp && Algorithm::of(&s.digest) == Some(algorithm);
        Ok(self.lock().get(&name(path)?).filter(is_known).map(|s| s.digest.clone()))
    }

    /// Whether a file has the length of a known one, and so may be that file under another name or
    /// time.
    pub(super) fn may_know(&self, path: &Path) -> Result<bool> {
        let n_bytes = Stamp::of(path)?.n_bytes;
        Ok(self.lock().values().any(|s| s.stamp.n_bytes == n_bytes))
    }

    /// Reads a file to compute its digest, not faster than `pace` allows.
    pub(super) fn read(&self, path: &Path, algorithm: Algorithm, pace: &Pace) -> Result<String> {
        let stamp = Stamp::of(path)?;
        let digest = algorithm.of_file(path, pace)?;
        self.take(path, stamp, &digest)?;
        Ok(digest)
    }

    /// Records the digest of a file that had this stamp before it was read; refuses a file that was
    /// changed meanwhile.
    pub(super) fn take(&self, path: &Path, stamp: Stamp, digest: &str) -> Result<()> {
        stamp.check(path)?;
        // Where many processes do a job, its first has waited until all inputs were settled.
        if stamp.is_settled() || self.own.is_some() {
            self.add(name(path)?, KnownFile { stamp, digest: digest.to_owned() });
        }
        Ok(())
    }

    /// Digest of names and bytes of all files in a folder, in the order of their names. For a
    /// symbolic link only its target path is digested: a target in the folder is digested by
    /// itself, and one elsewhere is not read.
    pub(super) fn folder(&self, folder: &Path) -> Result<String> {
        let mut files = Vec::new();
        walk(folder, &mut files)?;
        files.sort();
        let mut hasher = blake3::Hasher::new();
        for path in &files {
            let name = path.strip_prefix(folder).unwrap_or(path).display().to_string();
            hasher.update(name.as_bytes());
            hasher.update(&[0]);
            match std::fs::read_link(path) {
                Ok(to) => hasher.update(format!("link {}\n", to.display()).as_bytes()),
                Err(_) => hasher.update(self.digest(path, Algorithm::Blake3)?.as_bytes()),
            };
        }
        Ok(format!("blake3:{}", hasher.finalize().to_hex()))
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, BTreeMap<String, KnownFile>> {
        self.seen.lock().expect("no thread panics while it holds the list")
    }
}

/// A list of known digests; an unreadable list counts as empty.
fn read_list(path: &Path) -> BTreeMap<String, KnownFile> {
    let text = std::fs::read_to_string(path).unwrap_or_default();
    serde_json::from_str(&text).unwrap_or_default()
}

fn encoded(list: &BTreeMap<String, KnownFile>) -> Result<String> {
    serde_json::to_string_pretty(list).map_err(|e| {
        Error::new(Kind::Bug, "the list of known digests cannot be encoded").because(e)
    })
}

impl Stamp {
    pub(super) fn of(path: &Path) -> Result<Self> {
        let meta = std::fs::metadata(path).map_err(|e| Error::from(e).at(path.display()))?;
        Ok(Self { n_bytes: meta.len(), changed: changed(&meta), number: number(&meta) })
    }

    /// Length of the file, bytes.
    pub(super) fn n_bytes(&self) -> u64 {
        self.n_bytes
    }

    /// Refuses a file whose stamp has changed.
    pub(super) fn check(&self, path: &Path) -> Result<()> {
        if Self::of(path)? == *self {
            return Ok(());
        }
        let error = Error::bad_input("the file was changed while the run read it");
        Err(error.at(path.display()).hint("start the run again once the file is complete"))
    }

    /// Whether its modification time is old enough that a later change would alter it.
    pub(super) fn is_settled(&self) -> bool {
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
        now.is_ok_and(|now| now.as_nanos() > self.changed + SETTLED.as_nanos())
    }
}

/// Algorithm of a checksum.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Algorithm {
    /// BLAKE3: identifies contents.
    Blake3,
    /// CRC-32C: detects damage, and can be computed of files that are written piece by piece.
    Crc32c,
}

impl Algorithm {
    /// The algorithm of a digest that [`Algorithm::word`] wrote.
    pub(super) fn of(digest: &str) -> Option<Self> {
        [Self::Blake3, Self::Crc32c]
            .into_iter()
            .find(|algorithm| digest.starts_with(algorithm.name()))
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Blake3 => "blake3:",
            Self::Crc32c => "crc32c:",
        }
    }

    /// A digest with the name of its algorithm before it.
    pub(super) fn word(self, digits: &str) -> String {
        format!("{}{digits}", self.name())
    }

    /// Digest of bytes in memory.
    pub(super) fn of_bytes(self, bytes: &[u8]) -> String {
        match self {
            Self::Blake3 => self.word(&blake3::hash(bytes).to_hex()),
            Self::Crc32c => self.word(&format!("{:08x}", crc32c::crc32c(bytes))),
        }
    }

    /// Digest of a file.
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
            pace.wait(at, n_bytes)?;
        }
        Ok(match self {
            Self::Blake3 => self.word(&hasher.finalize().to_hex()),
            Self::Crc32c => self.word(&format!("{crc:08x}")),
        })
    }
}

/// The key of a file in the list: its canonical path.
fn name(path: &Path) -> Result<String> {
    let absolute = std::path::absolute(path).map_err(|e| Error::from(e).at(path.display()))?;
    Ok(absolute.display().to_string())
}

/// Progress of the thread that decodes a file, for the thread that digests it. Both read the file
/// from disk only once if they stay close together.
#[derive(Debug, Default)]
pub(crate) struct Pace {
    /// Number of decoded points, and of all points; without a known total there is no pace.
    done: AtomicU64,
    all: u64,
    /// Why the pace has ended: 1, all points are decoded; 2, decoding failed.
    end: AtomicU8,
}

impl Pace {
    /// The pace of a file with `all` points; 0 where the number is not known.
    pub(crate) fn of(all: u64) -> Self {
        Self { all, ..Self::default() }
    }

    /// The handle of the decoding thread. If it is dropped before its end, the digesting thread
    /// gives up.
    pub(crate) fn lead(&self) -> Lead<'_> {
        Lead(self)
    }

    /// Waits until the bytes from `at` on may be read.
    fn wait(&self, at: u64, n_bytes: u64) -> Result<()> {
        loop {
            let share = self.done.load(Ordering::Relaxed) as f64 / self.all.max(1) as f64;
            let is_near = at <= (share * n_bytes as f64) as u64 + AHEAD;
            match self.end.load(Ordering::Relaxed) {
                2 => {
                    return Err(Error::new(
                        Kind::Cancelled,
                        "the digest of a file is no longer needed, since decoding it has failed",
                    ));
                }
                0 if self.all > 0 && !is_near => std::thread::sleep(Duration::from_millis(1)),
                _ => return Ok(()),
            }
        }
    }
}

/// Handle of the thread that sets the pace.
pub(crate) struct Lead<'a>(&'a Pace);

impl Lead<'_> {
    pub(crate) fn has_decoded(&self, n_points: u64) {
        self.0.done.fetch_add(n_points, Ordering::Relaxed);
    }

    pub(crate) fn end(self) {
        self.0.end.store(1, Ordering::Relaxed);
    }
}

impl Drop for Lead<'_> {
    fn drop(&mut self) {
        // The first of end and failure counts.
        let _ = self.0.end.compare_exchange(0, 2, Ordering::Relaxed, Ordering::Relaxed);
    }
}

/// Modification time, nanoseconds since 1970; zero where the system does not state it.
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

/// Collects all files and symbolic links in a folder and its subfolders; links are not followed.
pub(super) fn walk(folder: &Path, files: &mut Vec<PathBuf>) -> Result<()> {
    let failed = |e: std::io::Error| Error::from(e).at(folder.display());
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let kind = entry.file_type().map_err(failed)?;
        if kind.is_dir() {
            walk(&entry.path(), files)?;
        } else if kind.is_file() || kind.is_symlink() {
            files.push(entry.path());
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
        let contents = FileDigests::open(dir.path());
        let one = contents.digest(&path, Algorithm::Blake3).expect("reads");
        contents.keep().expect("writes");
        // With the same length, time and inode the file counts as unchanged and is not read.
        std::fs::write(&path, b"two").expect("writes");
        set(old).expect("a time");
        let again = FileDigests::open(dir.path());
        assert_eq!(again.digest(&path, Algorithm::Blake3).expect("reads"), one);
        // A changed time makes it be read again.
        set(old + Duration::from_secs(1)).expect("a time");
        assert_ne!(again.digest(&path, Algorithm::Blake3).expect("reads"), one);
        assert!(contents.digest(&dir.path().join("none"), Algorithm::Blake3).is_err());
    }

    #[test]
    fn who_sums_up_keeps_near_who_decodes_and_gives_up_with_him() {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("scan.las");
        // A sparse file that is longer than the digesting thread may run ahead.
        File::create(&path).and_then(|f| f.set_len(AHEAD + (4 << 20))).expect("writes");
        let whole = Algorithm::Crc32c.read(&path).expect("reads");
        let pace = Pace::of(100);
        std::thread::scope(|scope| {
            let sum = scope.spawn(|| Algorithm::Crc32c.of_file(&path, &pace));
            let lead = pace.lead();
            lead.has_decoded(50);
            lead.end();
            assert_eq!(sum.join().expect("ends").expect("reads"), whole);
        });
        let pace = Pace::of(100);
        drop(pace.lead());
        let error = Algorithm::Crc32c.of_file(&path, &pace).expect_err("nobody wants it");
        assert_eq!(error.kind(), Kind::Cancelled);
    }

    #[test]
    fn a_file_that_is_another_now_is_refused_by_name() {
        let dir = tempfile::tempdir().expect("a folder");
        let (path, other) = (dir.path().join("scan.ptx"), dir.path().join("other.ptx"));
        std::fs::write(&path, b"one").expect("writes");
        let stamp = Stamp::of(&path).expect("is there");
        assert!(stamp.check(&path).is_ok());
        std::fs::write(&path, b"one and more").expect("writes");
        let error = stamp.check(&path).expect_err("it is longer");
        assert_eq!(error.kind(), Kind::BadInput);
        assert!(error.to_string().contains("scan.ptx"), "{error}");
        // The same length and time with another inode.
        let at = std::fs::metadata(&path).and_then(|m| m.modified()).expect("a time");
        let stamp = Stamp::of(&path).expect("is there");
        std::fs::write(&other, b"two and more").expect("writes");
        File::options().write(true).open(&other).and_then(|f| f.set_modified(at)).expect("a time");
        std::fs::rename(&other, &path).expect("takes its place");
        assert_eq!(stamp.check(&path).is_err(), cfg!(unix));
        std::fs::remove_file(&path).expect("is removed");
        assert!(stamp.check(&path).is_err());
    }
}
