//! Obstacles by the cubes that hold them, for queries of what is near a place.

use crate::obstacle::{Obstacle, distance};
use rustc_hash::FxHashMap;
use std::ops::Range;

/// Some obstacles, sorted by cubes. All coordinates are in the base frame, metres.
pub(crate) struct Grid {
    /// Edge of a cube, metres.
    edge: f32,
    /// Their indices and places, cube by cube.
    sorted: Vec<(u32, [f32; 3])>,
    cubes: FxHashMap<[i32; 3], Range<u32>>,
}

impl Grid {
    /// Those of `all` that count.
    pub(crate) fn of(edge: f32, all: &[Obstacle], counts: impl Fn(&Obstacle) -> bool) -> Self {
        let cube = |at: [f32; 3]| at.map(|v| (v / edge).floor() as i32);
        let own = (0..).zip(all).filter(|(_, o)| counts(o));
        let mut keyed: Vec<([i32; 3], u32)> = own.map(|(i, o)| (cube(o.at), i)).collect();
        keyed.sort_unstable();
        let mut cubes = FxHashMap::default();
        let mut from = 0;
        for own in keyed.chunk_by(|a, b| a.0 == b.0) {
            let to = from + own.len() as u32;
            cubes.insert(own[0].0, from..to);
            from = to;
        }
        let sorted = keyed.into_iter().map(|(_, i)| (i, all[i as usize].at)).collect();
        Self { edge, sorted, cubes }
    }

    /// How many there are.
    pub(crate) fn len(&self) -> usize {
        self.sorted.len()
    }

    /// Every `step`th of them.
    pub(crate) fn sampled(&self, step: usize) -> impl Iterator<Item = (u32, [f32; 3])> + '_ {
        self.sorted.iter().step_by(step).copied()
    }

    /// Indices and places of those in the cubes about a place, up to `n` cubes away along each
    /// axis.
    pub(crate) fn around(
        &self,
        at: [f32; 3],
        n: i32,
    ) -> impl Iterator<Item = (u32, [f32; 3])> + '_ {
        let [x, y, z] = at.map(|v| (v / self.edge).floor() as i32);
        let side = 2 * n + 1;
        let n_cubes = side * side * side;
        // The cube of the place first, since it mostly holds enough neighbours.
        (0..n_cubes).flat_map(move |i| {
            let i = (i + n_cubes / 2) % n_cubes;
            let by = [i % side - n, i / side % side - n, i / (side * side) - n];
            let range = self.cubes.get(&[x + by[0], y + by[1], z + by[2]]);
            let range = range.map_or(0..0, |own| own.start as usize..own.end as usize);
            self.sorted[range].iter().copied()
        })
    }

    /// Number of others than the obstacle with index `itself` within `within` metres of a place,
    /// which is at most the edge of a cube; counting stops at `most`.
    pub(crate) fn n_near(&self, itself: usize, at: [f32; 3], within: f32, most: usize) -> usize {
        let is_near = |(i, p): &(u32, [f32; 3])| *i as usize != itself && distance(*p, at) < within;
        self.around(at, 1).filter(is_near).take(most).count()
    }

    /// From a place to all within `reach` metres of it but the obstacle with index `itself`.
    pub(crate) fn offsets(
        &self,
        itself: usize,
        at: [f32; 3],
        reach: f32,
    ) -> impl Iterator<Item = (usize, nalgebra::Vector3<f32>)> + '_ {
        let n = (reach / self.edge).ceil() as i32;
        self.around(at, n)
            .filter(move |(i, _)| *i as usize != itself)
            .map(move |(i, p)| {
                (i as usize, nalgebra::Vector3::from(p) - nalgebra::Vector3::from(at))
            })
            .filter(move |(_, v)| v.norm() < reach)
    }
}
