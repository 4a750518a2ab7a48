//! Files that are either complete or absent: they are written under a temporary name, synced, and
//! then renamed.

use crate::block::{self, AlignedBlock};
use contract::{Error, Result};
use std::fs::{File, OpenOptions};
use std::io::{IoSlice, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// File name extension of a file that is not complete.
pub const PART: &str = "part";

/// Number of bytes that are buffered before they are written: at this size disks reach nearly their
/// full rate.
const GATHER: usize = 1 << 19;

/// A file that gets its final name on commit; if it is dropped before, it is removed. Writes are
/// buffered, and bypass the page cache as long as the file is written sequentially.
pub struct AtomicFile {
    file: Option<File>,
    part: PathBuf,
    path: PathBuf,
    waiting: AlignedBlock,
    /// Whether writes bypass the page cache; `None` before the first full buffer, which small
    /// files never reach.
    direct: Option<bool>,
}

impl AtomicFile {
    /// Opens `<path>.part` for writing and reading; creates its folder if needed.
    ///
    /// # Errors
    /// If folder or file cannot be created.
    pub fn create(path: impl Into<PathBuf>) -> Result<Self> {
        let path = path.into();
        let part = part_of(&path);
        Self::open(path, part)
    }

    fn open(path: PathBuf, part: PathBuf) -> Result<Self> {
        if let Some(folder) = path.parent().filter(|f| !f.as_os_str().is_empty()) {
            std::fs::create_dir_all(folder)
                .map_err(|e| Error::of_file("folder cannot be created", folder, e))?;
        }
        let file = OpenOptions::new()
            .create(true)
            .read(true)
            .write(true)
            .truncate(true)
            .open(&part)
            .map_err(|e| Error::of_file("file cannot be created", &part, e))?;
        let (file, waiting) = (Some(file), AlignedBlock::default());
        Ok(Self { file, part, path, waiting, direct: None })
    }

    /// The final name of the file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The temporary name of the file, for callers that open it by name.
    pub(crate) fn part(&self) -> &Path {
        &self.part
    }

    /// Flushes the buffer and opens the file a second time, for reading what was written so far.
    ///
    /// # Errors
    /// If the buffer cannot be written or the file cannot be opened.
    pub fn again(&mut self) -> std::io::Result<File> {
        self.settle()?;
        File::open(&self.part)
    }

    /// Syncs the file to disk and renames it, replacing any file of that name.
    ///
    /// # Errors
    /// If the file cannot be written or renamed.
    pub fn commit(mut self) -> Result<()> {
        let settled = self.settle();
        let file = self.file.take().expect("taken only here and on drop");
        let done = settled.and_then(|()| file.sync_all());
        let done = done.and_then(|()| std::fs::rename(&self.part, &self.path));
        if let Err(error) = done {
            // A caller that can do without the file goes on, and must not find a part of it.
            let _ = std::fs::remove_file(&self.part);
            return Err(Error::of_file("file cannot be finished", &self.path, error));
        }
        // The folder is synced, so that the new name survives a power cut. Where folders cannot be
        // opened (Windows), it does so anyway.
        if let Some(folder) = self.path.parent().and_then(|f| File::open(f).ok()) {
            let _ = folder.sync_all();
        }
        Ok(())
    }

    fn file(&mut self) -> &mut File {
        self.file.as_mut().expect("taken only by commit and drop")
    }

    /// Writes the buffer: whole pages past the cache, as long as all writes before were such.
    fn write_waiting(&mut self) -> std::io::Result<()> {
        let Self { file: Some(file), waiting, direct, .. } = self else { return Ok(()) };
        let direct = direct.get_or_insert_with(|| block::set_direct(file, true));
        let written = block::write_all(file, &mut [IoSlice::new(waiting.bytes())], direct);
        waiting.clear();
        written
    }

    /// Writes the whole buffer. Later writes use the cache, since they may begin anywhere.
    fn settle(&mut self) -> std::io::Result<()> {
        if self.direct == Some(true) {
            let _ = block::set_direct(self.file(), false);
        }
        self.direct = Some(false);
        self.write_waiting()
    }
}

/// Writes a whole file at once.
///
/// # Errors
/// If the file cannot be written.
pub fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut file = AtomicFile::create(path)?;
    file.write_all(bytes).map_err(|e| Error::of_file("file cannot be written", path, e))?;
    file.commit()
}

/// Like [`write()`], for a file that several processes, perhaps of several machines, may write at
/// once: each writes under a temporary name of its own, and the last rename counts.
///
/// # Errors
/// If the file cannot be written.
pub fn write_shared(path: &Path, bytes: &[u8]) -> Result<()> {
    let part = part_of(&path.with_extension(own_word()));
    let mut file = AtomicFile::open(path.to_path_buf(), part)?;
    file.write_all(bytes).map_err(|e| Error::of_file("file cannot be written", path, e))?;
    file.commit()
}

/// A word for temporary names that no other process uses, not even one on another machine: numbers
/// of processes repeat there, so the word is made of what the system draws for each hash table.
#[must_use]
pub fn own_word() -> String {
    use std::hash::{BuildHasher, Hasher};
    let drawn = std::collections::hash_map::RandomState::new().build_hasher().finish();
    format!("{drawn:016x}")
}

/// The temporary name of a file.
pub(crate) fn part_of(path: &Path) -> PathBuf {
    let mut name = path.file_name().map(std::ffi::OsStr::to_os_string).unwrap_or_default();
    name.push(".");
    name.push(PART);
    path.with_file_name(name)
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        if self.file.take().is_some() {
            // If the temporary file cannot be removed there is nothing more to do; it never had its
            // final name.
            let _ = std::fs::remove_file(&self.part);
        }
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let left = self.waiting.fill(bytes, GATHER).len();
        if self.waiting.bytes().len() == GATHER {
            self.write_waiting()?;
        }
        Ok(bytes.len() - left)
    }

    /// Does nothing: the buffer is written when it is full, when the file is read, and at the end.
    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

impl Read for AtomicFile {
    fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
        self.settle()?;
        self.file().read(bytes)
    }
}

impl Seek for AtomicFile {
    fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
        self.settle()?;
        self.file().seek(to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_committed_file_has_its_name() {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("result.json");
        let mut file = AtomicFile::create(&path).expect("begins");
        file.write_all(b"half").expect("writes");
        assert!(!path.exists());
        let mut half = String::new();
        file.again().expect("opens").read_to_string(&mut half).expect("reads");
        assert_eq!(half, "half");
        drop(file);
        assert_eq!(std::fs::read_dir(dir.path()).expect("a folder").count(), 0);
        write(&path, b"one").expect("writes");
        write(&path, b"two").expect("replaces");
        assert_eq!(std::fs::read(&path).expect("a file"), b"two");
        assert_eq!(std::fs::read_dir(dir.path()).expect("a folder").count(), 1);
        assert_eq!(
            write(&path.join("no/such"), b"").expect_err("fails").kind(),
            contract::Kind::Io
        );
    }

    #[test]
    fn a_file_that_cannot_get_its_name_leaves_nothing() {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("report.html");
        // A folder that is not empty cannot be replaced by a file.
        std::fs::create_dir_all(path.join("inside")).expect("a folder");
        assert!(write(&path, b"page").is_err());
        assert_eq!(std::fs::read_dir(dir.path()).expect("a folder").count(), 1);
    }
}
