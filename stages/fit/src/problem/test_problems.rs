//! Problems for tests: a robot made of a few boxes, and a scanner that measured parts of its front.

use contract::{MaskId, OneByOne, Region, ScanId, View};
use geometry::{Aabb, Point, Pose};

use super::adjust_state::AdjustState;
use super::context::Problem;
use crate::state::Hypothesis;
use crate::{MeasuredScene, Prepared, Settings};

/// A chain of boxes about their joints: name, kind of the joint to the link before, and size, place
/// and axis of that joint.
fn boxes(links: &[(&str, &str, [[f64; 3]; 3])]) -> robot::Model {
    let words = |v: &[f64; 3]| v.map(|v| v.to_string()).join(" ");
    let mut urdf = String::from("<robot name='boxes'>");
    for (k, (name, kind, [size, at, axis])) in links.iter().enumerate() {
        let size = words(size);
        urdf += &format!(
            "<link name='{name}'><visual><geometry><box size='{size}'/></geometry></visual></link>"
        );
        if let Some((parent, ..)) = k.checked_sub(1).map(|k| &links[k]) {
            let (at, axis) = (words(at), words(axis));
            urdf += &format!(
                "<joint name='to_{name}' type='{kind}'><origin xyz='{at}'/><parent link='{parent}'/><child link='{name}'/>\
                 <axis xyz='{axis}'/><limit lower='-3' upper='3' effort='1' velocity='1'/></joint>"
            );
        }
    }
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("boxes.urdf");
    std::fs::write(&path, urdf + "</robot>").expect("is written");
    robot::Model::load_urdf(&path, "boxes", &robot::Settings::default()).expect("loads").0
}

const TURNS: &str = "revolute";

/// A cube of 20 cm about the origin, and another link 4 mm within it.
fn cubes() -> robot::Model {
    let here = [0.0; 3];
    let (outer, inner) = ([0.2; 3], [0.192; 3]);
    boxes(&[("outer", "", [outer, here, here]), ("inner", TURNS, [inner, here, [0.0, 0.0, 1.0]])])
}

/// A foot, and a bar of 2 m over it that turns about z.
pub(crate) fn bar() -> robot::Model {
    let (foot, bar) = ([0.2; 3], [2.0, 0.05, 0.05]);
    boxes(&[
        ("foot", "", [foot, [0.0; 3], [0.0; 3]]),
        ("bar", TURNS, [bar, [0.0, 0.0, 0.15], [0.0, 0.0, 1.0]]),
    ])
}

/// A foot far behind, a knuckle that bends about y, and a plate that turns on it about x: its front
/// is 10 cm before the knuckle.
fn wrist() -> robot::Model {
    let (foot, knuckle, plate) = ([0.2; 3], [0.02; 3], [0.02, 0.1, 0.1]);
    boxes(&[
        ("foot", "", [foot, [0.0; 3], [0.0; 3]]),
        ("knuckle", TURNS, [knuckle, [0.5, 0.0, 0.0], [0.0, 1.0, 0.0]]),
        ("plate", TURNS, [plate, [0.09, 0.0, 0.0], [1.0, 0.0, 0.0]]),
    ])
}

/// The wrist, straight, and a scanner 3 m before it that measured places of its plate's front (y,
/// z); it is looked at as bent and turned by so much, radians.
pub(crate) fn before_plate(
    places: &[[f64; 2]],
    posture: [f64; 2],
    look: impl Fn(&Problem<'_>, &AdjustState),
) {
    let places = places.iter().map(|[y, z]| (Point::new(0.6, *y, *z), 0.0));
    measured(&wrist(), places, &posture, look);
}

/// A foot, a plate that turns before it and a jaw that slides on that; nothing of them is measured.
pub(crate) fn with_jaw(look: impl Fn(&Problem<'_>, &AdjustState)) {
    let (foot, plate, jaw) = ([0.2; 3], [0.02, 0.1, 0.1], [0.02; 3]);
    let model = boxes(&[
        ("foot", "", [foot, [0.0; 3], [0.0; 3]]),
        ("plate", TURNS, [plate, [0.5, 0.0, 0.0], [1.0, 0.0, 0.0]]),
        ("jaw", "prismatic", [jaw, [0.1, 0.0, 0.0], [1.0, 0.0, 0.0]]),
    ]);
    measured(&model, std::iter::empty(), &[0.0, 0.0], look);
}

/// The cubes, and a scanner 3 m before the front (x = 0.1) that measured these places of it (y, z).
pub(crate) fn before_front(places: &[[f64; 2]], look: impl Fn(&Problem<'_>, &AdjustState)) {
    seen(places.iter().map(|[y, z]| (*y, *z, 0.0)), look);
}

/// The same with ranges off by so much, metres.
pub(crate) fn seen(
    places: impl Iterator<Item = (f64, f64, f64)>,
    look: impl Fn(&Problem<'_>, &AdjustState),
) {
    measured(&cubes(), places.map(|(y, z, off)| (Point::new(0.1, y, z), off)), &[0.0], look);
}

fn measured(
    model: &robot::Model,
    places: impl Iterator<Item = (Point, f64)>,
    posture: &[f64],
    look: impl Fn(&Problem<'_>, &AdjustState),
) {
    let prepared = Prepared::new(0, model, &OneByOne);
    prepared.make_triangles(&OneByOne);
    let scanner = Point::new(3.0, 0.2, 0.4);
    let points = places.map(|(on_it, off)| {
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
    let scene = MeasuredScene::new(&region, &views, &[], &settings, &OneByOne);
    let problem = Problem::new(&prepared, &scene, &settings, &OneByOne);
    let hypothesis = Hypothesis::at(Pose::identity(), posture.to_vec());
    look(&problem, &AdjustState::at(&hypothesis, &scene));
}
