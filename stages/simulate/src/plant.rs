//! Random scenes of plants, as crowded as real ones: a cell, a line, or a hall without robots.
//! Robots of mixed models stand on floor and stands with hoses, tools and carried parts, between
//! fences, conveyors, machines, posts and people.

use crate::hand::{part_in, tool_on};
use crate::random::Random;
use crate::scene::{
    Anchor, BeamRaster, Column, Cuboid, Fence, FenceFilling, Furniture, Hose, Later, Scene,
    Section, StandShape, ToolShape,
};
use crate::spot::{RobotSpot, bare_hall, scanner};
use contract::{Error, Result};
use geometry::Point;
use robot::{Model, Role};

/// Parameters of a plant scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Plant {
    /// Seed of all random choices.
    pub seed: u64,
    /// Number of robots; with 0 the hall has furniture only.
    pub n_robots: usize,
    /// Number of rows of robots; between two rows runs a conveyor.
    pub n_rows: usize,
    /// Number of scanners.
    pub n_scanners: usize,
    /// Angle between beams, degrees.
    pub step_deg: f64,
    /// Whether fences, conveyors and carried parts touch the robots.
    pub is_tight: bool,
    /// Whether one robot moves after half of the scans.
    pub moves: bool,
}

/// Space around a robot on each side of its base, as share of its reach.
const ROOM: f64 = 0.95;
/// Smallest such space, metres.
const MIN_ROOM: f64 = 0.9;
/// Width of the aisles around a row, metres.
const AISLE: f64 = 1.8;
/// Width of the conveyor's way between two rows, metres.
const WAY: f64 = 1.4;
/// Range of elevations of a scanner, degrees.
const DOME: [f64; 2] = [-60.0, 70.0];
/// Number of samples of a link from which its reach is computed.
const N_SAMPLES: usize = 40;

/// The space of one robot.
struct Room<'a> {
    model: &'a Model,
    min: [f64; 2],
    max: [f64; 2],
}

/// Draws a random scene.
///
/// # Errors
/// `BadInput` if the library holds no robot, or if a room is too narrow for its robot.
pub fn plant(wanted: &Plant, models: &[Model]) -> Result<Scene> {
    let robots: Vec<&Model> = models.iter().filter(|m| !m.is_tool()).collect();
    if robots.is_empty() && wanted.n_robots > 0 {
        return Err(Error::bad_input("the library holds no robot"));
    }
    let mut random = Random::keyed(&[wanted.seed, 0x91A]);
    let (rooms, size) = rooms(wanted, &robots, &mut random);
    let size_and_height = [size[0], size[1], random.between(5.0, 8.0)];
    let has_ceiling = random.unit() < 0.7;
    let mut scene = bare_hall(wanted.seed, size_and_height, has_ceiling, &mut random);
    furnish(&mut scene, wanted, &rooms, size, &mut random);
    for (k, room) in rooms.iter().enumerate() {
        stand(&mut scene, room, k, wanted.moves && k == 0, wanted, &mut random)?;
    }
    scanners(&mut scene, wanted, &rooms, size, &mut random);
    if let (true, Some(robot)) = (wanted.moves, scene.robots.first_mut()) {
        let half = scene.scanners.iter().skip(wanted.n_scanners / 2);
        let names: Vec<String> = half.map(|s| s.name.clone()).collect();
        robot.later.iter_mut().for_each(|l| l.scanners.clone_from(&names));
    }
    Ok(scene)
}

/// Rooms in rows, and the size of the hall around them, metres.
fn rooms<'a>(
    wanted: &Plant,
    robots: &[&'a Model],
    random: &mut Random,
) -> (Vec<Room<'a>>, [f64; 2]) {
    let n_rows = wanted.n_rows.max(1);
    let of_row = wanted.n_robots.div_ceil(n_rows);
    let chosen: Vec<(&Model, f64)> = (0..wanted.n_robots)
        .map(|_| {
            let model = robots[random.below(robots.len())];
            (model, (ROOM * reach(model)).max(MIN_ROOM))
        })
        .collect();
    let rows: Vec<&[(&Model, f64)]> = chosen.chunks(of_row.max(1)).collect();
    let width = |row: &&[(&'a Model, f64)]| row.iter().map(|r| 2.0 * r.1).sum::<f64>();
    let depth = |row: &&[(&'a Model, f64)]| row.iter().map(|r| 2.0 * r.1).fold(0.0, f64::max);
    let length = rows.iter().map(width).fold(4.0, f64::max) + 2.0 * AISLE;
    let across = rows.iter().map(depth).sum::<f64>() + WAY * (n_rows - 1) as f64 + 2.0 * AISLE;
    let size = [length.max(9.0), across.max(8.0)];
    let mut out = Vec::new();
    let mut y = AISLE - 0.5 * across;
    for row in &rows {
        let mut x = -0.5 * width(row);
        for (model, half) in *row {
            let middle = y + 0.5 * depth(row);
            out.push(Room { model, min: [x, middle - half], max: [x + 2.0 * half, middle + half] });
            x += 2.0 * half;
        }
        y += depth(row) + WAY;
    }
    (out, size)
}

/// Largest horizontal distance of a robot's parts from its base over a few postures, metres.
pub(crate) fn reach(model: &Model) -> f64 {
    let mut random = Random::keyed(&[7]);
    let mut all: Vec<f64> = (0..24)
        .map(|_| {
            let posture: Vec<f64> = (0..model.free.len())
                .map(|j| {
                    let [low, high] = model.limits(j);
                    random.between(low, high)
                })
                .collect();
            let poses = model.poses(&posture);
            let far = model.links.iter().zip(&poses).flat_map(|(link, pose)| {
                let step = (link.mesh.vertices.len() / N_SAMPLES).max(1);
                link.mesh.vertices.iter().step_by(step).map(move |v| {
                    let p = pose * Point::from(v.map(f64::from));
                    p.x.hypot(p.y)
                })
            });
            far.fold(0.0, f64::max)
        })
        .collect();
    all.sort_by(f64::total_cmp);
    all[all.len() * 3 / 4]
}

/// Adds everything that does not move.
fn furnish(
    scene: &mut Scene,
    wanted: &Plant,
    rooms: &[Room<'_>],
    size: [f64; 2],
    random: &mut Random,
) {
    let gap = if wanted.is_tight { 0.02 } else { 0.25 };
    for (k, room) in rooms.iter().enumerate() {
        let (w, d) = (room.max[0] - room.min[0], room.max[1] - room.min[1]);
        // A fence on one side of the room, across to the next one or along the aisle.
        if random.unit() < 0.5 {
            let x = room.max[0] - 0.03;
            scene.fences.push(fence(
                format!("between {k}"),
                [x, room.min[1]],
                [x, room.max[1]],
                random,
            ));
        }
        if random.unit() < 0.5 {
            let y = if random.unit() < 0.5 { room.min[1] } else { room.max[1] };
            scene.fences.push(fence(
                format!("along {k}"),
                [room.min[0], y],
                [room.max[0], y],
                random,
            ));
        }
        if random.unit() < 0.7 {
            // A conveyor or a bench beside the foot.
            let side = if random.unit() < 0.5 { 1.0 } else { -1.0 };
            let width = random.between(0.4, 0.7);
            let foot = foot_radius(room.model) + 0.5 * width + gap + random.between(0.0, 0.2);
            let middle = [0.5 * (room.min[0] + room.max[0]), 0.5 * (room.min[1] + room.max[1])];
            let piece = Furniture {
                name: format!("beside {k}"),
                xy: [middle[0], middle[1] + side * foot.min(0.5 * d - 0.5 * width)],
                yaw_deg: 0.0,
                size: [0.8 * w, width, random.between(0.5, 0.9)],
            };
            if random.unit() < 0.6 {
                scene.conveyors.push(piece);
            } else {
                scene.benches.push(piece);
            }
        }
        if random.unit() < 0.6 {
            let corner = [room.min[0] + 0.35, room.min[1] + 0.35];
            crate_at(scene, &format!("controller {k}"), corner, [0.5, 0.6, 1.4], random);
        }
    }
    stuff(scene, size, if rooms.is_empty() { 14 } else { 5 }, random);
}

fn fence(name: String, from: [f64; 2], to: [f64; 2], random: &mut Random) -> Fence {
    let filling = if random.unit() < 0.75 { FenceFilling::Wires } else { FenceFilling::Panel };
    Fence { name, from, to, height: random.between(1.4, 2.2), filling }
}

fn crate_at(scene: &mut Scene, name: &str, [x, y]: [f64; 2], size: [f64; 3], random: &mut Random) {
    scene.boxes.push(Cuboid {
        name: name.into(),
        xyz: [x, y, scene.ground(x, y) + 0.5 * size[2]],
        size,
        rpy_deg: [0.0, 0.0, random.between(-15.0, 15.0)],
        reflectance: random.between(0.1, 0.9),
    });
}

/// Adds posts, cranes, machines and people in the aisles, or everywhere in a hall without robots.
fn stuff(scene: &mut Scene, size: [f64; 2], n: usize, random: &mut Random) {
    for k in 0..n {
        let along = random.unit() < 0.5;
        let wall = if random.unit() < 0.5 { 1.0 } else { -1.0 };
        let edge = 0.5 * size[1] - random.between(0.4, 0.9);
        let at = if n > 8 {
            [random.between(-0.42, 0.42) * size[0], random.between(-0.42, 0.42) * size[1]]
        } else if along {
            [random.between(-0.45, 0.45) * size[0], wall * edge]
        } else {
            [wall * (0.5 * size[0] - random.between(0.4, 0.9)), random.between(-0.4, 0.4) * size[1]]
        };
        match random.below(5) {
            0 => scene.columns.push(Column {
                name: format!("post {k}"),
                xy: at,
                radius: random.between(0.08, 0.2),
                height: random.between(2.0, 4.5),
                section: if random.unit() < 0.5 { Section::Round } else { Section::IBeam },
            }),
            1 => {
                // A jib crane: a post and an arm.
                let height = random.between(2.2, 3.2);
                scene.columns.push(Column {
                    name: format!("crane {k}"),
                    xy: at,
                    radius: 0.12,
                    height,
                    section: Section::Round,
                });
                let length = random.between(1.0, 2.0);
                scene.boxes.push(Cuboid {
                    name: format!("jib {k}"),
                    xyz: [at[0], at[1], scene.ground(at[0], at[1]) + height - 0.1],
                    size: [length, 0.12, 0.2],
                    rpy_deg: [0.0, 0.0, random.between(0.0, 360.0)],
                    reflectance: 0.6,
                });
            }
            2 => person(scene, &format!("person {k}"), at, random),
            3 => {
                // A machine: a low and a high part.
                crate_at(scene, &format!("machine {k}"), at, [0.8, 0.7, 0.9], random);
                let high = [at[0] + 0.15, at[1] + 0.1];
                let size = [0.4, 0.4, random.between(1.3, 1.9)];
                crate_at(scene, &format!("head {k}"), high, size, random);
            }
            _ => crate_at(scene, &format!("crate {k}"), at, [0.6, 0.4, 0.6], random),
        }
    }
}

/// Adds a person who does not move.
fn person(scene: &mut Scene, name: &str, [x, y]: [f64; 2], random: &mut Random) {
    let ground = scene.ground(x, y);
    let yaw = random.between(0.0, 360.0);
    for (part, z, size) in [
        ("legs", 0.45, [0.25, 0.35, 0.9]),
        ("body", 1.15, [0.25, 0.45, 0.5]),
        ("head", 1.6, [0.2, 0.18, 0.28]),
    ] {
        scene.boxes.push(Cuboid {
            name: format!("{part} of {name}"),
            xyz: [x, y, ground + z],
            size,
            rpy_deg: [0.0, 0.0, yaw],
            reflectance: 0.4,
        });
    }
}

/// Adds a robot in its room, with what it carries.
fn stand(
    scene: &mut Scene,
    room: &Room<'_>,
    k: usize,
    later: bool,
    wanted: &Plant,
    random: &mut Random,
) -> Result<()> {
    let name = format!("R{}", k + 1);
    let stand = if random.unit() < 0.4 { random.between(0.15, 0.6) } else { 0.0 };
    let grow = if wanted.is_tight { 0.0 } else { 0.08 };
    let spot = RobotSpot {
        name: name.clone(),
        model: &room.model.name,
        xy: [0.5 * (room.min[0] + room.max[0]), 0.5 * (room.min[1] + room.max[1])],
        stand,
        side: 0.9,
        shape: if stand > 0.3 { StandShape::Pedestal } else { StandShape::Plinth },
        yaw_deg: [-180.0, 180.0],
        load: None,
        min: room.min.map(|v| v + grow),
        max: room.max.map(|v| v - grow),
    };
    let mut place = spot.place(scene, room.model, random)?;
    place.xyz[2] -= lowest(room.model);
    if later {
        let again = spot.place(scene, room.model, random)?;
        place.later.push(Later { scanners: Vec::new(), posture: again.posture });
    }
    // A robot with a tool in its model gets no other tool.
    let is_armed = room.model.links.iter().any(|link| link.role == Role::Effector);
    let hand = room.model.flanges().first().copied().filter(|_| !is_armed);
    if let Some(hand) = hand.filter(|_| random.unit() < 0.7) {
        let shapes = [ToolShape::Gripper, ToolShape::Cups, ToolShape::Torch];
        let shape = shapes[random.below(shapes.len())];
        let length = (0.12 * reach(room.model)).clamp(0.1, 0.35);
        let tool = tool_on(room.model, hand, shape, length);
        if shape != ToolShape::Torch && random.unit() < 0.5 {
            let side = (0.2 * reach(room.model)).clamp(0.1, 0.5);
            scene.carried.push(part_in(&tool, &name, [side, 0.7 * side, side]));
        }
        place.tool = Some(tool);
    }
    hoses(scene, room.model, &name, random);
    scene.robots.push(place);
    Ok(())
}

/// Largest horizontal distance of a corner of the first link with a body from the base, metres.
pub(crate) fn foot_radius(model: &Model) -> f64 {
    let poses = model.poses(&model.home());
    let standing = model.links.iter().zip(&poses).find(|(l, _)| !l.mesh.vertices.is_empty());
    standing.map_or(0.3, |(link, pose)| {
        let corners = link.mesh.vertices.iter().map(|v| pose * Point::from(v.map(f64::from)));
        corners.map(|p| p.x.hypot(p.y)).fold(0.0, f64::max)
    })
}

/// Height of the lowest corner of the first link with a body, metres.
pub(crate) fn lowest(model: &Model) -> f64 {
    let poses = model.poses(&model.home());
    let standing = model.links.iter().zip(&poses).find(|(l, _)| !l.mesh.vertices.is_empty());
    standing.map_or(0.0, |(link, pose)| {
        let heights = link.mesh.vertices.iter().map(|v| (pose * Point::from(v.map(f64::from))).z);
        heights.fold(f64::INFINITY, f64::min)
    })
}

/// Adds cables from link to link, with their ends on the surfaces.
fn hoses(scene: &mut Scene, model: &Model, name: &str, random: &mut Random) {
    let bodies: Vec<usize> = model
        .main_chain
        .iter()
        .map(|&j| model.joints[j].child)
        .filter(|&l| model.links[l].cad.points.len() > 100)
        .collect();
    for k in 1..bodies.len().saturating_sub(1).min(4) {
        if random.unit() < 0.4 {
            continue;
        }
        let radius = random.between(0.012, 0.025);
        let on = |link: usize, random: &mut Random| {
            let cad = &model.links[link].cad;
            let i = random.below(cad.points.len());
            let lift = radius as f32 * 1.2;
            let p: [f32; 3] = std::array::from_fn(|a| cad.points[i][a] + lift * cad.normals[i][a]);
            Anchor {
                robot: Some(name.into()),
                link: Some(model.links[link].name.clone()),
                xyz: p.map(f64::from),
            }
        };
        let anchors = vec![on(bodies[k], random), on(bodies[k + 1], random)];
        let name = format!("cable {k} of {name}");
        scene.hoses.push(Hose { name, anchors, radius, sag: random.between(0.05, 0.2) });
    }
}

/// Adds scanners in the aisles and between rooms, each in a different place.
fn scanners(
    scene: &mut Scene,
    wanted: &Plant,
    rooms: &[Room<'_>],
    size: [f64; 2],
    random: &mut Random,
) {
    let inner = [0.5 * size[0] - 0.5 * AISLE, 0.5 * size[1] - 0.5 * AISLE];
    let around = 4.0 * (inner[0] + inner[1]);
    for k in 0..wanted.n_scanners {
        // Evenly around the hall, with every third in its middle where there is space.
        let mut at = (k as f64 + random.between(0.2, 0.8)) / wanted.n_scanners as f64 * around;
        let mut xy = [-inner[0], -inner[1]];
        for (axis, way) in [(0, 1.0), (1, 1.0), (0, -1.0), (1, -1.0)] {
            let part = at.clamp(0.0, 2.0 * inner[axis]);
            xy[axis] += way * part;
            at -= part;
        }
        if k % 3 == 2 && rooms.len() > 3 {
            xy[1] = 0.0;
        }
        let raster =
            BeamRaster { elevation_deg: DOME, step_deg: wanted.step_deg, ..BeamRaster::default() };
        let z = scene.ground(xy[0], xy[1]) + random.between(1.5, 2.3);
        let mut one = scanner(format!("scan_{}", k + 1), [xy[0], xy[1], z], raster);
        one.rpy_deg = [0.0, 0.0, random.between(-180.0, 180.0)];
        scene.scanners.push(one);
    }
}
