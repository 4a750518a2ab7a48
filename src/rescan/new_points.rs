//! Points of the new scans: the registration of each scan to the plant, and the occupancy of the
//! cell in the new session.

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

/// Approximate number of points of a scan that are registered to the plant's surfaces.
const N_LAID: u64 = 100_000;

/// Registration of each new scan, from the number `first` on; `None` for a scan that sees too few
/// earlier surfaces.
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

/// The map from tiles of the new scans to the occupancy of the cell.
pub(crate) struct NewPoints<'a> {
    pub(crate) scans: &'a [Scan],
    pub(crate) near: &'a NearRobots,
    pub(crate) ground: &'a FloorHeights,
    pub(crate) cell: Aabb,
    /// Earlier occupancy: the earlier scans are looked up only where it has nothing near.
    pub(crate) then: &'a SessionOccupancy,
    /// Look-up in the earlier scans.
    pub(crate) watch: &'a VisibilityQuery<'a>,
    /// Look-up in the new scans.
    pub(crate) own: &'a VisibilityQuery<'a>,
}

/// Occupancy of one tile.
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
        // Consecutive points mostly share a voxel, for which the look-up is made once.
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
