//! Reads pieces of a file, past the page cache of the system where that is wanted and possible. A
//! file that is read once and exceeds any cache would only evict pages that are needed again.

use export::block::{AlignedBlock, PAGE, read_all, set_direct};
use std::fs::File;
use std::io::Result;
use std::ops::{Deref, Range};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// A file whose pieces are read by many threads, each piece once.
pub(crate) struct DirectFile {
    file: File,
    /// Blocks of memory that no reader uses at present. They are kept, since fresh memory costs as
    /// much time as reading.
    free: Mutex<Vec<AlignedBlock>>,
}

/// Bytes of a file in a block of memory that returns to the file's pool when it is dropped.
pub(crate) struct LentBytes<'a> {
    of: &'a DirectFile,
    block: AlignedBlock,
    range: Range<usize>,
}

impl DirectFile {
    /// For an open file, read past the page cache where the system can do that.
    pub(crate) fn past_cache(file: File) -> Self {
        let _ = set_direct(&file, true);
        Self::through_cache(file)
    }

    /// For an open file that will be read again, read through the page cache.
    pub(crate) fn through_cache(file: File) -> Self {
        Self { file, free: Mutex::default() }
    }

    /// Reads `n` bytes from offset `start` on, or fewer at the end of the file.
    pub(crate) fn read(&self, start: u64, n: usize) -> Result<LentBytes<'_>> {
        let mut block = self.free().pop().unwrap_or_default();
        let before = (start % PAGE as u64) as usize;
        let first = start - before as u64;
        let room = block.room((before + n).next_multiple_of(PAGE));
        let at = |n: usize| first + n as u64;
        let read = read_all(&self.file, room, |room, n| read_at(&self.file, room, at(n)))?;
        Ok(LentBytes { of: self, block, range: before.min(read)..read.min(before + n) })
    }

    fn free(&self) -> MutexGuard<'_, Vec<AlignedBlock>> {
        self.free.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Deref for LentBytes<'_> {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        &self.block.bytes()[self.range.clone()]
    }
}

impl Drop for LentBytes<'_> {
    fn drop(&mut self) {
        self.of.free().push(std::mem::take(&mut self.block));
    }
}

#[cfg(unix)]
fn read_at(file: &File, bytes: &mut [u8], at: u64) -> Result<usize> {
    std::os::unix::fs::FileExt::read_at(file, bytes, at)
}

#[cfg(windows)]
fn read_at(file: &File, bytes: &mut [u8], at: u64) -> Result<usize> {
    std::os::windows::fs::FileExt::seek_read(file, bytes, at)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_piece_is_read_either_way_and_the_end_is_short() {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("file");
        let bytes: Vec<u8> = (0..3 * PAGE + 77).map(|i| (i % 251) as u8).collect();
        std::fs::write(&path, &bytes).expect("writes");
        let open = || File::open(&path).expect("opens");
        for file in [DirectFile::past_cache(open()), DirectFile::through_cache(open())] {
            for (start, n) in
                [(0, 1), (5, PAGE), (PAGE - 1, PAGE + 2), (3 * PAGE, 77), (2 * PAGE + 9, 0)]
            {
                let lent = file.read(start as u64, n).expect("reads");
                assert!(*lent == bytes[start..start + n], "{n} from {start}");
            }
            assert!(*file.read(3 * PAGE as u64 + 7, 100).expect("reads") == bytes[3 * PAGE + 7..]);
            assert!(file.read(5 * PAGE as u64 + 7, 100).expect("reads").is_empty());
        }
    }
}
