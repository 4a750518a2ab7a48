//! Places on the front of a cube in; out comes what an adjustment of a robot of two cubes starts from where a scanner measured
//! them: for tests.

use contract::{MaskId, OneByOne, Region, ScanId, View};
use geometry::{Aabb, Point, Pose};

use crate::adjust::State;
use crate::beam::Hypothesis;
use crate::refine::Refine;
use crate::{Prepared, Scene, Settings};

/// A cube of 20 cm about the origin, and another link 4 mm within it.
fn cubes() -> robot::Model {
    let body = |name: &str, size: f64| {
        format!(
            "<link name='{name}'><visual><geometry><box size='{size} {size} {size}'/></geometry></visual></link>"
        )
    };
    let joint = "<joint name='a' type='revolute'><parent link='outer'/><child link='inner'/><axis xyz='0 0 1'/>\
                 <limit lower='-3' upper='3' effort='1' velocity='1'/></joint>";
    let urdf = format!(
        "<robot name='cubes'>{}{}{joint}</robot>",
        body("outer", 0.2),
        body("inner", 0.192)
    );
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("cubes.urdf");
    std::fs::write(&path, urdf).expect("is written");
    robot::Model::load_urdf(&path, "cubes", &robot::Settings::default()).expect("loads").0
}

/// The cubes, and a scanner 3 m before the front (x = 0.1) that measured these places of it (y, z).
pub(crate) fn before_front(places: &[[f64; 2]], look: impl Fn(&Refine<'_>, &State)) {
    seen(places.iter().map(|[y, z]| (*y, *z, 0.0)), look);
}

/// The same with ranges off by so much, metres.
pub(crate) fn seen(
    places: impl Iterator<Item = (f64, f64, f64)>,
    look: impl Fn(&Refine<'_>, &State),
) {
    let model = cubes();
    let prepared = Prepared::new(0, &model, &OneByOne);
    prepared.make_triangles(&OneByOne);
    let scanner = Point::new(3.0, 0.2, 0.4);
    let points = places.map(|(y, z, off)| {
        let on_it = Point::new(0.1, y, z);
        let p = on_it + (on_it - scanner).normalize() * off;
        p.coords.map(|v| v as f32).into()
    });
    let view = View {
        scan: ScanId(0),
        mask: MaskId(0),
        scanner: Some(scanner),
        beam_step: 0.002,
        is_camera: false,
        images: Vec::new(),
        points: points.collect(),
    };
    let region = Region { origin: Point::origin(), bounds: Aabb::EMPTY };
    let (views, settings) = ([view], Settings::default());
    let scene = Scene::new(&region, &views, &[], &settings, &OneByOne);
    let refine = Refine { prepared: &prepared, scene: &scene, settings: &settings, prior: None };
    let hypothesis =
        Hypothesis { local_from_base: Pose::identity(), posture: vec![0.0], score: 0.0 };
    look(&refine, &State::at(&hypothesis, &scene));
}
