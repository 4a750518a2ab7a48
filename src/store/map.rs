//! A file of the store mapped into memory, by the same kind of map as inputs: it handles the signal
//! that a truncated file raises.

use contract::{Error, Kind, Result};
use ingest::Mapped;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// A read-only map of a whole file. Pages that were read count as resident memory, so they are
/// returned to the system each time `resident_bytes` bytes have been read.
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

    /// Checks that all bytes read so far were in the file. Call it before what was read is used.
    pub(super) fn check(&self) -> Result<()> {
        self.map.check().map_err(|_| {
            let what = "the tile file of the store was truncated or removed while it was read";
            Error::new(Kind::BadInput, what)
                .at(self.path.display())
                .hint("start the same run again: it makes the tiles again from the scans")
        })
    }

    /// Asks the system to read ahead a range that will be needed soon.
    pub(super) fn will_need(&self, start: usize, n: usize) {
        self.map.will_need(start, n);
    }

    /// Counts `n` bytes as read.
    pub(super) fn has_read(&self, n: usize) {
        if self.read_bytes.fetch_add(n, Ordering::Relaxed) + n < self.resident_bytes {
            return;
        }
        self.read_bytes.store(0, Ordering::Relaxed);
        self.map.give_back();
    }
}
