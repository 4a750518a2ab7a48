//! The settings of this crate with their defaults; no other file has tunable numbers.

use crate::record::LasSettings;

/// Settings of writing clouds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Whether all points are written with labels in spatial tiles (`tiles/`).
    pub tiles: bool,
    /// Edge of a tile, metres: half a robot cell, so that the rescan of a cell rewrites little
    /// beside it.
    pub tile_edge: f64,
    /// Largest number of spatial tiles; the default covers a square kilometre in tiles of 5 m.
    /// Points that are spread more widely, by a wrong unit or by stray points, would fill a disk
    /// with files of a few points each.
    pub max_tiles: usize,
    /// Whether all points that do not move are also written as one cloud (`clouds/fixed`). Most
    /// planners read that, but it doubles the disk space; the classes of the tiles tell the same.
    pub fixed_cloud: bool,
    /// Whether records hold the number of the connected body of a point (`BodyId`).
    pub bodies: bool,
    /// Whether all points are also written as one COPC file (`clouds/plant.copc.laz`), an octree
    /// that viewers load piece by piece.
    pub copc: bool,
    /// Whether clouds are compressed (LAZ): a quarter of the disk space at a tenth of the speed.
    pub compress: bool,
    /// Whether the page of the result for a browser is written (`report.html`), at most 15 MB. All
    /// tiles are read once more for it.
    pub page: bool,
    /// Memory for records that wait to be written to their tiles, bytes.
    pub waiting_bytes: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            tiles: true,
            tile_edge: 5.0,
            max_tiles: 40_000,
            fixed_cloud: true,
            bodies: false,
            copc: false,
            compress: false,
            page: true,
            waiting_bytes: 64 << 20,
        }
    }
}

impl Settings {
    /// The record format of tiles and clouds: `las` with the extra fields that are set here.
    #[must_use]
    pub fn records(&self, las: &LasSettings) -> LasSettings {
        LasSettings { compress: self.compress, with_bodies: self.bodies, ..las.clone() }
    }
}
