//! What the scans saw of the space around a robot, and its posture, in; voxels that are seen free
//! and that the robot itself fills out.
//!
//! What a robot hides is unknown, not free: a voxel is free only where a beam went on beyond it. A
//! beam that did not come back proves nothing.

use contract::{Fan, Region, Space, SpaceKind, View};
use geometry::{Aabb, Eye, Pose};
use robot::Model;

/// Half the diagonal of a cube of edge 1: a beam that ends this far beyond a voxel's middle has
/// left it.
const HALF_DIAGONAL: f64 = 0.866;
/// Range noise and rounding that a beam must go beyond that, metres.
const BEYOND: f64 = 0.01;
/// Voxels that are looked at by one thread.
const PIECE: usize = 1 << 14;

/// What beams went through.
pub struct Passed<'a> {
    region: &'a Region,
    eyes: Vec<Eye<'a>>,
    /// Edge of the voxels that are asked about, metres.
    edge: f64,
}

impl<'a> Passed<'a> {
    /// Of views of a region, for voxels of this edge.
    #[must_use]
    pub fn new(region: &'a Region, views: &'a [View], edge: f64) -> Self {
        Self { region, eyes: views.iter().map(|view| Eye::new(&view.images)).collect(), edge }
    }

    /// Whether a beam went on beyond the voxel with this middle (world, metres), or beams got to
    /// the middle of each of its eighths: in a voxel beside a surface none goes on, and where
    /// one ends in it there is a point, which makes of it what that is.
    #[must_use]
    pub fn is_free(&self, middle: [f64; 3]) -> bool {
        let beyond = (HALF_DIAGONAL * self.edge + BEYOND) as f32;
        let p: [f32; 3] = std::array::from_fn(|i| (middle[i] - self.region.origin[i]) as f32);
        let quarter = 0.25 * self.edge as f32;
        let eighth = |k: usize| {
            std::array::from_fn(|i| if k >> i & 1 == 0 { p[i] - quarter } else { p[i] + quarter })
        };
        self.is_passed(p, 2.0 * quarter, beyond)
            || (0..8).all(|k| self.is_passed(eighth(k), quarter, 0.0))
    }

    /// Whether a beam in a cell about a place of the region went on so far beyond it, metres.
    fn is_passed(&self, p: [f32; 3], footprint: f32, beyond: f32) -> bool {
        let is_passed = |eye: &Eye<'_>| {
            let look = eye.look(p, footprint);
            look.is_some_and(|l| l.far.is_finite() && l.far > l.range + beyond)
        };
        self.eyes.iter().any(is_passed)
    }
}

/// Frees every voxel that a beam of the views (of `region`) went through.
pub fn see(space: &mut Space, region: &Region, views: &[View], fan: &dyn Fan) {
    let grid = *space.grid();
    let passed = Passed::new(region, views, grid.edge);
    let pieces = space.voxels_mut().chunks_mut(PIECE).enumerate().collect();
    fan.fan(pieces, |(n, voxels): (usize, &mut [SpaceKind])| {
        for (i, voxel) in voxels.iter_mut().enumerate() {
            if passed.is_free(grid.middle(n * PIECE + i)) {
                *voxel = SpaceKind::Free;
            }
        }
    });
}

/// Fills the body of a robot that stands with its links at `world_from_links`, what its surface
/// encloses, with a kind: its own or another's.
pub fn stand(space: &mut Space, kind: SpaceKind, model: &Model, world_from_links: &[Pose]) {
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
    use contract::{MaskId, OneByOne, ScanId, SpaceGrid};
    use geometry::depth::Empty;
    use geometry::{DepthImage, Point};

    /// A scanner at the origin looks along x at a wall 4 m away, half of it behind a plate 2 m
    /// away.
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
    fn what_a_thing_hides_is_unknown() {
        let bounds = Aabb { min: [0.5, -1.0, -0.5], max: [5.0, 1.0, 0.5] };
        let region = Region { origin: Point::origin(), bounds };
        let mut space = Space::unknown(SpaceGrid::over(&bounds, 0.1));
        see(&mut space, &region, &[view()], &OneByOne);
        let at = |space: &Space, p| space.voxels()[space.grid().index(p).expect("inside")];
        assert_eq!(at(&space, [3.0, -0.5, 0.0]), SpaceKind::Free);
        assert_eq!(at(&space, [1.5, 0.3, 0.0]), SpaceKind::Free);
        // Behind the plate, behind the wall, and beside the image.
        for p in [[3.0, 0.5, 0.0], [4.6, -0.5, 0.0], [0.7, 0.9, 0.0]] {
            assert_eq!(at(&space, p), SpaceKind::Unknown, "{p:?}");
        }
        // Up to the wall space is seen, and no farther.
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
}
