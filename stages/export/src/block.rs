//! Bytes in, one after the other; whole pages of memory out, aligned as disks want them, so that
//! what is large goes to its file, and comes from it, past the system's cache.
//!
//! A plant's outputs are larger than any cache, and nobody reads them at once: copied into fresh
//! pages of the cache they take a processor and most of the disk's rate. Where a file system knows
//! no such writes, they go through its cache.

use bytemuck::{Pod, Zeroable};
use std::fs::File;
use std::io::{Error, ErrorKind, IoSlice, Read, Result, Seek, SeekFrom, Write};

/// Bytes that memory and places of a file are aligned to: a multiple of the sectors of all common
/// disks.
pub const PAGE: usize = 4096;

/// Memory that is aligned to its length.
#[repr(C, align(4096))]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Page([u8; PAGE]);

/// Aligned memory that is filled from its beginning.
#[derive(Default)]
pub struct AlignedBlock {
    pages: Vec<Page>,
    n_bytes: usize,
}

impl AlignedBlock {
    /// What it was filled with.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &bytemuck::cast_slice(&self.pages)[..self.n_bytes]
    }

    /// Takes as many bytes as it has room for, where it may hold `capacity` (whole pages); returns
    /// the others.
    pub(crate) fn fill<'a>(&mut self, bytes: &'a [u8], capacity: usize) -> &'a [u8] {
        let (now, later) = bytes.split_at(bytes.len().min(capacity - self.n_bytes));
        let end = self.n_bytes + now.len();
        if end > self.pages.len() * PAGE {
            // Files are mostly small: memory grows with what comes.
            let n_pages = end.next_power_of_two().clamp(PAGE, capacity) / PAGE;
            self.pages.resize(n_pages, Page::zeroed());
        }
        bytemuck::cast_slice_mut(&mut self.pages)[self.n_bytes..end].copy_from_slice(now);
        self.n_bytes = end;
        later
    }

    /// Room for so many bytes, to be read into; what was there is forgotten.
    pub fn room(&mut self, n_bytes: usize) -> &mut [u8] {
        self.n_bytes = n_bytes;
        let n_pages = n_bytes.div_ceil(PAGE);
        if n_pages > self.pages.len() {
            self.pages.resize(n_pages, Page::zeroed());
        }
        &mut bytemuck::cast_slice_mut(&mut self.pages)[..n_bytes]
    }

    /// Forgets its bytes, but not its memory.
    pub(crate) fn clear(&mut self) {
        self.n_bytes = 0;
    }
}

/// Has an open file written and read past the system's cache from now on, or through it again;
/// whether it is past it now. It never is but on Linux, and there not on all file systems.
#[must_use]
pub fn set_direct(file: &File, is_direct: bool) -> bool {
    #[cfg(target_os = "linux")]
    {
        use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
        let set = fcntl_getfl(file).and_then(|mut flags| {
            flags.set(OFlags::DIRECT, is_direct);
            fcntl_setfl(file, flags)
        });
        is_direct && set.is_ok()
    }
    #[cfg(not(target_os = "linux"))]
    {
        let _ = (file, is_direct);
        false
    }
}

/// Writes all of some slices. Where the file is `direct` (see [`set_direct`]), and its system takes
/// that back, through the cache.
pub(crate) fn write_all(
    file: &mut File,
    slices: &mut [IoSlice<'_>],
    direct: &mut bool,
) -> Result<()> {
    let mut left = slices;
    while left.iter().any(|slice| !slice.is_empty()) {
        match file.write_vectored(left) {
            Ok(0) => return Err(Error::from(ErrorKind::WriteZero)),
            Ok(n) => IoSlice::advance_slices(&mut left, n),
            Err(e) if e.kind() == ErrorKind::Interrupted => {}
            Err(e) if e.kind() == ErrorKind::InvalidInput && *direct => {
                *direct = set_direct(file, false);
            }
            Err(e) => return Err(e),
        }
    }
    Ok(())
}

/// Reads as much as there is room for, or as there is; returns how much that was. Where the file is
/// direct, and its system takes that back, through the cache.
///
/// # Errors
/// What the reads say.
pub fn read_all(
    file: &File,
    room: &mut [u8],
    mut read: impl FnMut(&mut [u8], usize) -> Result<usize>,
) -> Result<usize> {
    let (mut n, mut may_be_direct) = (0, true);
    while n < room.len() {
        match read(&mut room[n..], n) {
            Ok(0) => break,
            Ok(more) => n += more,
            Err(e) if e.kind() == ErrorKind::Interrupted => {}
            Err(e) if e.kind() == ErrorKind::InvalidInput && may_be_direct => {
                may_be_direct = set_direct(file, false);
            }
            Err(e) => return Err(e),
        }
    }
    Ok(n)
}

/// Bytes that are read at once: disks give pieces of this size at nearly their full rate.
const AT_ONCE: usize = 1 << 19;

/// Reads a file straight on, past the system's cache where that can be.
pub(crate) struct DirectReader {
    file: File,
    block: AlignedBlock,
    /// Bytes of the block that were given out.
    n_given: usize,
}

impl DirectReader {
    /// From a place of the file on.
    pub(crate) fn new(mut file: File, start: u64) -> Result<Self> {
        let n_given = start as usize % PAGE;
        file.seek(SeekFrom::Start(start - n_given as u64))?;
        let _ = set_direct(&file, true);
        let mut straight = Self { file, block: AlignedBlock::default(), n_given: 0 };
        straight.next()?;
        straight.n_given = n_given.min(straight.block.n_bytes);
        Ok(straight)
    }

    fn next(&mut self) -> Result<()> {
        let Self { file, block, .. } = self;
        let n = read_all(file, block.room(AT_ONCE), |room, _| (&*file).read(room))?;
        (block.n_bytes, self.n_given) = (n, 0);
        Ok(())
    }
}

impl Read for DirectReader {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize> {
        if self.n_given == self.block.n_bytes {
            self.next()?;
        }
        let left = &self.block.bytes()[self.n_given..];
        let n = left.len().min(bytes.len());
        bytes[..n].copy_from_slice(&left[..n]);
        self.n_given += n;
        Ok(n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_read_from_anywhere_to_their_end() {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("file");
        let bytes: Vec<u8> = (0..2 * AT_ONCE + 77).map(|i| (i % 251) as u8).collect();
        std::fs::write(&path, &bytes).expect("writes");
        for start in [0, 1, PAGE, AT_ONCE - 1, AT_ONCE + 3 * PAGE + 5, bytes.len(), bytes.len() + 9]
        {
            let file = File::open(&path).expect("opens");
            let mut read = Vec::new();
            let mut straight = DirectReader::new(file, start as u64).expect("begins");
            straight.read_to_end(&mut read).expect("reads");
            assert!(read == bytes[start.min(bytes.len())..], "from {start}");
        }
    }

    #[test]
    fn blocks_hold_what_they_were_filled_with() {
        let bytes: Vec<u8> = (0..5 * PAGE).map(|i| (i % 251) as u8).collect();
        let mut block = AlignedBlock::default();
        let mut rest = &bytes[..];
        for n in [1, 10, PAGE, 0, 2 * PAGE, PAGE] {
            let (now, _) = rest.split_at(n);
            rest = &rest[n - block.fill(now, 4 * PAGE).len()..];
        }
        assert_eq!(block.bytes(), &bytes[..4 * PAGE]);
        assert_eq!(rest.len(), PAGE);
        assert_eq!(block.bytes().as_ptr().align_offset(PAGE), 0);
        block.clear();
        assert!(block.fill(&bytes[7..9], 4 * PAGE).is_empty());
        assert_eq!(block.bytes(), &bytes[7..9]);
    }
}
