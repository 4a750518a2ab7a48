//! A file of ours in, its bytes in memory out, by the map that inputs are read through: it catches
//! the signal of a file that is cut short.

use contract::{Error, Kind, Result};
use ingest::Mapped;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// A read-only map of a whole file. Pages that were read count as resident, so they are given back
/// each time `resident_bytes` have been read.
pub(super) struct FileMap {
    map: Mapped,
    path: PathBuf,
    resident_bytes: usize,
    read_bytes: AtomicUsize,
}

impl FileMap {
    pub(super) fn open(path: &Path, resident_bytes: usize) -> Result<Self> {
        let map = ingest::map(path).map_err(|e| e.at(path.display()))?;
        let read_bytes = AtomicUsize::new(0);
        Ok(Self { map, path: path.to_path_buf(), resident_bytes, read_bytes })
    }

    pub(super) fn bytes(&self) -> &[u8] {
        &self.map
    }

    /// Whether all that was read of it was there; to be asked before what was read is used.
    pub(super) fn check(&self) -> Result<()> {
        self.map.check().map_err(|_| {
            let what = "the tiles of the store were cut short or went away while they were read";
            Error::new(Kind::BadInput, what)
                .at(self.path.display())
                .hint("start the same run again: it makes them anew from the scans")
        })
    }

    /// Has the system read a range that will be asked for soon: page by page it would be read at
    /// the disk's leisure.
    pub(super) fn will_need(&self, start: usize, n: usize) {
        self.map.will_need(start, n);
    }

    /// To be told after `n` bytes were read.
    pub(super) fn has_read(&self, n: usize) {
        if self.read_bytes.fetch_add(n, Ordering::Relaxed) + n < self.resident_bytes {
            return;
        }
        self.read_bytes.store(0, Ordering::Relaxed);
        self.map.give_back();
    }
}
