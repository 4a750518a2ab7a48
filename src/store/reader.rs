//! A folder with catalogue and tiles in; the tiles in any order, each checked once, out. Knows no
//! geometry beyond bounds.

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

/// Tiles that the system reads ahead of the one that is asked for: some ten megabytes.
const AHEAD: usize = 8;
/// A store that is whole: tiles by place, in the order of [`TileAt`], whatever way they came in.
pub struct Store {
    entries: Vec<TileEntry>,
    /// Which of their levels were read and found whole, a bit each: a tile is read for each region
    /// that sees it.
    is_whole: Vec<AtomicU8>,
    /// Its folders.
    folders: Vec<Folder>,
}

/// One folder.
struct Folder {
    /// Place of its first entry.
    first: usize,
    /// Its file of tiles.
    path: PathBuf,
    /// Its tiles, for those that are asked for again and again …
    map: FileMap,
    /// … and to read all of them once.
    direct: DirectFile,
}

impl Store {
    /// Opens a whole store, its scans numbered from `first`. Mapped pages are given back to the
    /// system each time `resident_bytes` have been read.
    pub fn open(dir: &Path, first: u32, resident_bytes: usize) -> Result<Self> {
        let (entries, n_tile_bytes) = catalogue::read(&dir.join(CATALOGUE), first)?;
        let path = dir.join(TILES);
        let map = FileMap::open(&path, resident_bytes)?;
        let bytes = map.bytes();
        if bytes.len() as u64 != n_tile_bytes || !bytes.starts_with(&catalogue::tiles_header()) {
            return Err(broken("the tiles are not those of the catalogue").at(path.display()));
        }
        let file = File::open(&path);
        let file = file.map_err(|e| Error::of_read("the tiles cannot be opened", &path, e))?;
        let direct = DirectFile::past_cache(file);
        let is_whole = entries.iter().map(|_| AtomicU8::new(0)).collect();
        Ok(Self { entries, is_whole, folders: vec![Folder { first: 0, path, map, direct }] })
    }

    /// Stores of scans that follow one another, as one.
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

    /// Scans were carried by a motion of the world: tiles get bounds that hold their points there.
    pub fn carry(&mut self, motion: &Pose) {
        for entry in &mut self.entries {
            let corners = entry.bounds.corners();
            entry.bounds = Aabb::EMPTY;
            corners.iter().for_each(|c| entry.bounds.add((motion * Point::from(*c)).coords.into()));
        }
    }

    /// What is known of each tile without reading it, sorted by [`TileAt`], then by place. Entries
    /// at the same [`TileAt`] are parts of one tile that would be too large.
    #[must_use]
    pub fn entries(&self) -> &[TileEntry] {
        &self.entries
    }

    /// Of each of its folders a digest of what it holds: points and checksums of all tiles,
    /// wherever they lie in their file. The same for whatever memory it was filled with.
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

    /// Tile `i` of [`Store::entries`], copied out, with all of its points or less (see
    /// [`Tile::skip`]); checked where it is read for the first time.
    ///
    /// # Panics
    /// Where there is no such entry.
    pub fn tile(&self, i: usize, skip: u32) -> Result<Tile> {
        let n_levels = n_levels(skip);
        let (part, Range { start, end }) = self.place(i, n_levels);
        let bytes = &part.map.bytes()[start..end];
        let checked = self.check(i, n_levels, bytes);
        let tile = checked.map(|()| encode::decode(&self.entries[i], n_levels, bytes));
        // A file that was cut short meanwhile says more than the checksum of what was put in its
        // place.
        part.map.check()?;
        part.map.has_read(end - start);
        tile
    }

    /// Does something with the points of each of these tiles, with those of a tile level by level,
    /// the coarsest first; in the given order and without a copy. Levels of less than `skip`
    /// are not read.
    ///
    /// # Errors
    /// A damaged tile; a store that was cut short meanwhile, of which `work` may have seen zeros:
    /// what it made is of no use.
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
            // Tiles whose checksums are known are not summed up again: what was cut off since shows
            // only here.
            part.map.check()?;
            part.map.has_read(end - start);
        }
        Ok(())
    }

    /// Compares the bytes of a tile's coarsest levels with their checksums, each once.
    fn check(&self, i: usize, n_levels: usize, bytes: &[u8]) -> Result<()> {
        let (entry, is_whole) = (&self.entries[i], &self.is_whole[i]);
        let known = is_whole.load(Ordering::Relaxed);
        for (level, block) in layout::blocks(&entry.n_of).into_iter().take(n_levels).enumerate() {
            if known & 1 << level == 0 && crc32c::crc32c(&bytes[block]) != entry.checksums[level] {
                let (at, path) = (entry.at, self.place(i, 0).0.path.display());
                return Err(broken("the tile is damaged: its checksum is not what it should be")
                    .at(format!("{path}: scan {}, tile {} {}", at.scan.0, at.row, at.col)));
            }
            is_whole.fetch_or(1 << level, Ordering::Relaxed);
        }
        Ok(())
    }

    /// Where the bytes of a tile's coarsest levels lie.
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

    /// Indices of the tile at `at`: none where it holds no point, mostly one, several where it has
    /// parts.
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

    /// All tiles in order, each to be read once, past the system's cache: a source for a pass,
    /// whose first map is [`Store::reads`]. `skip` says how much of each is left out (see
    /// [`Tile::skip`]).
    pub fn picks<'s>(
        &'s self,
        skip: impl Fn(&TileEntry) -> u32 + Send + 's,
    ) -> impl Iterator<Item = Result<Pick>> + Send + 's {
        let pick = move |(i, entry)| self.pick(i, skip(entry), true);
        self.entries.iter().enumerate().map(pick)
    }

    /// The same of these tiles.
    pub fn picks_once(
        &self,
        indices: Vec<usize>,
        skip: u32,
    ) -> impl Iterator<Item = Result<Pick>> + Send + '_ {
        indices.into_iter().map(move |i| self.pick(i, skip, true))
    }

    /// The same of these tiles, for those that are asked for again and again: the system reads them
    /// ahead.
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

    /// Reads tiles on the workers of a pass.
    #[must_use]
    pub fn reads(&self) -> Reads<'_> {
        Reads(self)
    }

    /// A tile that was picked, checked where it is read for the first time.
    pub fn read(&self, pick: &Pick) -> Result<Tile> {
        if !pick.once {
            return self.tile(pick.i, pick.skip);
        }
        let (i, n_levels) = (pick.i, n_levels(pick.skip));
        let (part, Range { start, end }) = self.place(i, n_levels);
        let bytes = part.direct.read(start as u64, end - start);
        let bytes = bytes.map_err(|e| Error::of_read("the tiles cannot be read", &part.path, e))?;
        if bytes.len() < end - start {
            return Err(broken("the tiles are cut short").at(part.path.display()));
        }
        self.check(i, n_levels, &bytes)?;
        Ok(encode::decode(&self.entries[i], n_levels, &bytes))
    }
}

/// A tile that is to be read.
#[derive(Debug, Clone, Copy)]
pub struct Pick {
    i: usize,
    skip: u32,
    /// Whether nobody reads it again soon.
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

/// Picked tiles in, read ones out.
pub struct Reads<'s>(&'s Store);

impl Map for Reads<'_> {
    type In = Pick;
    type Out = Tile;
    type Scratch = ();

    fn apply(&self, pick: Pick, (): &mut ()) -> Result<Tile> {
        self.0.read(&pick)
    }
}

/// Levels that are read where so much is left out.
fn n_levels(skip: u32) -> usize {
    (MAX_SKIP - skip.min(MAX_SKIP)) as usize + 1
}
