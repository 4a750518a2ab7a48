//! Fills the raster of a tile with the nearest return of each pixel, links neighbouring pixels, and
//! removes veil points.

use crate::Settings;
use crate::links;
use crate::raster::{NONE, TileRaster};
use contract::{Lattice, TILE_SIDE, Tile};

impl TileRaster {
    /// Fills the raster with the nearest returns of `tile`, links them, and takes the veils out.
    /// 2^`skip` rows and columns of the lattice become one: the first of their pixels that has
    /// a return stands for them.
    pub(crate) fn fill(&mut self, tile: &Tile, lattice: &Lattice, skip: u32, settings: &Settings) {
        self.skip = skip;
        self.side = TILE_SIDE as usize >> skip;
        let n_pixels = self.n_pixels();
        self.point.clear();
        self.point.resize(n_pixels, NONE);
        self.xyzr.clear();
        self.xyzr.resize(n_pixels, [0.0; 4]);
        for (i, (pixel, p)) in tile.pixel.iter().zip(&tile.xyz).enumerate() {
            let at = self.pixel(*pixel);
            // Points are sorted by pixel: another one holds this cell already.
            let old = self.point[at];
            if old != NONE && tile.pixel[old as usize] != *pixel {
                continue;
            }
            let range = (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt();
            // A return at the scanner itself has no direction: it is no surface.
            if range > 1e-3 && (old == NONE || range < self.xyzr[at][3]) {
                self.point[at] = i as u32;
                self.xyzr[at] = [p[0], p[1], p[2], range];
            }
        }
        let step = f64::from(1 << skip);
        self.row_step = (lattice.row_step * step) as f32;
        self.col_step.clear();
        self.col_step.extend((0..self.side as u32).map(|row| {
            let row = f64::from(tile.at.row * TILE_SIDE + (row << skip));
            let elevation = lattice.first_elevation + row * lattice.row_step;
            (lattice.col_step * step * elevation.cos().max(0.01)) as f32
        }));
        self.noise.measure(&self.xyzr, self.side, settings);
        links::link(self, settings);
        self.take_veils();
    }

    /// Finds the veils and empties their pixels.
    fn take_veils(&mut self) {
        links::veils(self);
        let veils = std::mem::take(&mut self.veils);
        for &at in &veils {
            self.point[usize::from(at)] = NONE;
            self.xyzr[usize::from(at)] = [0.0; 4];
        }
        self.veils = veils;
    }
}

/// Which points of `tile` are veils (mixed pixels between a near edge and what lies behind), in the
/// order of the tile's points. All are `false` if the scan has no lattice, since veil points cannot
/// be recognised then.
#[must_use]
pub fn veils(tile: &Tile, scan: &contract::Scan, settings: &Settings) -> Vec<bool> {
    let mut out = vec![false; tile.len()];
    let Some(lattice) = &scan.lattice else {
        return out;
    };
    let mut raster = TileRaster::default();
    raster.fill(tile, lattice, 0, settings);
    raster.flag_veils(tile, &mut out);
    out
}
