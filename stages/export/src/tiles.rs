//! Writes all points as spatial tiles.
//!
//! A large plant has many tiles, so none of them keeps a file open. Records wait in a bounded
//! number of memory blocks; when none is left, the fullest tiles are appended to their files in
//! parallel.

use crate::las::LasSummary;
use crate::pack::{Packed, TileRun};
use crate::record::LasSettings;
use crate::settings::Settings;
use crate::spool::{Blocks, Spool};
use contract::{Error, Fan, Result};
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::{Path, PathBuf};

/// Writes labelled points under `OUT/tiles`.
pub struct Tiles {
    out: PathBuf,
    las: LasSettings,
    tiles: BTreeMap<[i32; 2], Spool>,
    blocks: Blocks,
}

impl Tiles {
    /// Tiles in the output folder, with records as `las` says; `None` where none are requested.
    ///
    /// # Errors
    /// If the folder cannot be created.
    pub fn create(out: &Path, las: &LasSettings, settings: &Settings) -> Result<Option<Self>> {
        if !settings.tiles {
            return Ok(None);
        }
        let folder = out.join("tiles");
        std::fs::create_dir_all(&folder)
            .map_err(|e| Error::of_file("folder cannot be created", &folder, e))?;
        let blocks = Blocks::new(settings.waiting_bytes);
        Ok(Some(Self { out: out.to_path_buf(), las: las.clone(), tiles: BTreeMap::new(), blocks }))
    }

    /// Adds an encoded strip. When no more records may wait, those of some tiles are written by
    /// `fan`.
    ///
    /// # Errors
    /// If a tile cannot be written.
    pub fn add(&mut self, packed: &Packed, fan: &dyn Fan) -> Result<()> {
        let mut runs = packed.runs(self.las.record_len());
        runs.try_for_each(|(run, records)| self.spool(run, records, fan))
    }

    fn spool(&mut self, run: &TileRun, mut records: &[u8], fan: &dyn Fan) -> Result<()> {
        let (at, las) = (run.tile, &self.las);
        let path = || self.out.join(format!("tiles/{}_{}.{}", at[1], at[0], las.ending()));
        let spool = match self.tiles.entry(at) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(new) => new.insert(Spool::create(path(), las)?),
        };
        spool.extent.join(&run.extent);
        while let Some(spool) = self.tiles.get_mut(&at) {
            records = spool.fill(records);
            if records.is_empty() {
                break;
            }
            match self.blocks.take() {
                Some(block) => spool.blocks.push(block),
                None => relieve(&mut self.tiles, &mut self.blocks, fan)?,
            }
        }
        Ok(())
    }

    /// Finishes all tiles in parallel and returns their summaries, sorted by row, then column.
    ///
    /// # Errors
    /// The error of the first tile that cannot be written.
    pub fn finish(self, fan: &dyn Fan) -> Result<Vec<LasSummary>> {
        fan.fan(self.open(), Spool::finish).into_iter().collect()
    }

    /// The unfinished tiles, sorted by row, then column.
    #[must_use]
    pub fn open(self) -> Vec<Spool> {
        self.tiles.into_values().collect()
    }
}

/// Appends the fullest tiles to their files in parallel until half of the blocks are free; only
/// full blocks, as long as there are any.
fn relieve(
    tiles: &mut BTreeMap<[i32; 2], Spool>,
    blocks: &mut Blocks,
    fan: &dyn Fan,
) -> Result<()> {
    let mut fullest: Vec<([i32; 2], usize)> =
        tiles.iter().map(|(at, spool)| (*at, spool.blocks.len())).filter(|(_, n)| *n > 0).collect();
    fullest.sort_by_key(|(at, n)| (std::cmp::Reverse(*n), *at));
    let n_blocks: usize = fullest.iter().map(|(_, n)| n).sum();
    let (mut n_free, mut full) = (blocks.empty.len(), Vec::new());
    for (at, n_waiting) in fullest {
        if 2 * n_free > n_blocks {
            break;
        }
        let n = (n_waiting - 1).max(1);
        n_free += n;
        full.extend(tiles.remove(&at).map(|spool| (at, spool, n)));
    }
    let write = |(at, mut spool, n): ([i32; 2], Spool, usize)| {
        spool.write(n).map(|written| (at, spool, written))
    };
    for written in fan.fan(full, write) {
        let (at, spool, written) = written?;
        blocks.empty.extend(written);
        tiles.insert(at, spool);
    }
    Ok(())
}
