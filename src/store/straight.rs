//! A file of ours in, pieces of it out, past the system's cache where that can be: what is read once, and is larger than any
//! cache, would only push out of it what is read again.

use super::catalogue::broken;
use contract::{Error, Result};
use export::block::{Block, PAGE, read_all, set_direct};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// A file that is read once from beginning to end, in any order of its pieces.
pub(super) struct Straight {
    file: File,
    path: PathBuf,
    /// Memory that no reader uses now: fresh memory costs as much as reading.
    free: Mutex<Vec<Block>>,
}

impl Straight {
    pub(super) fn open(path: &Path) -> Result<Self> {
        let file =
            File::open(path).map_err(|e| Error::of_file("the tiles cannot be opened", path, e))?;
        // Where that cannot be, it is read through the cache.
        let _ = set_direct(&file, true);
        Ok(Self { file, path: path.to_owned(), free: Mutex::default() })
    }

    /// Does something with `n` bytes from `start` on.
    pub(super) fn with<T>(
        &self,
        start: usize,
        n: usize,
        work: impl FnOnce(&[u8]) -> T,
    ) -> Result<T> {
        let mut block = self.free().pop().unwrap_or_default();
        let first = start / PAGE * PAGE;
        let read = self.read(first, block.room((start + n).next_multiple_of(PAGE) - first));
        let read = read.map_err(|e| Error::of_file("the tiles cannot be read", &self.path, e))?;
        if read < start + n - first {
            return Err(broken("the tiles are cut short").at(self.path.display()));
        }
        let done = work(&block.bytes()[start - first..start - first + n]);
        self.free().push(block);
        Ok(done)
    }

    /// Reads as much as there is; returns how much that was.
    fn read(&self, first: usize, room: &mut [u8]) -> std::io::Result<usize> {
        let at = |n: usize| (first + n) as u64;
        read_all(&self.file, room, |room, n| read_at(&self.file, room, at(n)))
    }

    fn free(&self) -> std::sync::MutexGuard<'_, Vec<Block>> {
        self.free.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(unix)]
fn read_at(file: &File, bytes: &mut [u8], at: u64) -> std::io::Result<usize> {
    std::os::unix::fs::FileExt::read_at(file, bytes, at)
}

#[cfg(windows)]
fn read_at(file: &File, bytes: &mut [u8], at: u64) -> std::io::Result<usize> {
    std::os::windows::fs::FileExt::seek_read(file, bytes, at)
}
