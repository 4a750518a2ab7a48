//! Encoded tiles in, one after the other in a file, out; and tiles of it back while it is still being written.

use super::catalogue::{self, TileEntry};
use super::encode::{Encoded, layout};
use super::io_error;
use crate::atomic::AtomicFile;
use contract::Result;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// The tile file of a sink. A tile that was written too early and is written again leaves a gap.
pub(super) struct TileFile {
    file: Access,
    path: PathBuf,
    len: u64,
}

enum Access {
    Write(AtomicFile),
    Read(std::fs::File),
}

impl TileFile {
    pub(super) fn create(path: &Path) -> Result<Self> {
        let mut file = AtomicFile::create(path)?;
        file.write_all(&catalogue::tiles_header())
            .map_err(|e| io_error(path, "a tile cannot be written", e))?;
        let len = catalogue::HEADER_BYTES;
        Ok(Self { file: Access::Write(file), path: path.to_owned(), len })
    }

    /// Appends a tile; returns its entry.
    pub(super) fn append(&mut self, encoded: Encoded) -> Result<TileEntry> {
        let Encoded { mut entry, bytes } = encoded;
        entry.offset = self.len;
        self.len += bytes.len() as u64;
        let written = match &mut self.file {
            Access::Write(file) => file.write_all(&bytes),
            Access::Read(_) => Err(std::io::ErrorKind::PermissionDenied.into()),
        };
        written.map_err(|e| io_error(&self.path, "a tile cannot be written", e))?;
        Ok(entry)
    }

    /// The same file once more, to read what was written so far.
    pub(super) fn again(&mut self) -> Result<Self> {
        let again = match &mut self.file {
            Access::Write(file) => file.again(),
            Access::Read(file) => file.try_clone(),
        };
        let failed = |e| io_error(&self.path, "the tiles cannot be read again", e);
        Ok(Self {
            file: Access::Read(again.map_err(failed)?),
            path: self.path.clone(),
            len: self.len,
        })
    }

    /// The bytes of a tile.
    pub(super) fn read(&mut self, entry: &TileEntry) -> Result<Vec<u8>> {
        let mut bytes = vec![0; layout(entry.n_points)[3] as usize];
        let read = match &mut self.file {
            Access::Read(file) => {
                file.seek(SeekFrom::Start(entry.offset)).and_then(|_| file.read_exact(&mut bytes))
            }
            Access::Write(_) => Err(std::io::ErrorKind::PermissionDenied.into()),
        };
        read.map_err(|e| io_error(&self.path, "a tile cannot be read again", e))?;
        Ok(bytes)
    }

    /// Gives the file its name; returns its length.
    pub(super) fn commit(self) -> Result<u64> {
        if let Access::Write(file) = self.file {
            file.commit()?;
        }
        Ok(self.len)
    }
}
