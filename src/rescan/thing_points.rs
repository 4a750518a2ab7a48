//! Reads once more the tiles in which things moved, in both sessions, and finds from their points
//! how far each of them moved.

use super::earlier_points::{EarlierPoints, World};
use crate::engine::{AllThreads, Engine};
use crate::label::near_robots::NearRobots;
use crate::store::Store;
use change::{PassedPlaces, Thing, ThingPoints, ThingVoxels, find_motions};
use contract::{Label, Map, PointKind, Result, Scan, Tile, Weigh};
use freespace::{Visibility, VisibilityQuery};
use geometry::Aabb;
use segment::FloorHeights;

/// Both sessions of a cell in which things moved.
pub(crate) struct MovedPoints<'a> {
    pub(crate) voxels: &'a ThingVoxels,
    pub(crate) past: &'a EarlierPoints<'a>,
    /// Labels of robots that the earlier result missed.
    pub(crate) missed: Option<&'a NearRobots>,
    pub(crate) scans: &'a [Scan],
    pub(crate) store: &'a Store,
    /// Labels of the new points near robots.
    pub(crate) near: &'a NearRobots,
    pub(crate) ground: &'a FloorHeights,
    /// Look-up in the earlier scans and in the new ones.
    pub(crate) beams: [&'a VisibilityQuery<'a>; 2],
}

impl MovedPoints<'_> {
    /// Finds the motions of the things that moved.
    pub(crate) fn find(&self, things: &mut [Thing], engine: &Engine) -> Result<()> {
        let points = [
            gather(self.past.store, self.voxels.bounds(0), &EarlierOfThings(self), engine)?,
            gather(self.store, self.voxels.bounds(1), &LaterOfThings(self), engine)?,
        ];
        engine.pool()?.install(|| find_motions(things, &points, self, &AllThreads));
        Ok(())
    }
}

impl PassedPlaces for MovedPoints<'_> {
    fn is_passed(&self, session: usize, world: [f64; 3]) -> bool {
        self.beams[session].look(world) == Visibility::Through
    }
}

/// Reads the tiles that touch any of the bounds; returns the points of things in them.
fn gather(
    store: &Store,
    bounds: &[Aabb],
    map: &(impl Map<In = Tile, Out = GatheredPoints, Scratch = ()> + Sync),
    engine: &Engine,
) -> Result<ThingPoints> {
    let mut tiles: Vec<usize> = bounds.iter().flat_map(|b| store.touching(b)).collect();
    tiles.sort_unstable();
    tiles.dedup();
    let mut all = ThingPoints::default();
    let (source, reads) = (store.picks_once(tiles, 0), store.reads());
    engine.pass(store.task("things"), source, |f| {
        f.map(&reads).map(map).for_each(|own| {
            all.join(own.0);
            Ok(())
        })
    })?;
    Ok(all)
}

/// The map from tiles of the earlier scans.
struct EarlierOfThings<'a, 'm>(&'a MovedPoints<'m>);

/// The map from tiles of the new scans.
struct LaterOfThings<'a, 'm>(&'a MovedPoints<'m>);

/// Points of moved things in one tile.
struct GatheredPoints(ThingPoints);

impl Map for EarlierOfThings<'_, '_> {
    type In = Tile;
    type Out = GatheredPoints;
    type Scratch = ();

    fn apply(&self, tile: Tile, (): &mut ()) -> Result<GatheredPoints> {
        let (past, voxels) = (self.0.past, self.0.voxels);
        let (scan, mask) = past.scan(&tile);
        let in_world = World::from(scan);
        let (mut places, mut worlds, mut labels) = (Vec::new(), Vec::new(), Vec::new());
        for (xyz, place) in tile.xyz.iter().zip(&tile.place) {
            let (world, place) = (in_world.of(*xyz), tile.first_place + u64::from(*place));
            if voxels.contains(0, world) && !past.was_superseded(mask, place) {
                places.push(place);
                worlds.push(world);
            }
        }
        past.labels(mask, &places, &mut labels)?;
        let mut missed = self.0.missed.map(|near| near.of(mask));
        let mut out = ThingPoints::default();
        for ((&place, &world), label) in places.iter().zip(&worlds).zip(&labels) {
            let is_missed = missed.as_mut().and_then(|near| near.label(place));
            let is_robot = is_missed.is_some_and(|label| label.moves());
            if label.kind == PointKind::Fixed && !is_robot {
                out.add(voxels, 0, world, Some(scanner(scan)));
            }
        }
        Ok(GatheredPoints(out))
    }
}

impl Map for LaterOfThings<'_, '_> {
    type In = Tile;
    type Out = GatheredPoints;
    type Scratch = ();

    fn apply(&self, tile: Tile, (): &mut ()) -> Result<GatheredPoints> {
        let scan = &self.0.scans[tile.at.scan.0 as usize];
        let (in_world, mut near) = (World::from(scan), self.0.near.of(scan.mask));
        let mut out = ThingPoints::default();
        for (xyz, place) in tile.xyz.iter().zip(&tile.place) {
            let world = in_world.of(*xyz);
            if !self.0.voxels.contains(1, world) {
                continue;
            }
            let known = near.label(tile.first_place + u64::from(*place));
            let label: Label = known.unwrap_or_else(|| self.0.ground.label(world));
            if label.kind == PointKind::Fixed {
                out.add(self.0.voxels, 1, world, Some(scanner(scan)));
            }
        }
        Ok(GatheredPoints(out))
    }
}

/// Position of a scan's scanner, world frame, metres.
fn scanner(scan: &Scan) -> [f64; 3] {
    scan.world_from_scan.translation.vector.into()
}

impl Weigh for GatheredPoints {
    fn weight_bytes(&self) -> usize {
        self.0.bytes()
    }

    fn n_points(&self) -> u64 {
        0
    }
}
