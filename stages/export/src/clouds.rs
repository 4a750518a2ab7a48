//! Packed strips in, in any order; spatial tiles, and robots and fixed things apart, out.
//!
//! Tiles are as many as the plant is large, so none of them keeps a file open: records wait in memory, bounded in
//! bytes, and full tiles are appended to their files.

use crate::atomic::part_of;
use crate::las::{LasSummary, LasWriter, bounds, head};
use crate::pack::{Pack, Packed, Run};
use crate::record::{Extent, LasSettings};
use crate::settings::Settings;
use crate::summed::{BodySum, FileSum};
use contract::{Error, Fan, Result};
use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// A tile with so many waiting bytes is appended to its file: one call to the system for a hundred thousand points.
const FULL_BYTES: usize = 4 << 20;

/// What [`Clouds`] wrote.
#[derive(Debug, Clone, PartialEq)]
pub struct Written {
    /// Tiles, by row then column.
    pub tiles: Vec<LasSummary>,
    /// Links and attachments.
    pub robots: Option<LasSummary>,
    /// All the rest, where asked for.
    pub fixed: Option<LasSummary>,
}

impl Written {
    /// Checksums of the files, where they are known.
    pub fn sums(&self) -> impl Iterator<Item = &FileSum> {
        let all = self.tiles.iter().chain(&self.robots).chain(&self.fixed);
        all.filter_map(|summary| summary.sum.as_ref())
    }
}

/// Writes labelled clouds under `OUT/tiles` and `OUT/clouds`.
pub struct Clouds {
    out: PathBuf,
    las: LasSettings,
    settings: Settings,
    tiles: BTreeMap<[i32; 2], Spool>,
    /// Capacity of all waiting records, bytes.
    waiting: usize,
    robots: LasWriter,
    fixed: Option<LasWriter>,
}

impl Clouds {
    /// Opens the clouds under the output folder; `las` says what records hold.
    pub fn create(out: &Path, las: &LasSettings, settings: &Settings) -> Result<Self> {
        let (compress, with_bodies) = (settings.compress, settings.bodies);
        let las = LasSettings { compress, with_bodies, ..las.clone() };
        let open = |name: &str| {
            LasWriter::create(out.join(format!("clouds/{name}.{}", ending(&las))), las.clone())
        };
        let (robots, fixed) =
            (open("robots")?, settings.fixed_cloud.then(|| open("fixed")).transpose()?);
        if settings.tiles {
            let folder = out.join("tiles");
            std::fs::create_dir_all(&folder)
                .map_err(|e| Error::of_file("folder cannot be made", &folder, e))?;
        }
        let (tiles, settings) = (BTreeMap::new(), *settings);
        Ok(Self { out: out.to_path_buf(), las, settings, tiles, waiting: 0, robots, fixed })
    }

    /// What workers pack strips with.
    #[must_use]
    pub fn pack(&self) -> Pack {
        Pack::of_clouds(&self.las, &self.settings)
    }

    /// Adds a packed strip.
    pub fn add(&mut self, packed: &Packed) -> Result<()> {
        let mut start = 0;
        for run in &packed.runs {
            let end = start + run.extent.n as usize * self.las.record_len();
            let records = &packed.bytes[start..end];
            if run.moves {
                self.robots.push_records(records, &run.extent)?;
            } else if let Some(fixed) = &mut self.fixed {
                fixed.push_records(records, &run.extent)?;
            }
            if self.settings.tiles {
                self.spool(run, records)?;
            }
            start = end;
        }
        Ok(())
    }

    fn spool(&mut self, run: &Run, records: &[u8]) -> Result<()> {
        let at = run.tile;
        let spool = self.tiles.entry(at).or_insert_with(|| {
            Spool::new(self.out.join(format!("tiles/{}_{}.{}", at[1], at[0], ending(&self.las))))
        });
        let before = spool.records.capacity();
        spool.records.extend_from_slice(records);
        spool.extent.join(&run.extent);
        self.waiting += spool.records.capacity() - before;
        if spool.records.len() >= FULL_BYTES {
            self.waiting -= spool.append(&self.las)?;
        }
        if self.waiting >= self.settings.waiting_bytes { self.relieve() } else { Ok(()) }
    }

    /// Appends the fullest tiles to their files until half of the memory is free.
    fn relieve(&mut self) -> Result<()> {
        let mut fullest: Vec<([i32; 2], usize)> =
            self.tiles.iter().map(|(at, s)| (*at, s.records.len())).collect();
        fullest.sort_by_key(|(at, n)| (std::cmp::Reverse(*n), *at));
        for (at, _) in fullest {
            if self.waiting <= self.settings.waiting_bytes / 2 {
                break;
            }
            if let Some(spool) = self.tiles.get_mut(&at) {
                self.waiting -= spool.append(&self.las)?;
            }
        }
        Ok(())
    }

    /// Finishes all files, tiles side by side.
    pub fn finish(self, fan: &impl Fan) -> Result<Written> {
        let Self { las, tiles, robots, fixed, .. } = self;
        let robots = Some(robots.finish()?);
        let fixed = fixed.map(LasWriter::finish).transpose()?;
        let spools = tiles.into_values().collect();
        let tiles = fan.fan(spools, |spool: Spool| spool.finish(&las));
        Ok(Written { tiles: tiles.into_iter().collect::<Result<_>>()?, robots, fixed })
    }
}

fn ending(las: &LasSettings) -> &'static str {
    if las.compress { "laz" } else { "las" }
}

/// A tile that grows by appending.
struct Spool {
    path: PathBuf,
    /// Where records go: the LAS file to be; for LAZ, bare records that are compressed at the end.
    part: PathBuf,
    records: Vec<u8>,
    extent: Extent,
    body: BodySum,
    is_begun: bool,
}

impl Spool {
    fn new(path: PathBuf) -> Self {
        let part = part_of(&path.with_extension("records"));
        let (extent, body) = (Extent::default(), BodySum::default());
        Self { path, part, records: Vec::new(), extent, body, is_begun: false }
    }

    /// Appends what waits; returns how much memory that freed.
    fn append(&mut self, las: &LasSettings) -> Result<usize> {
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
        file.write_all(&self.records).map_err(failed)?;
        self.body.add(&self.records);
        self.is_begun = true;
        // Capacity counts as memory: what is not full yet may stay so for long.
        Ok(std::mem::take(&mut self.records).capacity())
    }

    fn finish(mut self, las: &LasSettings) -> Result<LasSummary> {
        self.append(las)?;
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
