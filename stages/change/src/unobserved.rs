//! Finds the regions of the earlier session that no beam of the later session reached, so that
//! nothing is known about their changes.

use crate::occupancy::{EDGE, OccupancyCell, REACH, SessionOccupancy, bounds, connected};
use crate::things::ThingSettings;
use geometry::Aabb;
use std::collections::BTreeSet;

/// Limit of the regions that are returned, the largest first. The backs of objects give many small
/// ones.
const MAX_REGIONS: usize = 50;

/// A region that the other session did not see.
#[derive(Debug, Clone, PartialEq)]
pub struct UnobservedRegion {
    /// Bounds; world frame, metres.
    pub bounds: Aabb,
    /// Volume of its voxels, m³. They lie on the surface that was seen in the earlier session.
    pub volume: f64,
    /// Number of points of the earlier session in its voxels.
    pub n_points: u64,
    /// Its voxels.
    pub cells: Vec<OccupancyCell>,
}

/// The regions of the earlier session that the later one did not see, sorted by descending number
/// of voxels. Small ones are left out by the same limits as in [`crate::things()`].
#[must_use]
pub fn unobserved_regions(
    then: &SessionOccupancy,
    now: &SessionOccupancy,
    settings: &ThingSettings,
) -> Vec<UnobservedRegion> {
    let mut left: BTreeSet<OccupancyCell> = then.unseen(now);
    let mut out = Vec::new();
    while let Some(first) = left.pop_first() {
        let cells = connected(first, REACH, |c| left.remove(c), usize::MAX);
        let (bounds, n_points) = (bounds(&cells), then.n_points(&cells));
        let size = bounds.size().into_iter().fold(0.0, f64::max);
        let is_speck = cells.len() < settings.min_voxels
            || n_points < u64::from(settings.min_points)
            || size < settings.min_size;
        if !is_speck {
            let volume = cells.len() as f64 * EDGE.powi(3);
            out.push(UnobservedRegion { bounds, volume, n_points, cells });
        }
    }
    out.sort_by_key(|region| std::cmp::Reverse(region.cells.len()));
    out.truncate(MAX_REGIONS);
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::occupancy::{OccupancyBuilder, SessionEvidence};

    #[test]
    fn a_cabinet_that_no_new_beam_reached_is_unobserved() {
        let (mut then, mut now) = (OccupancyBuilder::default(), OccupancyBuilder::default());
        for (i, j) in (0..40).flat_map(|i| (0..90).map(move |j| (i, j))) {
            let (y, z) = (0.02 * f64::from(i), 0.02 * f64::from(j));
            then.add([2.0, y, z], 4e-4, SessionEvidence::Unobserved);
            then.add([5.0, y, z], 4e-4, SessionEvidence::Occupied);
            then.add([8.0, y, z], 4e-4, SessionEvidence::Unobserved);
            // No new beam ended on exactly these places, but others ended beside them.
            now.add([8.02, y, z], 4e-4, SessionEvidence::Occupied);
        }
        let found = unobserved_regions(&then.finish(), &now.finish(), &ThingSettings::default());
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(found[0].bounds.contains([2.0, 0.4, 0.9]));
        assert_eq!(found[0].n_points, 3600);
    }
}
