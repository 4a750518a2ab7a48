//! Reads tiles of one or more store folders in any order. The checksum of each tile is compared
//! when it is first read.

use super::catalogue::{self, CATALOGUE, TILES, TileEntry, broken};
use super::encode;
use super::layout;
use super::map::FileMap;
use super::record::N_LEVELS;
use crate::engine::{Amount, Task};
use crate::io::direct::DirectFile;
use contract::{Error, MAX_SKIP, Map, Result, Tile, TileAt, TilePoints, Weigh};
use geometry::{Aabb, Point, Pose};
use std::fs::File;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU8, Ordering};

/// Number of tiles that the system reads ahead: some ten megabytes.
const AHEAD: usize = 8;
/// A complete store. Its tiles are sorted by [`TileAt`], then by place, in whatever order the
/// points came.
pub struct Store {
    entries: Vec<TileEntry>,
    /// One bit for each level of each tile whose checksum was compared: a tile is read once for
    /// each region that sees it.
    is_whole: Vec<AtomicU8>,
    /// Folders of the store, one for each input.
    folders: Vec<Folder>,
}

/// A folder of the store.
struct Folder {
    /// Index of its first entry.
    first: usize,
    /// Path of its tile file.
    path: PathBuf,
    /// Its tiles as a memory map, for tiles that are read repeatedly.
    map: FileMap,
    /// Its tile file, to read tiles once past the page cache.
    direct: DirectFile,
}

impl Store {
    /// Opens a complete store whose scans are numbered from `first`. Mapped pages are returned to
    /// the system each time `resident_bytes` bytes have been read.
    pub fn open(dir: &Path, first: u32, resident_bytes: usize) -> Result<Self> {
        let (entries, n_tile_bytes) = catalogue::read(&dir.join(CATALOGUE), first)?;
        let path = dir.join(TILES);
        let map = FileMap::open(&path, resident_bytes)?;
        let bytes = map.bytes();
        if bytes.len() as u64 != n_tile_bytes || !bytes.starts_with(&catalogue::tiles_header()) {
            return Err(broken("the tile file does not belong to the catalogue beside it")
                .at(path.display()));
        }
        let file = File::open(&path);
        let file = file.map_err(|e| Error::of_read("the tiles cannot be opened", &path, e))?;
        let direct = DirectFile::past_cache(file);
        let is_whole = entries.iter().map(|_| AtomicU8::new(0)).collect();
        Ok(Self { entries, is_whole, folders: vec![Folder { first: 0, path, map, direct }] })
    }

    /// Joins stores of consecutive scans to one.
    #[must_use]
    pub fn join(stores: Vec<Self>) -> Self {
        let mut all = Self { entries: Vec::new(), is_whole: Vec::new(), folders: Vec::new() };
        for store in stores {
            let start = all.entries.len();
            debug_assert!(
                all.entries.last().zip(store.entries.first()).is_none_or(|(a, b)| a.at < b.at)
            );
            let parts = store.folders.into_iter();
            all.folders.extend(parts.map(|part| Folder { first: start + part.first, ..part }));
            all.entries.extend(store.entries);
            all.is_whole.extend(store.is_whole);
        }
        all
    }

    /// Adapts the bounds of all tiles to scans that were moved by `motion` in the world frame.
    pub fn carry(&mut self, motion: &Pose) {
        for entry in &mut self.entries {
            let corners = entry.bounds.corners();
            entry.bounds = Aabb::EMPTY;
            corners.iter().for_each(|c| entry.bounds.add((motion * Point::from(*c)).coords.into()));
        }
    }

    /// Catalogue entries of all tiles, sorted by [`TileAt`], then by place. Entries with the same
    /// [`TileAt`] are parts of one tile that would be too large.
    #[must_use]
    pub fn entries(&self) -> &[TileEntry] {
        &self.entries
    }

    /// A digest of the content of each folder: points and checksums of all tiles, independent of
    /// their order in the file and of the memory that filled it.
    #[must_use]
    pub fn contents(&self) -> Vec<String> {
        let ends = self.folders.iter().skip(1).map(|part| part.first).chain([self.entries.len()]);
        let parts = self.folders.iter().zip(ends);
        parts.map(|(part, end)| catalogue::digest(&self.entries[part.first..end])).collect()
    }

    /// A task over all tiles, for progress.
    pub(crate) fn task(&self, name: &str) -> Task {
        let (items, points) = (self.entries.len() as u64, self.n_points());
        Task::new(name).of(Amount { items, points, bytes: 0 })
    }

    /// Number of points of all tiles.
    #[must_use]
    pub fn n_points(&self) -> u64 {
        self.entries.iter().map(|e| e.n_points).sum()
    }

    /// A copy of tile `i` of [`Store::entries`], with all of its points or fewer (see
    /// [`Tile::skip`]). Its checksum is compared when it is first read.
    ///
    /// # Panics
    /// `i` is not the index of an entry.
    pub fn tile(&self, i: usize, skip: u32) -> Result<Tile> {
        let n_levels = n_levels(skip);
        let (part, Range { start, end }) = self.place(i, n_levels);
        let bytes = &part.map.bytes()[start..end];
        let checked = self.check(i, n_levels, bytes);
        let tile = checked.map(|()| encode::decode(&self.entries[i], n_levels, bytes));
        // A truncated file is the better message than the checksum of the zeros that take its
        // place.
        part.map.check()?;
        part.map.has_read(end - start);
        tile
    }

    /// Calls `work` with the points of each of these tiles, level by level, coarsest first, in the
    /// given order and without a copy. Levels finer than `skip` are not read.
    ///
    /// # Errors
    /// A damaged tile, or a store that was truncated meanwhile; `work` may then have seen zeros,
    /// and its result must be dropped.
    pub fn look_at(
        &self,
        indices: &[usize],
        skip: u32,
        mut work: impl FnMut(&TilePoints<'_>),
    ) -> Result<()> {
        let n_levels = n_levels(skip);
        indices.iter().take(AHEAD).for_each(|&i| self.will_need(i, n_levels));
        for (k, &i) in indices.iter().enumerate() {
            indices.get(k + AHEAD).into_iter().for_each(|&i| self.will_need(i, n_levels));
            let (part, Range { start, end }) = self.place(i, n_levels);
            let bytes = &part.map.bytes()[start..end];
            let checked = self.check(i, n_levels, bytes);
            part.map.check()?;
            checked?;
            let entry = &self.entries[i];
            for (level, block) in layout::blocks(&entry.n_of).into_iter().take(n_levels).enumerate()
            {
                work(&encode::points(entry, level, &bytes[block]));
            }
            // Tiles that were compared before are not summed up again, so that a truncation since
            // then shows only here.
            part.map.check()?;
            part.map.has_read(end - start);
        }
        Ok(())
    }

    /// Compares the bytes of a tile's coarsest levels with their checksums, each level once.
    fn check(&self, i: usize, n_levels: usize, bytes: &[u8]) -> Result<()> {
        let (entry, is_whole) = (&self.entries[i], &self.is_whole[i]);
        let known = is_whole.load(Ordering::Relaxed);
        for (level, block) in layout::blocks(&entry.n_of).into_iter().take(n_levels).enumerate() {
            if known & 1 << level == 0 && crc32c::crc32c(&bytes[block]) != entry.checksums[level] {
                let (at, path) = (entry.at, self.place(i, 0).0.path.display());
                return Err(broken("the tile is damaged: its checksum differs from the catalogue")
                    .at(format!("{path}: scan {}, tile {} {}", at.scan.0, at.row, at.col)));
            }
            is_whole.fetch_or(1 << level, Ordering::Relaxed);
        }
        Ok(())
    }

    /// Folder and byte range of a tile's coarsest levels.
    fn place(&self, i: usize, n_levels: usize) -> (&Folder, Range<usize>) {
        let entry = &self.entries[i];
        let part = self.folders.partition_point(|part| part.first <= i);
        let (start, n) = (entry.offset as usize, entry.n_bytes(n_levels) as usize);
        (&self.folders[part - 1], start..start + n)
    }

    fn will_need(&self, i: usize, n_levels: usize) {
        let (part, Range { start, end }) = self.place(i, n_levels);
        part.map.will_need(start, end - start);
    }

    /// Indices of the tiles at `at`: none where it holds no point, mostly one, several for a tile
    /// with parts.
    #[must_use]
    pub fn find(&self, at: TileAt) -> Range<usize> {
        let start = self.entries.partition_point(|e| e.at < at);
        start..start + self.entries[start..].partition_point(|e| e.at == at)
    }

    /// Indices of the tiles whose bounds touch `bounds` (world frame, metres), ascending.
    #[must_use]
    pub fn touching(&self, bounds: &Aabb) -> Vec<usize> {
        (0..self.entries.len()).filter(|&i| self.entries[i].bounds.touches(bounds)).collect()
    }

    /// All tiles in order, to be read once past the page cache: the source of a pass whose first
    /// map is [`Store::reads`]. `skip` says how much of each tile is left out (see [`Tile::skip`]).
    pub fn picks<'s>(
        &'s self,
        skip: impl Fn(&TileEntry) -> u32 + Send + 's,
    ) -> impl Iterator<Item = Result<Pick>> + Send + 's {
        let pick = move |(i, entry)| self.pick(i, skip(entry), true);
        self.entries.iter().enumerate().map(pick)
    }

    /// Like [`Store::picks`], for these tiles only.
    pub fn picks_once(
        &self,
        indices: Vec<usize>,
        skip: u32,
    ) -> impl Iterator<Item = Result<Pick>> + Send + '_ {
        indices.into_iter().map(move |i| self.pick(i, skip, true))
    }

    /// Like [`Store::picks`], for these tiles only, which are read repeatedly: the system reads
    /// them ahead.
    pub fn picks_again(
        &self,
        indices: Vec<usize>,
    ) -> impl Iterator<Item = Result<Pick>> + Send + '_ {
        indices.into_iter().map(move |i| {
            self.will_need(i, N_LEVELS);
            self.pick(i, 0, false)
        })
    }

    fn pick(&self, i: usize, skip: u32, once: bool) -> Result<Pick> {
        let entry = &self.entries[i];
        let n_levels = n_levels(skip);
        Ok(Pick {
            i,
            skip,
            once,
            n_points: entry.n_points,
            n_bytes: entry.n_bytes(n_levels) as usize,
        })
    }

    /// The map that reads picked tiles on the workers of a pass.
    #[must_use]
    pub fn reads(&self) -> Reads<'_> {
        Reads(self)
    }

    /// Reads a picked tile and compares its checksum when it is first read.
    pub fn read(&self, pick: &Pick) -> Result<Tile> {
        if !pick.once {
            return self.tile(pick.i, pick.skip);
        }
        let (i, n_levels) = (pick.i, n_levels(pick.skip));
        let (part, Range { start, end }) = self.place(i, n_levels);
        let bytes = part.direct.read(start as u64, end - start);
        let bytes = bytes.map_err(|e| Error::of_read("the tiles cannot be read", &part.path, e))?;
        if bytes.len() < end - start {
            return Err(broken("the tile file is truncated").at(part.path.display()));
        }
        self.check(i, n_levels, &bytes)?;
        Ok(encode::decode(&self.entries[i], n_levels, &bytes))
    }
}

/// A tile that is to be read by a worker.
#[derive(Debug, Clone, Copy)]
pub struct Pick {
    i: usize,
    skip: u32,
    /// Whether it is read only once, past the page cache.
    once: bool,
    n_points: u64,
    n_bytes: usize,
}

impl Weigh for Pick {
    fn weight_bytes(&self) -> usize {
        self.n_bytes
    }

    fn n_points(&self) -> u64 {
        self.n_points
    }
}

/// The map from picked tiles to tiles with their points.
pub struct Reads<'s>(&'s Store);

impl Map for Reads<'_> {
    type In = Pick;
    type Out = Tile;
    type Scratch = ();

    fn apply(&self, pick: Pick, (): &mut ()) -> Result<Tile> {
        self.0.read(&pick)
    }
}

/// Number of levels that are read for this `skip`.
fn n_levels(skip: u32) -> usize {
    (MAX_SKIP - skip.min(MAX_SKIP)) as usize + 1
}
