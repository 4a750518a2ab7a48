//! Contacts of an arm on paths past synthetic points.

use super::*;
use crate::{Cells, KnownBounds, ScannerAt};
use contract::{OneByOne, Space, SpaceGrid, SpaceKind};
use geometry::{Aabb, Pose};
use robot::{Model, Settings};

/// An arm of one link, 1 m long and 0.1 m thick, that turns about z at its end.
fn arm(dir: &std::path::Path) -> Model {
    let urdf = "<robot name='arm'><link name='foot'/><link name='beam'><visual><origin xyz='0.5 0 0'/>\
        <geometry><box size='1 0.1 0.1'/></geometry></visual></link><joint name='turn' type='revolute'>\
        <parent link='foot'/><child link='beam'/><axis xyz='0 0 1'/>\
        <limit lower='-3.2' upper='3.2' effort='1' velocity='1'/></joint></robot>";
    let path = dir.join("arm.urdf");
    std::fs::write(&path, urdf).expect("is written");
    Model::load_urdf(&path, "arm", &Settings::default()).expect("loads").0
}

fn legs(body: &RobotBody<'_>, path: &[Vec<f64>]) -> Vec<Leg> {
    path.windows(2).map(|pair| leg(body, &pair[0], &pair[1])).collect()
}

fn contacts(walk: &PathWalk<'_>) -> Vec<Contact> {
    let mut all = Contacts::default();
    (0..walk.n_pieces()).for_each(|piece| walk.add(walk.examine(piece), &mut all));
    all.all()
}

fn walk(
    points: &[([f64; 3], ObstacleKind)],
    path: &[f64],
    found: f64,
    margin: f64,
) -> Vec<Contact> {
    walk_in(None, points, path, found, margin)
}

fn walk_in(
    space: Option<&Space>,
    points: &[([f64; 3], ObstacleKind)],
    path: &[f64],
    found: f64,
    margin: f64,
) -> Vec<Contact> {
    let dir = tempfile::tempdir().expect("a folder");
    let model = arm(dir.path());
    let mut body = RobotBody::new(&model, BTreeMap::new(), margin, 0.0, &OneByOne);
    let mut cells = Cells::within(crate::reach(&model) + margin + 0.1, &BTreeMap::new());
    points.iter().for_each(|(p, what)| cells.add(*p, *what, false, 0));
    cells.remove_duplicates();
    let bounds = Aabb { min: [-9.0; 3], max: [9.0; 3] };
    let known = KnownBounds { world_from_base: Pose::identity(), bounds };
    let mut around = Obstacles::new(&cells, &[], space, known, &OneByOne);
    body.remove_robot(&[found], &mut around);
    let path: Vec<Vec<f64>> = path.iter().map(|v| vec![*v]).collect();
    let legs = legs(&body, &path);
    let walk = PathWalk::new(&body, &around, &path, &legs, &[found]);
    contacts(&walk)
}

#[test]
fn a_post_in_the_way_is_hit_where_it_stands() {
    // The arm turns by half a turn. The post stands at 90°, 0.9 m away.
    let post: Vec<_> =
        (0..100).map(|k| ([0.0, 0.9, 0.002 * f64::from(k) - 0.1], ObstacleKind::Fixed)).collect();
    let found = walk(&post, &[0.0, std::f64::consts::PI], 0.0, 0.02);
    let [hit] = &found[..] else { panic!("one contact: {found:?}") };
    assert!(!hit.as_found && hit.level >= ContactLevel::Hit && hit.gap == 0.0, "{hit:?}");
    // The side of the beam is 5 cm off its axis, which it reaches 3.2° earlier and leaves 3.2°
    // later, plus the margin and half a step.
    let share = (0.05_f64 / 0.9).asin() / std::f64::consts::PI;
    assert!(hit.from < 0.5 - share && hit.from > 0.5 - 1.8 * share, "{hit:?}");
    assert!(hit.to > 0.5 + share && hit.to < 0.5 + 1.8 * share, "{hit:?}");
    assert!((hit.at.expect("a point") - Point::new(0.0, 0.9, 0.0)).norm() < 0.12);
    // A post beyond the end of the beam is not hit; within the margin it is near.
    let beyond = |off: f64| vec![([0.0, 1.0 + off, 0.0], ObstacleKind::Fixed)];
    assert!(walk(&beyond(0.04), &[0.0, 3.0], 0.0, 0.02).is_empty());
    let near = walk(&beyond(0.015), &[0.0, 3.0], 0.0, 0.02);
    assert!(near.len() == 1 && near[0].level == ContactLevel::Near, "{near:?}");
    assert!(near[0].gap <= 0.015 && near[0].gap > 0.002, "{near:?}");
}

#[test]
fn contacts_as_found_are_listed_separately_until_they_come_nearer() {
    // One post is at the end of the beam, 1 cm away as it was scanned; the beam turns into the
    // other.
    let points =
        [([1.01, 0.0, 0.0], ObstacleKind::Uncertain), ([0.0, 0.8, 0.0], ObstacleKind::Fixed)];
    let found = walk(&points, &[0.0, 1.6], 0.0, 0.02);
    let levels: Vec<_> =
        found.iter().map(|c| (c.what, c.level >= ContactLevel::Hit, c.as_found)).collect();
    assert_eq!(levels, [(ObstacleKind::Fixed, true, false), (ObstacleKind::Beside, false, true)]);
    // The same point does not belong to the arm if the arm was scanned in another posture.
    assert!(walk(&points[..1], &[0.0, 1.6], 1.6, 0.02).iter().all(|c| !c.as_found));
    // The point was near the arm as scanned, and is inside the arm on the path.
    let points = [([0.9, 0.06, 0.0], ObstacleKind::Fixed)];
    let found = walk(&points, &[0.0, 0.1], 0.0, 0.02);
    assert!(found.iter().any(|c| c.level >= ContactLevel::Hit && !c.as_found), "{found:?}");
}

#[test]
fn what_was_hardly_beyond_the_margin_is_as_found_a_little_beside_the_posture_that_was_found() {
    for k in 0..60 {
        let points = [([0.9, 0.075 + 0.0002 * f64::from(k), 0.0], ObstacleKind::Fixed)];
        let found = walk(&points, &[0.001], 0.0, 0.02);
        assert!(found.iter().all(|c| c.as_found), "{found:?}");
    }
}

#[test]
fn what_was_near_outside_is_not_as_found_inside() {
    // The point is beside the beam, 15 mm off its side, and the beam moves 10 mm into it.
    let points = [([0.5, 0.065, 0.0], ObstacleKind::Fixed)];
    let found = walk(&points, &[0.0, 0.05], 0.0, 0.02);
    assert!(found.iter().any(|c| c.level == ContactLevel::Inside && !c.as_found), "{found:?}");
}

#[test]
fn points_on_its_own_surface_are_no_obstacle() {
    // A patch of points of the robot that a mask labelled as fixed, at this distance from the
    // beam's side.
    let patch = |off: f64| -> Vec<_> {
        let at = |k: u32| [0.4 + 0.01 * f64::from(k % 10), 0.05 + off, 0.01 * f64::from(k / 10)];
        (0..40).map(|k| (at(k), ObstacleKind::Fixed)).collect()
    };
    assert_eq!(walk(&patch(0.003), &[0.0, 0.3], 0.0, 0.02), []);
    let hit = |c: &Contact| c.level >= ContactLevel::Hit && !c.as_found;
    assert!(walk(&patch(0.03), &[0.0, 0.3], 0.0, 0.02).iter().any(hit));
}

#[test]
fn a_link_above_the_floor_is_not_in_it_where_a_bin_reaches_from_the_floor_into_the_link() {
    // The floor 28 mm below the beam, and a point in the beam: the middle of their bin is in it.
    let floor = (0..100_u32)
        .map(|k| [0.33 + 0.01 * f64::from(k % 10), 0.17 + 0.01 * f64::from(k / 10), -0.078])
        .map(|p| (p, ObstacleKind::Floor));
    let above = ([0.4, 0.25, -0.002], ObstacleKind::Fixed);
    let points: Vec<_> = floor.chain([above]).collect();
    let found = walk(&points, &[0.0, 1.0], 0.0, 0.01);
    assert!(found.iter().all(|c| c.what != ObstacleKind::Floor), "{found:?}");
}

#[test]
fn a_few_points_beside_its_own_surface_are_strays_where_space_is_known() {
    let bounds = Aabb { min: [-2.0; 3], max: [2.0; 3] };
    let mut space = Space::unknown(SpaceGrid::over(&bounds, 0.05));
    space.voxels_mut().fill(SpaceKind::Free);
    // The beam's side as a mask labelled it, and this number of points 12 to 15 mm off the side.
    let side = (0..40_u32).map(|k| {
        ([0.4 + 0.01 * f64::from(k % 10), 0.053, 0.01 * f64::from(k / 10)], ObstacleKind::Uncertain)
    });
    let beside = |n: u32, apart: f64| -> Vec<_> {
        let at = |k: u32| [0.42 + apart * f64::from(k), 0.062 + 0.003 * f64::from(k % 2), 0.02];
        let off = (0..n).map(|k| (at(k), ObstacleKind::Uncertain));
        side.clone().chain(off).collect()
    };
    let contacts = |points: &[_], space| walk_in(space, points, &[0.0, 0.1], 0.0, 0.02);
    assert_eq!(contacts(&beside(3, 0.01), Some(&space)), []);
    // Without known space each point may belong to an object.
    assert_ne!(contacts(&beside(3, 0.01), None), []);
    // A small object, and a wire along the beam with few points.
    assert_ne!(contacts(&beside(6, 0.01), Some(&space)), []);
    assert_ne!(contacts(&beside(6, 0.04), Some(&space)), []);
}

#[test]
fn uncertain_points_beside_it_may_move_with_it() {
    // A point above the beam's end, and a post of which the beam passes below the lowest point.
    let beside = (0..8).map(|k| ([0.9, 0.0, 0.07 + 0.01 * f64::from(k)], ObstacleKind::Uncertain));
    let post = std::iter::once(([0.0, 0.9, 0.12], ObstacleKind::Fixed));
    let points: Vec<_> = beside.chain(post).collect();
    let found = walk(&points, &[0.0, 3.0], 0.0, 0.02);
    let fixed: Vec<_> = found.iter().filter(|c| c.what == ObstacleKind::Fixed).collect();
    assert!(
        fixed.len() == 1 && fixed[0].is_doubtful && fixed[0].level == ContactLevel::Hit,
        "{found:?}"
    );
    let away = found.iter().filter(|c| c.what == ObstacleKind::Beside && !c.as_found);
    assert!(away.count() == 0, "it does not come nearer to them: {found:?}");
}

#[test]
fn whole_turns_are_no_rest() {
    let dir = tempfile::tempdir().expect("a folder");
    let model = arm(dir.path());
    let body = RobotBody::new(&model, BTreeMap::new(), 0.02, 0.0, &OneByOne);
    let turns = MAX_STEPS as f64 * std::f64::consts::TAU;
    assert!(leg(&body, &[0.0], &[turns]).jumps && leg(&body, &[0.0], &[1e308]).jumps);
}

#[test]
fn what_lies_inside_of_a_link_from_the_beginning_is_hit() {
    let found = walk(&[([0.5, 0.0, 0.0], ObstacleKind::Uncertain)], &[0.0], 1.0, 0.005);
    assert!(found.len() == 1 && found[0].level == ContactLevel::Inside, "{found:?}");
}

#[test]
fn space_of_which_nothing_is_known_is_not_free() {
    let dir = tempfile::tempdir().expect("a folder");
    let model = arm(dir.path());
    let body = RobotBody::new(&model, BTreeMap::new(), 0.02, 0.0, &OneByOne);
    let bounds = Aabb { min: [-9.0, -0.2, -9.0], max: [9.0, 9.0, 9.0] };
    let known = KnownBounds { world_from_base: Pose::identity(), bounds };
    let around = Obstacles::new(
        &Cells::within(crate::reach(&model) + 0.2, &BTreeMap::new()),
        &[],
        None,
        known,
        &OneByOne,
    );
    let path = [vec![0.0], vec![-1.0]];
    let legs = legs(&body, &path);
    let walk = PathWalk::new(&body, &around, &path, &legs, &[0.0]);
    let found = contacts(&walk);
    assert!(found.len() == 1 && found[0].what == ObstacleKind::Unseen && found[0].at.is_none());
    assert!(found[0].from > 0.0 && found[0].to == 1.0, "{found:?}");
}

#[test]
fn points_between_a_wire_that_another_scanner_knows_and_a_surface_are_no_obstacle() {
    let eye = |at: [f64; 3]| ScannerAt { at: at.into(), step: 0.003 };
    let eyes = BTreeMap::from([(1, eye([-3.0, 0.0, 0.0])), (2, eye([0.0, -3.0, 0.0]))]);
    let bounds = Aabb { min: [-4.0; 3], max: [4.0; 3] };
    let mut space = Space::unknown(SpaceGrid::over(&bounds, 0.05));
    space.voxels_mut().fill(SpaceKind::Free);
    let n_near_zero = |what: ObstacleKind, has_wire: bool, sees_past: bool| {
        let mut cells = Cells::within(2.0, &eyes);
        let mut add = |p: [f64; 3], source: u16| {
            cells.add_measurement(&p.into(), source);
            cells.add(p, what, false, source);
        };
        // All that the first scanner has of the wire, on a line 0.5 m behind it.
        (0..5).for_each(|k| add([0.0, 0.0, 0.03 * f64::from(k)], 1));
        if has_wire {
            (0..100).for_each(|k| add([-0.5, 0.0, 0.01 * f64::from(k) - 0.5], 2));
        }
        if sees_past {
            let at = |k: i32| 0.014 * f64::from(k) - 0.35;
            (0..50 * 50).for_each(|k| add([at(k % 50), 1.9, at(k / 50)], 2));
        }
        cells.remove_duplicates();
        let known = KnownBounds { world_from_base: Pose::identity(), bounds };
        let around = Obstacles::new(&cells, &[], Some(&space), known, &OneByOne);
        let is_near_zero =
            |o: &&crate::obstacle::Obstacle| o.is_point() && o.at[0].abs() < 0.1 && o.at[1] < 1.0;
        around.all.iter().filter(is_near_zero).count()
    };
    // Without the wire they may be a wire themselves.
    let uncertain = |has_wire| n_near_zero(ObstacleKind::Uncertain, has_wire, false);
    assert_eq!([uncertain(false), uncertain(true)], [5, 0]);
    // Of those that are known to be fixed a scanner has to see past them.
    let fixed = |sees_past| n_near_zero(ObstacleKind::Fixed, true, sees_past);
    assert_eq!([fixed(false), fixed(true)], [5, 0]);
}
