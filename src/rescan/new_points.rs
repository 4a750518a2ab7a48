//! Points of the new scans in; how far each scan is off the plant, and what stands still in the
//! cell now, out.

use super::earlier_points::{World, area, sampled, seen};
use crate::engine::Engine;
use crate::label::near_robots::NearRobots;
use crate::store::Store;
use change::{OccupancyBuilder, SessionOccupancy};
use contract::{Label, Map, PointKind, Result, Scan, Tile, Weigh};
use freespace::{Visibility, VisibilityQuery};
use geometry::{Aabb, Point};
use register::{Planes, Registration};
use segment::FloorHeights;

/// Points of a scan that are laid on the plant's surfaces, about.
const N_LAID: u64 = 100_000;

/// How each new scan, from the number `first` on, is off the plant; none where too little of what
/// stood is seen.
pub(crate) fn register(
    planes: &Planes,
    scans: &[Scan],
    store: &Store,
    cell: &Aabb,
    engine: &Engine,
) -> Result<Vec<Option<Registration>>> {
    let touching = store.touching(cell);
    engine.fan_out("register", scans.iter().collect(), |scan| {
        let entries = || touching.iter().filter(|&&i| store.entries()[i].at.scan == scan.id);
        let n: u64 = entries().map(|&i| store.entries()[i].n_points).sum();
        let (skip, step) = sampled((n / N_LAID).max(1));
        let mut points = Vec::new();
        for &i in entries() {
            let tile = store.tile(i, skip)?;
            let in_world = World::from(scan);
            let worlds = tile.xyz.iter().step_by(step).map(|p| in_world.of(*p));
            points.extend(worlds.filter(|p| cell.contains(*p)));
        }
        Ok(planes.register(&points, &Point::from(cell.center().coords)))
    })
}

/// What stands still in a cell, and where the earlier scans saw nothing.
pub(crate) struct NewPoints<'a> {
    pub(crate) scans: &'a [Scan],
    pub(crate) near: &'a NearRobots,
    pub(crate) ground: &'a FloorHeights,
    pub(crate) cell: Aabb,
    /// What stood there: the earlier scans are asked only where nothing of it is near.
    pub(crate) then: &'a SessionOccupancy,
    /// Earlier scans.
    pub(crate) watch: &'a VisibilityQuery<'a>,
    /// The new ones.
    pub(crate) own: &'a VisibilityQuery<'a>,
}

/// What one tile adds.
pub(crate) struct Tallied(SessionOccupancy);

impl NewPoints<'_> {
    pub(crate) fn tally(&self, store: &Store, engine: &Engine) -> Result<SessionOccupancy> {
        let mut all = SessionOccupancy::default();
        let source = store.picks_once(store.touching(&self.cell), 0);
        let reads = store.reads();
        engine.pass(store.task("compare"), source, |f| {
            f.map(&reads).map(self).for_each(|own| {
                all.join(own.0);
                Ok(())
            })
        })?;
        Ok(all)
    }
}

impl Map for NewPoints<'_> {
    type In = Tile;
    type Out = Tallied;
    type Scratch = ();

    fn apply(&self, tile: Tile, (): &mut ()) -> Result<Tallied> {
        let scan = &self.scans[tile.at.scan.0 as usize];
        let mut out = OccupancyBuilder::default();
        let (in_world, mut near) = (World::from(scan), self.near.of(scan.mask));
        // Neighbours are mostly in one voxel, and ask once whether something stood there.
        let (mut last, mut stood) = (None, false);
        for (xyz, place) in tile.xyz.iter().zip(&tile.place) {
            let world = in_world.of(*xyz);
            if !self.cell.contains(world) {
                continue;
            }
            let known = near.label(tile.first_place + u64::from(*place));
            let label: Label = known.unwrap_or_else(|| self.ground.label(world));
            match label.kind {
                PointKind::Fixed => {
                    let cell = SessionOccupancy::cell(world);
                    if last != Some(cell) {
                        (last, stood) = (Some(cell), self.then.has_points_near(&cell));
                    }
                    let sight = if stood { Visibility::Onto } else { self.watch.look(world) };
                    out.add(world, area(scan, world), seen(sight, self.own, world));
                }
                PointKind::Link | PointKind::Attachment => out.add_robot(world),
                PointKind::Floor | PointKind::Uncertain => {}
            }
        }
        Ok(Tallied(out.finish()))
    }
}

impl Weigh for Tallied {
    fn weight_bytes(&self) -> usize {
        size_of::<Self>()
    }

    fn n_points(&self) -> u64 {
        0
    }
}
