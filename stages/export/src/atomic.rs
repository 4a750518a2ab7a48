//! Files that exist whole or not at all: bytes in; a temporary name until the end, then a sync and
//! a rename.

use crate::block::{self, AlignedBlock};
use contract::{Error, Result};
use std::fs::{File, OpenOptions};
use std::io::{IoSlice, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Ending of a file that is not yet whole.
pub const PART: &str = "part";

/// Bytes that are gathered before they go to a file: disks write pieces of this size at nearly
/// their full rate.
const GATHER: usize = 1 << 19;

/// A file that takes its own name only when it is committed; dropped before, it is removed. What is
/// written is gathered, and goes to disk past the system's cache as long as it is one long stream.
pub struct AtomicFile {
    file: Option<File>,
    part: PathBuf,
    path: PathBuf,
    waiting: AlignedBlock,
    /// Whether the file is written past the cache; `None` before the first piece, that of a small
    /// file is its last.
    direct: Option<bool>,
}

impl AtomicFile {
    /// Opens `<path>.part` for writing and reading; its folder is made where it is missing.
    pub fn create(path: impl Into<PathBuf>) -> Result<Self> {
        let path = path.into();
        if let Some(folder) = path.parent().filter(|f| !f.as_os_str().is_empty()) {
            std::fs::create_dir_all(folder)
                .map_err(|e| Error::of_file("folder cannot be made", folder, e))?;
        }
        let part = part_of(&path);
        let file = OpenOptions::new()
            .create(true)
            .read(true)
            .write(true)
            .truncate(true)
            .open(&part)
            .map_err(|e| Error::of_file("file cannot be made", &part, e))?;
        let (file, waiting) = (Some(file), AlignedBlock::default());
        Ok(Self { file, part, path, waiting, direct: None })
    }

    /// The name that it will have.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The name that it has until then, for those who write by name.
    pub(crate) fn part(&self) -> &Path {
        &self.part
    }

    /// The file once more, for reading what was written so far.
    pub fn again(&mut self) -> std::io::Result<File> {
        self.settle()?;
        File::open(&self.part)
    }

    /// Brings the bytes to disk, then gives the file its name, replacing what had it.
    pub fn commit(mut self) -> Result<()> {
        let settled = self.settle();
        let file = self.file.take().expect("taken only here and on drop");
        let done = settled.and_then(|()| file.sync_all());
        let done = done.and_then(|()| std::fs::rename(&self.part, &self.path));
        done.map_err(|e| Error::of_file("file cannot be finished", &self.path, e))?;
        // The new name itself must survive a power cut; where folders cannot be opened (Windows) it
        // does anyway.
        if let Some(folder) = self.path.parent().and_then(|f| File::open(f).ok()) {
            let _ = folder.sync_all();
        }
        Ok(())
    }

    fn file(&mut self) -> &mut File {
        self.file.as_mut().expect("taken only by commit and drop")
    }

    /// Writes what waits: whole pages past the cache, as long as there were no others before.
    fn write_waiting(&mut self) -> std::io::Result<()> {
        let Self { file: Some(file), waiting, direct, .. } = self else { return Ok(()) };
        let direct = direct.get_or_insert_with(|| block::set_direct(file, true));
        let written = block::write_all(file, &mut [IoSlice::new(waiting.bytes())], direct);
        waiting.clear();
        written
    }

    /// Writes all that waits; from now on through the cache, since what follows begins anywhere.
    fn settle(&mut self) -> std::io::Result<()> {
        if self.direct == Some(true) {
            let _ = block::set_direct(self.file(), false);
        }
        self.direct = Some(false);
        self.write_waiting()
    }
}

/// Writes a whole file at once.
pub fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut file = AtomicFile::create(path)?;
    file.write_all(bytes).map_err(|e| Error::of_file("file cannot be written", path, e))?;
    file.commit()
}

/// The name of a file while it is not yet whole.
pub(crate) fn part_of(path: &Path) -> PathBuf {
    let mut name = path.file_name().map(std::ffi::OsStr::to_os_string).unwrap_or_default();
    name.push(".");
    name.push(PART);
    path.with_file_name(name)
}

impl Drop for AtomicFile {
    fn drop(&mut self) {
        if self.file.take().is_some() {
            // Nothing more can be done about a leftover that refuses to go; it never had a final
            // name.
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

    /// Nothing: what waits goes to the file when it is read, when it is much, and at the end.
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
}
