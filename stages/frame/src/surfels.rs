//! Points with the places of their scanners in; one surfel a voxel, with an index by place, out.

use geometry::{Aabb, Moments, Vector};
use rustc_hash::{FxHashMap, FxHashSet};
use std::collections::hash_map::Entry;

/// Edge of a voxel, metres: some ten points of a scan that was thinned to 0.25° between beams, 10 m
/// away.
pub(crate) const EDGE: f64 = 0.2;
/// Where voxels begin, metres: floors and walls stand at round figures, and must not run along the
/// borders of voxels.
const BEGIN: f64 = 0.0371;
/// Fewest points of a plane, and of something that is none.
const MIN_FLAT: f64 = 6.0;
const MIN_ROUGH: f64 = 3.0;
/// A plane has at most this RMS distance from its points, metres: noise, and what scans of one
/// session differ by.
const MAX_RMS: f64 = 0.012;
/// A plane whose points lie on a line is none: least spread across it, metres.
const MIN_SPREAD: f64 = 0.025;
/// Normals are turned to the scanner where the beams come, on average, at least so steeply: sine of
/// 3°.
const SIGNED: f64 = 0.05;
/// A surface whose normal has this height at least is level, at most this one upright: cosines of
/// 11° and 78°.
pub(crate) const LEVEL: f64 = 0.98;
pub(crate) const UPRIGHT: f64 = 0.21;

/// Points of a session by voxel. Nothing depends on the order of the voxels.
#[derive(Debug, Clone)]
pub struct Gathered {
    origin: Vector,
    cells: FxHashMap<[i32; 3], SurfelCell>,
}

#[derive(Debug, Clone)]
struct SurfelCell {
    moments: Moments,
    /// Sum of the unit vectors from the points to their scanners; zero where these are not known.
    towards: Vector,
}

/// What lies in one voxel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surfel {
    /// Mean of its points, metres about the session's origin.
    pub at: Vector,
    /// Unit normal of the plane through them; zero where they lie on none.
    pub normal: Vector,
    /// Whether the normal points to the scanners.
    pub is_signed: bool,
    /// Whether a robot stood there, which may have moved since.
    pub may_move: bool,
}

/// The surfels of a session, ordered by voxel.
#[derive(Debug, Clone, Default)]
pub struct Surfels {
    /// What is subtracted from coordinates of the session, metres: they may be those of a map.
    pub origin: Vector,
    /// In the order of their voxels.
    pub all: Vec<Surfel>,
    index: FxHashMap<[i32; 3], u32>,
    /// Columns of voxels in which there is any.
    columns: FxHashSet<[i32; 2]>,
}

impl Gathered {
    /// For points about an origin (world of the session, metres).
    #[must_use]
    pub fn about(origin: Vector) -> Self {
        Self { origin, cells: FxHashMap::default() }
    }

    /// Adds a point, and where its scanner stands if that is known; world of the session, metres.
    pub fn add(&mut self, world: [f64; 3], scanner: Option<&Vector>) {
        let world = Vector::from(world);
        let p = world - self.origin;
        let cell = self.cells.entry(voxel(&p)).or_insert_with(|| SurfelCell {
            moments: Moments::new(middle(&voxel(&p))),
            towards: Vector::zeros(),
        });
        cell.moments.add(&p);
        if let Some(beam) = scanner.and_then(|s| (s - world).try_normalize(1e-9)) {
            cell.towards += beam;
        }
    }

    /// Adds those of others about the same origin.
    pub fn join(&mut self, other: Self) {
        debug_assert_eq!(self.origin, other.origin, "two origins");
        other.cells.into_iter().for_each(|(at, cell)| match self.cells.entry(at) {
            Entry::Vacant(slot) => drop(slot.insert(cell)),
            Entry::Occupied(mut own) => {
                let own = own.get_mut();
                own.moments.join(&cell.moments);
                own.towards += cell.towards;
            }
        });
    }

    /// The surfels; those within one of `may_move` (world of the session, metres) are of something
    /// that may move.
    #[must_use]
    pub fn surfels(&self, may_move: &[Aabb]) -> Surfels {
        let found = self.cells.iter().filter_map(|(at, cell)| Some((*at, cell.surfel()?)));
        let mut found: Vec<([i32; 3], Surfel)> = found.collect();
        found.sort_unstable_by_key(|(at, _)| *at);
        for (_, surfel) in &mut found {
            let world: [f64; 3] = (surfel.at + self.origin).into();
            surfel.may_move = may_move.iter().any(|bounds| bounds.contains(world));
        }
        let columns = found.iter().map(|([i, j, _], _)| [*i, *j]).collect();
        let index = found.iter().zip(0..).map(|((at, _), i)| (*at, i)).collect();
        Surfels {
            origin: self.origin,
            all: found.into_iter().map(|(_, surfel)| surfel).collect(),
            index,
            columns,
        }
    }
}

impl SurfelCell {
    fn surfel(&self) -> Option<Surfel> {
        if self.moments.n < MIN_ROUGH {
            return None;
        }
        let mut surfel = Surfel {
            at: self.moments.mean(),
            normal: Vector::zeros(),
            is_signed: false,
            may_move: false,
        };
        let fit = (self.moments.n >= MIN_FLAT).then(|| self.moments.plane()).flatten();
        if let Some(fit) = fit.filter(|fit| fit.rms <= MAX_RMS && fit.spread[1] >= MIN_SPREAD) {
            let side = fit.plane.normal.dot(&self.towards) / self.moments.n;
            surfel.normal = if side < 0.0 { -fit.plane.normal } else { fit.plane.normal };
            surfel.is_signed = side.abs() >= SIGNED;
        }
        Some(surfel)
    }
}

impl Surfel {
    /// Whether its points lie on a plane.
    #[must_use]
    pub fn is_flat(&self) -> bool {
        self.normal != Vector::zeros()
    }

    /// Whether it is flat and level: of a floor, a ceiling, a table.
    #[must_use]
    pub fn is_level(&self) -> bool {
        self.normal.z.abs() >= LEVEL
    }

    /// Whether it is flat and upright: of a wall, a cabinet, a fence.
    #[must_use]
    pub fn is_upright(&self) -> bool {
        self.is_flat() && self.normal.z.abs() <= UPRIGHT
    }

    /// Cosine between its normal and another one; of normals whose side is not known, that to the
    /// nearer side.
    pub(crate) fn cosine(&self, normal: &Vector, is_signed: bool) -> f64 {
        let cosine = self.normal.dot(normal);
        if self.is_signed && is_signed { cosine } else { cosine.abs() }
    }
}

impl Surfels {
    /// The surfel of the voxel with this index.
    #[inline]
    pub(crate) fn of(&self, voxel: &[i32; 3]) -> Option<usize> {
        self.index.get(voxel).map(|i| *i as usize)
    }

    /// Whether anything was seen above or below a place.
    pub(crate) fn covers(&self, at: &Vector) -> bool {
        let [i, j, _] = voxel(at);
        self.columns.contains(&[i, j])
    }

    /// The surfels of the voxel that holds a place and of the 26 about it.
    pub(crate) fn about(&self, at: &Vector) -> impl Iterator<Item = usize> + '_ {
        let [i, j, k] = voxel(at);
        let steps = (0..27).map(|n| [n / 9 - 1, n / 3 % 3 - 1, n % 3 - 1]);
        steps.filter_map(move |[a, b, c]| self.of(&[i + a, j + b, k + c]))
    }
}

/// The voxel that holds a place.
#[inline]
pub(crate) fn voxel(p: &Vector) -> [i32; 3] {
    [0, 1, 2].map(|i| ((p[i] - BEGIN) / EDGE).floor() as i32)
}

fn middle(voxel: &[i32; 3]) -> Vector {
    Vector::from(voxel.map(|i| (f64::from(i) + 0.5) * EDGE + BEGIN))
}
