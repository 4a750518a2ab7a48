//! Writes one spatial tile piece by piece. No file is kept open: records wait in memory blocks and
//! are appended.

use crate::atomic::part_of;
use crate::block::{self, AlignedBlock};
use crate::las::{LasSummary, LasWriter, bounds, head};
use crate::record::{LasSettings, RecordExtent};
use crate::summed::BodySum;
use contract::{Error, Result};
use std::fs::{File, OpenOptions};
use std::io::{IoSlice, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Size of a block of waiting records, bytes. Blocks are reused, since new memory costs as much as
/// copying into it.
const BLOCK_BYTES: usize = 128 << 10;
/// Smallest number of blocks, however little memory is allowed.
const MIN_BLOCKS: usize = 4;

/// The pool of blocks for waiting records.
pub(crate) struct Blocks {
    pub(crate) empty: Vec<AlignedBlock>,
    /// Number of blocks that may still be allocated.
    left: usize,
}

impl Blocks {
    pub(crate) fn new(bytes: usize) -> Self {
        Self { empty: Vec::new(), left: (bytes / BLOCK_BYTES).max(MIN_BLOCKS) }
    }

    /// An empty block; `None` where all are in use.
    pub(crate) fn take(&mut self) -> Option<AlignedBlock> {
        let known = self.empty.pop();
        if known.is_none() && self.left > 0 {
            self.left -= 1;
            return Some(AlignedBlock::default());
        }
        known
    }
}

/// A tile that grows by appending records.
pub struct Spool {
    path: PathBuf,
    las: LasSettings,
    /// Temporary file of the records: the LAS file to be, or bare records that are compressed at
    /// the end.
    part: PathBuf,
    /// Waiting records; all blocks but the last are full.
    pub(crate) blocks: Vec<AlignedBlock>,
    pub(crate) extent: RecordExtent,
    body: BodySum,
    /// The part of the header that is not yet written.
    head: Vec<u8>,
    n_head: usize,
    is_begun: bool,
    /// Whether writes bypass the page cache, which they do as long as all are full blocks.
    direct: bool,
}

impl Spool {
    /// A tile without points, with records as `las` says.
    ///
    /// # Errors
    /// If the settings give no valid header.
    pub fn create(path: PathBuf, las: &LasSettings) -> Result<Self> {
        let part = part_of(&path.with_extension("records"));
        let head = if las.compress { Vec::new() } else { head(las, &RecordExtent::default())? };
        let (extent, body, n_head) = (RecordExtent::default(), BodySum::default(), head.len());
        let (las, blocks) = (las.clone(), Vec::new());
        let (is_begun, direct) = (false, true);
        Ok(Self { path, las, part, blocks, extent, body, head, n_head, is_begun, direct })
    }

    /// The final name of the tile.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The record format of the tile.
    pub(crate) fn las(&self) -> &LasSettings {
        &self.las
    }

    /// Number of points.
    #[must_use]
    pub fn n_points(&self) -> u64 {
        self.extent.n
    }

    /// Appends records; `blocks` is the pool in which they wait.
    pub(crate) fn push(
        &mut self,
        mut records: &[u8],
        extent: &RecordExtent,
        blocks: &mut Blocks,
    ) -> Result<()> {
        self.extent.join(extent);
        loop {
            records = self.fill(records);
            if records.is_empty() {
                return Ok(());
            }
            match blocks.take() {
                Some(block) => self.blocks.push(block),
                // All of the tile's blocks are full.
                None => self.append(blocks, self.blocks.len())?,
            }
        }
    }

    /// Copies as many records as fit into the last block, and returns the others. A record may be
    /// split between two blocks.
    pub(crate) fn fill<'a>(&mut self, records: &'a [u8]) -> &'a [u8] {
        let Some(last) = self.blocks.last_mut() else { return records };
        if !self.head.is_empty() {
            let head = std::mem::take(&mut self.head);
            last.fill(&head, BLOCK_BYTES);
        }
        last.fill(records, BLOCK_BYTES)
    }

    /// Writes the first `n` waiting blocks to the file and returns them to the pool.
    pub(crate) fn append(&mut self, blocks: &mut Blocks, n: usize) -> Result<()> {
        blocks.empty.extend(self.write(n)?);
        Ok(())
    }

    /// Writes the first `n` waiting blocks to the file and returns them.
    pub(crate) fn write(&mut self, n: usize) -> Result<Vec<AlignedBlock>> {
        let first = &self.blocks[..n];
        self.direct &= first.iter().all(|block| block.bytes().len() == BLOCK_BYTES);
        let written = self.open().and_then(|mut file| {
            self.direct = self.direct && block::set_direct(&file, true);
            let mut all: Vec<IoSlice<'_>> =
                first.iter().map(|block| IoSlice::new(block.bytes())).collect();
            block::write_all(&mut file, &mut all, &mut self.direct)
        });
        written.map_err(|e| Error::of_file("tile cannot be written", &self.part, e))?;
        self.is_begun = true;
        let mut written: Vec<AlignedBlock> = self.blocks.drain(..n).collect();
        for block in &mut written {
            let n_head = self.n_head.min(block.bytes().len());
            self.body.add(&block.bytes()[n_head..]);
            self.n_head -= n_head;
            block.clear();
        }
        Ok(written)
    }

    /// Opens the file for appending; the first time a file left by an earlier run is replaced.
    fn open(&self) -> std::io::Result<File> {
        let mut options = OpenOptions::new();
        if self.is_begun {
            options.append(true).open(&self.part)
        } else {
            self.part.parent().map_or(Ok(()), std::fs::create_dir_all)?;
            options.write(true).create(true).truncate(true).open(&self.part)
        }
    }

    /// Writes what waits, syncs the file and renames it to its final name.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn finish(mut self) -> Result<LasSummary> {
        let n = self.blocks.len();
        self.append(&mut Blocks::new(0), n)?;
        if self.las.compress { self.compress() } else { self.seal() }
    }

    /// Writes the header and renames the file to its final name.
    fn seal(&self) -> Result<LasSummary> {
        let head = head(&self.las, &self.extent)?;
        let sealed = OpenOptions::new().write(true).open(&self.part).and_then(|mut file| {
            file.seek(SeekFrom::Start(0))?;
            file.write_all(&head)?;
            file.sync_all()?;
            std::fs::rename(&self.part, &self.path)
        });
        sealed.map_err(|e| Error::of_file("tile cannot be finished", &self.path, e))?;
        Ok(LasSummary {
            path: self.path.clone(),
            n_points: self.extent.n,
            bounds: bounds(&self.las, &self.extent),
            sum: Some(self.body.behind(&head, &self.path)),
        })
    }

    /// Compresses the records of the temporary file.
    fn compress(&self) -> Result<LasSummary> {
        let las = &self.las;
        let failed = |e| Error::of_file("tile cannot be read again", &self.part, e);
        let mut writer = LasWriter::create(&self.path, las.clone())?;
        let mut file = File::open(&self.part).map_err(failed)?;
        // The whole extent goes with the first piece.
        let mut extent = self.extent;
        let mut left = self.extent.n as usize * las.record_len();
        let mut piece = vec![0; 8192 * las.record_len()];
        while left > 0 {
            let n = left.min(piece.len());
            file.read_exact(&mut piece[..n]).map_err(failed)?;
            writer.push_records(&piece[..n], &extent)?;
            (left, extent) = (left - n, RecordExtent::default());
        }
        writer.finish()
    }
}

impl Drop for Spool {
    fn drop(&mut self) {
        if self.is_begun {
            // After a rename there is nothing left; a temporary file that cannot be removed never
            // had its final name.
            let _ = std::fs::remove_file(&self.part);
        }
    }
}
