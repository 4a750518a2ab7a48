//! Obstacles around a robot: balls that contain the points of a cell, sorted into bins. All
//! coordinates are in the frame of the robot's base, metres.

use crate::cells::{CellSight, Cells, PointCell, key, middle};
use crate::evidence::{SeenSpace, evident};
use crate::obstacle::{HALF_DIAGONAL, Obstacle, ObstacleKind, distance};
use crate::shadow::ScannerAt;
use contract::{Fan, Space, SpaceKind};
use geometry::{Aabb, Point, Pose, Vector};
use robot::Model;
use rustc_hash::FxHashMap;
use std::ops::Range;

/// Edge of a bin, metres: a bin has about as many cells of a surface as there are bins about a
/// robot.
const BIN: f64 = 0.16;

/// Neighbouring obstacles.
#[derive(Debug, Clone)]
pub(crate) struct Bin {
    pub(crate) middle: [f32; 3],
    /// Radius of the ball about the centre that contains all of them, metres.
    pub(crate) radius: f32,
    pub(crate) range: Range<usize>,
}

/// The part of space that beams passed through, in the world frame.
#[derive(Debug, Clone)]
pub struct KnownBounds {
    /// Pose of the robot's base in the world, metres.
    pub world_from_base: Pose,
    /// Bounds of the known space in the world, metres; empty where nothing is known.
    pub bounds: Aabb,
}

/// What happens to an obstacle in [`Obstacles::replace`].
pub(crate) enum Replaced {
    /// It is kept.
    Kept,
    /// It is replaced by these, or removed if there are none.
    By(Vec<Obstacle>),
}

/// All obstacles around a robot.
#[derive(Debug, Clone)]
pub struct Obstacles {
    pub(crate) all: Vec<Obstacle>,
    pub(crate) bins: Vec<Bin>,
    pub(crate) known: KnownBounds,
    /// Distance from the base along each axis up to which points were collected, metres.
    far: f64,
    pub(crate) split: Split,
    /// Scanners with known position.
    eyes: Vec<ScannerAt>,
    /// Cells of points that are no evidence of an object, with their kind.
    strays: Vec<(u64, ObstacleKind)>,
}

/// How a voxel of unseen space is divided into parts.
#[derive(Debug, Clone, Default)]
pub(crate) struct Split {
    /// Centres of the parts relative to that of the voxel, base frame, metres.
    offsets: Vec<[f32; 3]>,
    /// Radius of balls that contain a part, metres.
    radius: f32,
    /// Edge of a voxel, metres.
    edge: f64,
}

impl Obstacles {
    /// The obstacles from the cells, from other robots (index, model, poses of their links in this
    /// robot's base frame), and from unseen space, as far as space is known.
    #[must_use]
    pub fn new(
        cells: &Cells,
        others: &[(i16, &Model, Vec<Pose>)],
        space: Option<&Space>,
        known: KnownBounds,
        fan: &dyn Fan,
    ) -> Self {
        let mut all: Vec<Obstacle> = cells.obstacles();
        let seen = space.map(|space| SeenSpace { space, world_from_base: &known.world_from_base });
        let is_evident = evident(&mut all, &CellSight::new(cells), seen, fan);
        let mut evident = is_evident.into_iter();
        let mut strays = Vec::new();
        all.retain(|o| {
            let is_evident = evident.next().unwrap_or(true);
            if !is_evident {
                strays.push((key(o.at.map(f64::from), cells.far), o.what));
            }
            is_evident
        });
        for (number, model, poses) in others {
            all.extend(surface(*number, model, poses));
        }
        let base_from_world = known.world_from_base.inverse();
        let mut split = Split::default();
        if let Some(space) = space {
            all.extend(unseen(space, &base_from_world));
            split = Split::of(space.grid().edge, &base_from_world);
        }
        let (bins, eyes) = (Vec::new(), cells.eyes.clone());
        let mut out = Self { all, bins, known, far: cells.far, split, eyes, strays };
        out.sort();
        out
    }

    /// An index of the fixed obstacles for queries within `within` metres.
    pub(crate) fn fixed(&self, within: f32) -> Fixed {
        let of = |o: &&Obstacle| o.what == ObstacleKind::Fixed;
        let mut cubes: FxHashMap<[i32; 3], Vec<[f32; 3]>> = FxHashMap::default();
        for o in self.all.iter().filter(of) {
            cubes.entry(o.at.map(|v| (v / within).floor() as i32)).or_default().push(o.at);
        }
        Fixed { within, cubes }
    }

    /// Sorts the obstacles into bins.
    fn sort(&mut self) {
        let bin = |o: &Obstacle| o.at.map(|v| (f64::from(v) / BIN).floor() as i32);
        self.all.sort_by_cached_key(bin);
        self.bins.clear();
        let mut from = 0;
        for own in self.all.chunk_by(|a, b| bin(a) == bin(b)) {
            self.bins.push(Bin::of(own, from));
            from += own.len();
        }
    }

    /// Replaces each obstacle by the result of `of`.
    pub(crate) fn replace(&mut self, mut of: impl FnMut(usize, &Obstacle) -> Replaced) {
        let mut all = Vec::with_capacity(self.all.len());
        for (at, o) in self.all.iter().enumerate() {
            match of(at, o) {
                Replaced::Kept => all.push(*o),
                Replaced::By(others) => {
                    if others.is_empty() && o.is_point() {
                        self.strays.push((key(o.at.map(f64::from), self.far), o.what));
                    }
                    all.extend(others);
                }
            }
        }
        self.all = all;
        self.sort();
    }

    /// All cells of points that stand still or may do so, whether obstacles or dropped.
    pub fn point_cells(&self) -> impl Iterator<Item = PointCell> + '_ {
        let is_point = |o: &&Obstacle| o.is_point() || o.what == ObstacleKind::Beside;
        let kept = self.all.iter().filter(is_point);
        let dropped = self.strays.iter().map(|(key, what)| (middle(*key, self.far), *what));
        (kept.map(|o| PointCell { at: o.at, what: o.what, is_dropped: false }))
            .chain(dropped.map(|(at, what)| PointCell { at, what, is_dropped: true }))
    }

    /// Pose of the robot's base in the world, metres.
    #[must_use]
    pub fn world_from_base(&self) -> Pose {
        self.known.world_from_base
    }

    /// Radius of the largest obstacle, metres.
    #[must_use]
    pub fn largest(&self) -> f64 {
        self.all.iter().map(|o| f64::from(o.radius)).fold(0.0, f64::max)
    }

    /// Distance between neighbouring beams of the scanner that resolves a place (base frame) best,
    /// metres; `None` without scanners of known position.
    pub(crate) fn beam_spacing(&self, p: &Point) -> Option<f64> {
        self.eyes.iter().map(|eye| eye.step * (p - eye.at).norm()).min_by(f64::total_cmp)
    }

    /// Whether a box of a link extends beyond the volume in which points were collected, or beyond
    /// the known space.
    pub(crate) fn reaches_unknown(&self, bounds: &Aabb, base_from_link: &Pose) -> bool {
        let pose = self.known.world_from_base * base_from_link;
        let is_known = |c: [f64; 3]| {
            let (here, world) = (base_from_link * Point::from(c), pose * Point::from(c));
            here.coords.amax() <= self.far && self.known.bounds.contains(world.coords.into())
        };
        !bounds.corners().into_iter().all(is_known)
    }
}

/// The fixed obstacles, see [`Obstacles::fixed`].
pub(crate) struct Fixed {
    within: f32,
    cubes: FxHashMap<[i32; 3], Vec<[f32; 3]>>,
}

impl Fixed {
    pub(crate) fn is_near(&self, p: [f32; 3]) -> bool {
        let [x, y, z] = p.map(|v| (v / self.within).floor() as i32);
        (0..27).any(|i: i32| {
            let cube = [x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1];
            let own = self.cubes.get(&cube).into_iter().flatten();
            own.into_iter().any(|q| distance(*q, p) < self.within)
        })
    }
}

impl Bin {
    fn of(own: &[Obstacle], from: usize) -> Self {
        let bounds = Aabb::of(own.iter().map(|o| o.at.map(f64::from)));
        let middle: [f32; 3] = bounds.center().coords.map(|v| v as f32).into();
        let far = |o: &Obstacle| distance(o.at, middle) + o.radius;
        let radius = own.iter().map(far).fold(0.0, f32::max);
        Self { middle, radius, range: from..from + own.len() }
    }
}

/// Samples of the surface of another robot, including what no scan saw of it.
fn surface<'a>(
    number: i16,
    model: &'a Model,
    poses: &'a [Pose],
) -> impl Iterator<Item = Obstacle> + 'a {
    let links = model.links.iter().zip(poses);
    links.flat_map(move |(link, pose)| {
        // Samples are spread unevenly, so that some gaps are wider than the mean spacing.
        let radius = 2.0 * link.cad.spacing;
        link.cad.points.iter().map(move |p| {
            let at = pose * Point::from(p.map(f64::from));
            let at = at.coords.map(|v| v as f32).into();
            Obstacle { at, radius, what: ObstacleKind::Robot(number), is_grazed: false }
        })
    })
}

/// Number of parts of a voxel of unseen space along each axis: their balls exceed the voxel by less
/// than a margin.
const PARTS: usize = 4;

impl Split {
    /// Parts of voxels with this edge, metres.
    fn of(edge: f64, base_from_world: &Pose) -> Self {
        let step = edge / PARTS as f64;
        let at = |k: usize| (k as f64 - 0.5 * (PARTS - 1) as f64) * step;
        let middle = |k: usize| {
            let by = Vector::new(at(k % PARTS), at(k / PARTS % PARTS), at(k / (PARTS * PARTS)));
            (base_from_world * by).map(|v| v as f32).into()
        };
        let offsets = (0..PARTS.pow(3)).map(middle).collect();
        Self { offsets, radius: (HALF_DIAGONAL * step) as f32, edge }
    }

    /// Edge of a voxel and radius of the ball of a part, metres; `None` without known space.
    pub(crate) fn sizes(&self) -> Option<(f64, f32)> {
        (!self.is_empty()).then_some((self.edge, self.radius))
    }

    /// Edge of a part, metres.
    pub(crate) fn step(&self) -> f64 {
        self.edge / PARTS as f64
    }

    /// Whether there is no known space.
    pub(crate) fn is_empty(&self) -> bool {
        self.offsets.is_empty()
    }

    /// The parts of a voxel of unseen space; `None` for other obstacles, and for parts themselves.
    pub(crate) fn parts(&self, o: &Obstacle) -> Option<impl Iterator<Item = Obstacle> + '_> {
        let is_whole = o.what == ObstacleKind::Unseen && o.radius > 1.5 * self.radius;
        let (middle, what, radius) = (o.at, o.what, self.radius);
        is_whole.then(|| {
            self.offsets.iter().map(move |by| Obstacle {
                at: std::array::from_fn(|i| middle[i] + by[i]),
                radius,
                what,
                is_grazed: false,
            })
        })
    }
}

/// Balls that contain the voxels that no beam passed through.
fn unseen(space: &Space, base_from_world: &Pose) -> impl Iterator<Item = Obstacle> {
    let grid = *space.grid();
    let voxels = space.voxels().iter().enumerate();
    voxels.filter(|(_, kind)| **kind == SpaceKind::Unknown).map(move |(at, _)| {
        let cell = grid.cell(at);
        let middle = |i: usize| ((grid.first[i] + cell[i] as i64) as f64 + 0.5) * grid.edge;
        let p = base_from_world * Point::new(middle(0), middle(1), middle(2));
        let at = p.coords.map(|v| v as f32).into();
        Obstacle {
            at,
            radius: (HALF_DIAGONAL * grid.edge) as f32,
            what: ObstacleKind::Unseen,
            is_grazed: false,
        }
    })
}
