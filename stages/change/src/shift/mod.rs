//! The motion of each thing that moved, from what both sessions saw of it: the displacement of a
//! stated point of the thing, its turn about the vertical, and their uncertainty.
//!
//! 1. The points of the thing are gathered from both sessions, thinned (`points`), and get normals
//!    (`surfels`). Where only parts of it left their old place, the whole body is (`body`).
//! 2. Turns and places from which to start are aligned, point to plane, where surfaces overlap;
//!    beams of one session that pass where the other one has the thing count against a motion
//!    (`search`, `votes`, `align`).
//! 3. Directions in which the common faces determine nothing are determined by the ends of the
//!    thing, or are open (`slide`).
//! 4. Other turns that explain the points as well are named; the stated point is the one that all
//!    of them move alike (`motion`). Errors of the places of scans are part of its uncertainty
//!    (`scan_set`).

mod align;
mod body;
pub(crate) mod motion;
mod points;
mod scan_set;
mod search;
mod slide;
mod surfels;
mod votes;

pub use motion::{ThingMotion, UnknownMotion};
pub use points::{ThingPoints, ThingVoxels};
pub use search::SessionBeams;

use crate::occupancy::SessionEvidence;
use crate::things::{Thing, ThingChange};
use body::ShownParts;
use contract::Fan;
use geometry::Vector;
use motion::motion;
use surfels::ThingPoint;

/// Width around the space that a thing takes in both sessions within which its points are kept,
/// metres: the noise of bounds by voxels.
const BESIDE: f64 = 0.05;

/// Finds the motion of each of those `things` that moved, from its points in the earlier and in the
/// later session. One task a thing runs on `fan`.
pub fn find_motions(
    things: &mut [Thing],
    (voxels, points): (&ThingVoxels, &[ThingPoints; 2]),
    beams: &dyn SessionBeams,
    fan: &dyn Fan,
) {
    let moved: Vec<usize> =
        (0..things.len()).filter(|&i| things[i].change == ThingChange::Moved).collect();
    let things_then: &[Thing] = things;
    let found = fan.fan(moved.clone(), |i| {
        let shown = voxels.shown(i);
        if shown == ShownParts::OfUnknown {
            return Err(UnknownMotion::PartsOnly);
        }
        let means = [0, 1].map(|k| {
            let mut means = points[k].means(i);
            let is_its = |p: &ThingPoint| may_have_moved(&things_then[i], k, &p.at, beams);
            means.retain(|p| matches!(shown, ShownParts::Of(_)) || is_its(p));
            means
        });
        let sides = means.each_ref().map(|means| surfels::surfels(means));
        let places = means.map(|means| means.iter().map(|m| m.at).collect::<Vec<Vector>>());
        motion(sides, places, beams)
    });
    for (i, found) in moved.into_iter().zip(found) {
        things[i].motion = Some(found);
    }
}

/// Whether a point of a session may belong to a thing that moved: the other session has nothing at
/// its place, or the thing stands there in both.
fn may_have_moved(thing: &Thing, session: usize, at: &Vector, beams: &dyn SessionBeams) -> bool {
    let both = thing.then.zip(thing.now).map(|(then, now)| then.shared(&now));
    let world = (*at).into();
    both.is_some_and(|both| !both.is_empty() && both.grown(BESIDE).contains(world))
        || beams.evidence(1 - session, world) != SessionEvidence::Occupied
}

#[cfg(test)]
mod tests;
