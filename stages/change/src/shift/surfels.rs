//! Gives thinned points of a thing their normals, and finds for a place the nearest of them that
//! faces the same way.

use super::scan_set::ScanSet;
use geometry::{Moments, Vector};
use rustc_hash::FxHashMap;

/// Radii within which neighbours give a normal, metres: the second where beams lie farther apart.
const RADII: [f64; 2] = [0.03, 0.06];
/// Fewest neighbours for a normal, itself among them.
const MIN_NEIGHBOURS: f64 = 7.0;
/// Largest RMS distance of the neighbours from their plane, metres: range noise, not an edge.
const MAX_RMS: f64 = 0.005;
/// Least spread of the neighbours across their main direction, metres.
const MIN_SPREAD: f64 = 0.008;
/// Normals are means over the surfels within this distance, metres, that face the same way, with at
/// least this cosine (18°): the noise of single ones would seem to tell of shifts along a face.
const SMOOTH: (f64, f64) = (0.08, 0.95);

/// A small piece of a thing's surface; world frame, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ThingSurfel {
    pub(super) at: Vector,
    /// Unit normal towards the scanner.
    pub(super) normal: Vector,
    /// The scans that saw it.
    pub(super) scans: ScanSet,
}

/// A point of a thing, thinned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ThingPoint {
    /// World frame, metres.
    pub(super) at: Vector,
    /// Mean direction towards its scanners.
    pub(super) towards: Vector,
    /// The scans that saw it.
    pub(super) scans: ScanSet,
}

/// Points by voxels of one edge, metres.
pub(super) struct PlaceGrid {
    edge: f64,
    cells: FxHashMap<[i32; 3], Vec<u32>>,
}

impl PlaceGrid {
    pub(super) fn new(places: impl Iterator<Item = Vector>, edge: f64) -> Self {
        let mut cells: FxHashMap<[i32; 3], Vec<u32>> = FxHashMap::default();
        for (i, place) in (0..).zip(places) {
            cells.entry(cell(&place, edge)).or_default().push(i);
        }
        Self { edge, cells }
    }

    /// Numbers of all points in the 27 voxels around a place: all that are nearer than an edge.
    pub(super) fn near(&self, place: &Vector) -> impl Iterator<Item = usize> + '_ {
        let [x, y, z] = cell(place, self.edge);
        let steps =
            (-1..=1).flat_map(|i| (-1..=1).flat_map(move |j| (-1..=1).map(move |k| [i, j, k])));
        let cells = steps.filter_map(move |[i, j, k]| self.cells.get(&[x + i, y + j, z + k]));
        cells.flatten().map(|i| *i as usize)
    }
}

fn cell(place: &Vector, edge: f64) -> [i32; 3] {
    [0, 1, 2].map(|i| (place[i] / edge).floor() as i32)
}

/// Surfels of points with the directions towards their scanners. A point on an edge or on a wire,
/// and one whose scanner is not known, gives none.
pub(super) fn surfels(points: &[ThingPoint]) -> Vec<ThingSurfel> {
    let grids = RADII.map(|r| PlaceGrid::new(points.iter().map(|p| p.at), r));
    let one = |ThingPoint { at, towards, scans }: &ThingPoint| {
        let neighbours = |k: usize| {
            let mut moments = Moments::new(*at);
            let near = grids[k].near(at).map(|i| &points[i].at);
            near.filter(|p| (*p - at).norm() <= RADII[k]).for_each(|p| moments.add(p));
            moments
        };
        let tight = neighbours(0);
        let moments = if tight.n >= MIN_NEIGHBOURS { tight } else { neighbours(1) };
        let fit = (moments.n >= MIN_NEIGHBOURS).then(|| moments.plane()).flatten()?;
        let is_flat = fit.rms <= MAX_RMS && fit.spread[1] >= MIN_SPREAD;
        let normal = fit.plane.normal;
        let facing = normal.dot(towards);
        (is_flat && facing != 0.0).then(|| ThingSurfel {
            at: *at,
            normal: facing.signum() * normal,
            scans: *scans,
        })
    };
    smoothed(&points.iter().filter_map(one).collect::<Vec<_>>())
}

fn smoothed(all: &[ThingSurfel]) -> Vec<ThingSurfel> {
    let grid = PlaceGrid::new(all.iter().map(|s| s.at), SMOOTH.0);
    let one = |own: &ThingSurfel| {
        let near = grid.near(&own.at).map(|i| &all[i]);
        let alike = near.filter(|s| {
            s.normal.dot(&own.normal) >= SMOOTH.1 && (s.at - own.at).norm() <= SMOOTH.0
        });
        ThingSurfel { normal: alike.map(|s| s.normal).sum::<Vector>().normalize(), ..*own }
    };
    all.iter().map(one).collect()
}

/// Surfels that can be asked for the nearest one.
pub(super) struct SurfelIndex {
    pub(super) all: Vec<ThingSurfel>,
    grid: PlaceGrid,
}

impl SurfelIndex {
    /// `reach` is the largest distance that is asked for, metres.
    pub(super) fn new(all: Vec<ThingSurfel>, reach: f64) -> Self {
        let grid = PlaceGrid::new(all.iter().map(|s| s.at), reach);
        Self { all, grid }
    }

    /// The nearest surfel that is at most `reach` metres away and faces the same way as `like`,
    /// with a cosine of at least `cosine`.
    pub(super) fn nearest(
        &self,
        like: &ThingSurfel,
        reach: f64,
        cosine: f64,
    ) -> Option<&ThingSurfel> {
        let mut best = (reach * reach, None);
        for i in self.grid.near(&like.at) {
            let one = &self.all[i];
            let apart = (one.at - like.at).norm_squared();
            if apart < best.0 && one.normal.dot(&like.normal) >= cosine {
                best = (apart, Some(one));
            }
        }
        best.1
    }
}

/// At most `n` of some items, spread evenly over all and the same for each call.
pub(super) fn thinned<T: Copy>(all: &[T], n: usize) -> Vec<T> {
    if all.len() <= n {
        return all.to_vec();
    }
    // Steps of the golden ratio: neighbours in the list, which are neighbours in space, are spread.
    let step = 0.618_033_988_749_894_9;
    let mut taken: Vec<usize> =
        (0..n).map(|k| ((k as f64 * step).fract() * all.len() as f64) as usize).collect();
    taken.sort_unstable();
    taken.dedup();
    taken.into_iter().map(|i| all[i]).collect()
}
