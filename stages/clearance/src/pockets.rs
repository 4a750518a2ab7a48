//! Removes unseen pockets beside a robot in which nothing can stand.
//!
//! Beams leave small holes where the robot itself hides a place from all scanners. If only free
//! space and the robot surround such a hole, nothing holds what might stand in it: it would float,
//! or hang on the robot and move with it.

use crate::obstacle::{Obstacle, ObstacleKind, distance};
use crate::obstacles::{Obstacles, Replaced};
use geometry::Point;
use rustc_hash::FxHashMap;

/// Largest pocket, in voxels of known space: twice the edge along two axes.
const MAX_VOXELS: f64 = 4.0;
/// Largest distance between neighbouring parts of a pocket, in radii of a part: they share a face,
/// an edge or a corner.
const BESIDE: f32 = 2.05;

/// Edge of the cubes by which neighbours are found, in edges of a voxel: no less than the distance
/// of a voxel and a part beside it.
const CUBE: f32 = 1.3;

/// Unseen parts of voxels and all else, by cubes.
struct Neighbours<'a> {
    all: &'a [Obstacle],
    /// Edge of a voxel of known space, metres.
    edge: f32,
    cubes: FxHashMap<[i32; 3], Vec<u32>>,
}

/// Removes the pockets. It is to be called once what the robot itself fills is removed, and voxels
/// beside it are divided into parts.
pub(crate) fn remove_pockets(around: &mut Obstacles) {
    let Some((edge, part_radius)) = around.split.sizes() else { return };
    let neighbours = Neighbours::of(&around.all, edge as f32);
    let most = (MAX_VOXELS * (edge / around.split.step()).powi(3)).round() as usize;
    let is_part = |o: &Obstacle| o.what == ObstacleKind::Unseen && o.radius <= 1.5 * part_radius;
    let is_inside = |o: &Obstacle| {
        let world = around.known.world_from_base * Point::from(o.at.map(f64::from));
        around.known.bounds.grown(-2.0 * edge).contains(world.coords.into())
    };
    let mut is_asked = vec![false; around.all.len()];
    let mut is_pocket = vec![false; around.all.len()];
    for first in 0..around.all.len() {
        if is_asked[first] || !is_part(&around.all[first]) {
            continue;
        }
        let (pocket, touches) = neighbours.body_of(first, &is_part, &mut is_asked);
        let is_small = pocket.len() <= most;
        if is_small && !touches && pocket.iter().all(|i| is_inside(&around.all[*i])) {
            pocket.iter().for_each(|i| is_pocket[*i] = true);
        }
    }
    around.replace(|at, _| match is_pocket[at] {
        true => Replaced::By(Vec::new()),
        false => Replaced::Kept,
    });
}

impl<'a> Neighbours<'a> {
    fn of(all: &'a [Obstacle], edge: f32) -> Self {
        let mut out = Self { all, edge, cubes: FxHashMap::default() };
        for (i, o) in all.iter().enumerate() {
            out.cubes.entry(out.cube(o.at)).or_default().push(i as u32);
        }
        out
    }

    fn cube(&self, at: [f32; 3]) -> [i32; 3] {
        at.map(|v| (v / (CUBE * self.edge)).floor() as i32)
    }

    /// All obstacles in the cube of a place and in those beside it.
    fn near(&self, at: [f32; 3]) -> impl Iterator<Item = usize> + '_ {
        let [x, y, z] = self.cube(at);
        (0..27).flat_map(move |i: i32| {
            let cube = [x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1];
            self.cubes.get(&cube).into_iter().flatten().map(|i| *i as usize)
        })
    }

    /// The parts that hang together with one, and whether something else is nearer to any of them
    /// than the edge of a voxel: an obstacle, or unseen space that is not beside the robot.
    fn body_of(
        &self,
        first: usize,
        is_part: &impl Fn(&Obstacle) -> bool,
        is_asked: &mut [bool],
    ) -> (Vec<usize>, bool) {
        let (mut body, mut at, mut touches) = (vec![first], 0, false);
        is_asked[first] = true;
        while let Some(here) = body.get(at).map(|i| self.all[*i]) {
            at += 1;
            for i in self.near(here.at) {
                let other = &self.all[i];
                let gap = distance(other.at, here.at);
                if !is_part(other) {
                    touches |= gap < self.edge.max(1.05 * (here.radius + other.radius));
                } else if !is_asked[i] && gap <= BESIDE * here.radius {
                    is_asked[i] = true;
                    body.push(i);
                }
            }
        }
        (body, touches)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::obstacles::{Cells, KnownBounds};
    use contract::{Space, SpaceGrid, SpaceKind};
    use geometry::{Aabb, Pose};

    /// Obstacles of free space with unseen voxels in a row and points, after the voxels were
    /// divided; the number of unseen parts that are left.
    fn n_left(n_voxels: usize, points: &[[f64; 3]]) -> usize {
        let bounds = Aabb { min: [-1.0; 3], max: [1.0; 3] };
        let mut space = Space::unknown(SpaceGrid::over(&bounds, 0.05));
        space.voxels_mut().fill(SpaceKind::Free);
        for k in 0..n_voxels {
            let at = space.grid().index([0.025 + 0.05 * k as f64, 0.025, 0.025]).expect("inside");
            space.voxels_mut()[at] = SpaceKind::Unknown;
        }
        let mut cells = Cells::within(1.5, &Default::default());
        points.iter().for_each(|p| cells.add(*p, ObstacleKind::Floor, false, 0));
        let known = KnownBounds { world_from_base: Pose::identity(), bounds };
        let mut around = Obstacles::new(&cells, &[], Some(&space), known);
        let split = around.split.clone();
        around.replace(|_, o| {
            split.parts(o).map_or(Replaced::Kept, |parts| Replaced::By(parts.collect()))
        });
        remove_pockets(&mut around);
        around.all.iter().filter(|o| o.what == ObstacleKind::Unseen).count()
    }

    #[test]
    fn a_hole_in_free_space_holds_nothing() {
        assert_eq!([n_left(1, &[]), n_left(4, &[])], [0; 2]);
        // A larger one may hide a thing that stands beside what is seen.
        assert_eq!(n_left(5, &[]), 5 * 64);
        // What is seen beside it may go on in it; at a distance it does not.
        assert_eq!(n_left(1, &[[0.025, 0.07, 0.025]]), 64);
        assert_eq!(n_left(1, &[[0.025, 0.15, 0.025]]), 0);
    }
}
