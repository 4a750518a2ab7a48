//! Packed strips in, in any order; spatial tiles of all points out.
//!
//! Tiles are as many as the plant is large, so none of them keeps a file open: records wait in blocks of memory, bounded in
//! number, and full tiles are appended to their files.

use crate::las::LasSummary;
use crate::pack::{Packed, Run};
use crate::record::LasSettings;
use crate::settings::Settings;
use crate::spool::{Blocks, Spool};
use contract::{Error, Fan, Result};
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::{Path, PathBuf};

/// A tile with so many waiting bytes is appended to its file: one call to the system for a hundred thousand points.
const FULL_BYTES: usize = 4 << 20;
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
            Entry::Vacant(new) => new.insert(Spool::create(path(), las)?),
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
        fan.fan(self.open(), Spool::finish).into_iter().collect()
    }

    /// All tiles as they are, still to be finished; by row then column.
    #[must_use]
    pub fn open(self) -> Vec<Spool> {
        self.tiles.into_values().collect()
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
