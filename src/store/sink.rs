//! Scattered strips in, a whole store out. Memory is bounded by a budget: what does not fit is spilled.
//!
//! Each tile has a buffer. When all buffers together pass the budget, the largest are written as segments to a spill
//! file, until half of the budget is free. At the end each tile's segments and buffer are joined, sorted by pixel and
//! place, and written.

use super::catalogue::{self, TileEntry};
use super::encode::{Encode, Encoded};
use super::record::Record;
use super::scatter::Scattered;
use super::spill::{Segment, Spill};
use super::{CATALOGUE, Store, TILES, io_error};
use crate::atomic::AtomicFile;
use crate::engine::{Engine, Task};
use crate::progress::Amount;
use contract::{Result, Scan, TileAt, Weigh};
use std::collections::HashMap;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Most points of one tile: bounds what a worker holds. A square of ground of a dense cloud, or a lattice far coarser
/// than its scan, may have more; then several tiles stand at the same [`TileAt`], cut in the order of places.
pub const TILE_POINTS: usize = 1 << 21;

/// Fills a store. Feed it in the order of the input.
pub struct TileSink {
    dir: PathBuf,
    encode: Encode,
    /// Where the tile of a scan, row and column has its buffer; never iterated.
    places: HashMap<(u32, [u32; 2]), usize>,
    buffers: Vec<Buffer>,
    /// Capacity of all buffers, bytes.
    bytes: usize,
    budget_bytes: usize,
    spill: Option<Spill>,
    n_points: u64,
    /// First scan of the store.
    first: u32,
}

struct Buffer {
    at: TileAt,
    records: Vec<Record>,
    segments: Vec<Segment>,
    n_points: usize,
    last_place: u64,
    ascending: bool,
}

impl TileSink {
    /// A sink for the scans from `first` on that keeps about `budget_bytes` in memory. An older store in `dir` is
    /// removed.
    pub(super) fn new(dir: &Path, scans: &[Scan], first: u32, budget_bytes: usize) -> Result<Self> {
        std::fs::create_dir_all(dir).map_err(|e| io_error(dir, "the store cannot be made", e))?;
        // Without its catalogue an old store is no store: nobody can take old tiles for new ones.
        match std::fs::remove_file(dir.join(CATALOGUE)) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => {
                return Err(io_error(dir, "an old catalogue cannot be removed", e));
            }
            _ => {}
        }
        Ok(Self {
            dir: dir.to_owned(),
            encode: Encode::new(scans),
            places: HashMap::new(),
            buffers: Vec::new(),
            bytes: 0,
            budget_bytes,
            spill: None,
            n_points: 0,
            first,
        })
    }

    /// Number of points taken so far.
    #[must_use]
    pub fn n_points(&self) -> u64 {
        self.n_points
    }

    /// Bytes written to the spill file so far.
    #[must_use]
    pub fn spilled_bytes(&self) -> u64 {
        self.spill.as_ref().map_or(0, Spill::len)
    }

    /// Takes the points of one strip.
    pub fn add(&mut self, strip: &Scattered) -> Result<()> {
        let mut start = 0;
        for run in &strip.runs {
            let place = self.place(strip.scan.0, run.tile);
            let buffer = &mut self.buffers[place];
            let before = buffer.records.capacity();
            buffer.add(&strip.records[start..start + run.n]);
            self.bytes += (buffer.records.capacity() - before) * Record::BYTES;
            start += run.n;
        }
        self.n_points += strip.records.len() as u64;
        if self.bytes > self.budget_bytes { self.spill_half() } else { Ok(()) }
    }

    fn place(&mut self, scan: u32, tile: [u32; 2]) -> usize {
        *self.places.entry((scan, tile)).or_insert_with(|| {
            let at = TileAt { scan: contract::ScanId(scan), row: tile[0], col: tile[1] };
            self.buffers.push(Buffer {
                at,
                records: Vec::new(),
                segments: Vec::new(),
                n_points: 0,
                last_place: 0,
                ascending: true,
            });
            self.buffers.len() - 1
        })
    }

    /// Largest first, since a long segment costs one seek as a short one does.
    fn spill_half(&mut self) -> Result<()> {
        if self.spill.is_none() {
            self.spill = Some(Spill::create(&self.dir)?);
        }
        let spill = self.spill.as_mut().expect("just made");
        let mut order: Vec<usize> =
            (0..self.buffers.len()).filter(|&i| !self.buffers[i].records.is_empty()).collect();
        order.sort_by_key(|&i| std::cmp::Reverse(self.buffers[i].records.len()));
        for i in order {
            if self.bytes * 2 <= self.budget_bytes {
                break;
            }
            let buffer = &mut self.buffers[i];
            let records = std::mem::take(&mut buffer.records);
            buffer.segments.push(spill.write(&records)?);
            self.bytes -= records.capacity() * Record::BYTES;
        }
        Ok(())
    }

    /// Writes all tiles and the catalogue, and opens the store. `open_bytes` as in [`Store::open`].
    pub fn finish(self, engine: &Engine, open_bytes: usize) -> Result<Store> {
        let Self { dir, encode, mut buffers, spill, n_points, first, .. } = self;
        buffers.sort_by_key(|b| b.at);
        let task = Task::new("store").of(Amount::points(n_points));
        let path = dir.join(TILES);
        let mut file = AtomicFile::create(&path)?;
        let failed = |e| io_error(&path, "a tile cannot be written", e);
        file.write_all(&catalogue::tiles_header()).map_err(failed)?;
        let mut offset = catalogue::HEADER_BYTES;
        let mut entries: Vec<TileEntry> = Vec::new();
        let parts = Parts { buffers: buffers.into_iter(), spill, current: None };
        engine.pass(task, parts, |flow| {
            flow.map(&encode).for_each(|Encoded { mut entry, bytes }| {
                entry.offset = offset;
                offset += bytes.len() as u64;
                entries.push(entry);
                file.write_all(&bytes).map_err(failed)
            })
        })?;
        file.commit()?;
        catalogue::write(&dir.join(CATALOGUE), &entries, offset, first)?;
        Store::open(&dir, first, open_bytes)
    }
}

impl Buffer {
    fn add(&mut self, records: &[Record]) {
        for r in records {
            let place = r.place();
            self.ascending &= self.n_points == 0 || place > self.last_place;
            self.last_place = place;
        }
        self.n_points += records.len();
        self.records.extend_from_slice(records);
    }
}

/// The points of a tile, or of a part of it that is small enough.
pub(super) struct Part {
    pub(super) at: TileAt,
    pub(super) records: Vec<Record>,
}

impl Weigh for Part {
    fn weight_bytes(&self) -> usize {
        size_of::<Self>() + self.records.len() * Record::BYTES
    }

    fn n_points(&self) -> u64 {
        self.records.len() as u64
    }
}

/// Reads the tiles back, one after the other, each in parts of at most [`TILE_POINTS`].
struct Parts {
    buffers: std::vec::IntoIter<Buffer>,
    spill: Option<Spill>,
    current: Option<Current>,
}

/// A tile that is being read back.
struct Current {
    at: TileAt,
    /// Segments still to be read.
    segments: std::vec::IntoIter<Segment>,
    /// What was in memory; comes after all segments.
    last: Vec<Record>,
    /// Read, not yet given out.
    ahead: Vec<Record>,
}

impl Parts {
    fn part(&mut self) -> Result<Option<Part>> {
        loop {
            let current = match &mut self.current {
                Some(current) => current,
                None => {
                    let Some(buffer) = self.buffers.next() else {
                        return Ok(None);
                    };
                    self.current.insert(Self::begin(buffer, &mut self.spill)?)
                }
            };
            let at = current.at;
            let records = current.records(&mut self.spill)?;
            if records.is_empty() {
                self.current = None;
                continue;
            }
            return Ok(Some(Part { at, records }));
        }
    }

    fn begin(buffer: Buffer, spill: &mut Option<Spill>) -> Result<Current> {
        let Buffer { at, records, segments, ascending, n_points, .. } = buffer;
        let mut current =
            Current { at, segments: segments.into_iter(), last: records, ahead: Vec::new() };
        if !ascending && n_points > TILE_POINTS {
            // Rare: points out of order, and too many. Their order decides where parts are cut.
            current.fill(usize::MAX, spill)?;
            current.ahead.sort_unstable_by_key(Record::place);
        }
        Ok(current)
    }
}

impl Current {
    /// Reads until `n` records are ahead, or all.
    fn fill(&mut self, n: usize, spill: &mut Option<Spill>) -> Result<()> {
        while self.ahead.len() < n {
            if let Some(segment) = self.segments.next() {
                let spill = spill.as_mut().expect("a segment has a spill file");
                spill.read(&segment, &mut self.ahead)?;
            } else if self.last.is_empty() {
                break;
            } else if self.ahead.is_empty() {
                self.ahead = std::mem::take(&mut self.last);
            } else {
                self.ahead.append(&mut self.last);
                self.last = Vec::new();
            }
        }
        Ok(())
    }

    /// The next part. Within one, places span less than 2³².
    fn records(&mut self, spill: &mut Option<Spill>) -> Result<Vec<Record>> {
        self.fill(TILE_POINTS, spill)?;
        let mut n = self.ahead.len().min(TILE_POINTS);
        let span = |r: &[Record]| {
            let places = || r.iter().map(Record::place);
            places().max().zip(places().min()).map_or(0, |(max, min)| max - min)
        };
        if span(&self.ahead[..n]) > u64::from(u32::MAX) {
            self.ahead.sort_unstable_by_key(Record::place);
            let end = self.ahead[0].place() + u64::from(u32::MAX);
            n = self.ahead[..n].partition_point(|r| r.place() <= end);
        }
        if n == self.ahead.len() {
            return Ok(std::mem::take(&mut self.ahead));
        }
        let rest = self.ahead.split_off(n);
        Ok(std::mem::replace(&mut self.ahead, rest))
    }
}

impl Iterator for Parts {
    type Item = Result<Part>;

    fn next(&mut self) -> Option<Self::Item> {
        self.part().transpose()
    }
}
