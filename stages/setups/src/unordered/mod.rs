//! Finds where scanners stood from points in no order: shuffled, merged, thinned.
//!
//! Noise of the range moves a point along its own beam, so that seen from the true place and axis
//! its angles stay on the raster, whatever the order of the points and however few are left. Places
//! are looked for on the floor, where columns are lines through the foot of the axis (`votes`). A
//! place counts where the azimuths of the floor's points lie on a comb (`foot`), then their
//! elevations from one height above it (`foot`, `solve`), and then the angles of points all round
//! (`chain`), each so clearly that chance does not (`judge`).

mod chain;
mod floor;
mod foot;
mod judge;
mod owners;
mod raster;
mod solve;
mod spectrum;
#[cfg(test)]
mod tests;
mod votes;

use contract::Fan;
use floor::FloorPoints;
pub use judge::CLEAR as CLEAR_RASTER;
pub use raster::{FoundRasters, RasterEvidence, RasterSetup, UnorderedCause};
use votes::FootVote;

/// Distance within which two results are one setup, metres.
const TWINS: f64 = 0.2;
/// Least score of a candidate: right ones had 3 to 105, most wrong ones less than 6.
const LEAST_SCORE: f64 = 2.0;
/// Number of candidates that are tried together.
const AT_ONCE: usize = 12;
/// Largest number of candidates.
const MOST_CANDIDATES: usize = 600;
/// Share of explained points from which on nothing is said to be missing.
const EXPLAINED: f64 = 0.8;
/// Number of points that are compared all round a candidate.
const LOOKED: usize = 200_000;

/// Finds the scanners that measured points in any order. The votes for places are held in so many
/// bytes, so that few of them leave the floor far from its middle out. The answer depends on the
/// points, their order and this only, on no number of threads.
#[must_use]
pub fn find_unordered(points: &[[f32; 3]], bytes: usize, fan: &dyn Fan) -> FoundRasters {
    let none = |cause| FoundRasters { cause: Some(cause), ..FoundRasters::default() };
    let cells = (bytes / votes::VOTE_BYTES) as f64;
    let reach = 0.5 * votes::VOTE * cells.sqrt();
    let Some(floor) = FloorPoints::find(points, reach) else {
        return none(UnorderedCause::NoFloor);
    };
    let waves = votes::waves(&floor, fan);
    let mut candidates = votes::candidates(&floor, &waves, LEAST_SCORE);
    candidates.truncate(MOST_CANDIDATES);
    if candidates.is_empty() {
        return none(UnorderedCause::NoPattern);
    }
    let all_round = chain::all_round(&floor, points, LOOKED);
    let mut setups: Vec<RasterSetup> = Vec::new();
    for batch in candidates.chunks(AT_ONCE) {
        // What is near a setup that was found already is the same one.
        let is_new = |c: &&FootVote| setups.iter().all(|s| !is_near(&floor, s, c));
        let batch: Vec<FootVote> = batch.iter().filter(is_new).copied().collect();
        let found = fan.fan(batch, |candidate| {
            chain::certified(&floor, &candidate.refined(&waves), &all_round)
        });
        let n_before = setups.len();
        found.into_iter().flatten().for_each(|setup| take(&mut setups, setup));
        if setups.len() == n_before {
            break;
        }
    }
    setups.sort_by(|a, b| b.evidence.share.total_cmp(&a.evidence.share));
    let explained = setups.iter().map(|s| s.evidence.share).sum::<f64>().min(1.0);
    let cause = if setups.is_empty() {
        Some(UnorderedCause::NoComb)
    } else {
        (explained < EXPLAINED).then_some(UnorderedCause::Part)
    };
    owners::narrow(&mut setups, &floor.pose, &all_round);
    FoundRasters { is_alone: owners::is_alone(&setups), setups, cause, explained }
}

/// Whether a candidate is the foot of a setup.
fn is_near(floor: &FloorPoints, setup: &RasterSetup, candidate: &FootVote) -> bool {
    let at = floor.pose.inverse() * setup.world_from_scanner;
    let (p, axis) = (at.translation.vector, at.rotation * geometry::Vector::z());
    let foot = p - axis * (p.z / axis.z);
    (foot.x - candidate.at[0]).hypot(foot.y - candidate.at[1]) < TWINS
}

/// Adds a setup, or replaces its less clear twin.
fn take(setups: &mut Vec<RasterSetup>, setup: RasterSetup) {
    let at = |s: &RasterSetup| s.world_from_scanner.translation.vector;
    let clearness = |s: &RasterSetup| s.evidence.clearness[0] + s.evidence.clearness[1];
    match setups.iter_mut().find(|other| (at(other) - at(&setup)).norm() < TWINS) {
        None => setups.push(setup),
        Some(twin) if clearness(twin) < clearness(&setup) => *twin = setup,
        Some(_) => {}
    }
}
