//! Computes the normal at each point of a tile: from its raster if the scanner's position is known,
//! otherwise from voxels.

use crate::{LatticeScratch, Settings, voxels};
use contract::{Scan, Tile};

/// Unit normals of a tile's points, in the order of its points, in the scan frame (as its
/// coordinates are), towards the scanner. Where the scanner is unknown, the sign is such that the
/// largest component of the normal is positive, so horizontal surfaces point up as long as the scan
/// frame does. `None` for veils and where no surface was found.
#[must_use]
pub fn normals(tile: &Tile, scan: &Scan, settings: &Settings) -> Vec<Option<[f32; 3]>> {
    let mut scratch = LatticeScratch::default();
    let Some(lattice) = &scan.lattice else {
        return voxels::normals(tile, &mut scratch.surface, settings);
    };
    scratch.raster.fill(tile, lattice, 0, settings);
    scratch.normals.fill(&scratch.raster, settings);
    let (raster, normals) = (&scratch.raster, &scratch.normals);
    tile.pixel
        .iter()
        .zip(&tile.xyz)
        .map(|(pixel, p)| {
            // Nothing is skipped, so pixels of the tile are pixels of the raster.
            let at = usize::from(*pixel);
            if !raster.holds(at) || normals.error[at] == 0.0 {
                return None;
            }
            // A second return of the pixel only shares the normal if it lies on the same tangent
            // plane.
            let (n, q) = (normals.normal[at], raster.xyzr[at]);
            let off = n[0] * (p[0] - q[0]) + n[1] * (p[1] - q[1]) + n[2] * (p[2] - q[2]);
            (off.abs() <= 3.0 * raster.noise.sigma(q[3]) + 1e-3).then_some(n)
        })
        .collect()
}
