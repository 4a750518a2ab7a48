//! The tile file while a store is filled: encoded tiles are appended, and can be read back before
//! the file is complete.

use super::catalogue;
use super::catalogue::TileEntry;
use super::encode::Encoded;
use super::record::N_LEVELS;
use contract::{Error, Result};
use export::AtomicFile;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// The tile file of a sink. A tile that was written early and is written again leaves a gap.
pub(super) struct TileFile {
    file: AtomicFile,
    path: PathBuf,
    len: u64,
}

/// The same file, opened to read tiles that were written so far.
pub(super) struct Early {
    file: File,
    path: PathBuf,
}

impl TileFile {
    pub(super) fn create(path: &Path) -> Result<Self> {
        let mut file = AtomicFile::create(path)?;
        file.write_all(&catalogue::tiles_header())
            .map_err(|e| Error::of_file("a tile cannot be written", path, e))?;
        Ok(Self { file, path: path.to_owned(), len: catalogue::HEADER_BYTES })
    }

    /// Appends a tile and returns its catalogue entry.
    pub(super) fn append(&mut self, encoded: &Encoded) -> Result<TileEntry> {
        let entry = TileEntry { offset: self.len, ..encoded.entry };
        self.len += encoded.bytes.len() as u64;
        self.file
            .write_all(&encoded.bytes)
            .map_err(|e| Error::of_file("a tile cannot be written", &self.path, e))?;
        Ok(entry)
    }

    pub(super) fn early(&mut self) -> Result<Early> {
        let failed = |e| Error::of_file("the tiles cannot be read again", &self.path, e);
        Ok(Early { file: self.file.again().map_err(failed)?, path: self.path.clone() })
    }

    /// Gives the file its final name and returns its length, bytes.
    pub(super) fn commit(self) -> Result<u64> {
        self.file.commit()?;
        Ok(self.len)
    }
}

impl Early {
    /// Reads the bytes of a tile.
    pub(super) fn read(&mut self, entry: &TileEntry) -> Result<Vec<u8>> {
        let mut bytes = vec![0; entry.n_bytes(N_LEVELS) as usize];
        let read = self.file.seek(SeekFrom::Start(entry.offset));
        read.and_then(|_| self.file.read_exact(&mut bytes))
            .map_err(|e| Error::of_file("a tile cannot be read again", &self.path, e))?;
        Ok(bytes)
    }
}
