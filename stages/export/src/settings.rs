//! What can be tuned in writing; defaults in, no file knows another number.

use crate::record::LasSettings;

/// Tunables of this room.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Whether all points are written with their labels, in spatial tiles (`tiles/`).
    pub tiles: bool,
    /// Edge of a tile, metres: half a robot cell, so that a rescan of one rewrites little beside
    /// it.
    pub tile_edge: f64,
    /// Spatial tiles at most: a square kilometre in tiles of 5 m. Points that are spread wider, by
    /// a wrong unit or by strays, would fill a disk with files of a few points each.
    pub max_tiles: usize,
    /// Whether all that does not move is written as one cloud too (`clouds/fixed`). It is what
    /// most planners read, and twice the disk; a plant is read by tiles, whose classes tell
    /// the same.
    pub fixed_cloud: bool,
    /// Whether records hold the number of the connected body that a point belongs to (`BodyId`).
    pub bodies: bool,
    /// Whether all points are written as one COPC file too (`clouds/plant.copc.laz`), made of the
    /// tiles: an octree that viewers load piece by piece.
    pub copc: bool,
    /// Whether clouds are compressed (LAZ): a quarter of the disk, at a tenth of the speed.
    pub compress: bool,
    /// Records that wait in memory for their tile, bytes.
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
            waiting_bytes: 64 << 20,
        }
    }
}

impl Settings {
    /// What records of tiles and clouds hold that are otherwise as `las` says.
    #[must_use]
    pub fn records(&self, las: &LasSettings) -> LasSettings {
        LasSettings { compress: self.compress, with_bodies: self.bodies, ..las.clone() }
    }
}
