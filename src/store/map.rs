//! A file of ours in, its bytes in memory out. The only unsafe code of `src`.
#![allow(unsafe_code, reason = "a memory map is unsafe by its nature; it is gathered here")]

use contract::{Error, Result};
use memmap2::Mmap;
use std::fs::File;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A read-only map of a whole file. Pages that were read count as resident, so they are given back each time
/// `resident_bytes` have been read.
pub(super) struct FileMap {
    map: Mmap,
    resident_bytes: usize,
    read_bytes: AtomicUsize,
}

impl FileMap {
    pub(super) fn open(path: &Path, resident_bytes: usize) -> Result<Self> {
        let file =
            File::open(path).map_err(|e| Error::of_file("the tiles cannot be opened", path, e))?;
        // SAFETY: the file lies in the store's private folder, was renamed there whole, and is never written again;
        // nobody but us has reason to change it while it is mapped.
        let map = unsafe { Mmap::map(&file) };
        let map = map.map_err(|e| Error::of_file("the tiles cannot be mapped", path, e))?;
        Ok(Self { map, resident_bytes, read_bytes: AtomicUsize::new(0) })
    }

    pub(super) fn bytes(&self) -> &[u8] {
        &self.map
    }

    /// Has the system read a range that will be asked for soon: page by page it would be read at the disk's leisure.
    pub(super) fn will_need(&self, start: usize, n: usize) {
        #[cfg(unix)]
        {
            // Advice only.
            let _ = self.map.advise_range(memmap2::Advice::WillNeed, start, n);
        }
    }

    /// To be told after `n` bytes were read.
    pub(super) fn has_read(&self, n: usize) {
        if self.read_bytes.fetch_add(n, Ordering::Relaxed) + n < self.resident_bytes {
            return;
        }
        self.read_bytes.store(0, Ordering::Relaxed);
        #[cfg(unix)]
        {
            // SAFETY: the map is shared and read-only: a dropped page is read again from the file, same bytes.
            let advised = unsafe { self.map.unchecked_advise(memmap2::UncheckedAdvice::DontNeed) };
            // Advice only: where the system does not take it, the pages stay until it needs them.
            let _ = advised;
        }
    }
}
