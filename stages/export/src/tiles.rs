//! Packed strips in, in any order; spatial tiles of all points out.
//!
//! Tiles are as many as the plant is large, so none of them keeps a file open: records wait in blocks of memory, bounded in
//! number, and full tiles are appended to their files.

use crate::atomic::part_of;
use crate::block::{self, Block};
use crate::las::{LasSummary, LasWriter, bounds, head};
use crate::pack::{Packed, Run};
use crate::record::{Extent, LasSettings};
use crate::settings::Settings;
use crate::summed::BodySum;
use contract::{Error, Fan, Result};
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::fs::{File, OpenOptions};
use std::io::{IoSlice, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// A tile with so many waiting bytes is appended to its file: one call to the system for a hundred thousand points.
const FULL_BYTES: usize = 4 << 20;
/// Blocks in which records wait, bytes. They are used again and again: fresh memory costs as much as copying into it.
const BLOCK_BYTES: usize = 128 << 10;
/// Fewest blocks, however little memory there is.
const MIN_BLOCKS: usize = 4;

/// Memory of the records that wait.
struct Blocks {
    empty: Vec<Block>,
    /// Of which there may be at most so many more.
    left: usize,
}

impl Blocks {
    fn new(bytes: usize) -> Self {
        Self { empty: Vec::new(), left: (bytes / BLOCK_BYTES).max(MIN_BLOCKS) }
    }

    /// An empty block; `None` where all are in use.
    fn take(&mut self) -> Option<Block> {
        let known = self.empty.pop();
        if known.is_none() && self.left > 0 {
            self.left -= 1;
            return Some(Block::default());
        }
        known
    }
}

/// Writes labelled points under `OUT/tiles`.
pub struct Tiles {
    out: PathBuf,
    las: LasSettings,
    tiles: BTreeMap<[i32; 2], Spool>,
    blocks: Blocks,
}

impl Tiles {
    /// Tiles under the output folder, of records as `las` has them; `None` where they are not asked for.
    ///
    /// # Errors
    /// A folder that cannot be made.
    pub fn create(out: &Path, las: &LasSettings, settings: &Settings) -> Result<Option<Self>> {
        if !settings.tiles {
            return Ok(None);
        }
        let folder = out.join("tiles");
        std::fs::create_dir_all(&folder)
            .map_err(|e| Error::of_file("folder cannot be made", &folder, e))?;
        let blocks = Blocks::new(settings.waiting_bytes);
        Ok(Some(Self { out: out.to_path_buf(), las: las.clone(), tiles: BTreeMap::new(), blocks }))
    }

    /// Adds a packed strip.
    ///
    /// # Errors
    /// A tile that cannot be written.
    pub fn add(&mut self, packed: &Packed) -> Result<()> {
        let mut runs = packed.runs(self.las.record_len());
        runs.try_for_each(|(run, records)| self.spool(run, records))
    }

    fn spool(&mut self, run: &Run, mut records: &[u8]) -> Result<()> {
        let (at, las) = (run.tile, &self.las);
        let path = || self.out.join(format!("tiles/{}_{}.{}", at[1], at[0], las.ending()));
        let spool = match self.tiles.entry(at) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(new) => new.insert(Spool::new(path(), las)?),
        };
        spool.extent.join(&run.extent);
        while let Some(spool) = self.tiles.get_mut(&at) {
            records = spool.fill(records);
            if spool.n_bytes() >= FULL_BYTES {
                spool.append(&mut self.blocks, spool.blocks.len())?;
            }
            if records.is_empty() {
                break;
            }
            match self.blocks.take() {
                Some(block) => spool.blocks.push(block),
                None => relieve(&mut self.tiles, &mut self.blocks)?,
            }
        }
        Ok(())
    }

    /// Finishes all tiles, side by side; by row then column.
    ///
    /// # Errors
    /// A tile that cannot be written, the first of them.
    pub fn finish(self, fan: &impl Fan) -> Result<Vec<LasSummary>> {
        let Self { las, tiles, blocks, .. } = self;
        drop(blocks);
        let spools = tiles.into_values().collect();
        fan.fan(spools, |spool: Spool| spool.finish(&las)).into_iter().collect()
    }
}

/// Appends the fullest tiles to their files until half of the blocks are free: full blocks, as long as there are some.
fn relieve(tiles: &mut BTreeMap<[i32; 2], Spool>, blocks: &mut Blocks) -> Result<()> {
    let mut fullest: Vec<([i32; 2], usize)> =
        tiles.iter().map(|(at, spool)| (*at, spool.blocks.len())).collect();
    fullest.sort_by_key(|(at, n)| (std::cmp::Reverse(*n), *at));
    let n_blocks: usize = fullest.iter().map(|(_, n)| n).sum();
    for (at, _) in fullest.into_iter().filter(|(_, n)| *n > 0) {
        if 2 * blocks.empty.len() > n_blocks {
            break;
        }
        if let Some(spool) = tiles.get_mut(&at) {
            spool.append(blocks, (spool.blocks.len() - 1).max(1))?;
        }
    }
    Ok(())
}

/// A tile that grows by appending.
struct Spool {
    path: PathBuf,
    /// Where records go: the LAS file to be; for LAZ, bare records that are compressed at the end.
    part: PathBuf,
    /// Bytes that wait, all blocks but the last full.
    blocks: Vec<Block>,
    extent: Extent,
    body: BodySum,
    /// What the file begins with: room for its header, bytes; and what of that is not written yet.
    head: Vec<u8>,
    n_head: usize,
    is_begun: bool,
    /// Whether the file is written past the system's cache, as it is while only full blocks are.
    direct: bool,
}

impl Spool {
    fn new(path: PathBuf, las: &LasSettings) -> Result<Self> {
        let part = part_of(&path.with_extension("records"));
        let head = if las.compress { Vec::new() } else { head(las, &Extent::default())? };
        let (extent, body, n_head) = (Extent::default(), BodySum::default(), head.len());
        let blocks = Vec::new();
        Ok(Self { path, part, blocks, extent, body, head, n_head, is_begun: false, direct: true })
    }

    /// Bytes that wait.
    fn n_bytes(&self) -> usize {
        self.blocks.iter().map(|block| block.bytes().len()).sum()
    }

    /// Takes as many records as the last block has room for; returns the others. A record may lie in two blocks.
    fn fill<'a>(&mut self, records: &'a [u8]) -> &'a [u8] {
        let Some(last) = self.blocks.last_mut() else { return records };
        if !self.head.is_empty() {
            let head = std::mem::take(&mut self.head);
            last.fill(&head, BLOCK_BYTES);
        }
        last.fill(records, BLOCK_BYTES)
    }

    /// Appends the first `n` blocks that wait, and gives them back.
    fn append(&mut self, blocks: &mut Blocks, n: usize) -> Result<()> {
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
        for mut block in self.blocks.drain(..n) {
            let n_head = self.n_head.min(block.bytes().len());
            self.body.add(&block.bytes()[n_head..]);
            self.n_head -= n_head;
            block.clear();
            blocks.empty.push(block);
        }
        Ok(())
    }

    /// The file, to be written from its end on; the first time, what an earlier run left behind goes.
    fn open(&self) -> std::io::Result<File> {
        let mut options = OpenOptions::new();
        if self.is_begun {
            options.append(true).open(&self.part)
        } else {
            options.write(true).create(true).truncate(true).open(&self.part)
        }
    }

    fn finish(mut self, las: &LasSettings) -> Result<LasSummary> {
        let n = self.blocks.len();
        self.append(&mut Blocks::new(0), n)?;
        if las.compress { self.compress(las) } else { self.seal(las) }
    }

    /// Writes the header and gives the file its name.
    fn seal(&self, las: &LasSettings) -> Result<LasSummary> {
        let head = head(las, &self.extent)?;
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
            bounds: bounds(las, &self.extent),
            sum: Some(self.body.behind(&head, &self.path)),
        })
    }

    /// Compresses the spooled records.
    fn compress(&self, las: &LasSettings) -> Result<LasSummary> {
        let failed = |e| Error::of_file("tile cannot be read again", &self.part, e);
        let mut writer = LasWriter::create(&self.path, las.clone())?;
        let mut file = File::open(&self.part).map_err(failed)?;
        // All of it with the first piece.
        let mut extent = self.extent;
        let mut left = self.extent.n as usize * las.record_len();
        let mut piece = vec![0; 8192 * las.record_len()];
        while left > 0 {
            let n = left.min(piece.len());
            file.read_exact(&mut piece[..n]).map_err(failed)?;
            writer.push_records(&piece[..n], &extent)?;
            (left, extent) = (left - n, Extent::default());
        }
        writer.finish()
    }
}

impl Drop for Spool {
    fn drop(&mut self) {
        if self.is_begun {
            // After a rename there is nothing left; a leftover that refuses to go never had a final name.
            let _ = std::fs::remove_file(&self.part);
        }
    }
}
