//! Points of earlier scans in a cell: the surfaces that they lie on, how the new scans see each of
//! them, and which of them are superseded.

use super::earlier_result::EarlierResult;
use super::superseded::Places;
use super::voxel_fates::Fates;
use crate::engine::{Engine, Task};
use crate::label::near_robots::NearRobots;
use crate::store::Store;
use change::{OccupancyBuilder, SessionEvidence, SessionOccupancy};
use contract::{Label, MAX_SKIP, Map, MaskId, PointKind, Result, Scan, Tile, Weigh};
use export::MaskReader;
use freespace::{Visibility, VisibilityQuery};
use geometry::{Aabb, Point};
use register::SurfaceVoxels;
use std::collections::BTreeSet;

/// One of so many points is used for the surfaces, since a tenth of a voxel's points is enough for
/// its plane; of dense tiles fewer are read.
const SAMPLE: u64 = 5;
const N_SAMPLED: u64 = 2_000_000;
/// Distance of places in a mask beyond which they are read separately.
const GAP: u64 = 1 << 14;

/// Share of requested places, as one in so many, from which on a mask is read sequentially.
const SPARSE: u64 = 64;

/// Points of the earlier scans in a cell.
pub(crate) struct EarlierPoints<'a> {
    pub(crate) scans: &'a [Scan],
    pub(crate) store: &'a Store,
    pub(crate) cell: Aabb,
    base: &'a EarlierResult,
    masks: Vec<MaskReader>,
    /// For each mask, places that were superseded before, and its number of points.
    before: Vec<Vec<u64>>,
    n_points: Vec<u64>,
    tiles: Vec<usize>,
}

/// The earlier points as the new scans see them.
pub(crate) struct ComparedPoints {
    /// Occupancy of the earlier session, by voxel.
    pub(crate) then: SessionOccupancy,
    tiles: Vec<LookedUpTile>,
    /// Fates of the points, by voxel.
    pub(crate) fates: Fates,
    /// For each mask, places whose surface the new scans measured again.
    anew: Vec<Places>,
}

/// The points of one tile as the new scans see them.
#[derive(Default)]
struct LookedUpTile {
    mask: u32,
    /// Places that new beams passed through, with their voxels.
    through: Vec<(u64, [i32; 3])>,
    /// Places of robot points, with the robots' numbers.
    robots: Vec<(u64, i16)>,
    /// Voxels of robots that the earlier result missed: where new beams pass through them, the
    /// points are gone.
    missed: BTreeSet<[i32; 3]>,
    tally: SessionOccupancy,
}

impl<'a> EarlierPoints<'a> {
    pub(crate) fn new(
        base: &'a EarlierResult,
        scans: &'a [Scan],
        store: &'a Store,
        cell: Aabb,
    ) -> Result<Self> {
        let (masks, before) = (base.masks(), base.superseded()?);
        let n_points = base.result.labels.scans.iter().map(|s| s.n_points).collect();
        Ok(Self { scans, store, cell, base, masks, before, n_points, tiles: store.touching(&cell) })
    }

    /// The same points for another cell.
    pub(crate) fn of_cell(self, cell: Aabb) -> Self {
        Self { cell, tiles: self.store.touching(&cell), ..self }
    }

    /// Surfaces of the earlier points.
    pub(crate) fn surfaces(&self, engine: &Engine) -> Result<SurfaceVoxels> {
        let (skip, step) = sampled((self.n_points() / N_SAMPLED).max(SAMPLE));
        let (mut all, sample) = (SurfaceVoxels::default(), Sample { past: self, step });
        let source = self.store.picks_once(self.tiles.clone(), skip);
        let reads = self.store.reads();
        engine.pass(self.task("register"), source, |f| {
            f.map(&reads).map(&sample).for_each(|own| {
                all.join(own.0);
                Ok(())
            })
        })?;
        Ok(all)
    }

    /// Looks up every point in the new scans; where those saw nothing, in the earlier ones.
    pub(crate) fn look_up(
        &self,
        [watch, own]: [&VisibilityQuery<'_>; 2],
        missed: Option<&NearRobots>,
        engine: &Engine,
    ) -> Result<ComparedPoints> {
        let (mut then, mut tiles) = (SessionOccupancy::default(), Vec::new());
        let fates = Fates::of(&self.cell);
        let anew: Vec<Places> = self.n_points.iter().map(|n| Places::of(*n)).collect();
        let look =
            EarlierPointLookUp { past: self, watch, own, missed, fates: &fates, anew: &anew };
        let source = self.store.picks_once(self.tiles.clone(), 0);
        let reads = self.store.reads();
        engine.pass(self.task("compare"), source, |f| {
            f.map(&reads).map(&look).for_each(|mut looked| {
                then.join(std::mem::take(&mut looked.tally));
                tiles.push(looked);
                Ok(())
            })
        })?;
        Ok(ComparedPoints { then, tiles, fates, anew })
    }

    /// All superseded places, by mask: those superseded before, measured again, of bodies that are
    /// gone, and of robots that have moved.
    pub(crate) fn superseded<'c>(
        &self,
        compared: &'c ComparedPoints,
        gone: &BTreeSet<[i32; 3]>,
        stands_otherwise: impl Fn(i16) -> bool,
    ) -> &'c [Places] {
        let all = &compared.anew;
        for (own, before) in all.iter().zip(&self.before).filter(|(_, b)| !b.is_empty()) {
            let mut own = own.adding();
            before.iter().for_each(|place| own.add(*place));
        }
        for tile in &compared.tiles {
            let mut own = all[tile.mask as usize].adding();
            let away = tile.through.iter().filter(|(_, cell)| gone.contains(cell));
            away.for_each(|(place, _)| own.add(*place));
            let left = tile.robots.iter().filter(|(_, robot)| stands_otherwise(*robot));
            left.for_each(|(place, _)| own.add(*place));
        }
        all
    }

    /// Voxels of robots that the earlier result missed: what the new scans see through of them is
    /// gone.
    pub(crate) fn missed(compared: &ComparedPoints) -> impl Iterator<Item = &[i32; 3]> {
        compared.tiles.iter().flat_map(|tile| &tile.missed)
    }

    /// Whether a place of a mask was superseded before.
    pub(crate) fn was_superseded(&self, mask: MaskId, place: u64) -> bool {
        self.before[mask.0 as usize].binary_search(&place).is_ok()
    }

    /// Number of places of one mask that were superseded before.
    pub(crate) fn n_of(&self, mask: usize) -> usize {
        self.before[mask].len()
    }

    /// Number of places that were superseded before.
    pub(crate) fn n_before(&self) -> u64 {
        self.before.iter().map(|places| places.len() as u64).sum()
    }

    /// Number of points of the tiles that the cell touches.
    fn n_points(&self) -> u64 {
        self.tiles.iter().map(|&i| self.store.entries()[i].n_points).sum()
    }

    fn task(&self, name: &str) -> Task {
        let items = self.tiles.len() as u64;
        let amount = crate::engine::Amount { items, points: self.n_points(), bytes: 0 };
        self.store.task(name).of(amount)
    }

    /// The scan of a tile, and its mask.
    pub(super) fn scan(&self, tile: &Tile) -> (&Scan, MaskId) {
        let scan = &self.scans[tile.at.scan.0 as usize];
        (scan, scan.mask)
    }

    /// Labels of a tile's points, by their places in its mask.
    pub(super) fn labels(
        &self,
        mask: MaskId,
        places: &[u64],
        labels: &mut Vec<Label>,
    ) -> Result<()> {
        if !places.is_empty() {
            self.base.compare_mask(mask.0 as usize)?;
        }
        let mask = &self.masks[mask.0 as usize];
        let of = |first: u64, last: u64| mask.range(first, (last - first + 1) as usize);
        labels.clear();
        let (Some(&first), Some(&last)) = (places.iter().min(), places.iter().max()) else {
            return Ok(());
        };
        labels.resize(places.len(), Label::UNCERTAIN);
        if (last - first) / SPARSE <= places.len() as u64 {
            let read = of(first, last)?;
            for (label, place) in labels.iter_mut().zip(places) {
                *label = read.label((place - first) as usize)?;
            }
            return Ok(());
        }
        let mut order: Vec<usize> = (0..places.len()).collect();
        order.sort_unstable_by_key(|&i| places[i]);
        for group in order.chunk_by(|&a, &b| places[b] - places[a] < GAP) {
            let first = places[group[0]];
            let read = of(first, places[group[group.len() - 1]])?;
            for &i in group {
                labels[i] = read.label((places[i] - first) as usize)?;
            }
        }
        Ok(())
    }
}

/// How to read one of `of` points: the `skip` of each tile (see [`Tile::skip`]), and the step
/// through the remaining points.
pub(crate) fn sampled(of: u64) -> (u32, usize) {
    let skip = (of.max(1).ilog2() / 2).min(MAX_SKIP);
    (skip, (of >> (2 * skip)) as usize)
}

/// The map that gathers surfaces.
struct Sample<'a> {
    past: &'a EarlierPoints<'a>,
    step: usize,
}

struct Sampled(SurfaceVoxels);

impl Map for Sample<'_> {
    type In = Tile;
    type Out = Sampled;
    type Scratch = ();

    fn apply(&self, tile: Tile, (): &mut ()) -> Result<Sampled> {
        let (scan, mask) = self.past.scan(&tile);
        let old = &self.past.before[mask.0 as usize];
        let mut out = SurfaceVoxels::default();
        let in_world = World::from(scan);
        for i in (0..tile.len()).step_by(self.step) {
            let world = in_world.of(tile.xyz[i]);
            let place = tile.first_place + u64::from(tile.place[i]);
            if self.past.cell.contains(world) && old.binary_search(&place).is_err() {
                out.add(world);
            }
        }
        Ok(Sampled(out))
    }
}

/// Points of a tile that are looked up; kept from tile to tile, since fresh memory costs more time
/// than the look-up.
#[derive(Default)]
struct PointsToLookUp {
    places: Vec<u64>,
    worlds: Vec<[f64; 3]>,
    labels: Vec<Label>,
    sights: Vec<Visibility>,
}

/// The map that looks up points in the new scans.
struct EarlierPointLookUp<'a> {
    past: &'a EarlierPoints<'a>,
    watch: &'a VisibilityQuery<'a>,
    /// Look-up in the earlier scans.
    own: &'a VisibilityQuery<'a>,
    /// Labels of robots that the earlier result missed.
    missed: Option<&'a NearRobots>,
    fates: &'a Fates,
    anew: &'a [Places],
}

impl Map for EarlierPointLookUp<'_> {
    type In = Tile;
    type Out = LookedUpTile;
    type Scratch = PointsToLookUp;

    fn apply(&self, tile: Tile, asked: &mut PointsToLookUp) -> Result<LookedUpTile> {
        let (scan, mask) = self.past.scan(&tile);
        let old = &self.past.before[mask.0 as usize];
        let is_new = |place: u64| old.is_empty() || old.binary_search(&place).is_err();
        let PointsToLookUp { places, worlds, labels, sights } = asked;
        places.clear();
        worlds.clear();
        let in_world = World::from(scan);
        for (xyz, place) in tile.xyz.iter().zip(&tile.place) {
            let (world, place) = (in_world.of(*xyz), tile.first_place + u64::from(*place));
            if self.past.cell.contains(world) && is_new(place) {
                places.push(place);
                worlds.push(world);
            }
        }
        self.past.labels(mask, places, labels)?;
        self.watch.look_all(worlds, sights);
        let mut out = LookedUpTile { mask: mask.0, ..LookedUpTile::default() };
        let mut tallying = OccupancyBuilder::default();
        let mut anew = self.anew[mask.0 as usize].adding();
        let mut missed = self.missed.map(|near| near.of(mask));
        let points = places.iter().zip(&*worlds).zip(labels.iter().zip(&*sights));
        for ((&place, &world), (label, &sight)) in points {
            let voxel = SessionOccupancy::cell(world);
            self.fates.add(voxel, sight);
            match sight {
                Visibility::Onto => anew.add(place),
                Visibility::Through => out.through.push((place, voxel)),
                Visibility::Close | Visibility::Hidden | Visibility::Unseen => {}
            }
            let is_missed = missed.as_mut().and_then(|near| near.label(place));
            if is_missed.is_some_and(|label| label.moves()) {
                out.missed.insert(voxel);
                tallying.add_robot(world);
                continue;
            }
            match label.kind {
                PointKind::Fixed => {
                    tallying.add(world, area(scan, world), seen(sight, self.own, world));
                }
                PointKind::Link | PointKind::Attachment => {
                    out.robots.push((place, label.robot));
                    tallying.add_robot(world);
                }
                PointKind::Floor | PointKind::Uncertain => {}
            }
        }
        out.tally = tallying.finish();
        Ok(out)
    }
}

/// Visibility of a point of one session in the scans of the other; the beams of its own session
/// tell whether it belongs to a mesh or fence.
pub(crate) fn seen(
    sight: Visibility,
    own: &VisibilityQuery<'_>,
    world: [f64; 3],
) -> SessionEvidence {
    match sight {
        Visibility::Through => SessionEvidence::Empty { is_pierced: own.is_pierced(world) },
        Visibility::Onto | Visibility::Close => SessionEvidence::Occupied,
        Visibility::Hidden | Visibility::Unseen => SessionEvidence::Unobserved,
    }
}

/// Area across its beam that a point represents, m²: that of its pixel, or the share of a voxel
/// where no scanner is known.
pub(crate) fn area(scan: &Scan, world: [f64; 3]) -> f64 {
    let Some(lattice) = &scan.lattice else { return SessionOccupancy::FACE };
    let beam = Point::from(world) - Point::from(scan.world_from_scan.translation.vector);
    lattice.row_step * lattice.col_step * beam.norm_squared()
}

/// Transformation of a scan's points to the world frame.
pub(crate) struct World {
    /// Rotation matrix, by row.
    rotation: [[f64; 3]; 3],
    shift: [f64; 3],
}

impl World {
    pub(crate) fn from(scan: &Scan) -> Self {
        let pose = &scan.world_from_scan;
        let rotation = pose.rotation.to_rotation_matrix().matrix().transpose();
        Self { rotation: rotation.into(), shift: pose.translation.vector.into() }
    }

    /// World coordinates of a point of the scan, metres.
    #[inline]
    pub(crate) fn of(&self, [x, y, z]: [f32; 3]) -> [f64; 3] {
        let ([x, y, z], Self { rotation: r, shift }) =
            ([f64::from(x), f64::from(y), f64::from(z)], self);
        let one = |i: usize| r[i][0] * x + r[i][1] * y + r[i][2] * z + shift[i];
        [one(0), one(1), one(2)]
    }
}

impl Weigh for Sampled {
    fn weight_bytes(&self) -> usize {
        size_of::<Self>()
    }

    fn n_points(&self) -> u64 {
        0
    }
}

impl Weigh for LookedUpTile {
    fn weight_bytes(&self) -> usize {
        size_of_val(&*self.through) + size_of_val(&*self.robots)
    }

    fn n_points(&self) -> u64 {
        0
    }
}
