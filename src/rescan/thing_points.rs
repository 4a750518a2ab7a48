//! Reads once more the tiles in which things moved, in both sessions, and finds from their points
//! how far each of them moved.

use super::earlier_points::{EarlierPoints, World};
use super::session::{CellComparison, CellLabels, ComparedRobots};
use crate::detect::robots::FittedRobots;
use crate::engine::{AllThreads, Engine};
use crate::label::near_robots::NearRobots;
use crate::store::Store;
use change::{
    SessionBeams, SessionEvidence, Thing, ThingChange, ThingPoints, ThingVoxels, find_motions,
};
use contract::{Label, Map, PointKind, Result, Scan, Tile, Weigh};
use freespace::{Visibility, VisibilityQuery};
use geometry::Aabb;
use segment::FloorHeights;

/// Both sessions of a cell in which things moved.
struct MovedPoints<'a> {
    voxels: &'a ThingVoxels,
    past: &'a EarlierPoints<'a>,
    /// Labels of robots that the earlier result missed.
    missed: Option<&'a NearRobots>,
    scans: &'a [Scan],
    store: &'a Store,
    /// Labels of the new points near robots.
    near: &'a NearRobots,
    ground: &'a FloorHeights,
    /// Look-up in the earlier scans and in the new ones.
    beams: [&'a VisibilityQuery<'a>; 2],
}

impl CellComparison<'_> {
    /// Finds how far the things that moved did so.
    pub(super) fn find_motions(
        &self,
        plant: FittedRobots<'_>,
        robots: &ComparedRobots,
        labels: &mut CellLabels,
        engine: &Engine,
    ) -> Result<()> {
        if labels.things.iter().all(|thing| thing.change != ThingChange::Moved) {
            return Ok(());
        }
        let voxels = ThingVoxels::of(&labels.things, [&labels.compared.then, &labels.now]);
        let own = self.own_fits(plant.fits, robots);
        let labelling = self.labelling(FittedRobots { fits: &own, ..plant });
        let (watch, old_watch) = (self.watch(), VisibilityQuery::new(&self.cell, &self.old_views));
        let missed = self.missed(plant, robots, engine)?;
        let moved = MovedPoints {
            voxels: &voxels,
            past: self.past,
            missed: missed.as_ref(),
            scans: &self.sources.scans,
            store: self.store,
            near: &labels.near,
            ground: labelling.ground(),
            beams: [&old_watch, &watch],
        };
        moved.find(&mut labels.things, engine)
    }
}

impl MovedPoints<'_> {
    /// Finds the motions of the things that moved.
    fn find(&self, things: &mut [Thing], engine: &Engine) -> Result<()> {
        let points = [
            gather(self.past.store, self.voxels.bounds(0), &EarlierOfThings(self), engine)?,
            gather(self.store, self.voxels.bounds(1), &LaterOfThings(self), engine)?,
        ];
        engine.pool()?.install(|| find_motions(things, (self.voxels, &points), self, &AllThreads));
        Ok(())
    }
}

impl SessionBeams for MovedPoints<'_> {
    fn evidence(&self, session: usize, world: [f64; 3]) -> SessionEvidence {
        match self.beams[session].look(world) {
            Visibility::Through => SessionEvidence::Empty { is_pierced: false },
            Visibility::Onto => SessionEvidence::Occupied,
            Visibility::Close | Visibility::Hidden | Visibility::Unseen => {
                SessionEvidence::Unobserved
            }
        }
    }
}

/// Reads the tiles that touch any of the bounds; returns the points of things in them.
fn gather(
    store: &Store,
    bounds: &[Aabb],
    map: &impl Map<In = Tile, Out = GatheredPoints, Scratch = ()>,
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
