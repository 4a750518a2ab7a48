//! Points of things and stray points, as one or two scanners have them: which are evidence.

use super::*;
use crate::cells::{CellSight, Cells};
use crate::shadow::ScannerAt;
use contract::{OneByOne, SpaceGrid};
use geometry::Aabb;

const EYE: [f64; 3] = [-2.0, 0.0, 0.0];

/// Tells of all obstacles that only a scanner at [`EYE`] measured them.
struct OneEye;

impl Sight for OneEye {
    fn eyes(&self, _: usize) -> Vec<Point> {
        vec![Point::from(EYE)]
    }

    fn are_of_several(&self, _: usize, _: usize) -> bool {
        false
    }

    fn is_passed(&self, _: usize, _: &Obstacle) -> bool {
        false
    }

    fn behind(&self, all: &[Obstacle], _: &[bool]) -> Vec<bool> {
        vec![false; all.len()]
    }
}

fn space_of(kind: SpaceKind) -> Space {
    let bounds = Aabb { min: [-1.5; 3], max: [1.5; 3] };
    let mut space = Space::unknown(SpaceGrid::over(&bounds, 0.05));
    space.voxels_mut().fill(kind);
    space
}

/// Places of a distant wall with 1 cm between points, which sets the density of the scan.
fn wall() -> impl Iterator<Item = [f32; 3]> {
    (0..2500).map(|i| [1.0, 0.01 * (i % 50) as f32, 0.01 * (i / 50) as f32])
}

/// Which of some uncertain points are evidence.
fn evident_among(points: &[[f32; 3]], kind: SpaceKind) -> Vec<bool> {
    evident_by(points, ObstacleKind::Uncertain, kind, false)
}

/// Which of some points of this kind, of grazing beams or not, are evidence.
fn evident_by(points: &[[f32; 3]], what: ObstacleKind, kind: SpaceKind, grazed: bool) -> Vec<bool> {
    let obstacle = |(at, is_grazed)| Obstacle { at, radius: 0.0035, what, is_grazed };
    let mut all: Vec<Obstacle> = (points.iter().map(|p| (*p, grazed)))
        .chain(wall().map(|p| (p, false)))
        .map(obstacle)
        .collect();
    let space = space_of(kind);
    let seen = SeenSpace { space: &space, world_from_base: &Pose::identity() };
    let out = evident(&mut all, &OneEye, Some(seen), &OneByOne);
    assert!(out[points.len()..].iter().all(|is| *is), "the wall stands");
    out[..points.len()].to_vec()
}

#[test]
fn strays_in_seen_space_are_evidence_of_nothing() {
    let strays = [[0.0, 0.0, 0.0], [0.03, 0.02, -0.02], [-0.02, 0.05, 0.05], [0.3, 0.3, 0.1]];
    assert_eq!(evident_among(&strays, SpaceKind::Free), [false; 4]);
    // Where no beam passed, each of them may be an object.
    assert_eq!(evident_among(&strays, SpaceKind::Unknown), [true; 4]);
    // Fixed points stay, since no beam passed their places.
    assert_eq!(evident_by(&strays, ObstacleKind::Fixed, SpaceKind::Free, false), [true; 4]);
    assert_eq!(evident_by(&strays, ObstacleKind::Fixed, SpaceKind::Free, true), [true; 4]);
}

#[test]
fn a_small_thing_of_four_points_stays() {
    let hook = [[0.0, 0.0, 0.0], [0.012, 0.0, 0.0], [0.0, 0.0, 0.012], [0.012, 0.0, 0.012]];
    assert_eq!(evident_among(&hook, SpaceKind::Free), [true; 4]);
}

#[test]
fn a_wire_that_few_beams_met_stays() {
    // Points 4 cm apart with a noise of 3 mm.
    let noise = |i: usize| [0.003, -0.002, 0.001, -0.003][i % 4];
    let wire: Vec<[f32; 3]> =
        (0..9).map(|i| [noise(i), noise(i + 1), 0.04 * i as f32 - 0.16]).collect();
    assert_eq!(evident_among(&wire, SpaceKind::Free), [true; 9]);
}

fn grazed_among(points: &[[f32; 3]], kind: SpaceKind) -> Vec<bool> {
    evident_by(points, ObstacleKind::Uncertain, kind, true)
}

#[test]
fn a_wire_that_stands_behind_an_edge_by_chance_stays() {
    let noise = |i: usize| [0.002, -0.002, 0.001, -0.003][i % 4];
    let mut all: Vec<[f32; 3]> =
        (0..60).map(|i| [noise(i), noise(i + 1), 0.01 * i as f32]).collect();
    // Some points of the edge itself are among them.
    all.extend((0..5).map(|i| [-0.05 * i as f32, 0.02, 0.1 * i as f32]));
    assert_eq!(grazed_among(&all, SpaceKind::Free)[..60], [true; 60]);
}

#[test]
fn a_wall_of_few_beams_behind_an_edge_stays() {
    let noise = |i: usize| [0.002, -0.002, 0.001, -0.003][i % 4];
    // Beams 3 cm apart on a wall that stands askew, at 45° to them.
    let of = |i: usize| [(i % 8) as f32 * 0.03, (i / 8) as f32 * 0.03];
    let all: Vec<[f32; 3]> =
        (0..64).map(|i| [0.2 + of(i)[0] + noise(i), of(i)[0], of(i)[1]]).collect();
    assert_eq!(grazed_among(&all, SpaceKind::Free), [true; 64]);
}

#[test]
fn stray_points_are_not_attached() {
    let hose = (0..40).map(|i| ([0.01 * i as f32, 0.0, 0.0], i % 5 == 0));
    let curtain = (0..20).map(|i| ([0.0, 0.3, 0.01 * i as f32], true));
    let all: Vec<_> = hose.chain(curtain).chain([([0.0, -0.4, 0.0], false)]).collect();
    let left = attached_points(&all);
    assert_eq!(left, all[..40].iter().map(|(p, _)| *p).collect::<Vec<_>>());
}

#[test]
fn uncertain_points_of_grazing_beams_count_only_on_surfaces_of_others() {
    // Behind an upright edge, at any depth, which no line has in common.
    let depth = |i: usize| (i * i * 37 % 53) as f32 * 0.01;
    let curtain: Vec<[f32; 3]> = (0..30).map(|i| [depth(i), 0.0, 0.01 * i as f32]).collect();
    assert_eq!(grazed_among(&curtain, SpaceKind::Free), [false; 30]);
    assert_eq!(grazed_among(&curtain, SpaceKind::Unknown), [false; 30]);
    // Behind a tip, along the beam.
    let tail: Vec<[f32; 3]> = (0..30).map(|i| [0.01 * i as f32, 0.0, 0.0]).collect();
    assert_eq!(grazed_among(&tail, SpaceKind::Free), [false; 30]);
    // Points at the wall belong to the wall.
    let at_wall = [[0.99, 0.2, 0.2], [1.01, 0.305, 0.1]];
    assert_eq!(grazed_among(&at_wall, SpaceKind::Free), [true; 2]);
}

#[test]
fn a_point_among_the_wires_of_a_fence_stays() {
    let obstacle = |at, what, is_grazed| Obstacle { at, radius: 0.0035, what, is_grazed };
    let grazed = |at| obstacle(at, ObstacleKind::Uncertain, true);
    // Few points of wires, in a plane along the beams; one that sticks out of it, and one beyond.
    let mut all = vec![grazed([0.0; 3]), grazed([0.0, 0.03, 0.0]), grazed([0.0, 0.0, 0.16])];
    let wires = (0..12).map(|i| (0.05 * (i % 4) as f32 - 0.075, 0.08 * (i / 4) as f32 - 0.08));
    all.extend(wires.map(|(x, z)| obstacle([x, 0.0, z], ObstacleKind::Fixed, false)));
    all.extend(wall().map(|p| obstacle(p, ObstacleKind::Fixed, false)));
    let space = space_of(SpaceKind::Free);
    let seen = SeenSpace { space: &space, world_from_base: &Pose::identity() };
    assert_eq!(evident(&mut all, &OneEye, Some(seen), &OneByOne)[..3], [true, false, false]);
}

/// Scanners at [`EYE`] and at its side, with beams that are 4 mm apart at the origin.
const SIDE: [f64; 3] = [0.0, -2.0, 0.0];
const STEP: f64 = 0.002;

/// Which fixed points, of the scanners with these numbers, are evidence where also a wall behind
/// stands that the scanner at the side sees past them, but for the beams that `hits` stops.
fn fixed_among(points: &[([f64; 3], u16)], hits: impl Fn(&Point) -> bool) -> Vec<bool> {
    let eyes = [EYE, SIDE].map(|at| ScannerAt { at: Point::from(at), step: STEP });
    let eyes = [(1, eyes[0]), (2, eyes[1])].into_iter().collect();
    let mut cells = Cells::within(1.5, &eyes);
    let mut add = |p: [f64; 3], source: u16| {
        cells.add_measurement(&Point::from(p), source);
        cells.add(p, ObstacleKind::Fixed, false, source);
    };
    points.iter().for_each(|(p, source)| add(*p, *source));
    // Each beam from the side ends 1 m behind the points.
    for k in 0..400 * 200 {
        let [x, z] = [k % 400 - 200, k / 400 - 100].map(|v| f64::from(v) * STEP * 3.0);
        let end = Point::new(x, 1.0, z);
        if !hits(&end) {
            add(end.coords.into(), 2);
        }
    }
    cells.remove_duplicates();
    let mut all = cells.obstacles();
    let space = space_of(SpaceKind::Free);
    let seen = SeenSpace { space: &space, world_from_base: &Pose::identity() };
    let is_evident = evident(&mut all, &CellSight::new(&cells), Some(seen), &OneByOne);
    let of = |p: &[f64; 3]| {
        let near = |o: &Obstacle| (place(o) - Point::from(*p)).norm() < 0.004;
        all.iter().position(near).map(|at| is_evident[at])
    };
    points.iter().map(|(p, _)| of(p).expect("its cell")).collect()
}

/// A curtain behind an upright edge, at many depths along the beams from [`EYE`].
fn curtain() -> Vec<([f64; 3], u16)> {
    let depth = |i: i32| f64::from(i * i * 37 % 53) * 0.01 - 0.2;
    (0..20).map(|i| ([depth(i), 0.0, 0.02 * f64::from(i) - 0.2], 1)).collect()
}

/// That edge: a post that the scanner at [`EYE`] has beside all beams of a curtain.
fn post() -> impl Iterator<Item = ([f64; 3], u16)> {
    (0..150).map(|i| ([-0.5, 0.003, 0.003 * f64::from(i) - 0.225], 1))
}

#[test]
fn a_fixed_point_is_dropped_only_where_beams_of_another_scanner_passed() {
    let curtain: Vec<_> = curtain().into_iter().chain(post()).collect();
    assert_eq!(fixed_among(&curtain, |_| false)[..20], [false; 20]);
    // The scanner at the side had no beam there.
    assert_eq!(fixed_among(&curtain, |_| true)[..20], [true; 20]);
}

#[test]
fn a_fixed_point_stays_where_its_own_beam_passed_no_edge() {
    // Beams from the side are too far apart to meet these pins.
    let pins: Vec<_> = (0..8).map(|i| ([0.0, 0.0, 0.08 * f64::from(i) - 0.28], 1)).collect();
    assert_eq!(fixed_among(&pins, |_| false), [true; 8]);
}

#[test]
fn the_wires_of_a_fence_that_is_seen_along_stay() {
    // Upright wires 50 mm apart, at 11° to the beams, so that each has others in front of it.
    let of = |i: i32| {
        let along = f64::from(i % 5) * 0.05 - 0.1;
        ([along, 0.2 * along, f64::from(i / 5) * 0.012 - 0.2], 1)
    };
    let fence: Vec<_> = (0..170).map(of).collect();
    assert_eq!(fixed_among(&fence, |_| false), [true; 170]);
}

#[test]
fn what_lies_right_beside_an_undoubted_point_stays() {
    let obstacle = |at, what, is_grazed| Obstacle { at, radius: 0.0035, what, is_grazed };
    let grazed = |x| obstacle([x, 0.0, 0.0], ObstacleKind::Uncertain, true);
    let mut all = vec![obstacle([0.0; 3], ObstacleKind::Fixed, false), grazed(0.017), grazed(0.03)];
    all.extend(wall().map(|p| obstacle(p, ObstacleKind::Fixed, false)));
    let space = space_of(SpaceKind::Free);
    let seen = SeenSpace { space: &space, world_from_base: &Pose::identity() };
    assert_eq!(evident(&mut all, &OneEye, Some(seen), &OneByOne)[..3], [true, true, false]);
}

#[test]
fn a_wire_that_another_scanner_sees_past_stays() {
    // Too thin for the beams of the one at the side, and met by few of the other one's.
    let noise = |i: i32| [0.002, -0.002, 0.001, -0.002][i as usize % 4];
    let wire: Vec<_> =
        (0..14).map(|i| ([noise(i), noise(i + 1), 0.045 * f64::from(i) - 0.3], 1)).collect();
    assert_eq!(fixed_among(&wire, |_| false), [true; 14]);
}

#[test]
fn a_pipe_that_another_scanner_sees_past_stays() {
    // 20 mm wide, too wide for a line and too narrow for a plane, and between two rows of beams of
    // the scanner at the side.
    let noise = |i: i32| [0.001, -0.002, 0.002, -0.001, 0.0][i as usize % 5];
    let of = |i: i32| {
        let turn = f64::from(i % 9 - 4) * 0.35;
        let [x, y] = [-turn.cos(), turn.sin()].map(|v| 0.01 * v);
        ([x + noise(i), y, 0.004 * f64::from(i / 9) - 0.1], 1)
    };
    let pipe: Vec<_> = (0..450).map(of).collect();
    assert_eq!(fixed_among(&pipe, |_| false), [true; 450]);
    // A curtain that dense behind an edge is as deep as what the edge hides.
    let behind =
        |i: i32| ([f64::from(i * i * 37 % 53) * 0.002, 0.002, 0.002 * f64::from(i % 60)], 1);
    let curtain: Vec<_> = (0..240).map(behind).chain(post()).collect();
    let kept = fixed_among(&curtain, |_| false);
    let n_kept = kept[..240].iter().filter(|is| **is).count();
    assert!(n_kept < 24, "{n_kept}");
}

#[test]
fn a_mesh_of_few_wires_that_another_scanner_sees_past_stays() {
    // Wires 80 mm apart, upright and across, 45° to the beams, with a point each 5 cm.
    let along = |i: i32| (f64::from(i % 5) * 0.08 - 0.16, f64::from(i / 5) * 0.05 - 0.2);
    let of = |i: i32| {
        let (u, v) = if i < 45 { along(i) } else { (along(i - 45).1, along(i - 45).0) };
        ([u, u, v], 1)
    };
    let mesh: Vec<_> = (0..90).map(of).collect();
    assert_eq!(fixed_among(&mesh, |_| false), [true; 90]);
}

#[test]
fn points_at_which_two_scanners_agree_stay() {
    let here = [([0.0, 0.0, 0.0], 1), ([0.025, 0.025, 0.0], 2)];
    assert_eq!(fixed_among(&here, |_| false), [true; 2]);
    // Or a scanner agrees with a place that both have measured.
    let here = [([0.0, 0.0, 0.0], 1), ([0.012, 0.012, 0.0], 1), ([0.012, 0.012, 0.0], 2)];
    assert_eq!(fixed_among(&here, |_| false), [true; 3]);
}
