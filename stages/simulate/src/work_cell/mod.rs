//! Random scenes of robots at work: tools that touch parts, carried parts with benches between the
//! robots, hoses from the building, and robots that form one body with what surrounds them.

mod hoses;
mod parts;
mod worker;

pub use worker::Work;

use crate::hand::tool_on;
use crate::plant::{foot_radius, lowest, reach};
use crate::posture::Postures;
use crate::random::Random;
use crate::scene::{
    BeamRaster, Cuboid, Fence, FenceFilling, Furniture, RobotPlace, Scene, SceneStand, StandShape,
    ToolShape, pose,
};
use crate::solid::cuboid;
use crate::spot::{bare_hall, keep_out, scanner};
use contract::{Error, Result};
use geometry::Point;
use robot::{Model, Role};
use std::f64::consts::TAU;
use worker::Worker;

/// Parameters of a scene of robots at work.
#[derive(Debug, Clone, PartialEq)]
pub struct WorkCell {
    /// Seed of all random choices.
    pub seed: u64,
    /// What the robots do.
    pub work: Work,
    /// Number of scanners.
    pub n_scanners: usize,
    /// Angle between beams, degrees.
    pub step_deg: f64,
}

/// Largest reach of a robot of these scenes, metres: larger ones would need halls of their own.
const MAX_REACH: f64 = 3.2;
/// Width of the aisles for scanners around the robots, metres.
const AISLE: f64 = 1.9;
/// Number of postures that are drawn until one suits the work.
const N_POSTURES: usize = 150;
/// Range of elevations of a scanner, degrees.
const DOME: [f64; 2] = [-60.0, 70.0];
/// Length of a tool beside its flange that may touch the wrist, metres.
const TOOL_FOOT: f64 = 0.05;

/// A robot that may stand in a scene.
#[derive(Clone, Copy)]
struct WorkRobot<'a> {
    model: &'a Model,
    /// Its reach from the base, metres.
    reach: f64,
}

impl WorkRobot<'_> {
    /// Space along the row on each side of its base, metres.
    fn room(&self) -> f64 {
        (0.9 * self.reach).max(0.8)
    }
}

/// Number of scenes that are drawn until one leaves each robot room for a posture.
const N_SCENES: u64 = 12;

/// Draws a random scene of robots at work.
///
/// # Errors
/// `BadInput` if the library holds no robot that fits into such a scene.
pub fn work_cell(wanted: &WorkCell, models: &[Model]) -> Result<Scene> {
    let robots: Vec<WorkRobot<'_>> = models
        .iter()
        .filter(|m| !m.is_tool() && !m.flanges().is_empty())
        .map(|model| WorkRobot { model, reach: reach(model) })
        .filter(|candidate| candidate.reach <= MAX_REACH)
        .collect();
    if robots.is_empty() {
        return Err(Error::bad_input("the library holds no robot for a work cell"));
    }
    let mut last = one_cell(wanted, &robots, 0);
    for k in 1..N_SCENES {
        if last.is_ok() {
            break;
        }
        last = one_cell(wanted, &robots, k);
    }
    last
}

/// The scene of one attempt.
fn one_cell(wanted: &WorkCell, robots: &[WorkRobot<'_>], attempt: u64) -> Result<Scene> {
    let mut random = Random::keyed(&[wanted.seed, 0x3C9, wanted.work as u64, attempt]);
    let n = match wanted.work {
        Work::Touch | Work::Joined => 1,
        Work::Carry => 2 + random.below(2),
        Work::Hoses => 2,
    };
    let chosen: Vec<WorkRobot<'_>> = (0..n).map(|_| robots[random.below(robots.len())]).collect();
    let half: Vec<f64> = chosen.iter().map(WorkRobot::room).collect();
    let length = 2.0 * half.iter().sum::<f64>();
    let depth = 2.0 * half.iter().copied().fold(0.0, f64::max);
    let size = [(length + 2.0 * AISLE).max(8.0), (depth + 2.0 * AISLE).max(7.0)];
    let size_and_height = [size[0], size[1], random.between(4.6, 6.0)];
    let mut scene = bare_hall(wanted.seed, size_and_height, true, &mut random);
    let mut x = -0.5 * length;
    let mut middles = Vec::new();
    for half in &half {
        middles.push(x + half);
        x += 2.0 * half;
    }
    surround(&mut scene, wanted.work, &chosen, &middles, depth, &mut random);
    for (k, candidate) in chosen.iter().enumerate() {
        let mut worker = worker(&mut scene, candidate, k, middles[k], wanted, &mut random)?;
        parts::add(&mut scene, &worker, wanted.work, &mut random);
        hoses::add(&mut scene, &worker, wanted.work, &mut random);
        worker.place.tool = worker.tool.map(|(_, tool)| tool);
        scene.robots.push(worker.place);
    }
    scanners(&mut scene, wanted, size, &mut random);
    Ok(scene)
}

/// Adds what stands around and between the robots.
fn surround(
    scene: &mut Scene,
    work: Work,
    robots: &[WorkRobot<'_>],
    middles: &[f64],
    depth: f64,
    random: &mut Random,
) {
    if work == Work::Carry {
        for (k, pair) in middles.windows(2).enumerate() {
            bench_between(scene, k, 0.5 * (pair[0] + pair[1]), random);
        }
    }
    if work != Work::Joined {
        return;
    }
    let (x, foot) = (middles[0], foot_radius(robots[0].model));
    let side = if random.unit() < 0.5 { 1.0 } else { -1.0 };
    let gap = random.between(0.0, 0.02);
    let width = random.between(0.4, 0.6);
    let height = random.between(0.4, 0.6);
    scene.benches.push(Furniture {
        name: "at the foot".into(),
        xy: [x + side * (foot + 0.08 + gap + 0.5 * width), 0.0],
        yaw_deg: 0.0,
        size: [width, random.between(0.5, 0.9), height],
    });
    scene.conveyors.push(Furniture {
        name: "through the fence".into(),
        xy: [x, -side * (foot + 0.3 + random.between(0.1, 0.3))],
        yaw_deg: 0.0,
        size: [depth + 2.0, 0.5, random.between(0.5, 0.7)],
    });
    let r = 0.5 * depth + 0.2;
    let corners = [[x - r, -r], [x + r, -r], [x + r, r], [x - r, r]];
    for k in 0..4 {
        scene.fences.push(Fence {
            name: format!("{k}"),
            from: corners[k],
            to: corners[(k + 1) % 4],
            height: 2.0,
            filling: FenceFilling::Wires,
        });
    }
}

/// Adds a bench between two robots, with parts on it.
fn bench_between(scene: &mut Scene, k: usize, x: f64, random: &mut Random) {
    let size = [random.between(0.4, 0.6), random.between(0.6, 1.2), random.between(0.45, 0.85)];
    let y = random.between(-0.5, 0.5);
    scene.benches.push(Furniture { name: format!("between {k}"), xy: [x, y], yaw_deg: 0.0, size });
    for part in 0..1 + random.below(3) {
        let edges =
            [random.between(0.1, 0.35), random.between(0.1, 0.35), random.between(0.05, 0.4)];
        let at = [x, y + (part as f64 - 0.5) * 0.4];
        scene.boxes.push(Cuboid {
            name: format!("part {part} between {k}"),
            xyz: [at[0], at[1], scene.ground(x, y) + size[2] + 0.5 * edges[2]],
            size: edges,
            rpy_deg: [0.0, 0.0, random.between(-40.0, 40.0)],
            reflectance: random.between(0.2, 0.9),
        });
    }
}

/// Places a robot with its tool in a posture that suits the work.
fn worker<'a>(
    scene: &mut Scene,
    candidate: &WorkRobot<'a>,
    k: usize,
    x: f64,
    wanted: &WorkCell,
    random: &mut Random,
) -> Result<Worker<'a>> {
    let WorkRobot { model, reach } = *candidate;
    let name = format!("R{}", k + 1);
    let stand = if reach < 1.2 { random.between(0.4, 0.85) } else { random.between(0.05, 0.3) };
    let ground = scene.ground(x, 0.0);
    scene.stands.push(SceneStand {
        name: name.clone(),
        xy: [x, 0.0],
        yaw_deg: 0.0,
        top: ground + stand,
        side: 2.0 * foot_radius(model) + 0.1,
        shape: [StandShape::Pedestal, StandShape::Table, StandShape::Plinth][random.below(3)],
    });
    let place = RobotPlace {
        name: name.clone(),
        model: model.name.clone(),
        xyz: [x, 0.0, ground + stand - lowest(model)],
        rpy_deg: [0.0, 0.0, random.between(-180.0, 180.0)],
        ..RobotPlace::default()
    };
    let is_armed = model
        .links
        .iter()
        .any(|link| link.role == Role::Effector && !link.mesh.vertices.is_empty());
    let has_tool = wanted.work != Work::Hoses || random.unit() < 0.5;
    let tool = model.flanges().first().copied().filter(|_| !is_armed && has_tool).map(|flange| {
        let shapes = [ToolShape::Gripper, ToolShape::Cups, ToolShape::Torch];
        let n = if wanted.work == Work::Carry { 2 } else { 3 };
        let length = (0.14 * reach).clamp(0.12, 0.35) * random.between(0.8, 1.2);
        (flange, tool_on(model, flange, shapes[random.below(n)], length))
    });
    let mut worker = Worker { model, reach, place, tool, world_from_links: Vec::new() };
    let room = [x - candidate.room(), x + candidate.room()];
    pose_worker(scene, &mut worker, wanted.work, room, random)?;
    Ok(worker)
}

/// Draws the posture of a robot within its room along x, metres.
fn pose_worker(
    scene: &Scene,
    worker: &mut Worker<'_>,
    work: Work,
    room: [f64; 2],
    random: &mut Random,
) -> Result<()> {
    let walls = keep_out(scene, &worker.place.name);
    let allowed = |p: &Point| {
        let taken = walls.iter().any(|(a, b)| (0..3).all(|i| p[i] > a[i] && p[i] < b[i]));
        p.x > room[0] && p.x < room[1] && !taken && p.z > scene.ground(p.x, p.y) + 0.02
    };
    let mut postures = Postures::new(worker.model);
    if let Some((link, tool)) = &worker.tool {
        // Its first part is left out, since the wrist behind a flange may be wider than the tool.
        let length = tool.length - TOOL_FOOT;
        let body = cuboid([0.12, 0.12, length], 0.0).at([0.0, 0.0, TOOL_FOOT + 0.5 * length]);
        let body = body.posed(&pose(tool.xyz, tool.rpy_deg));
        postures = postures.carrying(*link, &body.mesh());
    }
    let world_from_base = worker.place.world_from_base();
    for _ in 0..N_POSTURES {
        let posture = postures.draw(random, &world_from_base, allowed)?;
        let poses = worker.model.poses(&posture);
        worker.world_from_links = poses.iter().map(|p| world_from_base * p).collect();
        let joints = worker.model.free.iter().zip(posture);
        worker.place.posture =
            joints.map(|(&j, v)| (worker.model.joints[j].name.clone(), v)).collect();
        if work != Work::Touch || parts::is_over_a_part(worker, scene) {
            break;
        }
    }
    Ok(())
}

/// Adds scanners around the hall; half of those of a fenced robot stand outside of the fence.
fn scanners(scene: &mut Scene, wanted: &WorkCell, size: [f64; 2], random: &mut Random) {
    let turn = random.between(0.0, TAU);
    for k in 0..wanted.n_scanners {
        let a = turn + TAU * (k as f64 + random.between(-0.25, 0.25)) / wanted.n_scanners as f64;
        let is_inside = wanted.work == Work::Joined && k % 2 == 1;
        // A square around the cell; inside of a fence the scanner stands in a corner.
        let share = if is_inside { 0.5 - (AISLE - 0.2) / size[1] } else { 0.5 - 0.5 / size[1] };
        let square = a.cos().abs().max(a.sin().abs());
        let (x, y) = (size[0] * share * a.cos() / square, size[1] * share * a.sin() / square);
        let z = scene.ground(x, y) + random.between(1.4, 2.0);
        let raster =
            BeamRaster { elevation_deg: DOME, step_deg: wanted.step_deg, ..BeamRaster::default() };
        let mut one = scanner(format!("scan_{}", k + 1), [x, y, z], raster);
        one.noise = 0.001;
        one.rpy_deg = [0.0, 0.0, random.between(-180.0, 180.0)];
        scene.scanners.push(one);
    }
}
