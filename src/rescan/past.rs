//! Points of earlier scans in a cell in; the surfaces that they lie on, what the new scans say of each of them, and which of
//! them are superseded, out.

use super::base::Base;
use super::fate::Fates;
use crate::engine::{Engine, Task};
use crate::labelling::Near;
use crate::report::tiles;
use crate::store::Store;
use contract::{Label, Map, MaskId, PointKind, Result, Scan, Tile, Weigh};
use export::MaskReader;
use geometry::{Aabb, Point, Vector};
use merge::{Seen, Sight, Surfaces, Tally, Tallying, Watch};
use nalgebra::Matrix3;
use std::collections::BTreeSet;

/// One of so many points tells the surfaces, and of many points more are passed over, so that about so many do: a tenth of a
/// voxel's points is enough for its plane.
const SAMPLE: u64 = 5;
const N_SAMPLED: u64 = 2_000_000;
/// Places so far apart are read from the mask one after the other.
const GAP: u64 = 1 << 14;

/// Masks are read through where at least one place in so many is asked for.
const SPARSE: u64 = 64;

/// Earlier points in a cell.
pub(crate) struct Past<'a> {
    pub(crate) scans: &'a [Scan],
    pub(crate) store: &'a Store,
    pub(crate) cell: Aabb,
    masks: Vec<MaskReader>,
    /// By mask: places that were superseded before.
    before: Vec<Vec<u64>>,
    tiles: Vec<usize>,
}

/// What the new scans say of the points of one tile.
#[derive(Default)]
pub(crate) struct Looked {
    mask: u32,
    /// Places where they saw a surface: it was measured anew.
    onto: Vec<u64>,
    /// Places that their beams went through, with their voxels.
    through: Vec<(u64, [i32; 3])>,
    /// Places that belong to robots.
    robots: Vec<(u64, i16)>,
    /// Voxels of robots that the earlier result missed.
    missed: BTreeSet<[i32; 3]>,
    tally: Tally,
}

impl<'a> Past<'a> {
    pub(crate) fn new(
        base: &Base,
        scans: &'a [Scan],
        store: &'a Store,
        cell: Aabb,
    ) -> Result<Self> {
        let (masks, before) = (base.masks(), base.superseded()?);
        Ok(Self { scans, store, cell, masks, before, tiles: store.touching(&cell) })
    }

    /// The surfaces of what stood there.
    pub(crate) fn surfaces(&self, engine: &Engine) -> Result<Surfaces> {
        let step = (self.n_points() / N_SAMPLED).max(SAMPLE) as usize;
        let (mut all, sample) = (Surfaces::default(), Sample { past: self, step });
        engine.pass(self.task("register"), self.store.tiles_of(self.tiles.clone()), |f| {
            f.map(&sample).for_each(|own| {
                all.join(own.0);
                Ok(())
            })
        })?;
        Ok(all)
    }

    /// Asks the new scans about every point, and the earlier ones where those saw nothing; what stood there by voxel, what is
    /// said of each tile, and what becomes of the points.
    pub(crate) fn look(
        &self,
        [watch, own]: [&Watch<'_>; 2],
        missed: Option<&Near>,
        engine: &Engine,
    ) -> Result<(Tally, Vec<Looked>, Fates)> {
        let (mut tally, mut all) = (Tally::default(), Vec::new());
        let fates = Fates::of(&self.cell);
        let look = Look { past: self, watch, own, missed, fates: &fates };
        engine.pass(self.task("compare"), self.store.tiles_of(self.tiles.clone()), |f| {
            f.map(&look).for_each(|mut looked| {
                tally.join(std::mem::take(&mut looked.tally));
                all.push(looked);
                Ok(())
            })
        })?;
        Ok((tally, all, fates))
    }

    /// All places that are superseded now, by mask, ascending: those that were measured anew, those of things that are gone,
    /// and those of robots that stand otherwise.
    pub(crate) fn superseded(
        &self,
        looked: &[Looked],
        gone: &BTreeSet<[i32; 3]>,
        stands_otherwise: impl Fn(i16) -> bool,
    ) -> Vec<Vec<u64>> {
        let mut all: Vec<Places> = self.before.iter().map(|b| Places::of(b)).collect();
        for tile in looked {
            let own = &mut all[tile.mask as usize];
            tile.onto.iter().for_each(|place| own.add(*place));
            let away = tile.through.iter().filter(|(_, cell)| gone.contains(cell));
            away.for_each(|(place, _)| own.add(*place));
            let left = tile.robots.iter().filter(|(_, robot)| stands_otherwise(*robot));
            left.for_each(|(place, _)| own.add(*place));
        }
        all.iter().map(Places::sorted).collect()
    }

    /// Voxels of robots that the earlier result missed: what the new scans see through of them is gone.
    pub(crate) fn missed(looked: &[Looked]) -> impl Iterator<Item = &[i32; 3]> {
        looked.iter().flat_map(|tile| &tile.missed)
    }

    /// How many of one mask were superseded before.
    pub(crate) fn n_of(&self, mask: usize) -> usize {
        self.before[mask].len()
    }

    /// How many were superseded before.
    pub(crate) fn n_before(&self) -> u64 {
        self.before.iter().map(|places| places.len() as u64).sum()
    }

    /// Points of the tiles that the cell touches.
    fn n_points(&self) -> u64 {
        self.tiles.iter().map(|&i| self.store.entries()[i].n_points).sum()
    }

    fn task(&self, name: &str) -> Task {
        let items = self.tiles.len() as u64;
        let amount = crate::progress::Amount { items, points: self.n_points(), bytes: 0 };
        tiles(name, self.store).of(amount)
    }

    fn scan(&self, tile: &Tile) -> (&Scan, MaskId) {
        let scan = &self.scans[tile.at.scan.0 as usize];
        (scan, scan.mask)
    }

    /// Labels of a tile's points.
    fn labels(&self, mask: MaskId, places: &[u64], labels: &mut Vec<Label>) -> Result<()> {
        let mask = &self.masks[mask.0 as usize];
        let of = |first: u64, last: u64| mask.range(first, (last - first + 1) as usize);
        labels.clear();
        let (first, last) = places.iter().fold((u64::MAX, 0), |(a, b), &p| (a.min(p), b.max(p)));
        if first > last {
            return Ok(());
        }
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

/// Places of a mask, one bit each: millions of them are in order without being sorted.
struct Places(Vec<u64>);

impl Places {
    fn of(places: &[u64]) -> Self {
        let mut out = Self(Vec::new());
        places.iter().for_each(|place| out.add(*place));
        out
    }

    fn add(&mut self, place: u64) {
        let at = (place / 64) as usize;
        if at >= self.0.len() {
            self.0.resize((at + 1).next_power_of_two(), 0);
        }
        self.0[at] |= 1 << (place % 64);
    }

    /// All of them, ascending.
    fn sorted(&self) -> Vec<u64> {
        let mut out = Vec::with_capacity(self.0.iter().map(|w| w.count_ones() as usize).sum());
        for (at, &word) in self.0.iter().enumerate() {
            let mut left = word;
            while left != 0 {
                out.push(at as u64 * 64 + u64::from(left.trailing_zeros()));
                left &= left - 1;
            }
        }
        out
    }
}

/// The map that gathers surfaces.
struct Sample<'a> {
    past: &'a Past<'a>,
    step: usize,
}

struct Sampled(Surfaces);

impl Map for Sample<'_> {
    type In = Tile;
    type Out = Sampled;
    type Scratch = ();

    fn apply(&self, tile: Tile, (): &mut ()) -> Result<Sampled> {
        let (scan, mask) = self.past.scan(&tile);
        let old = &self.past.before[mask.0 as usize];
        let mut out = Surfaces::default();
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

/// The points of a tile that are asked for; kept from tile to tile, since fresh memory costs more than what is done with it.
#[derive(Default)]
struct Asked {
    places: Vec<u64>,
    worlds: Vec<[f64; 3]>,
    labels: Vec<Label>,
    sights: Vec<Sight>,
}

/// The map that asks the new scans.
struct Look<'a> {
    past: &'a Past<'a>,
    watch: &'a Watch<'a>,
    /// Of the earlier scans.
    own: &'a Watch<'a>,
    /// Labels of robots that the earlier result missed.
    missed: Option<&'a Near>,
    fates: &'a Fates,
}

impl Map for Look<'_> {
    type In = Tile;
    type Out = Looked;
    type Scratch = Asked;

    fn apply(&self, tile: Tile, asked: &mut Asked) -> Result<Looked> {
        let (scan, mask) = self.past.scan(&tile);
        let old = &self.past.before[mask.0 as usize];
        let is_new = |place: u64| old.is_empty() || old.binary_search(&place).is_err();
        let Asked { places, worlds, labels, sights } = asked;
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
        let mut out = Looked { mask: mask.0, ..Looked::default() };
        let mut tallying = Tallying::default();
        let points = places.iter().zip(&*worlds).zip(labels.iter().zip(&*sights));
        for ((&place, &world), (label, &sight)) in points {
            let voxel = Tally::cell(world);
            self.fates.add(voxel, sight);
            match sight {
                Sight::Onto => out.onto.push(place),
                Sight::Through => out.through.push((place, voxel)),
                Sight::Close | Sight::Hidden | Sight::Unseen => {}
            }
            let missed = self.missed.and_then(|near| near.label(mask, place));
            if missed.is_some_and(|label| label.moves()) {
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

/// What a session has at the place of another one's point, of which that one's own beams say whether it is of a mesh.
pub(crate) fn seen(sight: Sight, own: &Watch<'_>, world: [f64; 3]) -> Seen {
    match sight {
        Sight::Through => Seen::Nothing { is_pierced: own.is_pierced(world) },
        Sight::Onto | Sight::Close => Seen::Something,
        Sight::Hidden | Sight::Unseen => Seen::Not,
    }
}

/// Area across its beam that a point stands for, m²: that of its pixel, or of a voxel's share where no scanner is known.
pub(crate) fn area(scan: &Scan, world: [f64; 3]) -> f64 {
    let Some(lattice) = &scan.lattice else { return Tally::FACE };
    let range = (Point::from(world) - Point::from(scan.world_from_scan.translation.vector)).norm();
    (lattice.row_step * range) * (lattice.col_step * range)
}

/// Points of a scan in the world.
pub(crate) struct World {
    rotation: Matrix3<f64>,
    shift: Vector,
}

impl World {
    pub(crate) fn from(scan: &Scan) -> Self {
        let pose = &scan.world_from_scan;
        Self {
            rotation: *pose.rotation.to_rotation_matrix().matrix(),
            shift: pose.translation.vector,
        }
    }

    /// A point of the scan in the world, metres.
    #[inline]
    pub(crate) fn of(&self, xyz: [f32; 3]) -> [f64; 3] {
        (self.rotation * Vector::from(xyz.map(f64::from)) + self.shift).into()
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

impl Weigh for Looked {
    fn weight_bytes(&self) -> usize {
        size_of_val(&*self.onto) + size_of_val(&*self.through) + size_of_val(&*self.robots)
    }

    fn n_points(&self) -> u64 {
        0
    }
}
