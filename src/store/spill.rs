//! The spill file of a sink: records are appended as segments and read back. Where the system
//! allows it, the open file has no name in its folder, so that nothing remains when the program is
//! killed.

use super::record::Record;
use bytemuck::Zeroable;
use contract::{Error, Result};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Offset and number of consecutive records in the spill file.
#[derive(Debug, Clone, Copy)]
pub(super) struct SpilledSegment {
    offset: u64,
    n: usize,
}

/// The spill file of one sink.
pub(super) struct Spill {
    dir: PathBuf,
    file: File,
    len: u64,
}

impl Spill {
    pub(super) fn create(dir: &Path) -> Result<Self> {
        let file = tempfile::tempfile_in(dir)
            .map_err(|e| Error::of_file("a spill file cannot be created", dir, e))?;
        Ok(Self { dir: dir.to_owned(), file, len: 0 })
    }

    /// Number of bytes written.
    pub(super) fn len(&self) -> u64 {
        self.len
    }

    pub(super) fn write(&mut self, records: &[Record]) -> Result<SpilledSegment> {
        let bytes: &[u8] = bytemuck::cast_slice(records);
        self.file
            .write_all(bytes)
            .map_err(|e| Error::of_file("the spill file cannot be written", &self.dir, e))?;
        let segment = SpilledSegment { offset: self.len, n: records.len() };
        self.len += bytes.len() as u64;
        Ok(segment)
    }

    /// Reads a segment and appends it to `records`. After the first read no more may be written.
    pub(super) fn read(
        &mut self,
        segment: &SpilledSegment,
        records: &mut Vec<Record>,
    ) -> Result<()> {
        let start = records.len();
        records.resize(start + segment.n, Record::zeroed());
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut records[start..]);
        self.file
            .seek(SeekFrom::Start(segment.offset))
            .and_then(|_| self.file.read_exact(bytes))
            .map_err(|e| Error::of_file("the spill file cannot be read", &self.dir, e))
    }
}
