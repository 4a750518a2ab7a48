//! Reduces the points of a session to surfels: one for each voxel, with an index by place.

use geometry::{Aabb, Moments, Vector};
use rustc_hash::{FxHashMap, FxHashSet};
use std::collections::hash_map::Entry;

/// Edge of a voxel, metres: at 10 m it holds some ten points of a scan thinned to 0.25° between
/// beams.
pub(crate) const EDGE: f64 = 0.2;
/// Offset of the voxels, metres: floors and walls stand at round coordinates and must not coincide
/// with borders of voxels.
const BEGIN: f64 = 0.0371;
/// Smallest number of points of a flat surfel.
const MIN_FLAT: f64 = 6.0;
/// Smallest number of points of a surfel that is not flat.
const MIN_ROUGH: f64 = 3.0;
/// Largest RMS distance of points from their plane, metres: noise, and registration errors within a
/// session.
const MAX_RMS: f64 = 0.012;
/// Smallest spread of points across the line along which they lie most, metres; below, they define
/// no plane.
const MIN_SPREAD: f64 = 0.025;
/// A normal is turned towards the scanner if the mean beam meets the plane at least this steeply:
/// sine of 3°.
const SIGNED: f64 = 0.05;
/// Smallest z of a level surface's normal: cosine of 11°.
pub(crate) const LEVEL: f64 = 0.98;
/// Largest z of an upright surface's normal: cosine of 78°.
pub(crate) const UPRIGHT: f64 = 0.21;

/// The points of a session by voxel. No result depends on the order of the voxels.
#[derive(Debug, Clone)]
pub struct Gathered {
    origin: Vector,
    cells: FxHashMap<[i32; 3], SurfelCell>,
}

#[derive(Debug, Clone)]
struct SurfelCell {
    moments: Moments,
    /// Sum of the unit vectors from the points to their scanners; zero where scanners are unknown.
    towards: Vector,
}

/// The points of one voxel, reduced to a point and a normal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surfel {
    /// Mean of the points relative to the session's origin, metres.
    pub at: Vector,
    /// Unit normal of the plane of the points; zero where they lie on no plane.
    pub normal: Vector,
    /// Whether the normal points towards the scanners; otherwise its sign is arbitrary.
    pub is_signed: bool,
    /// Whether a robot stood there, which may have moved since.
    pub may_move: bool,
}

/// The surfels of a session, ordered by voxel.
#[derive(Debug, Clone, Default)]
pub struct Surfels {
    /// Subtracted from coordinates of the session, which may be those of a map, metres.
    pub origin: Vector,
    /// The surfels in the order of their voxels.
    pub all: Vec<Surfel>,
    index: FxHashMap<[i32; 3], u32>,
    /// Columns of voxels with at least one surfel.
    columns: FxHashSet<[i32; 2]>,
}

impl Gathered {
    /// An empty collection about an origin (world of the session, metres).
    #[must_use]
    pub fn about(origin: Vector) -> Self {
        Self { origin, cells: FxHashMap::default() }
    }

    /// Adds a point and the position of its scanner, if known; world of the session, metres.
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

    /// Adds the points of another collection about the same origin.
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

    /// Computes the surfels. Those within one of the boxes `may_move` (world of the session,
    /// metres) belong to something that may have moved.
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

    /// Whether it is flat and level, as on a floor, a ceiling or a table.
    #[must_use]
    pub fn is_level(&self) -> bool {
        self.normal.z.abs() >= LEVEL
    }

    /// Whether it is flat and upright, as on a wall, a cabinet or a fence.
    #[must_use]
    pub fn is_upright(&self) -> bool {
        self.is_flat() && self.normal.z.abs() <= UPRIGHT
    }

    /// Cosine of the angle between its normal and another one. If the sign of either is arbitrary,
    /// the absolute value.
    pub(crate) fn cosine(&self, normal: &Vector, is_signed: bool) -> f64 {
        let cosine = self.normal.dot(normal);
        if self.is_signed && is_signed { cosine } else { cosine.abs() }
    }
}

impl Surfels {
    /// Index of the surfel of this voxel.
    #[inline]
    pub(crate) fn of(&self, voxel: &[i32; 3]) -> Option<usize> {
        self.index.get(voxel).map(|i| *i as usize)
    }

    /// Whether anything was seen above or below a place.
    pub(crate) fn covers(&self, at: &Vector) -> bool {
        let [i, j, _] = voxel(at);
        self.columns.contains(&[i, j])
    }

    /// Indices of the surfels in the voxel of a place and its 26 neighbours.
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
