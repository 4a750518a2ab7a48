//! Path in, bytes out: the one place of this room that maps files into memory.
#![allow(unsafe_code)]

use contract::{Error, Result};
use memmap2::Mmap;
use std::fs::File;
use std::path::Path;

/// Maps a whole file, read only. An empty file is refused, since it cannot be mapped and holds nothing.
pub(crate) fn map(path: &Path) -> Result<Mmap> {
    let file = File::open(path)?;
    if file.metadata()?.len() == 0 {
        return Err(Error::bad_input("the file is empty"));
    }
    // SAFETY: the map is private to this room and only read, and inputs are never written by us. What remains is
    // another process that shortens the file while it is read: then the system ends the run with a signal, no byte
    // of ours is written over; every reader of mapped files accepts that.
    Ok(unsafe { Mmap::map(&file)? })
}
