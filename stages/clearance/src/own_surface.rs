//! The moving links of a robot as scanned in; which places lie on their surfaces or in them out.

use crate::body::{SURFACE_REACH, is_near};
use crate::shape::{Gap, PartShape};
use geometry::{Aabb, Point, Pose};
use robot::Model;

/// The surfaces of the links that the joints of a robot move, where they were when it was scanned.
pub struct OwnSurface {
    /// Index, bounds (link frame, metres) and shape of each link.
    links: Vec<(usize, Aabb, PartShape)>,
    /// For each posture, the world in the frame of each link of the model.
    postures: Vec<Vec<Pose>>,
    /// Bounds of all of it, world frame, metres.
    bounds: Aabb,
}

impl OwnSurface {
    /// The surfaces in some postures, each given by the poses of all links in the world.
    #[must_use]
    pub fn new(model: &Model, postures: &[Vec<Pose>]) -> Self {
        let moves = model.moving();
        let shape = |link: usize| {
            let (mesh, bounds) = (&model.links[link].mesh, model.links[link].bounds);
            Some((link, bounds, PartShape::surface(mesh, &bounds, SURFACE_REACH)?))
        };
        let links: Vec<_> =
            (0..moves.len()).filter(|link| moves[*link]).filter_map(shape).collect();
        let mut bounds = Aabb::EMPTY;
        for poses in postures {
            for (link, own, _) in &links {
                own.corners()
                    .into_iter()
                    .for_each(|c| bounds.add((poses[*link] * Point::from(c)).into()));
            }
        }
        let inverse = |poses: &Vec<Pose>| poses.iter().map(Pose::inverse).collect();
        Self { links, postures: postures.iter().map(inverse).collect(), bounds }
    }

    /// Bounds of the links in all postures, world frame, metres; empty without a moving link.
    #[must_use]
    pub fn bounds(&self) -> &Aabb {
        &self.bounds
    }

    /// Whether a place (world frame, metres) lies on or in a link in one of the postures.
    #[must_use]
    pub fn contains(&self, world: [f64; 3]) -> bool {
        self.is_near(world, f64::from(SURFACE_REACH))
    }

    /// Whether a place lies within a distance of a link, or in it, in one of the postures (world
    /// frame, metres).
    #[must_use]
    pub fn is_near(&self, world: [f64; 3], within: f64) -> bool {
        let reach = within as f32;
        self.bounds.grown(within).contains(world)
            && self.postures.iter().any(|link_from_world| {
                self.links.iter().any(|(link, bounds, shape)| {
                    let p = link_from_world[*link] * Point::from(world);
                    let p = p.coords.map(|v| v as f32).into();
                    is_near(bounds, p, reach) && shape.gap(p, reach) != Gap::Far
                })
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Vector;
    use robot::Settings;

    #[test]
    fn places_on_moving_links_are_the_robots_own_and_others_are_not() {
        let dir = tempfile::tempdir().expect("a folder");
        let link = |name: &str, z: f64| {
            format!(
                "<link name='{name}'><visual><origin xyz='0 0 {z}'/>\
                <geometry><box size='0.2 0.2 0.4'/></geometry></visual></link>"
            )
        };
        let urdf = format!(
            "<robot name='post'>{}{}<joint name='turn' type='revolute'>\
            <parent link='foot'/><child link='arm'/><origin xyz='0 0 0.4'/><axis xyz='0 0 1'/>\
            <limit lower='-3' upper='3' effort='1' velocity='1'/></joint></robot>",
            link("foot", 0.2),
            link("arm", 0.2)
        );
        let path = dir.path().join("post.urdf");
        std::fs::write(&path, urdf).expect("is written");
        let (model, _) = Model::load_urdf(&path, "post", &Settings::default()).expect("loads");
        // In map coordinates, and turned by an eighth in a second posture.
        let by = Vector::new(4e5, 5e6, 100.0);
        let placed = |turn: f64| -> Vec<Pose> {
            let world_from_base = Pose::translation(by.x, by.y, by.z);
            model.poses(&[turn]).into_iter().map(|p| world_from_base * p).collect()
        };
        let eighth = std::f64::consts::FRAC_PI_4;
        let one = OwnSurface::new(&model, &[placed(0.0)]);
        let both = OwnSurface::new(&model, &[placed(0.0), placed(eighth)]);
        for (at, in_one, in_both) in [
            ([0.105, 0.0, 0.6], true, true),
            ([0.05, 0.0, 0.6], true, true),
            ([0.0, 0.0, 0.807], true, true),
            ([0.112, 0.0, 0.6], false, true),
            ([0.152, 0.0, 0.6], false, false),
            ([0.0, 0.0, 0.812], false, false),
            // The foot stands still: what is beside it is in nobody's way.
            ([0.105, 0.0, 0.2], false, false),
        ] {
            let world = (Vector::from(at) + by).into();
            assert_eq!([one.contains(world), both.contains(world)], [in_one, in_both], "{at:?}");
        }
        let beside = (Vector::from([0.15, 0.0, 0.6]) + by).into();
        assert_eq!([0.04, 0.06].map(|within| one.is_near(beside, within)), [false, true]);
    }
}
