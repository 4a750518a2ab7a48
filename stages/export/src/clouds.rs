//! Labelled clouds: points in any order in; spatial tiles, and robots and fixed things apart, out.
//!
//! Tiles are as many as the plant is large, so none of them keeps a file open: records wait in memory, bounded in
//! bytes, and the fullest tiles are appended to their files.

use crate::atomic::{part_of, refused};
use crate::las::{LasSummary, LasWriter, bounds, head};
use crate::record::{Extent, LasPoint, LasSettings, encode};
use contract::{PointKind, Result};
use geometry::narrow::floor_i32;
use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// What clouds are written, and how.
#[derive(Debug, Clone, PartialEq)]
pub struct CloudsSettings {
    /// Format of all of them.
    pub las: LasSettings,
    /// Edge of a tile, metres; `None` for no tiles. 10 m is a robot cell.
    pub tile_edge: Option<f64>,
    /// Whether `clouds/robots` (links and attachments) and `clouds/fixed` (all the rest, uncertain too) are written.
    pub apart: bool,
    /// Records that may wait in memory, bytes.
    pub memory: usize,
}

impl CloudsSettings {
    /// Tiles of 10 m and clouds apart, with 64 MiB of waiting records.
    #[must_use]
    pub fn new(las: LasSettings) -> Self {
        Self { las, tile_edge: Some(10.0), apart: true, memory: 64 << 20 }
    }
}

/// What [`Clouds`] wrote.
#[derive(Debug, Clone, PartialEq)]
pub struct Written {
    /// Tiles, by row then column.
    pub tiles: Vec<LasSummary>,
    /// Links and attachments.
    pub robots: Option<LasSummary>,
    /// All the rest.
    pub fixed: Option<LasSummary>,
}

/// Writes labelled clouds under `OUT/tiles` and `OUT/clouds`.
pub struct Clouds {
    out: PathBuf,
    settings: CloudsSettings,
    tiles: BTreeMap<[i32; 2], Spool>,
    waiting: usize,
    robots: Option<LasWriter>,
    fixed: Option<LasWriter>,
}

impl Clouds {
    /// Opens the clouds under the output folder.
    pub fn create(out: &Path, settings: CloudsSettings) -> Result<Self> {
        let ending = if settings.las.compress { "laz" } else { "las" };
        let open = |name: &str| {
            settings
                .apart
                .then(|| {
                    LasWriter::create(
                        out.join(format!("clouds/{name}.{ending}")),
                        settings.las.clone(),
                    )
                })
                .transpose()
        };
        let (robots, fixed) = (open("robots")?, open("fixed")?);
        if settings.tile_edge.is_some() {
            let folder = out.join("tiles");
            std::fs::create_dir_all(&folder)
                .map_err(|e| refused("folder cannot be made", &folder, e))?;
        }
        Ok(Self {
            out: out.to_path_buf(),
            settings,
            tiles: BTreeMap::new(),
            waiting: 0,
            robots,
            fixed,
        })
    }

    /// Adds a labelled point.
    #[inline]
    pub fn push(&mut self, point: &LasPoint, kind: PointKind) -> Result<()> {
        let moves = matches!(kind, PointKind::Link | PointKind::Attachment);
        if let Some(cloud) = if moves { &mut self.robots } else { &mut self.fixed } {
            cloud.push(point)?;
        }
        let Some(edge) = self.settings.tile_edge else {
            return Ok(());
        };
        let at = [floor_i32(point.xyz[1] / edge), floor_i32(point.xyz[0] / edge)];
        let spool = self.tiles.entry(at).or_insert_with(|| {
            let ending = if self.settings.las.compress { "laz" } else { "las" };
            Spool::new(self.out.join(format!("tiles/{}_{}.{ending}", at[1], at[0])))
        });
        let before = spool.records.len();
        encode(point, &self.settings.las, &mut spool.extent, &mut spool.records)
            .map_err(|e| e.at(spool.path.display()))?;
        self.waiting += spool.records.len() - before;
        if self.waiting >= self.settings.memory { self.relieve() } else { Ok(()) }
    }

    /// Appends the fullest tiles to their files until half of the memory is free.
    fn relieve(&mut self) -> Result<()> {
        let mut fullest: Vec<([i32; 2], usize)> =
            self.tiles.iter().map(|(at, s)| (*at, s.records.len())).collect();
        fullest.sort_by_key(|(at, n)| (std::cmp::Reverse(*n), *at));
        for (at, _) in fullest {
            if self.waiting <= self.settings.memory / 2 {
                break;
            }
            if let Some(spool) = self.tiles.get_mut(&at) {
                self.waiting -= spool.records.len();
                spool.append(&self.settings.las)?;
                // Capacity counts as memory too.
                spool.records = Vec::new();
            }
        }
        Ok(())
    }

    /// Finishes all files.
    pub fn finish(self) -> Result<Written> {
        let Self { settings, tiles, robots, fixed, .. } = self;
        let robots = robots.map(LasWriter::finish).transpose()?;
        let fixed = fixed.map(LasWriter::finish).transpose()?;
        let mut written = Vec::new();
        for (_, spool) in tiles {
            written.push(spool.finish(&settings.las)?);
        }
        Ok(Written { tiles: written, robots, fixed })
    }
}

/// A tile that grows by appending.
struct Spool {
    path: PathBuf,
    /// Where records go: the LAS file to be; for LAZ, bare records that are compressed at the end.
    part: PathBuf,
    records: Vec<u8>,
    extent: Extent,
    is_begun: bool,
}

impl Spool {
    fn new(path: PathBuf) -> Self {
        let part = part_of(&path.with_extension("records"));
        Self { path, part, records: Vec::new(), extent: Extent::default(), is_begun: false }
    }

    fn append(&mut self, las: &LasSettings) -> Result<()> {
        let failed = |e| refused("tile cannot be written", &self.part, e);
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
        self.records.clear();
        self.is_begun = true;
        Ok(())
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
        sealed.map_err(|e| refused("tile cannot be finished", &self.path, e))?;
        Ok(LasSummary {
            path: self.path.clone(),
            n_points: self.extent.n,
            bounds: bounds(las, &self.extent),
        })
    }

    /// Compresses the spooled records.
    fn compress(&self, las: &LasSettings) -> Result<LasSummary> {
        let failed = |e| refused("tile cannot be read again", &self.part, e);
        let mut writer = LasWriter::create(&self.path, las.clone())?;
        writer.widen(&self.extent);
        let mut file = File::open(&self.part).map_err(failed)?;
        let mut left = self.extent.n as usize * las.record_len();
        let mut piece = vec![0; 8192 * las.record_len()];
        while left > 0 {
            let n = left.min(piece.len());
            file.read_exact(&mut piece[..n]).map_err(failed)?;
            writer.push_records(&piece[..n])?;
            left -= n;
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
