//! Obstacles around a random robot (METHOD.md §19, T6): plates about its foot, a conveyor that
//! touches it, a fence on three sides, and another robot whose arm crosses it.

use super::condition::{Condition, DrawnCase};
use contract::Result;
use geometry::{Point, Pose, Vector};
use nalgebra::{Translation3, UnitQuaternion};
use robot::Model;
use simulate::random::Random;
use simulate::scene::{Cuboid, Fence, FenceFilling, Furniture, RobotPlace};
use simulate::{Postures, Scene};
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::{FRAC_PI_2, TAU};

/// Distance of plates from the foot, and their thickness, metres.
const PLATES: [f64; 2] = [0.05, 0.005];
/// A conveyor's length, width and height, metres: lower than most arms reach.
const CONVEYOR: [f64; 3] = [1.5, 0.6, 0.4];
/// Number of directions in which it may lie from the foot.
const N_WAYS: usize = 12;
/// Distance of another robot beyond the reach of the first, metres.
const BESIDE: [f64; 2] = [0.3, 0.8];
/// Number of random postures, of which the one that comes nearest is taken.
const N_POSTURES: usize = 6;
/// Least distance between two robots, metres.
const CLEAR: f64 = 0.08;
/// Least distance between an arm and a scanner, metres.
const ASIDE: f64 = 0.8;

/// The robot as it was drawn.
pub(super) struct Standing<'a> {
    pub(super) model: &'a Model,
    pub(super) world_from_base: Pose,
    pub(super) posture: &'a [f64],
    /// Its reach from the base, metres.
    pub(super) reach: f64,
    /// Distance of the scanners from the origin, metres.
    pub(super) circle: f64,
}

/// Adds the obstacles of the case's condition; returns the base of another robot, world frame, if
/// there is one.
///
/// # Errors
/// `BadInput` where there is no room for them.
pub(super) fn add(
    scene: &mut Scene,
    robot: &Standing<'_>,
    case: &DrawnCase,
) -> Result<Option<Vector>> {
    let (c, mut random) = (&case.condition, Random::keyed(&[case.seed, 0x0B5]));
    if c.hidden > 0.0 {
        hide(scene, robot, c, &mut random);
    }
    c.crossed.then(|| cross(scene, robot, &mut random)).transpose()
}

/// Hides a robot's foot and fences it in, as the condition says.
fn hide(scene: &mut Scene, robot: &Standing<'_>, c: &Condition, random: &mut Random) {
    let Some(foot) = robot.model.links.iter().find(|link| !link.bounds.is_empty()) else { return };
    let size = foot.bounds.size();
    let middle = robot.world_from_base * foot.bounds.center();
    plates(scene, robot, middle, [size[0], size[1], c.hidden * size[2]], random);
    conveyor(scene, robot, middle, 0.5 * size[0].max(size[1]), random);
    fences(scene, robot, random);
}

/// Four plates, of a height, about a foot.
fn plates(
    scene: &mut Scene,
    robot: &Standing<'_>,
    middle: Point,
    size: [f64; 3],
    random: &mut Random,
) {
    let (_, _, yaw) = robot.world_from_base.rotation.euler_angles();
    let z = scene.ground(middle.x, middle.y) + 0.5 * size[2];
    for side in 0..4 {
        let along = usize::from(side % 2 == 1);
        let gap = 0.5 * size[along] + PLATES[0];
        let turn = (yaw + FRAC_PI_2 * f64::from(side)).rem_euclid(TAU);
        scene.boxes.push(Cuboid {
            name: format!("plate {side}"),
            xyz: [middle.x + gap * turn.cos(), middle.y + gap * turn.sin(), z],
            size: [PLATES[1], size[1 - along] + 2.0 * PLATES[0], size[2]],
            rpy_deg: [0.0, 0.0, turn.to_degrees()],
            reflectance: random.between(0.2, 0.9),
        });
    }
}

/// A conveyor that ends at the plates around a foot with this radius, metres, in the direction
/// where the arm is least in its way.
fn conveyor(
    scene: &mut Scene,
    robot: &Standing<'_>,
    middle: Point,
    radius: f64,
    random: &mut Random,
) {
    let gap = radius + PLATES[0] + PLATES[1] + 0.5 * CONVEYOR[0];
    let first = random.between(0.0, TAU);
    let ways = (0..N_WAYS).map(|k| first + TAU * k as f64 / N_WAYS as f64);
    let arm = surface(robot);
    let in_it = |way: f64| {
        let at = Translation3::new(middle.x + gap * way.cos(), middle.y + gap * way.sin(), 0.0);
        let pose = Pose::from_parts(at, UnitQuaternion::from_euler_angles(0.0, 0.0, way));
        let is_in = |p: &&Point| {
            let q = pose.inverse() * *p;
            q.x.abs() < 0.5 * CONVEYOR[0] && q.y.abs() < 0.5 * CONVEYOR[1] && q.z < CONVEYOR[2]
        };
        arm.iter().filter(is_in).count()
    };
    let way = ways.min_by_key(|way| in_it(*way)).unwrap_or(first);
    scene.conveyors.push(Furniture {
        name: "conveyor at the foot".into(),
        xy: [middle.x + gap * way.cos(), middle.y + gap * way.sin()],
        yaw_deg: way.rem_euclid(TAU).to_degrees(),
        size: CONVEYOR,
    });
}

/// Wires on three sides of a square about the robot.
fn fences(scene: &mut Scene, robot: &Standing<'_>, random: &mut Random) {
    let base = robot.world_from_base.translation.vector;
    let r = (robot.reach + random.between(0.4, 0.8)) * 2.0_f64.sqrt();
    let turn = random.between(0.0, TAU);
    let corner = |k: usize| {
        let a = turn + FRAC_PI_2 * k as f64;
        [base.x + r * a.cos(), base.y + r * a.sin()]
    };
    for k in 0..3 {
        scene.fences.push(Fence {
            name: format!("fence {k}"),
            from: corner(k),
            to: corner(k + 1),
            height: random.between(1.8, 2.2),
            filling: FenceFilling::Wires,
        });
    }
}

/// Adds another robot of the same model whose arm crosses the first one; returns its base.
fn cross(scene: &mut Scene, robot: &Standing<'_>, random: &mut Random) -> Result<Vector> {
    let (base, way) = (robot.world_from_base.translation.vector, random.between(0.0, TAU));
    let apart = robot.reach + random.between(BESIDE[0], BESIDE[1]);
    let (x, y) = (base.x + apart * way.cos(), base.y + apart * way.sin());
    let z = base.z - scene.ground(base.x, base.y) + scene.ground(x, y);
    let heading = UnitQuaternion::from_euler_angles(0.0, 0.0, random.between(0.0, TAU));
    let world_from_base = Pose::from_parts(Translation3::new(x, y, z), heading);
    let cell = |p: &Point| [p.x, p.y, p.z].map(|v| (v / CLEAR).floor() as i32);
    let arm = surface(robot);
    let taken: BTreeSet<[i32; 3]> = arm.iter().map(cell).collect();
    let is_free = |p: &Point| {
        let [x, y, z] = cell(p);
        let mut near = (-1..=1)
            .flat_map(|i| (-1..=1).flat_map(move |j| (-1..=1).map(move |k| [x + i, y + j, z + k])));
        p.z > scene.ground(p.x, p.y) - 0.005
            && p.x.hypot(p.y) < robot.circle - ASIDE
            && !near.any(|c| taken.contains(&c))
    };
    let postures = Postures::new(robot.model);
    let drawn: Result<Vec<Vec<f64>>> =
        (0..N_POSTURES).map(|_| postures.draw(random, &world_from_base, is_free)).collect();
    let nearest = |posture: &Vec<f64>| {
        let other = Standing { world_from_base, posture, ..*robot };
        let across = |p: &Point| (p.x - base.x).hypot(p.y - base.y);
        surface(&other).iter().map(across).fold(f64::INFINITY, f64::min)
    };
    let best = drawn?.into_iter().min_by(|a, b| nearest(a).total_cmp(&nearest(b)));
    let (_, _, yaw) = world_from_base.rotation.euler_angles();
    let names = robot.model.free.iter().map(|&j| robot.model.joints[j].name.clone());
    let posture: BTreeMap<String, f64> = names.zip(best.into_iter().flatten()).collect();
    scene.robots.push(RobotPlace {
        name: "R2".into(),
        model: robot.model.name.clone(),
        xyz: [x, y, z],
        rpy_deg: [0.0, 0.0, yaw.to_degrees()],
        posture,
        ..RobotPlace::default()
    });
    Ok(world_from_base.translation.vector)
}

/// Samples of its surface, world.
fn surface(robot: &Standing<'_>) -> Vec<Point> {
    let poses = robot.model.poses(robot.posture);
    let links = robot.model.links.iter().zip(poses);
    let of = |(link, pose): (&robot::Link, Pose)| {
        let pose = robot.world_from_base * pose;
        let points = link.cad.points.iter().step_by(5);
        points.map(move |p| pose * Point::from(p.map(f64::from))).collect::<Vec<_>>()
    };
    links.flat_map(of).collect()
}
