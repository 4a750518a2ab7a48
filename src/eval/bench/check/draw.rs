//! Random cells with wires and pipes in their robots' ways, and random paths of these robots.

use super::bodies::places as on_triangle;
use super::scene_robot::SceneRobot;
use super::truth::{PathTruth, TOUCH, between};
use contract::Result;
use geometry::{Point, Pose, Vector};
use glamx::Vec3;
use robot::Model;
use simulate::random::Random;
use simulate::scene::{Anchor, Hose};
use simulate::{Plant, Postures, Scene, Shapes};

/// Least and greatest turn of a joint in a small move, radians; sliding joints move a fifth of
/// that, in metres.
const SMALL: [f64; 2] = [0.03, 0.35];
/// Number of paths of each kind for each robot; each thin object gets one path into it.
const N_SMALL: usize = 8;
const N_WRIST: usize = 8;
const N_FAR: usize = 4;
const N_HIT: usize = 3;
/// Number of thin objects in the way of each robot.
const N_THIN: usize = 2;
/// Attempts to draw a path that hits something, or a thin object that touches no robot.
const N_TRIES: usize = 12;
/// Radii of wires and of pipes, metres.
const WIRE: [f64; 2] = [0.002, 0.005];
const PIPE: f64 = 0.010;
/// Least distance of thin objects from scanned robots, metres: more than the margin of a check.
const ASIDE: f64 = 0.08;
/// Distance between places that stand for a surface, metres.
const APART: f64 = 0.05;
/// Length of a wire that hangs level, metres.
const LENGTH: [f64; 2] = [1.0, 2.5];

/// Kind of a random path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum PathKind {
    /// A small move of a few joints.
    Small,
    /// A small move of a few joints of the outer half, mostly through seen space.
    Wrist,
    /// A move to a random posture.
    Far,
    /// The first of several random moves that hits something.
    Hit,
    /// A move into a wire or a pipe.
    Thin,
}

/// Waypoints from the scanned posture on, straight in joint space.
#[derive(Debug, Clone)]
pub(super) struct DrawnPath {
    pub(super) drawn: PathKind,
    pub(super) to: Vec<f64>,
}

/// A cell, and for each robot the paths that lead into thin things.
pub(super) fn cell(wanted: &Plant, models: &[Model]) -> Result<(Scene, Vec<Vec<DrawnPath>>)> {
    let mut scene = simulate::plant(wanted, models)?;
    // Beams that do not come back prove nothing: of a hall that is open above, little is known.
    if let Some(hall) = &mut scene.hall {
        hall.ceiling = true;
    }
    let mut random = Random::keyed(&[wanted.seed, 0xC4EC]);
    // Low and high, as they are put up in real cells: what no scanner sees from below no path is
    // free in.
    for (k, scanner) in scene.scanners.iter_mut().enumerate() {
        if k % 2 == 1 {
            scanner.position[2] -= random.between(0.6, 1.1);
        }
    }
    let standing = standing(&scene, models)?;
    let mut paths = Vec::new();
    for robot in 0..scene.robots.len() {
        let mut own = Vec::new();
        for k in 0..N_THIN {
            let name = format!("thin {k} of {}", scene.robots[robot].name);
            if let Some((thing, to)) = thin(&scene, models, robot, &standing, &name, &mut random)? {
                scene.hoses.push(thing);
                own.push(DrawnPath { drawn: PathKind::Thin, to });
            }
        }
        paths.push(own);
    }
    Ok((scene, paths))
}

/// Places on the robots as they stand, and on what hangs on them, world, metres.
fn standing(scene: &Scene, models: &[Model]) -> Result<Vec<Point>> {
    let shapes = Shapes::of(scene, models)?;
    let hanging = shapes.all.iter().filter(|s| s.robot.is_some() && !s.is_of_model);
    let mut out = Vec::new();
    for t in hanging.flat_map(|s| &s.triangles) {
        on_triangle(&t.map(Vec3::from_array), APART, |p| out.push(p));
    }
    for robot in 0..scene.robots.len() {
        let Some(robot) = SceneRobot::of(scene, models, robot) else { continue };
        for (link, pose) in robot.model.links.iter().zip(robot.model.poses(&robot.posture)) {
            out.extend(places(&link.cad.points, &(robot.world_from_base * pose)));
        }
    }
    Ok(out)
}

fn places<'p>(points: &'p [[f32; 3]], pose: &'p Pose) -> impl Iterator<Item = Point> + 'p {
    /// Enough of a link's samples to keep a few centimetres off it.
    const EACH: usize = 7;
    points.iter().step_by(EACH).map(move |p| pose * Point::from(p.map(f64::from)))
}

/// A wire or a pipe through a point that a link passes, away from all scanned robots; and the end
/// of that path.
fn thin(
    scene: &Scene,
    models: &[Model],
    robot: usize,
    standing: &[Point],
    name: &str,
    random: &mut Random,
) -> Result<Option<(Hose, Vec<f64>)>> {
    let Some(robot) = SceneRobot::of(scene, models, robot) else { return Ok(None) };
    let (model, from, base) = (robot.model, &robot.posture[..], robot.world_from_base);
    let moves = model.moving();
    for _ in 0..N_TRIES {
        let to = target(&robot, random)?;
        let there = model.poses(&between(from, &to, random.between(0.3, 1.0)));
        let links: Vec<usize> = (0..model.links.len())
            .filter(|&l| moves[l] && !model.links[l].cad.points.is_empty())
            .collect();
        let link = links[random.below(links.len())];
        let points = &model.links[link].cad.points;
        let p = base * there[link] * Point::from(points[random.below(points.len())].map(f64::from));
        let ground = scene.ground(p.x, p.y);
        let radius = if random.unit() < 0.35 { PIPE } else { random.between(WIRE[0], WIRE[1]) };
        let ends = if random.unit() < 0.5 {
            let top = (p.z + random.between(0.3, 1.0)).max(ground + 1.0);
            [Point::new(p.x, p.y, ground), Point::new(p.x, p.y, top)]
        } else {
            let yaw = random.between(0.0, std::f64::consts::PI);
            let half = Vector::new(yaw.cos(), yaw.sin(), 0.0)
                * (0.5 * random.between(LENGTH[0], LENGTH[1]));
            [p - half, p + half]
        };
        let is_clear = standing.iter().all(|q| off(q, &ends) > ASIDE + radius);
        if p.z < ground + 0.2 || !is_clear {
            continue;
        }
        let anchors = ends.map(|p| Anchor { robot: None, link: None, xyz: p.coords.into() });
        let thing = Hose { name: name.into(), anchors: anchors.to_vec(), radius, sag: 0.0 };
        return Ok(Some((thing, to)));
    }
    Ok(None)
}

/// How far a place is from a line between two others, metres.
pub(super) fn off(p: &Point, [a, b]: &[Point; 2]) -> f64 {
    let along = b - a;
    let at = ((p - a).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
    (p - (a + along * at)).norm()
}

/// A posture some way to another one that the robot can stand in.
fn target(robot: &SceneRobot<'_>, random: &mut Random) -> Result<Vec<f64>> {
    let &SceneRobot { scene, model, ref posture, world_from_base: base, .. } = robot;
    let above = |p: &Point| p.z > scene.ground(p.x, p.y);
    let to = Postures::new(model).draw(random, &base, above)?;
    Ok(between(posture, &to, random.between(0.3, 1.0)))
}

/// Paths of a robot, beside those into thin things.
pub(super) fn paths(
    robot: &SceneRobot<'_>,
    truth: &PathTruth<'_>,
    random: &mut Random,
) -> Result<Vec<DrawnPath>> {
    let (model, from) = (robot.model, &robot.posture[..]);
    let mut out = Vec::new();
    for _ in 0..N_SMALL {
        out.push(DrawnPath { drawn: PathKind::Small, to: small(model, from, 0, random) });
    }
    for _ in 0..N_FAR {
        let to = target(robot, random)?;
        out.push(DrawnPath { drawn: PathKind::Far, to });
    }
    for _ in 0..N_HIT {
        for _ in 0..N_TRIES {
            let to = target(robot, random)?;
            if truth.along(from, &to, TOUCH).gap <= TOUCH {
                out.push(DrawnPath { drawn: PathKind::Hit, to });
                break;
            }
        }
    }
    for _ in 0..N_WRIST {
        let to = small(model, from, from.len() / 2, random);
        out.push(DrawnPath { drawn: PathKind::Wrist, to });
    }
    Ok(out)
}

/// One to three joints from `first` on turned by little, within their limits.
fn small(model: &Model, from: &[f64], first: usize, random: &mut Random) -> Vec<f64> {
    let mut to = from.to_vec();
    for _ in 0..=random.below(3) {
        let joint = first + random.below(to.len() - first);
        let slides = model.joints[model.free[joint]].kind == robot::JointKind::Prismatic;
        let far = random.between(SMALL[0], SMALL[1]) * if slides { 0.2 } else { 1.0 };
        let way = if random.unit() < 0.5 { far } else { -far };
        let [low, high] = model.limits(joint);
        to[joint] = (from[joint] + way).clamp(low, high);
    }
    to
}
