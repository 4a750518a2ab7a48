//! The store: strips in, tiles on disk, tiles out again in any order. A folder with two files: the catalogue, and the
//! tiles, memory-mapped. Knows no geometry beyond bounds.

mod catalogue;
mod encode;
mod file;
mod map;
mod parts;
mod record;
mod scatter;
mod sink;
mod spill;
mod straight;
#[cfg(test)]
mod tests;
mod writer;

use catalogue::broken;
use contract::{Result, Scan, Tile, TileAt, TilePoints, Weigh};
use geometry::Aabb;
use map::FileMap;
use std::ops::Range;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use straight::Straight;

pub use catalogue::TileEntry;
pub use scatter::{Scatter, Scattered};
pub use sink::{TILE_POINTS, TileSink};

/// Tiles that the system reads ahead of the one that is asked for: some ten megabytes.
const AHEAD: usize = 8;
/// Name of the catalogue in the folder of a store.
const CATALOGUE: &str = "catalogue.rkyv";
/// Name of the file of all tiles.
const TILES: &str = "tiles.bin";

/// A store that is whole: tiles by place, in the order of [`TileAt`], whatever way they came in.
pub struct Store {
    entries: Vec<TileEntry>,
    /// Which of them were read and found whole: a tile is read for each region that sees it.
    is_whole: Vec<AtomicBool>,
    /// Its folders.
    parts: Vec<Part>,
}

/// One folder.
struct Part {
    /// Place of its first entry.
    first: usize,
    /// Its tiles, for those that are asked for again and again …
    map: FileMap,
    /// … and to read all of them once.
    straight: Straight,
}

impl Store {
    /// Begins a store in `dir` for strips of `scans` (all of a run, in their order) from the scan `first` on; it keeps
    /// about `budget_bytes` in memory while it is filled.
    pub fn create(dir: &Path, scans: &[Scan], first: u32, budget_bytes: usize) -> Result<TileSink> {
        TileSink::new(dir, scans, first, budget_bytes)
    }

    /// Opens a whole store, its scans numbered from `first`. Mapped pages are given back to the system each time
    /// `resident_bytes` have been read.
    pub fn open(dir: &Path, first: u32, resident_bytes: usize) -> Result<Self> {
        let (entries, n_tile_bytes) = catalogue::read(&dir.join(CATALOGUE), first)?;
        let path = dir.join(TILES);
        let map = FileMap::open(&path, resident_bytes)?;
        let bytes = map.bytes();
        if bytes.len() as u64 != n_tile_bytes || !bytes.starts_with(&catalogue::tiles_header()) {
            return Err(broken("the tiles are not those of the catalogue").at(path.display()));
        }
        let straight = Straight::open(&path)?;
        let is_whole = entries.iter().map(|_| AtomicBool::new(false)).collect();
        Ok(Self { entries, is_whole, parts: vec![Part { first: 0, map, straight }] })
    }

    /// Stores of scans that follow one another, as one.
    #[must_use]
    pub fn join(stores: Vec<Self>) -> Self {
        let mut all = Self { entries: Vec::new(), is_whole: Vec::new(), parts: Vec::new() };
        for store in stores {
            let start = all.entries.len();
            debug_assert!(
                all.entries.last().zip(store.entries.first()).is_none_or(|(a, b)| a.at < b.at)
            );
            let parts = store.parts.into_iter();
            all.parts.extend(parts.map(|part| Part { first: start + part.first, ..part }));
            all.entries.extend(store.entries);
            all.is_whole.extend(store.is_whole);
        }
        all
    }

    /// What is known of each tile without reading it, sorted by [`TileAt`], then by place. Entries at the same
    /// [`TileAt`] are parts of one tile that would be too large.
    #[must_use]
    pub fn entries(&self) -> &[TileEntry] {
        &self.entries
    }

    /// Number of points of all tiles.
    #[must_use]
    pub fn n_points(&self) -> u64 {
        self.entries.iter().map(|e| e.n_points).sum()
    }

    /// Tile `i` of [`Store::entries`], copied out; checked where it is read for the first time.
    ///
    /// # Panics
    /// Where there is no such entry.
    pub fn tile(&self, i: usize) -> Result<Tile> {
        let (part, Range { start, end }) = self.place(i);
        let bytes = &part.map.bytes()[start..end];
        self.check(i, bytes)?;
        let tile = encode::decode(&self.entries[i], bytes);
        part.map.has_read(end - start);
        Ok(tile)
    }

    /// Does something with the points of each of these tiles, in the given order and without a copy.
    pub fn look_at(&self, indices: &[usize], mut work: impl FnMut(&TilePoints<'_>)) -> Result<()> {
        indices.iter().take(AHEAD).for_each(|&i| self.will_need(i));
        for (k, &i) in indices.iter().enumerate() {
            indices.get(k + AHEAD).into_iter().for_each(|&i| self.will_need(i));
            let (part, Range { start, end }) = self.place(i);
            let bytes = &part.map.bytes()[start..end];
            self.check(i, bytes)?;
            work(&encode::points(&self.entries[i], bytes));
            part.map.has_read(end - start);
        }
        Ok(())
    }

    /// Compares the bytes of a tile with its checksum, once.
    fn check(&self, i: usize, bytes: &[u8]) -> Result<()> {
        let (entry, is_whole) = (&self.entries[i], &self.is_whole[i]);
        if is_whole.load(Ordering::Relaxed) {
            return Ok(());
        }
        if crc32c::crc32c(bytes) != entry.checksum {
            let at = entry.at;
            return Err(broken("the tile is damaged: its checksum is not what it should be")
                .at(format!("store, scan {}, tile {} {}", at.scan.0, at.row, at.col)));
        }
        is_whole.store(true, Ordering::Relaxed);
        Ok(())
    }

    /// Where the bytes of a tile lie.
    fn place(&self, i: usize) -> (&Part, Range<usize>) {
        let entry = &self.entries[i];
        let part = self.parts.partition_point(|part| part.first <= i);
        let (start, n) = (entry.offset as usize, encode::layout(entry.n_points)[3] as usize);
        (&self.parts[part - 1], start..start + n)
    }

    fn will_need(&self, i: usize) {
        let (part, Range { start, end }) = self.place(i);
        part.map.will_need(start, end - start);
    }

    /// Indices of the tile at `at`: none where it holds no point, mostly one, several where it has parts.
    #[must_use]
    pub fn find(&self, at: TileAt) -> Range<usize> {
        let start = self.entries.partition_point(|e| e.at < at);
        start..start + self.entries[start..].partition_point(|e| e.at == at)
    }

    /// Indices of the tiles whose bounds touch `bounds` (world, metres), ascending.
    #[must_use]
    pub fn touching(&self, bounds: &Aabb) -> Vec<usize> {
        (0..self.entries.len()).filter(|&i| self.entries[i].bounds.touches(bounds)).collect()
    }

    /// All tiles in order, each read once: a source for a pass.
    pub fn tiles(&self) -> impl Iterator<Item = Result<Tile>> + Send + '_ {
        (0..self.entries.len()).map(|i| {
            let (part, Range { start, end }) = self.place(i);
            let tile = |bytes: &[u8]| {
                self.check(i, bytes)?;
                Ok(encode::decode(&self.entries[i], bytes))
            };
            part.straight.with(start, end - start, tile)?
        })
    }

    /// These tiles in the given order: a source for a pass.
    pub fn tiles_of(&self, indices: Vec<usize>) -> impl Iterator<Item = Result<Tile>> + Send + '_ {
        let mut ahead = indices.clone().into_iter();
        for i in ahead.by_ref().take(AHEAD) {
            self.will_need(i);
        }
        indices.into_iter().map(move |i| {
            if let Some(next) = ahead.next() {
                self.will_need(next);
            }
            self.tile(i)
        })
    }
}

impl Weigh for TileEntry {
    fn weight_bytes(&self) -> usize {
        size_of::<Self>()
    }

    fn n_points(&self) -> u64 {
        self.n_points
    }
}
