//! Path in, bytes out: the one place of this room that maps files into memory.
#![allow(unsafe_code)]

use contract::{Error, Result};
use memmap2::Mmap;
use std::fs::File;
use std::ops::{Deref, Range};
use std::path::Path;

/// Bytes that are given back to the system at a time: pages that were read count as resident memory of the program.
const GIVEN_BACK: usize = 32 << 20;
/// Pages of the largest systems: what is given back begins and ends at their bounds.
const PAGE: usize = 1 << 16;

/// A read-only map of a whole file.
pub(crate) struct Mapped(Mmap);

/// Maps a whole file, read only. An empty file is refused, since it cannot be mapped and holds nothing.
pub(crate) fn map(path: &Path) -> Result<Mapped> {
    let file = File::open(path)?;
    if file.metadata()?.len() == 0 {
        return Err(Error::bad_input("the file is empty"));
    }
    // SAFETY: the map is private to this room and only read, and inputs are never written by us. What remains is
    // another process that shortens the file while it is read: then the system ends the run with a signal, no byte
    // of ours is written over; every reader of mapped files accepts that.
    Ok(Mapped(unsafe { Mmap::map(&file)? }))
}

impl Mapped {
    /// To be told how far a reader of consecutive bytes has come; `given` is what it has given back so far.
    pub(crate) fn passed(&self, to: usize, given: &mut usize) {
        if to >= *given + GIVEN_BACK {
            let end = to / PAGE * PAGE;
            self.turn(*given..end);
            *given = end;
        }
    }

    #[cfg(not(unix))]
    fn turn(&self, _: Range<usize>) {}

    /// Gives back a range, and has the system read what comes after it: disks are slow to answer, not to read.
    #[cfg(unix)]
    fn turn(&self, range: Range<usize>) {
        // SAFETY: the map is read-only and of a file: a page that is dropped is read again, with the same bytes.
        let advised = unsafe {
            let dont_need = memmap2::UncheckedAdvice::DontNeed;
            self.0.unchecked_advise_range(dont_need, range.start, range.len())
        };
        let next = range.end + GIVEN_BACK..(range.end + 2 * GIVEN_BACK).min(self.0.len());
        // Advice only: where the system does not take it, the pages stay until it needs them, or come when asked for.
        let _ = advised;
        if !next.is_empty() {
            let _ = self.0.advise_range(memmap2::Advice::WillNeed, next.start, next.len());
        }
    }
}

impl Deref for Mapped {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        &self.0
    }
}
