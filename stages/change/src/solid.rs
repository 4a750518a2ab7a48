//! Tells whether the voxels of a change belong to something that beams do not pass through. A fence
//! or a mesh, which other beams pass, is no change where one session missed a part of it.

use crate::occupancy::{OccupancyCell, SessionOccupancy};
use nalgebra::{Matrix3, Vector3};

/// Least share of the voxels' faces that the points of a solid object cover. Solid objects reach
/// 0.6 and more even at grazing incidence. Veils at edges reach 0.1. A mesh of 4 mm wires 50 mm
/// apart reaches 0.16, and up to 0.32 where the beams are as wide as its wires.
const MIN_COVER: f64 = 0.4;
/// Least cover of a body that no beams of its own session pass: seen from nearby at grazing
/// incidence, the top and sides of a pallet reach 0.37.
const MIN_COVER_UNPIERCED: f64 = 0.25;
/// Largest share of the points of a body that other beams of their own session passed. Beams pass
/// at edges; between wires, of which many scans together cover a fence, the share is larger.
const MAX_PIERCED: f64 = 0.3;
/// The limit of that share for sheets, and for bodies with little cover.
const MAX_PIERCED_SHEET: f64 = 0.05;
/// Largest thickness of a sheet, as the standard deviation of its voxels along its normal, in
/// voxels: two layers have 0.5, three 0.8.
const SHEET: f64 = 0.6;
/// Largest vertical component of an upright sheet's unit normal: 30°.
const UPRIGHT: f64 = 0.5;

/// The shape of a set of voxels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ChangeShape {
    /// A thin upright sheet, as a fence is.
    Fence,
    /// Any other thin sheet.
    Sheet,
    /// Anything thicker.
    Body,
}

impl SessionOccupancy {
    /// Whether some voxels belong to something that beams do not pass through.
    pub(crate) fn is_opaque(&self, cells: &[OccupancyCell]) -> bool {
        let (cover, shape) = (self.cover(cells), shape(cells));
        let most = if shape == ChangeShape::Body && cover >= MIN_COVER {
            MAX_PIERCED
        } else {
            MAX_PIERCED_SHEET
        };
        let is_tight = self.pierced(cells) <= most;
        is_tight
            && match shape {
                // Many scans together cover a mesh, and a nearby scan gives most of its points; no
                // scan covers it alone.
                ChangeShape::Fence => self.cover_by_one(cells) >= MIN_COVER,
                ChangeShape::Sheet => cover >= MIN_COVER,
                ChangeShape::Body => cover >= MIN_COVER_UNPIERCED,
            }
    }
}

fn shape(cells: &[OccupancyCell]) -> ChangeShape {
    let places = || cells.iter().map(|c| Vector3::from(c.map(f64::from)));
    let n = cells.len() as f64;
    let mean = places().sum::<Vector3<f64>>() / n;
    let spread = places().map(|p| (p - mean) * (p - mean).transpose());
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

    /// A plane of 1.5 m × 1 m with points 1 cm apart, along a direction on the ground and leaning
    /// by a slope. `area` is what one point represents, m².
    fn plane(along: f64, slope: f64, area: f64) -> SessionOccupancy {
        let mut out = OccupancyBuilder::default();
        for (i, j) in (0..150).flat_map(|i| (0..100).map(move |j| (i, j))) {
            let (s, z) = (0.01 * f64::from(i), 0.01 * f64::from(j));
            let (x, y) = (s * along.cos() - slope * z * along.sin(), s * along.sin());
            let at = [x, y + slope * z * along.cos(), z];
            out.add(at, area, SessionEvidence::Empty { is_pierced: false });
        }
        out.finish()
    }

    fn cells(tally: &SessionOccupancy) -> Vec<OccupancyCell> {
        tally.cells().copied().collect()
    }

    #[test]
    fn fences_are_recognised_at_any_yaw() {
        for along in [0.0, 0.3, 0.8, 1.4] {
            assert_eq!(shape(&cells(&plane(along, 0.0, 1e-4))), ChangeShape::Fence, "{along}");
            assert_eq!(shape(&cells(&plane(along, 4.0, 1e-4))), ChangeShape::Sheet, "{along}");
        }
        let mut corner = plane(0.0, 0.0, 1e-4);
        corner.join(plane(1.57, 0.0, 1e-4));
        assert_eq!(shape(&cells(&corner)), ChangeShape::Body);
    }

    #[test]
    fn a_fence_covered_by_many_scans_together_is_not_opaque() {
        // Each scan covers a sixth of the area, ten of them more than all of it.
        let mut mesh = plane(0.4, 0.0, 1.6e-5);
        for _ in 0..9 {
            mesh.join(plane(0.4, 0.0, 1.6e-5));
        }
        assert!(mesh.cover(&cells(&mesh)) > MIN_COVER);
        assert!(!mesh.is_opaque(&cells(&mesh)));
        let plate = plane(0.4, 0.0, 7e-5);
        assert!(plate.is_opaque(&cells(&plate)));
    }
}
