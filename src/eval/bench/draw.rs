//! Draws the scene of a case from its seed, with the true base and posture.

use super::cell::Start;
use super::condition::{Condition, DrawnCase, Mounting};
use super::obstacles::Standing;
use super::{carried_items, obstacles, shape};
use contract::Result;
use geometry::{Point, Pose, Vector};
use nalgebra::{Translation3, UnitQuaternion};
use robot::Model;
use simulate::random::Random;
use simulate::scene::{
    BeamRaster, Column, Cuboid, Fence, FenceFilling, Furniture, Mixed, RegistrationError,
    RobotPlace, Scanner, SceneFloor, SceneStand, Section, StandShape,
};
use simulate::{Postures, Scene};
use std::f64::consts::TAU;

/// A drawn case.
pub(super) struct DrawnCell {
    pub(super) scene: Scene,
    pub(super) world_from_base: Pose,
    pub(super) posture: Vec<f64>,
    /// Closed loops that have their other solution.
    pub(super) other_branches: Vec<usize>,
    /// Base of another robot beside it, world frame.
    pub(super) beside: Option<Vector>,
}

/// Number of starts of a case of the convergence basin, and the errors of their bases: metres,
/// radians (METHOD.md §20).
const N_STARTS: usize = 24;
const START_BASE: (f64, f64) = (0.02, 0.0175);
/// Least radius of the circle of scanners, metres (METHOD.md §19); larger robots are scanned from
/// farther away.
const CIRCLE: f64 = 5.0;
/// Height of a scanner, metres.
const HEIGHT: f64 = 1.6;
/// Elevations of a full dome of beams, degrees.
const DOME: [f64; 2] = [-60.0, 90.0];
/// Side and thickness of a plate that is bolted to steelwork, metres.
const PLATE: [f64; 2] = [1.6, 0.08];
/// Thickness of a plate on something larger, metres, and side and thickness of that.
const ON_PANEL: [f64; 2] = [0.02, 0.12];
const PANEL: [f64; 2] = [2.4, 0.1];
/// Side of a stand, metres: room for the largest foot.
const STAND_SIDE: f64 = 1.4;
/// Heights of stands that a foot hides the top of, metres, and their side in widths of the foot.
const PILLAR: [f64; 2] = [0.25, 1.2];
const NARROW: f64 = 0.7;

impl DrawnCell {
    /// The library with the shapes of the real robots, which may differ from their models.
    pub(super) fn models(&self, models: &[Model], case: &DrawnCase) -> Vec<Model> {
        let mut out = models.to_vec();
        out[case.model] = out[case.model].with_other_branches(&self.other_branches);
        if case.condition.warp > 0.0 {
            let condition = &case.condition;
            shape::warp(&mut out[case.model], condition.warp, condition.each_side, case.seed);
        }
        if case.condition.uncovered {
            shape::uncover(&mut out[case.model], case.seed);
        }
        if case.condition.scaled != 0.0 {
            shape::scale(&mut out[case.model], case.condition.scaled, case.seed);
        }
        if case.condition.frames != [0.0; 2] {
            shape::displace(&mut out[case.model], case.condition.frames, case.robot());
        }
        out
    }
}

/// A tool on a flange.
pub(super) struct Mount {
    /// Index in the library.
    pub(super) tool: usize,
    /// Turn about the flange, radians.
    pub(super) turn: f64,
    /// Whether the arm's last joint turns the tool the same way (1) or the other (−1).
    pub(super) way: f64,
    /// Free joints of the arm.
    pub(super) n_arm: usize,
}

impl Mount {
    /// The arm with the tool on it.
    pub(super) fn tooled(&self, models: &[Model], arm: usize) -> Model {
        models[arm].with_tool(&models[self.tool], flange(&models[arm]), self.turn)
    }
}

/// Link that carries the tools of the suites.
fn flange(arm: &Model) -> usize {
    arm.flanges().first().copied().unwrap_or(0)
}

/// The tool of a case and its mount, where its condition has one.
pub(super) fn mount(case: &DrawnCase, models: &[Model]) -> Option<Mount> {
    let tools: Vec<usize> = (0..models.len()).filter(|&i| models[i].is_tool()).collect();
    if !case.condition.tool || tools.is_empty() {
        return None;
    }
    let mut random = Random::keyed(&[case.seed, 0x7001]);
    let any = |random: &mut Random, n: usize| ((random.unit() * n as f64) as usize).min(n - 1);
    let tool = tools[any(&mut random, tools.len())];
    // Holes of usual bolt circles.
    let turn = any(&mut random, 8) as f64 * TAU / 8.0;
    let way = models[case.model].mount(flange(&models[case.model])).1;
    Some(Mount { tool, turn, way, n_arm: models[case.model].free.len() })
}

/// Draws a case of a model.
pub(super) fn draw(case: &DrawnCase, model: &Model) -> Result<DrawnCell> {
    let c = &case.condition;
    let mut random = Random::keyed(&[case.seed, 0xACC]);
    let mut scene = empty(case.seed, &mut random);
    let (stand, side) = match c.mount {
        Mounting::Pillar => (random.between(PILLAR[0], PILLAR[1]), NARROW * narrower(model)),
        _ if c.stand > 0.0 && random.unit() < 0.5 => (random.between(0.15, c.stand), STAND_SIDE),
        _ => (0.0, STAND_SIDE),
    };
    let xy = [random.between(-0.5, 0.5), random.between(-0.5, 0.5)];
    let yaw = random.between(0.0, TAU);
    let ground = scene.ground(xy[0], xy[1]);
    let foot = foot(model);
    let at = Translation3::new(xy[0], xy[1], ground + stand - foot);
    let upright = Pose::from_parts(at, UnitQuaternion::from_euler_angles(0.0, 0.0, yaw));
    let world_from_plate = plate(&mut scene, model, c, [xy[0], xy[1], yaw], &mut random);
    let world_from_base =
        world_from_plate.map_or(upright, |plate| plate * Pose::translation(0.0, 0.0, -foot));
    if stand > 0.0 && world_from_plate.is_none() {
        scene.stands.push(SceneStand {
            name: "stand".into(),
            xy,
            yaw_deg: yaw.to_degrees(),
            top: stand,
            side,
            shape: StandShape::Plinth,
        });
    }
    let low = ground + stand - 0.005;
    let posture = Postures::new(model).draw(&mut random, &world_from_base, |p| {
        world_from_plate
            .map_or(p.z > low, |plate| p.z > ground + 0.1 && (plate.inverse() * p).z > -0.005)
    })?;
    scene.robots.push(RobotPlace {
        name: "R1".into(),
        model: model.name.clone(),
        xyz: world_from_base.translation.vector.into(),
        rpy_deg: rpy_deg(&world_from_base),
        posture: named(model, &posture),
        ..RobotPlace::default()
    });
    let reach = reach(model, &world_from_base, &posture);
    add_clutter(&mut scene, c.clutter, reach[0], &mut random);
    carried_items::hoses(&mut scene, model, c.clutter, &mut random);
    carried_items::load(&mut scene, model, c.laden, reach[0], &mut random);
    scanners(&mut scene, c, reach, &mut random);
    let circle = circle(reach);
    let standing = Standing { model, world_from_base, posture: &posture, reach: reach[0], circle };
    let beside = obstacles::add(&mut scene, &standing, case)?;
    let has_branch = |at: &usize| c.other_branch && model.has_other_branch(*at, &posture);
    let other_branches = (0..model.loops.len()).find(has_branch).into_iter().collect();
    Ok(DrawnCell { scene, world_from_base, posture, other_branches, beside })
}

/// An empty scene of this seed with a floor, as level as real floors are.
fn empty(seed: u64, random: &mut Random) -> Scene {
    Scene {
        seed,
        floor: Some(SceneFloor {
            size: Some([24.0, 24.0]),
            tilt_deg: [random.between(-0.1, 0.1), random.between(-0.1, 0.1)],
            wave_amplitude: 0.002,
            wave_length: 5.0,
            levels: vec![],
        }),
        ..Scene::default()
    }
}

/// Roll, pitch and yaw, degrees.
fn rpy_deg(pose: &Pose) -> [f64; 3] {
    let (roll, pitch, yaw) = pose.rotation.euler_angles();
    [roll, pitch, yaw].map(f64::to_degrees)
}

/// The plate of a robot that is not on the floor: the pose of its surface, with z pointing away
/// from it.
fn plate(
    scene: &mut Scene,
    model: &Model,
    c: &Condition,
    [x, y, yaw]: [f64; 3],
    random: &mut Random,
) -> Option<Pose> {
    let size = reach(model, &Pose::identity(), &model.home());
    let (z, lean) = match c.mount {
        Mounting::Floor | Mounting::Pillar => return None,
        Mounting::Ceiling => (0.6 + 1.1 * size[0].max(size[1]), 180.0),
        Mounting::Wall => (0.4 + size[0].max(size[1]) * random.between(0.7, 0.9), 90.0),
        Mounting::Tilted => (random.between(0.7, 1.0), random.between(10.0, 45.0)),
    };
    let heading = UnitQuaternion::from_euler_angles(0.0, 0.0, yaw);
    let lean = UnitQuaternion::from_euler_angles(f64::to_radians(lean), 0.0, 0.0);
    let spin = UnitQuaternion::from_euler_angles(0.0, 0.0, random.between(0.0, TAU));
    let surface = Pose::from_parts(Translation3::new(x, y, z), heading * lean);
    let turned = surface * Pose::from_parts(Translation3::identity(), spin);
    let foot = model.links.iter().map(|link| link.bounds).find(|bounds| !bounds.is_empty());
    let (middle, [a, b]) = match foot.filter(|_| c.rim > 0.0) {
        Some(foot) => {
            let (at, size) = (foot.center(), foot.size());
            (turned * Pose::translation(at.x, at.y, 0.0), [0, 1].map(|i| size[i] + 2.0 * c.rim))
        }
        None => (surface, [PLATE[0]; 2]),
    };
    let mut push = |name: &str, top: &Pose, size: [f64; 3]| {
        let middle = top * Pose::translation(0.0, 0.0, -0.5 * size[2]);
        scene.boxes.push(Cuboid {
            name: name.into(),
            xyz: middle.translation.vector.into(),
            size,
            rpy_deg: rpy_deg(&middle),
            reflectance: 0.5,
        });
    };
    if c.backed {
        let thick = random.between(ON_PANEL[0], ON_PANEL[1]);
        push("plate", &middle, [a, b, thick]);
        let behind = surface * Pose::translation(0.0, 0.0, -thick);
        push("panel", &behind, [PANEL[0], PANEL[0], PANEL[1]]);
    } else {
        push("plate", &middle, [a, b, PLATE[1]]);
    }
    Some(turned)
}

/// Starts of the refinement, where the case asks for it: the truth, then postures with errors of
/// all joints and of the base.
pub(super) fn starts(case: &DrawnCase, drawn: &DrawnCell) -> Vec<Start> {
    let off = case.condition.perturbed_deg.to_radians();
    if off == 0.0 {
        return Vec::new();
    }
    let mut random = Random::keyed(&[case.seed, 0xBA5]);
    let start = |_| {
        let posture = drawn.posture.iter().map(|q| q + random.between(-off, off)).collect();
        let mut vector = |size: f64| Vector::from_fn(|_, _| random.between(-size, size));
        let moved = Pose::new(vector(START_BASE.0), vector(START_BASE.1));
        (drawn.world_from_base * moved, posture)
    };
    let truth = (drawn.world_from_base, drawn.posture.clone());
    std::iter::once(truth).chain((0..N_STARTS).map(start)).collect()
}

fn named(model: &Model, posture: &[f64]) -> std::collections::BTreeMap<String, f64> {
    let names = model.free.iter().map(|&j| model.joints[j].name.clone());
    names.zip(posture.iter().copied()).collect()
}

/// Height of the lowest sample of the links that do not move, metres.
fn foot(model: &Model) -> f64 {
    let poses = model.poses(&model.home());
    let standing = model.links.iter().zip(&poses).filter(|(l, _)| !l.cad.points.is_empty());
    let (link, pose) = match standing.clone().next() {
        Some(first) => first,
        None => return 0.0,
    };
    let heights = link.cad.points.iter().map(|p| (pose * Point::from(p.map(f64::from))).z);
    heights.fold(f64::INFINITY, f64::min)
}

/// The shorter side of the link that stands on the ground, metres.
fn narrower(model: &Model) -> f64 {
    let link = model.links.iter().find(|link| !link.cad.points.is_empty());
    link.map_or(STAND_SIDE, |link| {
        let size = link.bounds.size();
        size[0].min(size[1])
    })
}

/// Greatest distance of the robot from the vertical through its base, and its greatest height,
/// metres.
fn reach(model: &Model, world_from_base: &Pose, posture: &[f64]) -> [f64; 2] {
    let base = world_from_base.translation.vector;
    let mut out = [0.5_f64, 1.0];
    for (link, pose) in model.links.iter().zip(model.poses(posture)) {
        for p in link.cad.points.iter().step_by(20) {
            let p = world_from_base * pose * Point::from(p.map(f64::from));
            out = [out[0].max((p.x - base.x).hypot(p.y - base.y)), out[1].max(p.z)];
        }
    }
    out
}

/// Objects around a robot of this reach (metres), each with this probability.
fn add_clutter(scene: &mut Scene, chance: f64, reach: f64, random: &mut Random) {
    let there = |random: &mut Random| random.unit() < chance;
    // Beside the robot, so far beyond its reach.
    let beside = |random: &mut Random, gap: [f64; 2]| {
        let (a, radius) = (random.between(0.0, TAU), reach + random.between(gap[0], gap[1]));
        [radius * a.cos(), radius * a.sin()]
    };
    if there(random) {
        // One straight fence in front, wires as real ones.
        let (a, r) = (random.between(0.0, TAU), reach + random.between(0.4, 0.8));
        let corner = |t: f64| [r * a.cos() - t * a.sin(), r * a.sin() + t * a.cos()];
        let filling = if random.unit() < 0.8 { FenceFilling::Wires } else { FenceFilling::Panel };
        scene.fences.push(Fence {
            name: "fence".into(),
            from: corner(-2.0),
            to: corner(2.0),
            height: random.between(1.4, 2.2),
            filling,
        });
    }
    if there(random) {
        let xy = beside(random, [0.7, 1.0]);
        let size = [random.between(1.0, 2.0), 0.6, random.between(0.5, 0.9)];
        scene.conveyors.push(Furniture {
            name: "conveyor".into(),
            xy,
            yaw_deg: random.between(0.0, 180.0),
            size,
        });
    }
    if there(random) {
        let [x, y] = beside(random, [0.6, 1.0]);
        let size = [0.5, 0.6, random.between(1.0, 2.0)];
        scene.boxes.push(Cuboid {
            name: "cabinet".into(),
            xyz: [x, y, 0.5 * size[2] + scene.ground(x, y)],
            size,
            rpy_deg: [0.0, 0.0, random.between(0.0, 90.0)],
            reflectance: random.between(0.2, 0.9),
        });
        let xy = beside(random, [0.6, 1.2]);
        let height = random.between(2.0, 4.0);
        let section = Section::Round;
        scene.columns.push(Column { name: "post".into(), xy, radius: 0.1, height, section });
    }
}

/// Radius of the circle of scanners, metres.
fn circle(reach: [f64; 2]) -> f64 {
    CIRCLE.max(reach[0] + 2.5)
}

/// Scanners on a circle, jittered, each casting only the part of its dome that sees the cell.
fn scanners(scene: &mut Scene, c: &Condition, reach: [f64; 2], random: &mut Random) {
    let step_deg = (360.0 * (DOME[1] - DOME[0]) / c.n_beams).sqrt();
    let circle = circle(reach);
    let turn = random.between(0.0, TAU);
    for k in 0..c.n_scanners {
        let a = turn + TAU * (k as f64 + random.between(-0.2, 0.2)) / c.n_scanners as f64;
        let radius = circle + random.between(-0.3, 0.3);
        let (x, y) = (radius * a.cos(), radius * a.sin());
        let z = scene.ground(x, y) + HEIGHT + random.between(-0.2, 0.2);
        // The scanner looks at the origin along its own x axis.
        let half = ((reach[0] + 1.3) / radius).min(0.95).asin().to_degrees();
        let near = (radius - reach[0] - 0.6).max(1.0);
        let up = ((reach[1] + 0.4 - z) / near).atan().to_degrees().clamp(5.0, 85.0);
        let down = (z / near).atan().to_degrees().clamp(10.0, 60.0);
        let yaw = (a + std::f64::consts::PI).rem_euclid(TAU).to_degrees();
        let [shift, angle, bias] = c.registration;
        let registration = RegistrationError::drawn([shift, angle], random);
        scene.scanners.push(Scanner {
            name: format!("scan_{}", k + 1),
            position: [x, y, z],
            rpy_deg: [0.0, 0.0, yaw],
            raster: BeamRaster {
                elevation_deg: [-down, up],
                azimuth_deg: [-half, half],
                step_deg,
                n_beams: None,
            },
            noise: c.noise,
            range_bias: random.normals()[0] * bias,
            mixed: c.mixed.then(Mixed::default),
            registration,
            ..Scanner::default()
        });
    }
}
