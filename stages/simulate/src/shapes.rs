//! The triangles of each body of a scene with the link that moves it, and visibility between
//! places: the truth against which checks of robot paths are judged.

use crate::beams::Beams;
use crate::scene::Scene;
use crate::world::{BodySurface, SceneTriangles};
use contract::{PointKind, Result};
use geometry::Point;
use robot::Model;

/// Distance before the end of a beam within which a place counts as its end, metres: the rounding
/// of single precision in a hall.
const AT: f64 = 1e-3;

/// A body of a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct BodyShape {
    /// Kind and name of the object that it belongs to.
    pub name: String,
    /// Index of the robot that it is part of or attached to.
    pub robot: Option<usize>,
    /// Index of the link with which it moves rigidly; `None` for hoses, which bend.
    pub link: Option<usize>,
    /// Whether it belongs to the robot's model, and not to what the robot carries.
    pub is_of_model: bool,
    /// Triangles in the world without the scene's origin, metres.
    pub triangles: Vec<[[f32; 3]; 3]>,
}

/// All bodies of a scene.
pub struct Shapes {
    /// The bodies that have triangles.
    pub all: Vec<BodyShape>,
    beams: Beams,
}

impl Shapes {
    /// The bodies of a scene with its robots in their first postures; `models` must include the
    /// models of these robots.
    ///
    /// # Errors
    /// `BadInput` if the scene names a model, link or joint that does not exist, or has a number
    /// out of range.
    pub fn of(scene: &Scene, models: &[Model]) -> Result<Self> {
        crate::check::check(scene)?;
        let world = SceneTriangles::new(scene, models)?;
        let index = |i: i16| usize::try_from(i).ok();
        let shape = |surface: &BodySurface| BodyShape {
            name: world.objects.get(usize::from(surface.object)).cloned().unwrap_or_default(),
            robot: index(surface.label.robot),
            link: match surface.label.kind {
                // Effectors in the model are links, too.
                PointKind::Link | PointKind::Attachment if surface.label.link >= 0 => {
                    index(surface.label.link)
                }
                _ => index(surface.holder),
            },
            is_of_model: surface.label.robot >= 0 && surface.label.link >= 0,
            triangles: Vec::new(),
        };
        let mut all: Vec<BodyShape> = world.surfaces.iter().map(shape).collect();
        for (triangle, surface) in world.triangles.iter().zip(&world.surface_of) {
            all[*surface as usize].triangles.push(triangle.map(|corner| corner.to_array()));
        }
        all.retain(|shape| !shape.triangles.is_empty());
        Ok(Self { all, beams: Beams::new(&world.triangles, &world.surface_of) })
    }

    /// Whether no body lies between two places (world without the scene's origin, metres).
    #[must_use]
    pub fn sees(&self, from: &Point, to: &Point) -> bool {
        let way = to - from;
        let length = way.norm();
        let Some(along) = way.try_normalize(AT) else { return true };
        self.beams.cast(&from.coords, &along, (length - AT).max(0.0)).is_none()
    }

    /// Whether a beam from a place through another one hits something within `within` metres of its
    /// origin.
    #[must_use]
    pub fn ends(&self, from: &Point, through: &Point, within: f64) -> bool {
        let along = (through - from).try_normalize(AT);
        along.is_some_and(|along| self.beams.cast(&from.coords, &along, within).is_some())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Anchor, Cuboid, Hose};

    #[test]
    fn a_box_hides_what_is_behind_it() {
        let cuboid = Cuboid {
            name: "crate".into(),
            xyz: [2.0, 0.0, 0.0],
            size: [0.5; 3],
            rpy_deg: [0.0; 3],
            reflectance: 0.5,
        };
        let anchor = |x: f64| Anchor { robot: None, link: None, xyz: [x, 5.0, 0.0] };
        let wire = Hose {
            name: "wire".into(),
            anchors: vec![anchor(0.0), anchor(1.0)],
            radius: 0.002,
            sag: 0.0,
        };
        let scene = Scene { boxes: vec![cuboid], hoses: vec![wire], ..Scene::default() };
        let shapes = Shapes::of(&scene, &[]).expect("a scene");
        let at = |x: f64, y: f64| Point::new(x, y, 0.0);
        assert!(shapes.sees(&at(0.0, 0.0), &at(1.74, 0.0)));
        assert!(!shapes.sees(&at(0.0, 0.0), &at(3.0, 0.0)));
        assert!(shapes.sees(&at(0.0, 1.0), &at(3.0, 1.0)));
        assert!(shapes.ends(&at(0.0, 0.0), &at(1.0, 0.0), 10.0));
        assert!(!shapes.ends(&at(0.0, 1.0), &at(1.0, 1.0), 10.0));
        let names: Vec<&str> = shapes.all.iter().map(|s| &*s.name).collect();
        assert_eq!(names, ["box crate", "line wire"]);
        assert!(shapes.all.iter().all(|s| s.robot.is_none() && s.link.is_none()));
    }
}
