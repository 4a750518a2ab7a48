//! Voxels of what stood still in a session in; those regions of it out that no beam of another
//! session reached: of them nobody can say whether they changed.

use crate::occupancy::{EDGE, OccupancyCell, REACH, SessionOccupancy, bounds, connected};
use crate::things::ThingSettings;
use geometry::Aabb;
use std::collections::BTreeSet;

/// Regions that are told, the largest first: the backs of things are many.
const MOST: usize = 50;

/// A region that the other session did not see.
#[derive(Debug, Clone, PartialEq)]
pub struct Unseen {
    /// World, metres.
    pub bounds: Aabb,
    /// Volume of its voxels, m³: of the surface that was seen then.
    pub volume: f64,
    /// Points that were seen in them.
    pub n_points: u64,
    /// Its voxels.
    pub cells: Vec<OccupancyCell>,
}

/// What stood then and was not looked at since, by size; specks are left out as among
/// [`crate::things()`].
#[must_use]
pub fn unseen(
    then: &SessionOccupancy,
    now: &SessionOccupancy,
    settings: &ThingSettings,
) -> Vec<Unseen> {
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
            out.push(Unseen { bounds, volume, n_points, cells });
        }
    }
    out.sort_by_key(|region| std::cmp::Reverse(region.cells.len()));
    out.truncate(MOST);
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::occupancy::{OccupancyBuilder, SessionEvidence};

    #[test]
    fn a_cabinet_that_no_new_beam_reached_is_said_to_be_so() {
        let (mut then, mut now) = (OccupancyBuilder::default(), OccupancyBuilder::default());
        for (i, j) in (0..40).flat_map(|i| (0..90).map(move |j| (i, j))) {
            let (y, z) = (0.02 * f64::from(i), 0.02 * f64::from(j));
            then.add([2.0, y, z], 4e-4, SessionEvidence::Not);
            then.add([5.0, y, z], 4e-4, SessionEvidence::Something);
            then.add([8.0, y, z], 4e-4, SessionEvidence::Not);
            // No new beam ended on these very places, but others did beside them.
            now.add([8.02, y, z], 4e-4, SessionEvidence::Something);
        }
        let found = unseen(&then.finish(), &now.finish(), &ThingSettings::default());
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(found[0].bounds.contains([2.0, 0.4, 0.9]));
        assert_eq!(found[0].n_points, 3600);
    }
}
