//! Marks, in the voxel grid around a robot, the voxels that beams passed through as free, and those
//! that the bodies of robots fill as robot.
//!
//! What a robot hides is unknown and not free: a voxel is free only if a beam ended beyond it. A
//! beam without a return proves nothing.

use contract::{Fan, Region, Space, SpaceGrid, SpaceKind, View};
use geometry::{Aabb, Eye, Pose};
use robot::Model;

/// Half the diagonal of a cube of edge 1. A beam that ends this far beyond the centre of a voxel,
/// times the voxel's edge, has left the voxel.
const HALF_DIAGONAL: f64 = 0.866;
/// Distance that a beam must end beyond the voxel, metres: range noise and rounding.
const BEYOND: f64 = 0.01;
/// Number of voxels in one piece of parallel work.
const PIECE: usize = 1 << 14;

/// Tells which voxels of a region beams passed through.
pub struct PassedVoxels<'a> {
    region: &'a Region,
    eyes: Vec<Eye<'a>>,
    /// Edge of the queried voxels, metres.
    edge: f64,
    /// The voxels of half that edge that the robot's body fills; `None` without a robot.
    body: Option<Space>,
}

impl<'a> PassedVoxels<'a> {
    /// Prepares queries of the views of a region, for voxels with this edge in metres.
    #[must_use]
    pub fn new(region: &'a Region, views: &'a [View], edge: f64) -> Self {
        let eyes = views.iter().map(|view| Eye::new(&view.images)).collect();
        Self { region, eyes, edge, body: None }
    }

    /// The same around a robot that was scanned with its links at `world_from_links`. Beams need
    /// not reach those octants of a voxel that the robot fills or touches, since it hides them
    /// itself.
    #[must_use]
    pub fn about(self, model: &Model, world_from_links: &[Pose]) -> Self {
        let mut bounds = Aabb::EMPTY;
        for (link, pose) in model.links.iter().zip(world_from_links) {
            let corners = link.bounds.corners().map(geometry::Point::from);
            let corners = corners.iter().filter(|_| !link.bounds.is_empty());
            corners.for_each(|corner| bounds.add((pose * corner).coords.into()));
        }
        if bounds.is_empty() {
            return self;
        }
        let half = 0.5 * self.edge;
        let mut body = Space::unknown(SpaceGrid::over(&bounds.grown(2.0 * half), half));
        mark_body(&mut body, SpaceKind::Robot, model, world_from_links);
        Self { body: Some(body), ..self }
    }

    /// Whether the voxel with this centre (world frame, metres) is free: a beam ended beyond the
    /// whole voxel, or beams reached the centre of each of its eight octants. The second test
    /// serves voxels in front of a surface, where no beam goes on far enough. A voxel that a beam
    /// ended in holds a point, and its kind follows from that point. An octant that the robot
    /// itself fills or touches need not be reached, if another one is.
    #[must_use]
    pub fn is_free(&self, centre: [f64; 3]) -> bool {
        let beyond = (HALF_DIAGONAL * self.edge + BEYOND) as f32;
        let p: [f32; 3] = std::array::from_fn(|i| (centre[i] - self.region.origin[i]) as f32);
        let quarter_edge = 0.25 * self.edge as f32;
        let octant = |k: usize| {
            std::array::from_fn(|i| {
                if k >> i & 1 == 0 { p[i] - quarter_edge } else { p[i] + quarter_edge }
            })
        };
        if self.is_passed(p, 2.0 * quarter_edge, beyond) {
            return true;
        }
        let mut n_passed = 0;
        let is_known = |k: usize| {
            let is_passed = self.is_passed(octant(k), quarter_edge, 0.0);
            n_passed += usize::from(is_passed);
            is_passed || self.is_body(octant(k))
        };
        (0..8).all(is_known) && n_passed > 0
    }

    /// Whether the robot fills or touches the octant of a voxel with this centre, region
    /// frame, metres.
    fn is_body(&self, centre: [f32; 3]) -> bool {
        let Some(body) = &self.body else { return false };
        let grid = body.grid();
        let at: [f64; 3] = std::array::from_fn(|i| f64::from(centre[i]) + self.region.origin[i]);
        let is_filled = |k: usize| {
            let mut neighbour = at;
            if k < 6 {
                neighbour[k / 2] += if k.is_multiple_of(2) { grid.edge } else { -grid.edge };
            }
            grid.index(neighbour).is_some_and(|at| body.voxels()[at] == SpaceKind::Robot)
        };
        (0..7).any(is_filled)
    }

    /// Whether a beam within `footprint` of a place ended more than `beyond` behind it; region
    /// frame, metres.
    fn is_passed(&self, p: [f32; 3], footprint: f32, beyond: f32) -> bool {
        let is_passed = |eye: &Eye<'_>| {
            let look = eye.look(p, footprint);
            look.is_some_and(|l| l.far.is_finite() && l.far > l.range + beyond)
        };
        self.eyes.iter().any(is_passed)
    }
}

/// Marks each voxel as free that beams passed through.
pub fn mark_free(space: &mut Space, passed: &PassedVoxels<'_>, fan: &dyn Fan) {
    let grid = *space.grid();
    let pieces = space.voxels_mut().chunks_mut(PIECE).enumerate().collect();
    fan.fan(pieces, |(n, voxels): (usize, &mut [SpaceKind])| {
        for (i, voxel) in voxels.iter_mut().enumerate() {
            if passed.is_free(grid.middle(n * PIECE + i)) {
                *voxel = SpaceKind::Free;
            }
        }
    });
}

/// Marks the voxels inside the body of a robot, which its surface encloses, with a kind: the
/// robot's own or another robot's. `world_from_links` has the pose of each link.
pub fn mark_body(space: &mut Space, kind: SpaceKind, model: &Model, world_from_links: &[Pose]) {
    let grid = *space.grid();
    let mut body = Aabb::EMPTY;
    let mut surface = Vec::new();
    for (link, pose) in model.links.iter().zip(world_from_links) {
        for p in &link.cad.points {
            let p = pose * geometry::Point::from(p.map(f64::from));
            body.add(p.coords.into());
            surface.extend(grid.index(p.coords.into()));
        }
    }
    if surface.is_empty() {
        return;
    }
    surface.iter().for_each(|at| space.voxels_mut()[*at] = kind);
    for at in grid.enclosed(&body, &surface) {
        space.voxels_mut()[at] = kind;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::{MaskId, OneByOne, ScanId};
    use geometry::depth::Empty;
    use geometry::{DepthImage, Point};

    /// The view of a scanner at the origin that looks along x at a wall 4 m away, half of it behind
    /// a plate 2 m away.
    fn view() -> View {
        let turn = nalgebra::UnitQuaternion::from_axis_angle(
            &nalgebra::Vector3::y_axis(),
            -std::f64::consts::FRAC_PI_2,
        );
        let camera = Pose::from_parts(nalgebra::Translation3::identity(), turn);
        let mut image = DepthImage::new(camera, 0.5, 200.0);
        for i in -200..200 {
            for j in -200..200 {
                let (y, z) = (f64::from(i) * 0.0025, f64::from(j) * 0.0025);
                let x = if y > 0.0 { 2.0 } else { 4.0 };
                let p = camera * Point::new(x, y * x, z * x);
                image.splat(p.coords.map(|v| v as f32).into());
            }
        }
        image.finish(2, |_| Empty::Unknown);
        View {
            scan: ScanId(0),
            mask: MaskId(0),
            scanner: Some(Point::origin()),
            beam_step: 0.0025,
            is_camera: false,
            images: vec![image],
            points: Vec::new(),
        }
    }

    #[test]
    fn space_behind_an_object_is_unknown() {
        let bounds = Aabb { min: [0.5, -1.0, -0.5], max: [5.0, 1.0, 0.5] };
        let region = Region { origin: Point::origin(), bounds };
        let mut space = Space::unknown(SpaceGrid::over(&bounds, 0.1));
        let views = [view()];
        mark_free(&mut space, &PassedVoxels::new(&region, &views, 0.1), &OneByOne);
        let at = |space: &Space, p| space.voxels()[space.grid().index(p).expect("inside")];
        assert_eq!(at(&space, [3.0, -0.5, 0.0]), SpaceKind::Free);
        assert_eq!(at(&space, [1.5, 0.3, 0.0]), SpaceKind::Free);
        // Behind the plate, behind the wall, and beside the image.
        for p in [[3.0, 0.5, 0.0], [4.6, -0.5, 0.0], [0.7, 0.9, 0.0]] {
            assert_eq!(at(&space, p), SpaceKind::Unknown, "{p:?}");
        }
        // Space up to the wall is free, and space behind it is unknown.
        assert_eq!(at(&space, [3.95, -0.5, 0.0]), SpaceKind::Free);
        assert_eq!(at(&space, [4.05, -0.5, 0.0]), SpaceKind::Unknown);
        let wall = space.grid().index([4.0, -0.5, 0.0]).expect("inside");
        for kind in [SpaceKind::Robot, SpaceKind::Other, SpaceKind::Robot] {
            space.mark(wall, kind);
        }
        assert_eq!(space.voxels()[wall], SpaceKind::Other);
        space.mark(wall, SpaceKind::Fixed);
        space.mark(wall, SpaceKind::Other);
        assert_eq!(space.voxels()[wall], SpaceKind::Fixed);
    }

    #[test]
    fn what_only_the_robot_itself_hides_of_a_voxel_leaves_it_free() {
        let bounds = Aabb { min: [0.5, -1.0, -0.5], max: [5.0, 1.0, 0.5] };
        let (region, views) = (Region { origin: Point::origin(), bounds }, [view()]);
        // Before the wall, at the edge of what the plate hides: half of its eighths are seen.
        let at_edge = [3.95, 0.02, 0.0];
        let filled = |from: f64| {
            let mut body = Space::unknown(SpaceGrid::over(&bounds, 0.05));
            let grid = *body.grid();
            for (at, voxel) in body.voxels_mut().iter_mut().enumerate() {
                if grid.middle(at)[1] > from {
                    *voxel = SpaceKind::Robot;
                }
            }
            PassedVoxels { body: Some(body), ..PassedVoxels::new(&region, &views, 0.1) }
        };
        assert!(!PassedVoxels::new(&region, &views, 0.1).is_free(at_edge));
        assert!(filled(0.0).is_free(at_edge));
        assert!(!filled(0.2).is_free(at_edge), "the robot is not there");
        // Where no eighth was seen nothing is known.
        assert!(!filled(0.0).is_free([3.95, 0.5, 0.0]));
    }
}
