//! Page-aligned buffers for writing and reading large files past the operating system's page cache.
//!
//! The outputs of a plant are larger than any cache and are not read again soon. Copying them into
//! the cache would cost much of a processor and of the disk's rate. Where a file system does not
//! support such writes, they go through its cache.

use bytemuck::{Pod, Zeroable};
use std::fs::File;
use std::io::{Error, ErrorKind, IoSlice, Read, Result, Seek, SeekFrom, Write};

/// Alignment of memory and file offsets, bytes: a multiple of the sector size of all common disks.
pub const PAGE: usize = 4096;

/// Memory with an alignment of its own length.
#[repr(C, align(4096))]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Page([u8; PAGE]);

/// A buffer of aligned memory.
#[derive(Default)]
pub struct AlignedBlock {
    pages: Vec<Page>,
    n_bytes: usize,
}

impl AlignedBlock {
    /// The bytes that were filled in.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &bytemuck::cast_slice(&self.pages)[..self.n_bytes]
    }

    /// Appends as many bytes as fit into `capacity` (whole pages), and returns the others.
    pub(crate) fn fill<'a>(&mut self, bytes: &'a [u8], capacity: usize) -> &'a [u8] {
        let (now, later) = bytes.split_at(bytes.len().min(capacity - self.n_bytes));
        let end = self.n_bytes + now.len();
        if end > self.pages.len() * PAGE {
            // Most files are small, so that memory grows with the content.
            let n_pages = end.next_power_of_two().clamp(PAGE, capacity) / PAGE;
            self.pages.resize(n_pages, Page::zeroed());
        }
        bytemuck::cast_slice_mut(&mut self.pages)[self.n_bytes..end].copy_from_slice(now);
        self.n_bytes = end;
        later
    }

    /// A buffer of `n_bytes` to read into; its previous content is lost.
    pub fn room(&mut self, n_bytes: usize) -> &mut [u8] {
        self.n_bytes = n_bytes;
        let n_pages = n_bytes.div_ceil(PAGE);
        if n_pages > self.pages.len() {
            self.pages.resize(n_pages, Page::zeroed());
        }
        &mut bytemuck::cast_slice_mut(&mut self.pages)[..n_bytes]
    }

    /// Empties the buffer and keeps its memory.
    pub(crate) fn clear(&mut self) {
        self.n_bytes = 0;
    }
}

/// Switches an open file to bypass the page cache, or back. Returns whether it now bypasses the
/// cache, which only some file systems of Linux support.
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

/// Writes all of some slices. If the operating system refuses a write to a `direct` file (see
/// [`set_direct`]), the cache is used.
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

/// Reads until the buffer is full or the file ends, and returns the number of bytes. If the
/// operating system refuses a read from a direct file, the cache is used.
///
/// # Errors
/// If the file cannot be read.
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

/// Number of bytes that are read at once: at this size disks reach nearly their full rate.
const AT_ONCE: usize = 1 << 19;

/// Reads a file sequentially, past the page cache where possible.
pub(crate) struct DirectReader {
    file: File,
    block: AlignedBlock,
    /// Number of bytes of the block that were returned.
    n_given: usize,
}

impl DirectReader {
    /// Starts at an offset of the file.
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
