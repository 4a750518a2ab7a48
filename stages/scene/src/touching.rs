//! What stands still and meets a robot as it was found: voxels that hold a tool's contact, points
//! that may be its own, or what is in the hollow of a link whose hull collides for it. Simulators
//! that are given such a start throw the robot away, planners refuse it.

use crate::link_pairs::hulls;
use crate::plant_scene::{FixedBox, PlantRobot};
use geometry::{Aabb, Pose, Vector};
use glamx::{Pose3, Rot3, Vec3};
use parry3d::query::intersection_test;
use parry3d::shape::{Cuboid, SharedShape};

/// The hulls of all links of robots as found.
pub struct FoundHulls {
    parts: Vec<HullPart>,
}

struct HullPart {
    robot: usize,
    link: usize,
    shape: SharedShape,
    world_from_link: Pose,
    /// Bounds in the world, metres.
    bounds: Aabb,
}

impl FoundHulls {
    /// Those of robots.
    #[must_use]
    pub fn of(robots: &[PlantRobot]) -> Self {
        let mut parts = Vec::new();
        for (at, robot) in robots.iter().enumerate() {
            for (link, world_from_link) in robot.world_from_links().into_iter().enumerate() {
                for (shape, vertices) in hulls(robot, link) {
                    let in_world = vertices.iter().map(|v| {
                        let p = world_from_link * geometry::Point::from(v.map(f64::from));
                        [p.x, p.y, p.z]
                    });
                    let bounds = Aabb::of(in_world);
                    parts.push(HullPart { robot: at, link, shape, world_from_link, bounds });
                }
            }
        }
        Self { parts }
    }

    /// Robots and links that a box meets, by their numbers, ascending.
    #[must_use]
    pub fn met_by(&self, own: &FixedBox) -> Vec<[usize; 2]> {
        let mut out = Vec::new();
        for part in &self.parts {
            let is_near = (0..3).all(|i| {
                let half = own.size[i] / 2.0;
                part.bounds.min[i] <= own.center[i] + half
                    && part.bounds.max[i] >= own.center[i] - half
            });
            let key = [part.robot, part.link];
            if is_near && out.last() != Some(&key) && part.meets(own) {
                out.push(key);
            }
        }
        out
    }
}

impl HullPart {
    fn meets(&self, own: &FixedBox) -> bool {
        // About the box, since a plant's coordinates do not fit into single precision.
        let box_from_link = Pose::from(-Vector::from(own.center)) * self.world_from_link;
        let p = box_from_link.translation.vector.cast::<f32>();
        let q = box_from_link.rotation.coords.cast::<f32>();
        let pose = Pose3::from_parts(Vec3::new(p.x, p.y, p.z), Rot3::from_xyzw(q.x, q.y, q.z, q.w));
        let half = Vec3::from_array(own.size.map(|edge| (edge / 2.0) as f32));
        let found = intersection_test(&pose, &*self.shape, &Pose3::IDENTITY, &Cuboid::new(half));
        // What cannot be compared does not count as met.
        found.is_ok_and(|found| found.intersecting)
    }
}
