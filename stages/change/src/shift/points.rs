//! Gathers the points of things that moved, thinned to one mean a small voxel. Sums are integers,
//! so that no result depends on the order of the points.

use super::body::ShownParts;
use super::scan_set::ScanSet;
use super::surfels::ThingPoint;
use crate::occupancy::{EDGE, OccupancyCell, SessionOccupancy, around};
use crate::things::{Thing, ThingChange};
use geometry::{Aabb, Vector};
use rustc_hash::FxHashMap;
use std::collections::BTreeMap;

/// Small voxels along an edge of a voxel of the occupancy: 12.5 mm, about as far apart as beams of
/// a common scan are at 5 m.
const FINER: f64 = 4.0;
/// Unit of summed positions within a small voxel, metres: far below the noise of a range.
const UNIT: f64 = 1e-6;
/// Unit of summed directions.
const DIRECTION_UNIT: f64 = 1e-4;
/// Most voxels of the occupancy whose points are gathered for a thing in one session. A thing of
/// 3 m has about 20 000; anything larger is thinned no more, but cut.
const MAX_VOXELS: usize = 60_000;
/// Most things whose points are gathered, the largest first.
const MAX_THINGS: usize = 64;

/// The voxels from which the points of moved things are gathered, in both sessions.
#[derive(Debug, Clone, Default)]
pub struct ThingVoxels {
    /// For each session, the things of each voxel, as places in the list of things.
    of: [FxHashMap<OccupancyCell, Vec<u16>>; 2],
    /// For each session, bounds of the voxels of each thing, world frame, metres.
    bounds: [Vec<Aabb>; 2],
    /// For each thing, what its changed places are of it.
    parts: FxHashMap<u16, ShownParts>,
}

impl ThingVoxels {
    /// The voxels of those `things` that moved: those that changed and their neighbours, those in
    /// the thing's bounds where the other session has nothing, and all in the bounds of both
    /// sessions where it stands partly where it stood.
    #[must_use]
    pub fn of(things: &[Thing], sessions: [&SessionOccupancy; 2]) -> Self {
        let mut out = Self::default();
        let moved = things.iter().enumerate().filter(|(_, t)| t.change == ThingChange::Moved);
        for (at, thing) in moved.take(MAX_THINGS) {
            let (Some(then), Some(now), Ok(number)) = (thing.then, thing.now, u16::try_from(at))
            else {
                continue;
            };
            let shown = ShownParts::of(thing, sessions);
            let (then, now, both, stays) = match shown {
                ShownParts::Of(body) => (body, body, body.grown(EDGE), true),
                _ => (then, now, then.shared(&now).grown(EDGE), then.touches(&now)),
            };
            out.parts.insert(number, shown);
            let parts = [(then, &thing.gone), (now, &thing.filled)];
            for (k, (bounds, changed)) in parts.into_iter().enumerate() {
                let [own, other] = [sessions[k], sessions[1 - k]];
                let is_its = |cell: &OccupancyCell| {
                    (stays && both.contains(SessionOccupancy::centres(&[*cell])[0]))
                        || around(cell, 1).any(|c| changed.binary_search(&c).is_ok())
                        || !other.has_points_near(cell)
                };
                let cells = cells(&bounds.grown(EDGE)).filter(|cell| own.has_points(cell));
                let cells: Vec<_> = cells.filter(is_its).take(MAX_VOXELS).collect();
                out.bounds[k].push(crate::occupancy::bounds(&cells));
                for cell in cells {
                    out.of[k].entry(cell).or_default().push(number);
                }
            }
        }
        out
    }

    /// Bounds of the things of a session (0 the earlier, 1 the later one), world frame, metres.
    #[must_use]
    pub fn bounds(&self, session: usize) -> &[Aabb] {
        &self.bounds[session]
    }

    /// What the changed places of a thing are of it.
    pub(super) fn shown(&self, thing: usize) -> ShownParts {
        let number = u16::try_from(thing).ok();
        number.and_then(|n| self.parts.get(&n)).copied().unwrap_or(ShownParts::Whole)
    }

    /// Whether a place of a session (world frame, metres) may be on a thing that moved.
    #[must_use]
    pub fn contains(&self, session: usize, world: [f64; 3]) -> bool {
        self.of[session].contains_key(&SessionOccupancy::cell(world))
    }
}

/// All voxels that a box touches.
fn cells(bounds: &Aabb) -> impl Iterator<Item = OccupancyCell> + use<> {
    let (low, high) = (SessionOccupancy::cell(bounds.min), SessionOccupancy::cell(bounds.max));
    let [x, y, z] = [0, 1, 2].map(|i| low[i]..=high[i]);
    x.flat_map(move |i| {
        let z = z.clone();
        y.clone().flat_map(move |j| z.clone().map(move |k| [i, j, k]))
    })
}

/// Number of points of a small voxel, and sums of their positions relative to its corner and of the
/// directions towards their scanners.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct ThingPointSums {
    n: u32,
    at: [i64; 3],
    towards: [i64; 3],
    scans: ScanSet,
}

/// The points of moved things in one session.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ThingPoints {
    /// For each thing, the sums by small voxel.
    of: BTreeMap<u16, FxHashMap<[i32; 3], ThingPointSums>>,
}

impl ThingPoints {
    /// Adds a point of a session (0 or 1), world frame, metres; `scanner` is where it was measured
    /// from, if that is known. Points that are on no moved thing are left out.
    pub fn add(
        &mut self,
        voxels: &ThingVoxels,
        session: usize,
        world: [f64; 3],
        scanner: Option<[f64; 3]>,
    ) {
        let Some(things) = voxels.of[session].get(&SessionOccupancy::cell(world)) else { return };
        let small = EDGE / FINER;
        let cell = world.map(|v| (v / small).floor() as i32);
        let at = |i: usize| ((world[i] - f64::from(cell[i]) * small) / UNIT).round() as i64;
        let beam = scanner.map(|s| Vector::from(s) - Vector::from(world));
        let towards = beam.and_then(|b| b.try_normalize(1e-6)).unwrap_or_default();
        let towards = towards.map(|v| (v / DIRECTION_UNIT).round() as i64);
        let scans = scanner.map(ScanSet::of).unwrap_or_default();
        let one = ThingPointSums { n: 1, at: [0, 1, 2].map(at), towards: towards.into(), scans };
        for thing in things {
            self.of.entry(*thing).or_default().entry(cell).or_default().join(&one);
        }
    }

    /// Adds the points of another part of the session.
    pub fn join(&mut self, other: Self) {
        for (thing, cells) in other.of {
            let own = self.of.entry(thing).or_default();
            cells.into_iter().for_each(|(cell, sums)| own.entry(cell).or_default().join(&sums));
        }
    }

    /// The mean points of a thing and the mean directions towards their scanners, sorted by small
    /// voxel; world frame, metres.
    pub(super) fn means(&self, thing: usize) -> Vec<ThingPoint> {
        let number = u16::try_from(thing).ok();
        let Some(all) = number.and_then(|number| self.of.get(&number)) else { return Vec::new() };
        let mut cells: Vec<_> = all.iter().collect();
        cells.sort_unstable_by_key(|(cell, _)| **cell);
        let mean = |(cell, sums): (&[i32; 3], &ThingPointSums)| {
            let one = |i: usize| {
                f64::from(cell[i]) * EDGE / FINER + sums.at[i] as f64 * UNIT / f64::from(sums.n)
            };
            let towards = Vector::from(sums.towards.map(|v| v as f64));
            ThingPoint {
                at: Vector::new(one(0), one(1), one(2)),
                towards: towards.try_normalize(0.0).unwrap_or_default(),
                scans: sums.scans,
            }
        };
        cells.into_iter().map(mean).collect()
    }

    /// Memory that the sums take, bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let one = size_of::<([i32; 3], ThingPointSums)>();
        self.of.values().map(|cells| cells.capacity() * one).sum()
    }
}

impl ThingPointSums {
    fn join(&mut self, other: &Self) {
        self.n += other.n;
        self.scans = self.scans.with(other.scans);
        for i in 0..3 {
            self.at[i] += other.at[i];
            self.towards[i] += other.towards[i];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::occupancy::{OccupancyBuilder, SessionEvidence};
    use crate::things::{ThingSettings, things};
    use contract::OneByOne;

    /// A crate whose surfaces have points every 2 cm.
    fn crate_at(x: f64) -> Vec<[f64; 3]> {
        let mut out = Vec::new();
        for (i, j) in (0..=30).flat_map(|i| (0..=30).map(move |j| (i, j))) {
            let (u, v) = (0.02 * f64::from(i), 0.02 * f64::from(j));
            out.extend([[x, u, v], [x + 0.6, u, v], [x + u, 0.0, v], [x + u, v, 0.6]]);
        }
        out
    }

    #[test]
    fn means_are_those_of_the_things_points_in_any_order() {
        let sessions = [1.0, 4.0].map(|x| {
            let mut out = OccupancyBuilder::default();
            let nothing = SessionEvidence::Empty { is_pierced: false };
            crate_at(x).into_iter().for_each(|p| out.add(p, 4e-4, nothing));
            out.finish()
        });
        let [then, now] = &sessions;
        let found = things(then, now, &ThingSettings::default(), &OneByOne);
        assert_eq!(found.len(), 1);
        let voxels = ThingVoxels::of(&found, [then, now]);
        assert!(voxels.contains(0, [1.0, 0.3, 0.3]) && !voxels.contains(0, [4.0, 0.3, 0.3]));
        assert!(voxels.bounds(1)[0].contains([4.3, 0.3, 0.3]));
        let gathered = |points: &[[f64; 3]]| {
            let mut out = ThingPoints::default();
            points.iter().for_each(|p| out.add(&voxels, 0, *p, Some([1.0, -5.0, 0.3])));
            out
        };
        let (all, far) = (crate_at(1.0), [[9.0, 0.0, 0.3]]);
        let whole = gathered(&[&far, &all[..]].concat());
        let (mut parts, reversed) = (gathered(&all[900..]), all[..900].iter().rev());
        parts.join(gathered(&reversed.copied().collect::<Vec<_>>()));
        assert!(whole == parts, "sums depend on the order");
        let means = whole.means(0);
        let front: Vec<_> = means.iter().filter(|p| p.at.y < 1e-6).collect();
        assert!(front.len() >= 30 * 30);
        assert!(front.into_iter().all(|p| p.at.x > 0.99 && p.towards.y < -0.9));
    }
}
