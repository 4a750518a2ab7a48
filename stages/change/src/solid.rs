//! Voxels of a change in; whether they are of something that beams do not go through, out: a fence
//! of which another session misses a part has not gone.

use crate::occupancy::{OccupancyCell, SessionOccupancy};
use nalgebra::{Matrix3, Vector3};

/// Share of a voxel's face that its points stand for, over all voxels of a change. Solid things
/// make 0.6 and more even where they are seen askew; veils at edges 0.1, and a mesh of 4 mm wires
/// 50 mm apart, which other beams go through, 0.16 and as much as 0.32 where beams are as wide as
/// its wires.
const MIN_COVER: f64 = 0.4;
/// The same of what no beams of its own session go through, seen from askew from nearby: 0.37 of a
/// pallet's top and sides.
const MIN_CLOSED: f64 = 0.25;
/// Share of the points of a change at whose places other beams of their own session may have gone
/// on: past an edge, but not between wires, of which enough scans together cover a fence.
const MAX_PIERCED: f64 = 0.3;
/// The same of a sheet, and of what is hardly covered.
const MAX_PIERCED_SHEET: f64 = 0.05;
/// Largest thickness of a sheet, as the standard deviation of its voxels across it, in voxels: two
/// layers have 0.5, three 0.8.
const SHEET: f64 = 0.6;
/// Largest vertical part of the direction across an upright sheet: 30°.
const UPRIGHT: f64 = 0.5;

/// Of what shape some voxels are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ChangeShape {
    /// As thin as a fence, and upright as one.
    Fence,
    /// As thin as that.
    Sheet,
    Body,
}

impl SessionOccupancy {
    /// Whether some voxels are of something that beams do not go through.
    pub(crate) fn is_closed(&self, cells: &[OccupancyCell]) -> bool {
        let (cover, shape) = (self.cover(cells), shape(cells));
        let most = if shape == ChangeShape::Body && cover >= MIN_COVER {
            MAX_PIERCED
        } else {
            MAX_PIERCED_SHEET
        };
        let is_tight = self.pierced(cells) <= most;
        is_tight
            && match shape {
                // Enough scans together cover a mesh, and one that is near gives most of its
                // points: each of them alone does not.
                ChangeShape::Fence => self.cover_by_one(cells) >= MIN_COVER,
                ChangeShape::Sheet => cover >= MIN_COVER,
                ChangeShape::Body => cover >= MIN_CLOSED,
            }
    }
}

fn shape(cells: &[OccupancyCell]) -> ChangeShape {
    let places = || cells.iter().map(|c| Vector3::from(c.map(f64::from)));
    let n = cells.len() as f64;
    let middle = places().sum::<Vector3<f64>>() / n;
    let spread = places().map(|p| (p - middle) * (p - middle).transpose());
    let eigen = (spread.sum::<Matrix3<f64>>() / n).symmetric_eigen();
    let thinnest = eigen.eigenvalues.imin();
    match eigen.eigenvalues[thinnest].max(0.0).sqrt() {
        SHEET.. => ChangeShape::Body,
        _ if eigen.eigenvectors[(2, thinnest)].abs() <= UPRIGHT => ChangeShape::Fence,
        _ => ChangeShape::Sheet,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::occupancy::{OccupancyBuilder, SessionEvidence};

    /// Points 1 cm apart on a plane through a direction on the ground, 1.5 m by 1 m, leaning by a
    /// slope; what one stands for, m².
    fn plane(along: f64, slope: f64, area: f64) -> SessionOccupancy {
        let mut out = OccupancyBuilder::default();
        for (i, j) in (0..150).flat_map(|i| (0..100).map(move |j| (i, j))) {
            let (s, z) = (0.01 * f64::from(i), 0.01 * f64::from(j));
            let (x, y) = (s * along.cos() - slope * z * along.sin(), s * along.sin());
            let at = [x, y + slope * z * along.cos(), z];
            out.add(at, area, SessionEvidence::Nothing { is_pierced: false });
        }
        out.finish()
    }

    fn cells(tally: &SessionOccupancy) -> Vec<OccupancyCell> {
        tally.cells().copied().collect()
    }

    #[test]
    fn fences_are_known_however_they_stand() {
        for along in [0.0, 0.3, 0.8, 1.4] {
            assert_eq!(shape(&cells(&plane(along, 0.0, 1e-4))), ChangeShape::Fence, "{along}");
            assert_eq!(shape(&cells(&plane(along, 4.0, 1e-4))), ChangeShape::Sheet, "{along}");
        }
        let mut corner = plane(0.0, 0.0, 1e-4);
        corner.join(plane(1.57, 0.0, 1e-4));
        assert_eq!(shape(&cells(&corner)), ChangeShape::Body);
    }

    #[test]
    fn scans_of_which_none_covers_a_fence_do_not_close_it_together() {
        // A sixth of the area each: ten of them make more than all of it.
        let mut mesh = plane(0.4, 0.0, 1.6e-5);
        for _ in 0..9 {
            mesh.join(plane(0.4, 0.0, 1.6e-5));
        }
        assert!(mesh.cover(&cells(&mesh)) > MIN_COVER);
        assert!(!mesh.is_closed(&cells(&mesh)));
        let plate = plane(0.4, 0.0, 7e-5);
        assert!(plate.is_closed(&cells(&plate)));
    }
}
