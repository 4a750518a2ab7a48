//! Hoses and dress packs of robots at work: along the arm, and from the building.

use super::worker::{Work, Worker};
use crate::plant::foot_radius;
use crate::random::Random;
use crate::scene::{Anchor, Column, Hose, Scene, Section};
use geometry::Point;
use std::f64::consts::TAU;

/// Least distance of a hose from links that do not hold it, metres.
const CLEAR: f64 = 0.04;
/// Length at the ends of a hose along which it may lie on a link, metres.
const HELD: f64 = 0.12;
/// Half of the width of a column that holds a hose, metres.
const COLUMN: f64 = 0.05;
/// Number of places that are drawn for a hose until one is clear of the arm.
const N_PLACES: usize = 40;

/// Where a hose from a link ends.
#[derive(Clone, Copy)]
enum HoseEnd {
    Ceiling,
    Floor,
    /// Clamped to a column, from where it runs on to the floor.
    Column,
    /// On another link.
    Link,
}

/// Adds the hoses of a robot.
pub(super) fn add(scene: &mut Scene, worker: &Worker<'_>, work: Work, random: &mut Random) {
    let ends: &[(HoseEnd, f64)] = match work {
        Work::Touch => &[(HoseEnd::Link, 0.7)],
        Work::Carry => &[(HoseEnd::Link, 0.5), (HoseEnd::Ceiling, 0.4)],
        Work::Hoses => &[
            (HoseEnd::Ceiling, 0.8),
            (HoseEnd::Floor, 0.6),
            (HoseEnd::Column, 0.5),
            (HoseEnd::Link, 0.7),
        ],
        Work::Joined => &[(HoseEnd::Ceiling, 0.6)],
    };
    for (end, chance) in ends {
        if random.unit() < *chance {
            for _ in 0..N_PLACES {
                if one(scene, worker, *end, random) {
                    break;
                }
            }
        }
    }
}

/// Draws one hose; adds it if it is clear of the arm.
fn one(scene: &mut Scene, worker: &Worker<'_>, end: HoseEnd, random: &mut Random) -> bool {
    let model = worker.model;
    let bodies: Vec<usize> = model
        .main_chain
        .iter()
        .map(|&j| model.joints[j].child)
        .filter(|&l| model.links[l].cad.points.len() > 100)
        .collect();
    if bodies.len() < 3 {
        return true;
    }
    let radius = random.between(0.012, 0.025);
    let first = 1 + random.below(bodies.len() - 1);
    let (anchor, start) = on_link(worker, bodies[first], radius, random);
    let mut hose = Hose {
        name: format!("{} of {}", scene.hoses.len(), worker.place.name),
        anchors: vec![anchor],
        radius,
        sag: random.between(0.02, 0.15),
    };
    let mut held = vec![start];
    let mut column = None;
    match end {
        HoseEnd::Ceiling => {
            let ceiling = scene.hall.as_ref().map_or(5.0, |hall| hall.size[2]);
            held.push(beside(start, 0.8, ceiling, random));
        }
        HoseEnd::Floor => {
            let p = beside(start, 1.2, 0.0, random);
            held.push(Point::new(p.x, p.y, scene.ground(p.x, p.y) + 1.2 * radius));
        }
        HoseEnd::Column => column = Some(to_column(scene, worker, radius, &mut held, random)),
        HoseEnd::Link => {
            let second = 1 + random.below(bodies.len() - 1);
            if second == first {
                return false;
            }
            let (anchor, p) = on_link(worker, bodies[second], radius, random);
            hose.anchors.push(anchor);
            held.push(p);
            // It hangs, or stands up as a stiff one does.
            let free = random.between(-0.3, 0.25);
            hose.sag = if free.abs() < 0.05 { 0.08 } else { free };
        }
    }
    let fixed = |p: &Point| Anchor { robot: None, link: None, xyz: p.coords.into() };
    hose.anchors.extend(held.iter().skip(hose.anchors.len()).map(fixed).collect::<Vec<_>>());
    if !is_clear(scene, worker, &held, hose.sag, column.as_ref()) {
        return false;
    }
    scene.columns.extend(column);
    scene.hoses.push(hose);
    true
}

/// An anchor on the surface of a link, and its place in the world, metres.
fn on_link(worker: &Worker<'_>, link: usize, radius: f64, random: &mut Random) -> (Anchor, Point) {
    let link_model = &worker.model.links[link];
    let cad = &link_model.cad;
    let i = random.below(cad.points.len());
    let lift = 0.9 * radius as f32;
    let p: [f32; 3] = std::array::from_fn(|a| cad.points[i][a] + lift * cad.normals[i][a]);
    let xyz = p.map(f64::from);
    let anchor =
        Anchor { robot: Some(worker.place.name.clone()), link: Some(link_model.name.clone()), xyz };
    (anchor, worker.world_from_links[link] * Point::from(xyz))
}

/// A place up to so far beside another along x and y, at this height, metres.
fn beside(start: Point, spread: f64, z: f64, random: &mut Random) -> Point {
    let mut by = || random.between(-spread, spread);
    Point::new(start.x + by(), start.y + by(), z)
}

/// Leads a hose to a clamp on a column beside the robot, and along the column to the floor.
fn to_column(
    scene: &Scene,
    worker: &Worker<'_>,
    radius: f64,
    held: &mut Vec<Point>,
    random: &mut Random,
) -> Column {
    let way = random.between(0.0, TAU);
    let apart = foot_radius(worker.model) + random.between(0.5, 0.9);
    let xy = [worker.place.xyz[0] + apart * way.cos(), worker.place.xyz[1] + apart * way.sin()];
    let height = random.between(1.2, 2.2);
    let side = COLUMN + radius;
    let at = [xy[0] - side * way.cos(), xy[1] - side * way.sin()];
    held.push(Point::new(at[0], at[1], height));
    held.push(Point::new(at[0], at[1], scene.ground(at[0], at[1]) + 0.02));
    Column {
        name: format!("of {}", worker.place.name),
        xy,
        radius: COLUMN,
        height: height + 0.1,
        section: Section::Round,
    }
}

/// Whether the first arc of a hose keeps clear of the arm, the ground and furniture, and its column
/// of the arm.
fn is_clear(
    scene: &Scene,
    worker: &Worker<'_>,
    held: &[Point],
    sag: f64,
    column: Option<&Column>,
) -> bool {
    let (a, b) = (held[0], held[1]);
    let length = (b - a).norm();
    let arc = |t: f64| {
        let mut p = a + (b - a) * t;
        p.z -= 4.0 * sag * length * t * (1.0 - t);
        p
    };
    let ends_on_link = held.len() == 2 && (b.z - scene.ground(b.x, b.y)) > 0.1;
    let path: Vec<Point> = (0..=40).map(|k| arc(f64::from(k) / 40.0)).collect();
    let free: Vec<&Point> = path
        .iter()
        .filter(|p| (*p - a).norm() > HELD && (!ends_on_link || (*p - b).norm() > HELD))
        .collect();
    let walls = crate::spot::keep_out(scene, "");
    let is_in_wall =
        |p: &&Point| walls.iter().any(|(a, b)| (0..3).all(|i| p[i] > a[i] && p[i] < b[i]));
    let near_ground = |p: &Point| p.z < scene.ground(p.x, p.y) + 0.01;
    let beside_column = |p: &Point| {
        column.is_some_and(|c| {
            (p.x - c.xy[0]).hypot(p.y - c.xy[1]) < c.radius + 0.1 && p.z < c.height
        })
    };
    length > 0.25
        && !free.iter().any(|p| near_ground(p))
        && !free.iter().any(is_in_wall)
        && worker
            .surface()
            .all(|(_, q)| !beside_column(&q) && free.iter().all(|p| (*p - q).norm() > CLEAR))
}
