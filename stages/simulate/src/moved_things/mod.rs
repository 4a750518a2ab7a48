//! Two scenes of a hall with three things that were pushed and turned between two sessions, each
//! scanned from other stations, and the true motion of each thing.

mod bodies;

pub use bodies::MovableKind;

use crate::random::Random;
use crate::scene::{BeamRaster, Cuboid, RegistrationError, Scanner, Scene};
use crate::simulator::Simulator;
use crate::spot::{bare_hall, scanner};
use bodies::{parts, placed};
use contract::{Error, Result};
use geometry::{Point, Pose, Vector};
use nalgebra::{Translation3, UnitQuaternion};
use std::collections::BTreeSet;

/// Number of things that are moved.
const N_THINGS: usize = 3;
/// Length and width of the hall, least and most, metres.
const HALL: [[f64; 2]; 2] = [[10.0, 9.0], [14.0, 12.0]];
/// Least and greatest distance by which a thing is pushed, metres; its logarithm is drawn.
const PUSHED: [f64; 2] = [0.05, 3.0];
/// Free space between two things, and around a station, metres.
const FREE: [f64; 2] = [0.12, 0.6];
/// Standard deviations of the registration errors of the stations: metres, degrees.
const OFF: [f64; 2] = [0.003, 0.01];
/// Angle between the beams that tell which sides of a thing are seen, degrees.
const COARSE: f64 = 0.4;
/// A side is seen if the beams meet this share of its squares, as far as there are any, of
/// [`SQUARE`] metres.
const SEEN: f64 = 0.35;
const SQUARE: f64 = 0.1;
/// Number of places that are tried for each object.
const TRIES: usize = 400;
/// Number of halls that are tried.
const N_HALLS: u64 = 20;

/// Parameters of the two scenes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MovedThings {
    /// Seed of all random choices.
    pub seed: u64,
    /// Angle between beams, degrees.
    pub step_deg: f64,
}

/// A thing that was moved, as it really was.
#[derive(Debug, Clone, PartialEq)]
pub struct TrueThing {
    /// What it is.
    pub kind: MovableKind,
    /// Name of its boxes in the scenes.
    pub name: String,
    /// Length, width and height, metres.
    pub size: [f64; 3],
    /// `world_from_thing` in the earlier and in the later session; the frame's origin is the middle
    /// of the footprint, z points up.
    pub poses: [Pose; 2],
    /// The upright sides, as turns of a quarter from +x on, of which each session sees a good part.
    pub sides: [BTreeSet<usize>; 2],
}

/// Draws the scenes of both sessions.
///
/// # Errors
/// `BadInput` if no hall had space for all things.
pub fn moved_things(wanted: &MovedThings) -> Result<([Scene; 2], Vec<TrueThing>)> {
    let drawn = (0..N_HALLS).find_map(|attempt| one_hall(wanted, attempt));
    let (scenes, mut things) =
        drawn.ok_or_else(|| Error::bad_input("no hall has room for the things"))?;
    for (k, scene) in scenes.iter().enumerate() {
        let seen = sides_seen(scene, &things, k)?;
        things.iter_mut().zip(seen).for_each(|(thing, sides)| thing.sides[k] = sides);
    }
    Ok((scenes, things))
}

/// A disc on the ground that is taken in one session or in both.
#[derive(Clone, Copy)]
struct Taken {
    xy: [f64; 2],
    radius: f64,
}

impl Taken {
    fn is_clear(&self, others: &[Self], gap: f64) -> bool {
        let apart = |o: &Self| (self.xy[0] - o.xy[0]).hypot(self.xy[1] - o.xy[1]);
        others.iter().all(|o| apart(o) > self.radius + o.radius + gap)
    }

    fn is_inside(&self, size: [f64; 3]) -> bool {
        (0..2).all(|i| self.xy[i].abs() + self.radius < 0.5 * size[i] - 0.05)
    }
}

fn one_hall(wanted: &MovedThings, attempt: u64) -> Option<([Scene; 2], Vec<TrueThing>)> {
    let mut random = Random::keyed(&[wanted.seed, 0x5417, attempt]);
    let random = &mut random;
    let [x, y] = [0, 1].map(|i| random.between(HALL[0][i], HALL[1][i]));
    let size = [x, y, random.between(4.5, 6.0)];
    let has_ceiling = random.unit() < 0.5;
    let mut scene = bare_hall(wanted.seed, size, has_ceiling, random);
    let mut taken = furniture(&mut scene, size, random);
    let mut scenes = [scene.clone(), scene];
    scenes[1].seed ^= 0x5E55_1045;
    let mut things = Vec::new();
    for k in 0..N_THINGS {
        let thing = thing(&mut scenes, &mut taken, (k, size), random)?;
        things.push(thing);
    }
    screens(&mut scenes, &mut taken, &things, random);
    for (k, scene) in scenes.iter_mut().enumerate() {
        scene.scanners = stations(scene, &taken, (k, size), wanted.step_deg, random)?;
    }
    Some((scenes, things))
}

/// Machines and posts that stand still; returns where they stand.
fn furniture(scene: &mut Scene, size: [f64; 3], random: &mut Random) -> Vec<Taken> {
    let mut taken = Vec::new();
    for k in 0..4 + random.below(5) {
        let body = [random.between(0.3, 1.2), random.between(0.3, 0.9), random.between(0.5, 2.4)];
        let radius = 0.5 * body[0].hypot(body[1]);
        let half = |i: usize| 0.5 * size[i] - radius - 0.1;
        let xy = [0, 1].map(|i| random.between(-half(i), half(i)));
        let own = Taken { xy, radius };
        if !own.is_clear(&taken, 0.8) {
            continue;
        }
        taken.push(own);
        scene.boxes.push(Cuboid {
            name: format!("machine {k}"),
            xyz: [xy[0], xy[1], scene.ground(xy[0], xy[1]) + 0.5 * body[2]],
            size: body,
            rpy_deg: [0.0, 0.0, random.between(0.0, 90.0)],
            reflectance: 0.6,
        });
    }
    taken
}

/// Draws a thing and both its places, and adds it to the scenes.
fn thing(
    scenes: &mut [Scene; 2],
    taken: &mut Vec<Taken>,
    (k, hall): (usize, [f64; 3]),
    random: &mut Random,
) -> Option<TrueThing> {
    let kind = MovableKind::ALL[random.below(MovableKind::ALL.len())];
    let (parts, size) = parts(kind, random);
    let radius = 0.5 * size[0].hypot(size[1]);
    for _ in 0..TRIES {
        let place = [0, 1].map(|i| random.between(-0.5, 0.5) * (hall[i] - 2.0 * radius));
        let (way, log) = (random.between(-180.0, 180.0).to_radians(), PUSHED.map(f64::ln));
        let far = random.between(log[0], log[1]).exp();
        let pushed = [place[0] + far * way.cos(), place[1] + far * way.sin()];
        let both = [place, pushed].map(|xy| Taken { xy, radius });
        let is_free = |t: &Taken| t.is_clear(taken, FREE[0]) && t.is_inside(hall);
        if !both.iter().all(is_free) {
            continue;
        }
        let yaw = random.between(-180.0, 180.0);
        // Half are pushed with hardly a turn.
        let most = if random.unit() < 0.5 { 5.0 } else { 180.0 };
        let yaws = [yaw, yaw + random.between(-most, most)];
        let name = format!("{} {k}", kind.name());
        let reflectance = random.between(0.3, 0.8);
        let pose = |s: usize| {
            let [x, y] = both[s].xy;
            let turn = UnitQuaternion::from_axis_angle(&Vector::z_axis(), yaws[s].to_radians());
            Pose::from_parts(Translation3::new(x, y, scenes[s].ground(x, y)), turn)
        };
        let poses = [pose(0), pose(1)];
        for (scene, pose) in scenes.iter_mut().zip(&poses) {
            scene.boxes.extend(placed(&parts, &name, pose, reflectance));
        }
        taken.extend(both);
        let sides = [BTreeSet::new(), BTreeSet::new()];
        return Some(TrueThing { kind, name, size, poses, sides });
    }
    None
}

/// Adds boards that hide parts of some things, in one session or in both.
fn screens(
    scenes: &mut [Scene; 2],
    taken: &mut Vec<Taken>,
    things: &[TrueThing],
    random: &mut Random,
) {
    for (k, thing) in things.iter().enumerate() {
        let (when, way) = (random.below(2), random.between(-180.0, 180.0).to_radians());
        let far = 0.5 * thing.size[0].hypot(thing.size[1]) + random.between(0.45, 1.0);
        let at = thing.poses[when].translation.vector;
        let xy = [at.x + far * way.cos(), at.y + far * way.sin()];
        let board = Cuboid {
            name: format!("board {k}"),
            xyz: [xy[0], xy[1], scenes[0].ground(xy[0], xy[1]) + 0.6],
            size: [0.04, random.between(0.5, 0.7), 1.2],
            rpy_deg: [0.0, 0.0, way.to_degrees()],
            reflectance: 0.5,
        };
        let own = Taken { xy, radius: 0.35 };
        if random.unit() < 0.5 && own.is_clear(taken, 0.05) {
            taken.push(own);
            scenes.iter_mut().for_each(|scene| scene.boxes.push(board.clone()));
        }
    }
}

/// Draws two to four stations.
fn stations(
    scene: &Scene,
    taken: &[Taken],
    (session, size): (usize, [f64; 3]),
    step_deg: f64,
    random: &mut Random,
) -> Option<Vec<Scanner>> {
    let mut out: Vec<Scanner> = Vec::new();
    let n = 2 + random.below(3);
    for _ in 0..TRIES {
        if out.len() == n {
            break;
        }
        let half = |i: usize| 0.5 * size[i] - 0.8;
        let xy = [0, 1].map(|i| random.between(-half(i), half(i)));
        let others = out.iter().map(|s| Taken { xy: [s.position[0], s.position[1]], radius: 1.2 });
        let others: Vec<Taken> = others.collect();
        let own = Taken { xy, radius: 0.0 };
        if !own.is_clear(taken, FREE[1]) || !own.is_clear(&others, FREE[1]) {
            continue;
        }
        let raster = BeamRaster { elevation_deg: [-60.0, 70.0], step_deg, ..BeamRaster::default() };
        let z = scene.ground(xy[0], xy[1]) + random.between(1.5, 2.1);
        let name = format!("session_{}_{}", session + 1, out.len() + 1);
        let mut one = scanner(name, [xy[0], xy[1], z], raster);
        one.rpy_deg = [0.0, 0.0, random.between(-180.0, 180.0)];
        one.registration = RegistrationError::drawn(OFF, random);
        out.push(one);
    }
    (out.len() == n).then_some(out)
}

/// The sides of each thing of which the stations of session `k` see a good part, found by casting
/// few beams.
fn sides_seen(scene: &Scene, things: &[TrueThing], k: usize) -> Result<Vec<BTreeSet<usize>>> {
    let mut coarse = scene.clone();
    coarse.scanners.iter_mut().for_each(|s| {
        s.raster.step_deg = COARSE;
        s.registration = RegistrationError::default();
    });
    let simulator = Simulator::new(&coarse, &[])?;
    let objects = simulator.truth().objects;
    let mut squares = vec![BTreeSet::new(); things.len()];
    for i in 0..simulator.n_scans() {
        let scan = simulator.scan(i);
        let points = scan.columns.hit.iter().zip(&scan.columns.xyz).zip(&scan.columns.object);
        for ((_, xyz), object) in points.filter(|((hit, _), _)| **hit) {
            let name = &objects[usize::from(*object)];
            let own = things.iter().position(|t| name.ends_with(&t.name));
            let Some(own) = own else { continue };
            let thing = &things[own];
            let world = scan.frame.true_world_from_scan * Point::from(*xyz);
            let p = thing.poses[k].inverse_transform_point(&world);
            squares[own].extend(square_of(&p, thing.size));
        }
    }
    let is_seen = |thing: &TrueThing, squares: &BTreeSet<(usize, i32, i32)>, side: usize| {
        let n = squares.iter().filter(|s| s.0 == side).count() as f64;
        n >= SEEN * thing.kind.filled() * thing.size[1 - side % 2] * thing.size[2]
            / (SQUARE * SQUARE)
    };
    let sides = things.iter().zip(&squares);
    Ok(sides.map(|(t, s)| (0..4).filter(|side| is_seen(t, s, *side)).collect()).collect())
}

/// The side of its box that a point of a thing (thing's frame) lies nearest to, and the square on
/// it; `None` for points farther inside than an eighth of the width: what stands on a deck.
fn square_of(p: &Point, size: [f64; 3]) -> Option<(usize, i32, i32)> {
    let depth =
        [0.5 * size[0] - p.x, 0.5 * size[1] - p.y, 0.5 * size[0] + p.x, 0.5 * size[1] + p.y];
    let side = (0..4).min_by(|&a, &b| depth[a].total_cmp(&depth[b]))?;
    let along = if side % 2 == 0 { p.y } else { p.x };
    let cell = |v: f64| (v / SQUARE).floor() as i32;
    // A point of the top beside an edge is none of the side.
    let is_top = p.z > size[2] - 0.02;
    (depth[side] < 0.125 * size[0].min(size[1]) && !is_top).then(|| (side, cell(along), cell(p.z)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn things_move_as_is_said_and_sides_that_face_stations_are_seen() {
        let wanted = MovedThings { seed: 5, step_deg: 1.0 };
        let ([then, now], things) = moved_things(&wanted).expect("is drawn");
        assert_eq!(moved_things(&wanted).expect("again").1, things);
        assert_eq!(things.len(), N_THINGS);
        assert!(!then.scanners.is_empty() && then.scanners != now.scanners);
        for thing in &things {
            let shift = thing.poses[1].translation.vector - thing.poses[0].translation.vector;
            assert!((PUSHED[0] - 0.01..PUSHED[1] + 0.01).contains(&shift.norm()), "{shift}");
            let of = |scene: &Scene| {
                let own = scene.boxes.iter().filter(|b| b.name == thing.name);
                own.map(|b| b.size).collect::<Vec<_>>()
            };
            assert!(!of(&then).is_empty() && of(&then) == of(&now));
            assert!(thing.sides.iter().any(|sides| !sides.is_empty()), "{thing:?}");
        }
    }

    #[test]
    fn a_drum_is_round() {
        let (parts, [width, _, height]) = parts(MovableKind::Drum, &mut Random::keyed(&[3]));
        let boxes = placed(&parts, "drum", &Pose::identity(), 0.5);
        let corner = boxes.iter().map(|b| 0.5 * b.size[0].hypot(b.size[1])).fold(0.0, f64::max);
        assert!(corner - 0.5 * width < 0.004 && (boxes[0].size[2] - height).abs() < 1e-12);
    }
}
