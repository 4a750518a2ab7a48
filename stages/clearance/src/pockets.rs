//! Removes unseen pockets in which nothing can stand.
//!
//! Robots, posts and wires cast shadows, and where those of all scanners meet, small or thin parts
//! of space stay unseen. If only free space and the robot surround such a pocket, nothing holds
//! what might stand in it: it would float, or hang on the robot and move with it.

use crate::obstacle::{Obstacle, ObstacleKind, distance};
use crate::obstacles::{Obstacles, Replaced};
use geometry::Point;
use rustc_hash::{FxHashMap, FxHashSet};

/// Largest pocket of any shape, in voxels of known space: twice the edge along two axes.
const MAX_VOXELS: f64 = 4.0;
/// Largest pocket that is nowhere two voxels thick in all directions, in voxels: the sheet that two
/// shadows have in common, 16 litres with voxels of 5 cm.
const MAX_THIN_VOXELS: f64 = 128.0;
/// Unseen voxels or their parts are one body where they share a face, an edge or a corner: their
/// centres are no farther apart than the radii of their balls together, but for rounding.
const BESIDE: f32 = 1.03;
/// Edge of the cubes by which neighbours are found, in edges of a voxel: no less than the reach of
/// [`Neighbours::is_touched`].
const CUBE: f32 = 1.4;

/// Unseen voxels or their parts, and all else, by cubes.
struct Neighbours<'a> {
    all: &'a [Obstacle],
    /// Edge of a voxel of known space, metres.
    edge: f32,
    unseen: FxHashMap<[i32; 3], Vec<u32>>,
    others: FxHashMap<[i32; 3], Vec<u32>>,
}

/// Removes the pockets. It is to be called once what the robot itself fills is removed, and voxels
/// beside it are divided into parts.
pub(crate) fn remove_pockets(around: &mut Obstacles) {
    let Some((edge, part_radius)) = around.split.sizes() else { return };
    let neighbours = Neighbours::of(&around.all, edge as f32);
    let part = (around.split.step() / edge).powi(3);
    let volume = |o: &Obstacle| if o.radius > 1.5 * part_radius { 1.0 } else { part };
    let world = |o: &Obstacle| -> [f64; 3] {
        (around.known.world_from_base * Point::from(o.at.map(f64::from))).coords.into()
    };
    let inner = around.known.bounds.grown(-2.0 * edge);
    let is_empty = |body: &[usize]| {
        let body = || body.iter().map(|i| &around.all[*i]);
        let n_voxels: f64 = body().map(volume).sum();
        let voxel = |o: &Obstacle| world(o).map(|v| (v / edge).floor() as i64);
        n_voxels <= MAX_THIN_VOXELS
            && body().all(|o| inner.contains(world(o)) && !neighbours.is_touched(o))
            && (n_voxels <= MAX_VOXELS || is_thin(&body().map(voxel).collect()))
    };
    let mut is_asked = vec![false; around.all.len()];
    let mut is_pocket = vec![false; around.all.len()];
    for first in 0..around.all.len() {
        if is_asked[first] || around.all[first].what != ObstacleKind::Unseen {
            continue;
        }
        let body = neighbours.body_of(first, &mut is_asked);
        if is_empty(&body) {
            body.iter().for_each(|i| is_pocket[*i] = true);
        }
    }
    around.replace(|at, _| match is_pocket[at] {
        true => Replaced::By(Vec::new()),
        false => Replaced::Kept,
    });
}

/// Whether no cube of two voxels an edge lies in a body; its voxels are given by their positions
/// along each axis.
fn is_thin(voxels: &FxHashSet<[i64; 3]>) -> bool {
    let corner = |[x, y, z]: [i64; 3], k: i64| [x + k % 2, y + k / 2 % 2, z + k / 4];
    !voxels.iter().any(|v| (1..8).all(|k| voxels.contains(&corner(*v, k))))
}

impl<'a> Neighbours<'a> {
    fn of(all: &'a [Obstacle], edge: f32) -> Self {
        let (unseen, others) = (FxHashMap::default(), FxHashMap::default());
        let mut out = Self { all, edge, unseen, others };
        for (i, o) in all.iter().enumerate() {
            let cube = out.cube(o.at);
            let is_unseen = o.what == ObstacleKind::Unseen;
            let cubes = if is_unseen { &mut out.unseen } else { &mut out.others };
            cubes.entry(cube).or_default().push(i as u32);
        }
        out
    }

    fn cube(&self, at: [f32; 3]) -> [i32; 3] {
        at.map(|v| (v / (CUBE * self.edge)).floor() as i32)
    }

    /// All of `cubes` in the cube of a place and in those beside it.
    fn near<'c>(
        &self,
        cubes: &'c FxHashMap<[i32; 3], Vec<u32>>,
        at: [f32; 3],
    ) -> impl Iterator<Item = usize> + 'c {
        let [x, y, z] = self.cube(at);
        (0..27).flat_map(move |i: i32| {
            let cube = [x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1];
            cubes.get(&cube).into_iter().flatten().map(|i| *i as usize)
        })
    }

    /// Whether something seen is so near that it may go on in this unseen voxel or part of one.
    fn is_touched(&self, here: &Obstacle) -> bool {
        let reach = self.edge.max(here.radius + 0.5 * self.edge);
        self.near(&self.others, here.at).any(|i| distance(self.all[i].at, here.at) < reach)
    }

    /// The unseen voxels and parts of voxels that hang together with one.
    fn body_of(&self, first: usize, is_asked: &mut [bool]) -> Vec<usize> {
        let (mut body, mut at) = (vec![first], 0);
        is_asked[first] = true;
        while let Some(here) = body.get(at).map(|i| self.all[*i]) {
            at += 1;
            for i in self.near(&self.unseen, here.at) {
                let other = &self.all[i];
                let reach = BESIDE * (here.radius + other.radius);
                if !is_asked[i] && distance(other.at, here.at) <= reach {
                    is_asked[i] = true;
                    body.push(i);
                }
            }
        }
        body
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cells::Cells;
    use crate::obstacles::KnownBounds;
    use contract::{Space, SpaceGrid, SpaceKind};
    use geometry::{Aabb, Pose};

    /// Obstacles of free space with points and a block of unseen voxels with so many along each
    /// axis; the number of unseen parts of voxels that are left, where all voxels were divided, or
    /// of voxels, where none was.
    fn n_left(size: [usize; 3], points: &[[f64; 3]], is_divided: bool) -> usize {
        let bounds = Aabb { min: [-1.0; 3], max: [1.0; 3] };
        let mut space = Space::unknown(SpaceGrid::over(&bounds, 0.05));
        space.voxels_mut().fill(SpaceKind::Free);
        let [nx, ny, nz] = size;
        for k in 0..nx * ny * nz {
            let cell = [k % nx, k / nx % ny, k / (nx * ny)];
            let at = space.grid().index(cell.map(|k| 0.025 + 0.05 * k as f64)).expect("inside");
            space.voxels_mut()[at] = SpaceKind::Unknown;
        }
        let mut cells = Cells::within(1.5, &Default::default());
        points.iter().for_each(|p| cells.add(*p, ObstacleKind::Floor, false, 0));
        let known = KnownBounds { world_from_base: Pose::identity(), bounds };
        let mut around = Obstacles::new(&cells, &[], Some(&space), known, &contract::OneByOne);
        let split = around.split.clone();
        around.replace(|_, o| {
            let parts = split.parts(o).filter(|_| is_divided);
            parts.map_or(Replaced::Kept, |parts| Replaced::By(parts.collect()))
        });
        remove_pockets(&mut around);
        around.all.iter().filter(|o| o.what == ObstacleKind::Unseen).count()
    }

    #[test]
    fn a_hole_in_free_space_holds_nothing() {
        for is_divided in [false, true] {
            let each = if is_divided { 64 } else { 1 };
            let left = |size, points: &[_]| n_left(size, points, is_divided);
            assert_eq!([left([1, 1, 1], &[]), left([4, 1, 1], &[])], [0; 2]);
            // The sheet of a shadow, and a block in which a box may float.
            assert_eq!(left([12, 10, 1], &[]), 0);
            assert_eq!(left([3, 2, 2], &[]), 12 * each);
            // A larger sheet may be seen edge-on by all scanners.
            assert_eq!(left([13, 10, 1], &[]), 130 * each);
            // What is seen beside a pocket may go on in it; at a distance it does not.
            assert_eq!(left([1, 1, 1], &[[0.025, 0.07, 0.025]]), each);
            assert_eq!(left([12, 10, 1], &[[0.025, 0.475, 0.06]]), 120 * each);
            assert_eq!(left([1, 1, 1], &[[0.025, 0.15, 0.025]]), 0);
        }
    }
}
