//! Two scenes of a plant: the whole plant, and one of its cells scanned again weeks later. In
//! between a robot moved, a pallet was pushed, and a barrel was removed.

use crate::plant::{Plant, plant};
use crate::random::Random;
use crate::scene::{BeamRaster, Column, Cuboid, RegistrationError, Scene, Section};
use crate::spot::scanner;
use contract::{Error, Result};
use robot::Model;

/// Size of the loaded pallet, metres.
const PALLET: [f64; 3] = [1.2, 0.8, 0.7];
/// Radius and height of the barrel, metres.
const BARREL: [f64; 2] = [0.29, 0.88];
/// Free space around both, metres.
const FREE: f64 = 0.8;
/// Largest distance of the new scanners from the robot's base, metres.
const NEAR: f64 = 3.6;
/// Smallest distance of the new scanners from the walls, metres.
const WALL: f64 = 0.8;
/// Standard deviations of the new scans' registration errors: metres, degrees.
const OFF: [f64; 2] = [0.003, 0.01];
/// Free space around a new scanner, metres: the tripod's feet, and a person beside it.
const TRIPOD: f64 = 0.6;
/// Half-width of the space that a robot's foot takes, metres.
const ROBOT: f64 = 0.9;
/// Number of places that are tried.
const TRIES: usize = 2000;

/// The two scenes of a plant drawn as by [`plant`]; its first robot is the one that moves.
///
/// # Errors
/// As [`plant`]; also `BadInput` if the hall has no space for the pallet.
pub fn sessions(wanted: &Plant, models: &[Model]) -> Result<[Scene; 2]> {
    let mut then = plant(&Plant { moves: true, ..wanted.clone() }, models)?;
    let mut random = Random::keyed(&[wanted.seed, 0x5E5]);
    let later: Vec<_> = then.robots.iter_mut().flat_map(|r| std::mem::take(&mut r.later)).collect();
    let (Some(robot), Some(later)) = (then.robots.first(), later.into_iter().next()) else {
        return Err(Error::bad_input("a plant without robots has no cell"));
    };
    let at = [robot.xyz[0], robot.xyz[1]];
    let size = then.hall.as_ref().map_or([20.0; 3], |hall| hall.size);
    let new = new_scanners(&then, at, size, wanted.step_deg, &mut random)?;
    let mut taken: Vec<[f64; 2]> = new.iter().map(|s| [s.position[0], s.position[1]]).collect();
    let pallet = free(&then, at, size, &mut taken, &mut random)?;
    let pushed = free(&then, at, size, &mut taken, &mut random)?;
    let barrel = free(&then, at, size, &mut taken, &mut random)?;
    let mut now = then.clone();
    put_pallet(&mut then, pallet, random.between(-15.0, 15.0));
    put_pallet(&mut now, pushed, random.between(-15.0, 15.0));
    then.columns.push(Column {
        name: "barrel".into(),
        xy: barrel,
        radius: BARREL[0],
        height: BARREL[1],
        section: Section::Round,
    });
    now.robots[0].posture = later.posture;
    now.seed = wanted.seed ^ 0x5E55_1045;
    now.scanners = new;
    Ok([then, now])
}

fn put_pallet(scene: &mut Scene, [x, y]: [f64; 2], yaw: f64) {
    let z = scene.ground(x, y) + 0.5 * PALLET[2];
    scene.boxes.push(Cuboid {
        name: "pallet".into(),
        xyz: [x, y, z],
        size: PALLET,
        rpy_deg: [0.0, 0.0, yaw],
        reflectance: 0.6,
    });
}

/// Adds two scanners on two sides of the robot, with the registration errors of rescans.
fn new_scanners(
    scene: &Scene,
    at: [f64; 2],
    size: [f64; 3],
    step_deg: f64,
    random: &mut Random,
) -> Result<Vec<crate::scene::Scanner>> {
    let side = |axis: usize, random: &mut Random| {
        let to_wall = (at[axis] + 0.5 * size[axis] - WALL).min(NEAR);
        for _ in 0..TRIES {
            let mut xy = at;
            xy[axis] -= to_wall * random.between(0.75, 1.0);
            xy[1 - axis] += random.between(-1.5, 1.5);
            let inside = (0..2).all(|i| xy[i].abs() < 0.5 * size[i] - WALL);
            if inside && is_free(scene, xy) {
                return Ok(xy);
            }
        }
        Err(no_room("a scanner"))
    };
    let places = [side(0, random)?, side(1, random)?];
    let one = |(k, xy): (usize, [f64; 2])| {
        let raster = BeamRaster { elevation_deg: [-60.0, 70.0], step_deg, ..BeamRaster::default() };
        let z = scene.ground(xy[0], xy[1]) + random.between(1.6, 2.2);
        let mut out = scanner(format!("again_{}", k + 1), [xy[0], xy[1], z], raster);
        out.rpy_deg = [0.0, 0.0, random.between(-180.0, 180.0)];
        out.registration = RegistrationError::drawn(OFF, random);
        out
    };
    Ok(places.into_iter().enumerate().map(one).collect())
}

/// A free place on the floor near the robot.
fn free(
    scene: &Scene,
    at: [f64; 2],
    size: [f64; 3],
    taken: &mut Vec<[f64; 2]>,
    random: &mut Random,
) -> Result<[f64; 2]> {
    for _ in 0..TRIES {
        let along = random.between(-6.5, 6.5);
        let edge = random.between(0.7, 1.1);
        let p = if random.unit() < 0.5 {
            [at[0] + along, edge - 0.5 * size[1]]
        } else {
            [edge - 0.5 * size[0], at[1] + along]
        };
        let inside = (0..2).all(|i| p[i].abs() < 0.5 * size[i] - 0.65);
        let scanners =
            scene.scanners.iter().map(|s| Disc { xy: [s.position[0], s.position[1]], radius: 0.0 });
        let taken_up = scanners.chain(taken.iter().map(|xy| Disc { xy: *xy, radius: 0.45 }));
        if inside && !things(scene).chain(taken_up).any(|thing| is_near(p, thing, FREE)) {
            taken.push(p);
            return Ok(p);
        }
    }
    Err(no_room("the object to be moved"))
}

/// A disc on the ground, metres.
#[derive(Debug, Clone, Copy)]
struct Disc {
    xy: [f64; 2],
    radius: f64,
}

/// The smallest disc that contains each object of a scene.
fn things(scene: &Scene) -> impl Iterator<Item = Disc> + '_ {
    let boxes = scene.boxes.iter();
    let boxes = boxes.map(|b| {
        let radius = 0.5 * b.size[0].hypot(b.size[1]);
        Disc { xy: [b.xyz[0], b.xyz[1]], radius }
    });
    boxes.chain(scene.columns.iter().map(|c| Disc { xy: c.xy, radius: c.radius }))
}

/// Whether a place is less than `room` metres away from the edge of a disc.
fn is_near(p: [f64; 2], disc: Disc, room: f64) -> bool {
    (p[0] - disc.xy[0]).hypot(p[1] - disc.xy[1]) < room + disc.radius
}

/// Whether a place has space for a tripod.
fn is_free(scene: &Scene, xy: [f64; 2]) -> bool {
    let robots = scene.robots.iter().map(|r| Disc { xy: [r.xyz[0], r.xyz[1]], radius: ROBOT });
    let furniture = scene.benches.iter().chain(&scene.conveyors).map(|f| {
        let (sin, cos) = f.yaw_deg.to_radians().sin_cos();
        let (x, y) = (xy[0] - f.xy[0], xy[1] - f.xy[1]);
        let beside = |along: f64, length: f64| (along.abs() - 0.5 * length).max(0.0);
        beside(x * cos + y * sin, f.size[0]).hypot(beside(y * cos - x * sin, f.size[1]))
    });
    !things(scene).chain(robots).any(|thing| is_near(xy, thing, TRIPOD))
        && furniture.fold(f64::MAX, f64::min) > TRIPOD
}

fn no_room(what: &str) -> Error {
    Error::bad_input(format!("the hall has no room for {what}")).hint("draw another seed")
}
