//! Gathers the scattered points of strips into tiles and writes the store. Where memory is full,
//! the tiles that have received no point for the longest time are written first, since a scanner
//! rarely returns to a place that it has passed. Points that do return go through a spill file, and
//! their tile is written again at the end.

use super::buffer::{Buffer, TILE_POINTS};
use super::catalogue::{self, CATALOGUE, TILES, TileEntry};
use super::encode::{Encode, Encoded};
use super::file::TileFile;
use super::parts::{LONGEST_SPAN, Parts, span};
use super::reader::Store;
use super::record::{Record, TilePart};
use super::scatter::Scattered;
use super::spill::Spill;
use super::writer::Writer;
use crate::engine::{Amount, Engine, Task};
use contract::{Error, Result, Scan, TileAt};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Most room that is reserved for a tile in advance, points: that of a scan with one point per
/// pixel and a few more.
const USUAL_POINTS: usize = (1 << 16) + (1 << 13);
/// Most tiles whose memory is kept for later tiles, whatever the budget.
const MAX_FREE: usize = 128;
/// Size of a batch of records that is written at once, bytes: some tens of tiles, little beside
/// what waits in memory.
const BATCH_BYTES: usize = 48 << 20;

/// Fills a store. Strips must be added in the order of the input.
pub struct TileSink {
    dir: PathBuf,
    encode: Arc<Encode>,
    /// Index of the buffer of each scan, row and column; never iterated.
    places: HashMap<(u32, [u32; 2]), usize>,
    buffers: Vec<Buffer>,
    /// Reserved room of all buffers, bytes.
    bytes: usize,
    /// Most points that a written tile had: the room that is reserved for later ones.
    usual: usize,
    budget_bytes: usize,
    writer: Writer,
    spill: Option<Spill>,
    n_points: u64,
    n_strips: u64,
    /// Number of the first scan of the store.
    first: u32,
}

impl TileSink {
    /// Begins a store in `dir` for strips of `scans` (all of a run, in their order) from the scan
    /// `first` on. It keeps about `budget_bytes` bytes in memory while it is filled. An older store
    /// in `dir` is removed.
    ///
    /// # Errors
    /// A folder or file that cannot be created.
    pub fn create(dir: &Path, scans: &[Scan], first: u32, budget_bytes: usize) -> Result<Self> {
        std::fs::create_dir_all(dir)
            .map_err(|e| Error::of_file("the folder of the store cannot be created", dir, e))?;
        // Removing the catalogue first makes the old store invalid: its tiles can never be taken
        // for new ones.
        match std::fs::remove_file(dir.join(CATALOGUE)) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => {
                return Err(Error::of_file(
                    "the catalogue of an earlier store cannot be removed",
                    dir,
                    e,
                ));
            }
            _ => {}
        }
        let encode = Arc::new(Encode::new(scans));
        let file = TileFile::create(&dir.join(TILES))?;
        Ok(Self {
            dir: dir.to_owned(),
            writer: Writer::start(file, &encode, n_free(budget_bytes))?,
            encode,
            places: HashMap::new(),
            buffers: Vec::new(),
            bytes: 0,
            usual: 0,
            budget_bytes,
            spill: None,
            n_points: 0,
            n_strips: 0,
            first,
        })
    }

    /// Number of points added so far.
    #[must_use]
    pub fn n_points(&self) -> u64 {
        self.n_points
    }

    /// Bytes written to the spill file so far.
    #[must_use]
    pub fn spilled_bytes(&self) -> u64 {
        self.spill.as_ref().map_or(0, Spill::len)
    }

    /// Adds the points of one strip.
    pub fn add(&mut self, strip: &Scattered) -> Result<()> {
        let mut start = 0;
        self.n_strips += 1;
        for run in &strip.runs {
            let place = self.place(strip.scan.0, run.tile);
            let buffer = &mut self.buffers[place];
            if buffer.records.capacity() == 0 {
                buffer.records = self.writer.room();
                self.bytes += buffer.records.capacity() * Record::BYTES;
            }
            self.bytes += buffer.make_room(run.n, self.usual);
            buffer.add(&strip.records[start..start + run.n]);
            buffer.touched = self.n_strips;
            start += run.n;
        }
        self.n_points += strip.records.len() as u64;
        if self.bytes > self.budget_bytes { self.relieve() } else { Ok(()) }
    }

    fn place(&mut self, scan: u32, tile: [u32; 2]) -> usize {
        *self.places.entry((scan, tile)).or_insert_with(|| {
            let at = TileAt { scan: contract::ScanId(scan), row: tile[0], col: tile[1] };
            self.buffers.push(Buffer::new(at));
            self.buffers.len() - 1
        })
    }

    /// Writes tiles to disk until the rest fits into the budget, in the order of their last point,
    /// oldest first.
    fn relieve(&mut self) -> Result<()> {
        let mut order: Vec<usize> =
            (0..self.buffers.len()).filter(|&i| !self.buffers[i].records.is_empty()).collect();
        order.sort_by_key(|&i| (self.buffers[i].touched, i));
        let enough = self.budget_bytes.saturating_sub(BATCH_BYTES.min(self.budget_bytes / 4));
        let mut batch: Vec<(usize, TilePart)> = Vec::new();
        for i in order {
            if self.bytes <= enough {
                break;
            }
            let buffer = &mut self.buffers[i];
            let records = std::mem::take(&mut buffer.records);
            self.bytes -= records.capacity() * Record::BYTES;
            self.usual = self.usual.max(records.len().min(USUAL_POINTS));
            // Points have returned to this tile, or it has too many: its parts are made at the end.
            let early = !buffer.comes_back()
                && records.len() <= TILE_POINTS
                && span(&records) <= LONGEST_SPAN;
            if early {
                buffer.is_written = true;
                batch.push((i, TilePart { at: buffer.at, records }));
                continue;
            }
            let spill = match &mut self.spill {
                Some(spill) => spill,
                None => self.spill.insert(Spill::create(&self.dir)?),
            };
            buffer.segments.push(spill.write(&records)?);
        }
        self.writer.write(batch)
    }

    /// Writes the remaining tiles and the catalogue, and opens the store. `open_bytes` is the
    /// `resident_bytes` of [`Store::open`].
    pub fn finish(self, engine: &Engine, open_bytes: usize) -> Result<Store> {
        let Self { dir, encode, mut buffers, writer, spill, first, .. } = self;
        let (mut file, written) = writer.finish()?;
        for (i, entry) in written {
            buffers[i].written.push(entry);
        }
        let (done, mut left): (Vec<_>, Vec<_>) = buffers.into_iter().partition(Buffer::is_done);
        left.sort_by_key(|b| b.at);
        let mut entries: Vec<TileEntry> = done.into_iter().flat_map(|b| b.written).collect();
        let n_points = left.iter().map(|b| b.n_points as u64).sum();
        let task = Task::new("store").of(Amount::points(n_points));
        let early = left.iter().any(|b| !b.written.is_empty());
        let early = early.then(|| file.early()).transpose()?;
        engine.pass(task, Parts::new(left, spill, early), |flow| {
            flow.map(&*encode).for_each(|encoded: Encoded| {
                entries.push(file.append(&encoded)?);
                Ok(())
            })
        })?;
        let n_tile_bytes = file.commit()?;
        entries.sort_by_key(|e| (e.at, e.first_place));
        catalogue::write(&dir.join(CATALOGUE), &entries, n_tile_bytes, first)?;
        Store::open(&dir, first, open_bytes)
    }
}

/// Number of tiles whose memory is kept for later ones: a quarter of the budget, for tiles of usual
/// size.
fn n_free(budget_bytes: usize) -> usize {
    (budget_bytes / 4 / (USUAL_POINTS * Record::BYTES)).min(MAX_FREE)
}
