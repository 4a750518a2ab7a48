//! Bodies of which only parts left their old place: a thing that was turned nearly on the spot
//! changes at its corners alone, and these look alike after several turns. Its points are gathered
//! from the whole body.

use crate::occupancy::{EDGE, OccupancyCell, SessionOccupancy, bounds, connected};
use crate::things::Thing;
use geometry::Aabb;
use std::collections::BTreeSet;

/// Width around the changed places in which the body must join them, metres.
const JOINS: f64 = 0.1;
/// Width around the changed places within which the body ends, metres: the corners that stick out
/// lie on one side of a thing of about twice this width.
const ENDS: f64 = 0.6;
/// Height above the lowest change below which nothing joins, metres, as the ground or a table on
/// which things stand.
const GROUND: f64 = 0.1;
/// Least share of the body that changed for the changed places to show the whole thing.
const SHOWN: f64 = 0.4;

/// What the changed places of a moved thing are of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum ShownParts {
    /// All of it that was seen.
    Whole,
    /// Parts of a body with these bounds; world frame, metres.
    Of(Aabb),
    /// Parts of something whose ends are not near.
    OfUnknown,
}

impl ShownParts {
    /// What the changed places of a thing are, by the voxels of both sessions.
    pub(super) fn of(thing: &Thing, sessions: [&SessionOccupancy; 2]) -> Self {
        let Some((then, now)) = thing.then.zip(thing.now) else { return Self::Whole };
        let changed = then.union(&now);
        let low = changed.min[2] + GROUND;
        let changes = || thing.gone.iter().chain(&thing.filled);
        let place = |cell: &OccupancyCell| SessionOccupancy::centres(&[*cell])[0];
        let joined = |within: f64| {
            let region = Aabb {
                min: [0, 1, 2].map(|i| if i < 2 { changed.min[i] - within } else { low }),
                max: changed.grown(within).max,
            };
            let is_in = |cell: &OccupancyCell| {
                region.contains(place(cell)) && sessions.iter().any(|s| s.is_solid(cell))
            };
            let mut all: BTreeSet<OccupancyCell> = BTreeSet::new();
            for first in thing.gone.iter().filter(|c| is_in(c)) {
                if all.insert(*first) {
                    connected(*first, 1, |c| is_in(c) && all.insert(*c), usize::MAX);
                }
            }
            (all, region)
        };
        let (near, _) = joined(JOINS);
        let n_changed = changes().filter(|c| near.contains(*c)).count();
        let is_joined = thing.filled.iter().any(|cell| near.contains(cell));
        if !is_joined || n_changed as f64 >= SHOWN * near.len() as f64 {
            return Self::Whole;
        }
        let (all, region) = joined(ENDS);
        let body = bounds(&all);
        let ends = (0..2)
            .all(|i| body.min[i] > region.min[i] + EDGE && body.max[i] < region.max[i] - EDGE);
        let mut whole = body.union(&changed);
        whole.min[2] = changed.min[2];
        if ends { Self::Of(whole) } else { Self::OfUnknown }
    }
}
