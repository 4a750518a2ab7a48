//! Packed strips in, in any order; spatial tiles of all points out.
//!
//! Tiles are as many as the plant is large, so none of them keeps a file open: records wait in blocks of memory, bounded in
//! number, and full tiles are appended to their files.

use crate::atomic::part_of;
use crate::las::{LasSummary, LasWriter, bounds, head};
use crate::pack::{Packed, Run};
use crate::record::{Extent, LasSettings};
use crate::settings::Settings;
use crate::summed::BodySum;
use contract::{Error, Fan, Result};
use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, IoSlice, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// A tile with so many waiting bytes is appended to its file: one call to the system for a hundred thousand points.
const FULL_BYTES: usize = 4 << 20;
/// Blocks in which records wait, bytes. They are used again and again: fresh memory costs as much as copying into it.
const BLOCK_BYTES: usize = 128 << 10;
/// Fewest blocks, however little memory there is.
const MIN_BLOCKS: usize = 4;

/// Memory of the records that wait.
struct Blocks {
    empty: Vec<Vec<u8>>,
    /// Of which there may be at most so many more.
    left: usize,
}

impl Blocks {
    fn new(bytes: usize) -> Self {
        Self { empty: Vec::new(), left: (bytes / BLOCK_BYTES).max(MIN_BLOCKS) }
    }

    /// An empty block; `None` where all are in use.
    fn take(&mut self) -> Option<Vec<u8>> {
        let known = self.empty.pop();
        if known.is_none() && self.left > 0 {
            self.left -= 1;
            return Some(Vec::with_capacity(BLOCK_BYTES));
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
        let spool = self.tiles.entry(at).or_insert_with(|| Spool::new(path()));
        spool.extent.join(&run.extent);
        while let Some(spool) = self.tiles.get_mut(&at) {
            records = spool.fill(records);
            if spool.n_bytes() >= FULL_BYTES {
                spool.append(las, &mut self.blocks)?;
            }
            if records.is_empty() {
                break;
            }
            match self.blocks.take() {
                Some(block) => spool.blocks.push(block),
                None => relieve(&mut self.tiles, &mut self.blocks, las)?,
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

/// Appends the fullest tiles to their files until half of the blocks are free.
fn relieve(
    tiles: &mut BTreeMap<[i32; 2], Spool>,
    blocks: &mut Blocks,
    las: &LasSettings,
) -> Result<()> {
    let mut fullest: Vec<([i32; 2], usize)> =
        tiles.iter().map(|(at, spool)| (*at, spool.blocks.len())).collect();
    fullest.sort_by_key(|(at, n)| (std::cmp::Reverse(*n), *at));
    let n_blocks: usize = fullest.iter().map(|(_, n)| n).sum();
    for (at, _) in fullest {
        if 2 * blocks.empty.len() > n_blocks {
            break;
        }
        if let Some(spool) = tiles.get_mut(&at) {
            spool.append(las, blocks)?;
        }
    }
    Ok(())
}

/// A tile that grows by appending.
struct Spool {
    path: PathBuf,
    /// Where records go: the LAS file to be; for LAZ, bare records that are compressed at the end.
    part: PathBuf,
    /// Records that wait, all blocks but the last full.
    blocks: Vec<Vec<u8>>,
    extent: Extent,
    body: BodySum,
    is_begun: bool,
}

impl Spool {
    fn new(path: PathBuf) -> Self {
        let part = part_of(&path.with_extension("records"));
        let (extent, body) = (Extent::default(), BodySum::default());
        Self { path, part, blocks: Vec::new(), extent, body, is_begun: false }
    }

    /// Bytes that wait.
    fn n_bytes(&self) -> usize {
        self.blocks.iter().map(Vec::len).sum()
    }

    /// Takes as many records as the last block has room for; returns the others. A record may lie in two blocks.
    fn fill<'a>(&mut self, records: &'a [u8]) -> &'a [u8] {
        let Some(last) = self.blocks.last_mut() else { return records };
        let (now, later) = records.split_at(records.len().min(BLOCK_BYTES - last.len()));
        last.extend_from_slice(now);
        later
    }

    /// Appends what waits, and gives its blocks back.
    fn append(&mut self, las: &LasSettings, blocks: &mut Blocks) -> Result<()> {
        let failed = |e| Error::of_file("tile cannot be written", &self.part, e);
        let begin = !self.is_begun;
        let mut options = OpenOptions::new();
        // The first time, what an earlier run left behind goes.
        let options = if begin {
            options.write(true).create(true).truncate(true)
        } else {
            options.append(true)
        };
        let mut file = options.open(&self.part).map_err(failed)?;
        if begin && !las.compress {
            file.write_all(&head(las, &Extent::default())?).map_err(failed)?;
        }
        let mut all: Vec<IoSlice<'_>> = self.blocks.iter().map(|b| IoSlice::new(b)).collect();
        let mut left = all.as_mut_slice();
        while left.iter().any(|slice| !slice.is_empty()) {
            match file.write_vectored(left) {
                Ok(0) => return Err(failed(ErrorKind::WriteZero.into())),
                Ok(n) => IoSlice::advance_slices(&mut left, n),
                Err(e) if e.kind() == ErrorKind::Interrupted => {}
                Err(e) => return Err(failed(e)),
            }
        }
        self.blocks.iter().for_each(|block| self.body.add(block));
        self.is_begun = true;
        for mut block in self.blocks.drain(..) {
            block.clear();
            blocks.empty.push(block);
        }
        Ok(())
    }

    fn finish(mut self, las: &LasSettings) -> Result<LasSummary> {
        self.append(las, &mut Blocks::new(0))?;
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
