//! A tile in, its summary out: patches, occupied space, counts.

use crate::Settings;
use crate::normals::Normals;
use crate::occupied::Counter;
use crate::patch::{patches, world_rows};
use crate::raster::Raster;
use crate::regions::Regions;
use crate::voxels::{self, Surface};
use contract::{Error, Kind, Map, Result, Scan, Tile, TileSummary};

/// Makes the summary of each tile.
#[derive(Debug, Clone)]
pub struct Summarise {
    scans: Vec<Scan>,
    settings: Settings,
}

impl Summarise {
    /// For tiles of these scans; a tile's `at.scan` is the scan's `id`.
    #[must_use]
    pub fn new(scans: &[Scan], settings: &Settings) -> Self {
        let mut scans = scans.to_vec();
        scans.sort_by_key(|scan| scan.id);
        Self { scans, settings: *settings }
    }
}

/// Buffers that one worker reuses from tile to tile (about 7 MB).
#[derive(Debug, Default)]
pub struct Scratch {
    pub(crate) raster: Raster,
    pub(crate) normals: Normals,
    pub(crate) regions: Regions,
    pub(crate) counter: Counter,
    pub(crate) surface: Surface,
    veils: Vec<bool>,
}

impl Map for Summarise {
    type In = Tile;
    type Out = TileSummary;
    type Scratch = Scratch;

    fn apply(&self, tile: Tile, scratch: &mut Scratch) -> Result<TileSummary> {
        let at = self.scans.binary_search_by_key(&tile.at.scan, |scan| scan.id).map_err(|_| {
            let what = format!("a tile of a scan that was not announced: '{}'", tile.at.scan.0);
            Error::new(Kind::Bug, what)
        })?;
        let scan = &self.scans[at];
        let settings = &self.settings;
        scratch.veils.clear();
        scratch.veils.resize(tile.len(), false);
        let mut n_veils = 0;
        let patches = if let Some(lattice) = &scan.lattice {
            scratch.raster.fill(&tile, lattice, settings);
            scratch.raster.flag_veils(&tile, &mut scratch.veils);
            n_veils = scratch.raster.veils.len() as u64;
            scratch.normals.fill(&scratch.raster, settings);
            scratch.regions.fill(&scratch.raster, &scratch.normals, settings);
            patches(&scratch.raster, &scratch.regions, scan, settings)
        } else {
            voxels::patches(&tile, scan, &mut scratch.surface, settings)
        };
        let rows = world_rows(&scan.world_from_scan);
        let occupancy = scratch.counter.count(&tile.xyz, &scratch.veils, &rows, settings.voxel);
        Ok(TileSummary { n_points: tile.len() as u64, n_veils, patches, occupancy })
    }
}
