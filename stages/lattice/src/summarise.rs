//! The step that reduces a tile to its summary: patches, occupied space and counts.

use crate::Settings;
use crate::normals::Normals;
use crate::occupied::Counter;
use crate::patch::{WorldRows, patches, world_rows};
use crate::raster::{NONE, TileRaster};
use crate::regions::Regions;
use crate::voxels::{self, VoxelSurface};
use contract::{Error, Kind, Map, Occupancy, Result, Scan, ScanId, Tile, TileSummary};

/// The step that makes the summary of each tile.
#[derive(Debug, Clone)]
pub struct Summarise {
    scans: Vec<Scan>,
    settings: Settings,
    with_planes: bool,
}

impl Summarise {
    /// A step for the tiles of these scans; `at.scan` of a tile must be the `id` of one of them.
    #[must_use]
    pub fn new(scans: &[Scan], settings: &Settings) -> Self {
        let mut scans = scans.to_vec();
        scans.sort_by_key(|scan| scan.id);
        Self { scans, settings: *settings, with_planes: true }
    }

    /// Level of subsampling (see [`Tile::skip`]) that suffices for a tile of a scan whose points
    /// are mostly no farther than `range` metres from the scanner; 0 where `range` is unknown (0).
    #[must_use]
    pub fn skip(&self, scan: ScanId, range: f32) -> u32 {
        let at = self.scans.binary_search_by_key(&scan, |scan| scan.id);
        let lattice = at.ok().and_then(|at| self.scans[at].lattice);
        lattice.map_or(0, |lattice| TileRaster::skip(range, &lattice, self.settings.spacing))
    }

    /// The step without patches, which are most of the work, for where the planes are known.
    #[must_use]
    pub fn without_planes(self) -> Self {
        Self { with_planes: false, ..self }
    }
}

/// Buffers that one worker reuses from tile to tile (about 7 MB).
#[derive(Debug, Default)]
pub struct LatticeScratch {
    pub(crate) raster: TileRaster,
    pub(crate) normals: Normals,
    pub(crate) regions: Regions,
    pub(crate) counter: Counter,
    pub(crate) surface: VoxelSurface,
    veils: Vec<bool>,
    solid: Vec<[f32; 3]>,
}

impl Map for Summarise {
    type In = Tile;
    type Out = TileSummary;
    type Scratch = LatticeScratch;

    fn apply(&self, tile: Tile, scratch: &mut LatticeScratch) -> Result<TileSummary> {
        let at = self.scans.binary_search_by_key(&tile.at.scan, |scan| scan.id).map_err(|_| {
            let what = format!("a tile of a scan that was not announced: '{}'", tile.at.scan.0);
            Error::new(Kind::Bug, what)
        })?;
        let scan = &self.scans[at];
        let settings = &self.settings;
        let rows = world_rows(&scan.world_from_scan);
        let n_points = tile.n_all;
        let Some(lattice) = &scan.lattice else {
            let patches = self
                .with_planes
                .then(|| voxels::patches(&tile, scan, &mut scratch.surface, settings));
            let patches = patches.unwrap_or_default();
            let occupancy = scratch.counter.count(&tile.xyz, &rows, settings.voxel);
            return Ok(TileSummary { n_points, n_veils: 0, patches, occupancy });
        };
        scratch.raster.fill(&tile, lattice, tile.skip, settings);
        let mut found = Vec::new();
        if self.with_planes {
            scratch.normals.fill(&scratch.raster, settings);
            scratch.regions.fill(&scratch.raster, &scratch.normals, settings);
            found = patches(&scratch.raster, &scratch.regions, scan, settings);
        }
        let occupancy = self.occupancy(&tile, &rows, scratch);
        let n_veils = scratch.raster.veils.len() as u64;
        Ok(TileSummary { n_points, n_veils, patches: found, occupancy })
    }
}

impl Summarise {
    /// Space that is occupied by points other than veils, at the tile's level of subsampling.
    fn occupancy(&self, tile: &Tile, rows: &WorldRows, scratch: &mut LatticeScratch) -> Occupancy {
        let (raster, solid) = (&scratch.raster, &mut scratch.solid);
        solid.clear();
        if raster.skip > 0 {
            let of = |at: &u32| tile.xyz[*at as usize];
            solid.extend(raster.point.iter().filter(|at| **at != NONE).map(of));
        } else {
            scratch.veils.clear();
            scratch.veils.resize(tile.len(), false);
            raster.flag_veils(tile, &mut scratch.veils);
            let all = tile.xyz.iter().zip(&scratch.veils);
            solid.extend(all.filter(|(_, veil)| !**veil).map(|(p, _)| *p));
        }
        let weight = raster.weight();
        let mut occupancy = scratch.counter.count(solid, rows, self.settings.voxel);
        occupancy.voxels.iter_mut().for_each(|(_, n)| *n = n.saturating_mul(weight));
        occupancy
    }
}
