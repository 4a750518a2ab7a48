//! Scenes of a line of equal cells: one of the whole line, and one of a single cell that is scanned
//! again later.
//!
//! In both scenes each robot has one of two postures and each pallet one of two places, so that the
//! cell that is scanned again may resemble its earlier neighbour more than itself.

use crate::random::Random;
use crate::scene::{
    BeamRaster, Building, Cuboid, Fence, FenceFilling, Furniture, RegistrationError, Scene,
    SceneFloor, StandShape,
};
use crate::spot::{RobotSpot, scanner};
use contract::{Error, Result};
use robot::Model;

/// Parameters of a line.
#[derive(Debug, Clone, PartialEq)]
pub struct ProductionLine {
    /// Seed of all random choices.
    pub seed: u64,
    /// Number of cells.
    pub n_cells: usize,
    /// Angle between beams, degrees.
    pub step_deg: f64,
    /// The surroundings of the ends of the line.
    pub ends: Ends,
}

/// What differs between the cells of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ends {
    /// Walls close to the first and the last cell.
    Walls,
    /// Walls along the line only, which extend far beyond it.
    Long,
    /// Only the floor.
    Open,
}

/// Depth of a cell across the line, metres.
const DEPTH: f64 = 4.4;
/// Distances between the centres of two cells, metres: least and most.
const PITCH: [f64; 2] = [4.0, 5.5];
/// Aisle on either side, metres.
const AISLE: f64 = 2.2;
/// How far walls and floor extend beyond a long line, metres.
const BEYOND: f64 = 45.0;
/// Standard deviations of the new scans' registration errors: metres, degrees.
const OFF: [f64; 2] = [0.003, 0.01];
const PALLET: [f64; 3] = [1.2, 0.8, 0.7];

/// The two scenes of a line, and the index of the cell that is scanned again.
///
/// # Errors
/// `BadInput` if no robot of the library fits into a cell.
pub fn line(wanted: &ProductionLine, models: &[Model]) -> Result<([Scene; 2], usize)> {
    let mut random = Random::keyed(&[wanted.seed, 0x11E]);
    let robots: Vec<&Model> = models.iter().filter(|m| !m.is_tool()).collect();
    if robots.is_empty() {
        return Err(Error::bad_input("the library holds no robot"));
    }
    let model = robots[random.below(robots.len())];
    let pitch = random.between(PITCH[0], PITCH[1]);
    let length = pitch * wanted.n_cells as f64;
    let mut then = shell(wanted, length, &mut random);
    let middle = |k: usize| (k as f64 + 0.5) * pitch - 0.5 * length;
    furnish(&mut then, wanted.n_cells, pitch, &middle, &mut random);
    let room = 0.5 * pitch - 0.15;
    let spot = |k: usize| RobotSpot {
        name: format!("R{}", k + 1),
        model: &model.name,
        xy: [middle(k), 0.0],
        stand: 0.25,
        side: 0.8,
        shape: StandShape::Plinth,
        yaw_deg: [90.0, 90.0],
        load: None,
        min: [middle(k) - room, -0.5 * DEPTH],
        max: [middle(k) + room, 0.5 * DEPTH],
    };
    // The two postures that all robots take.
    let mut bare = then.clone();
    let postures = [(); 2].map(|()| spot(0).place(&mut bare, model, &mut random));
    let [home, other] = postures;
    let postures = [home?.posture, other?.posture];
    for k in 0..wanted.n_cells {
        let robot = spot(k).stand_only(&mut then, &mut random);
        then.robots.push(robot);
    }
    let again = wanted.n_cells / 2;
    let mut now = then.clone();
    now.seed = wanted.seed ^ 0x5E55_1045;
    let mut at = [(); 2].map(|()| Vec::new());
    for session in &mut at {
        *session = (0..wanted.n_cells).map(|_| [random.below(2), random.below(2)]).collect();
    }
    // The cell that is scanned again has changed.
    at[1][again] = at[0][again].map(|v| 1 - v);
    for (scene, at) in [(&mut then, &at[0]), (&mut now, &at[1])] {
        for (k, [posture, pallet]) in at.iter().enumerate() {
            scene.robots[k].posture.clone_from(&postures[*posture]);
            put_pallet(scene, [middle(k), 0.0], *pallet, pitch);
        }
    }
    scanners(&mut then, wanted, pitch, &middle, &mut random);
    new_scanners(&mut now, wanted, [middle(again), pitch], &mut random);
    Ok(([then, now], again))
}

/// Building and floor.
fn shell(wanted: &ProductionLine, length: f64, random: &mut Random) -> Scene {
    let beyond = if wanted.ends == Ends::Walls { AISLE } else { BEYOND };
    let size = [length + 2.0 * beyond, DEPTH + 2.0 * AISLE];
    let height = random.between(4.5, 6.0);
    let hall = Building { size: [size[0], size[1], height], walls: true, ceiling: true };
    Scene {
        seed: wanted.seed,
        hall: (wanted.ends != Ends::Open).then_some(hall),
        floor: Some(SceneFloor {
            size: Some(size),
            tilt_deg: [0.0; 2],
            wave_amplitude: 0.001,
            wave_length: 5.0,
            levels: vec![],
        }),
        ..Scene::default()
    }
}

/// Adds the furniture that is the same in each cell.
fn furnish(
    scene: &mut Scene,
    n_cells: usize,
    pitch: f64,
    middle: &impl Fn(usize) -> f64,
    random: &mut Random,
) {
    let height = random.between(1.6, 2.2);
    let bench = [random.between(-0.2, 0.2), random.between(0.7, 0.9)];
    for k in 0..=n_cells {
        let x = middle(0) + (k as f64 - 0.5) * pitch;
        scene.fences.push(Fence {
            name: format!("before cell {k}"),
            from: [x, -0.5 * DEPTH],
            to: [x, 0.5 * DEPTH],
            height,
            filling: FenceFilling::Panel,
        });
    }
    for k in 0..n_cells {
        let corner = [middle(k) - 0.5 * pitch + 0.4, 0.5 * DEPTH - 0.4];
        scene.boxes.push(Cuboid {
            name: format!("controller {k}"),
            xyz: [corner[0], corner[1], 0.7],
            size: [0.5, 0.6, 1.4],
            rpy_deg: [0.0; 3],
            reflectance: 0.5,
        });
        scene.benches.push(Furniture {
            name: format!("bench {k}"),
            xy: [middle(k) + bench[0], 0.5 * DEPTH - 0.4],
            yaw_deg: 0.0,
            size: [1.2, 0.6, bench[1]],
        });
    }
}

/// Puts the pallet of a cell in one of its two places.
fn put_pallet(scene: &mut Scene, [x, y]: [f64; 2], place: usize, pitch: f64) {
    let side = if place == 0 { -1.0 } else { 1.0 };
    scene.boxes.push(Cuboid {
        name: "pallet".into(),
        xyz: [x + side * (0.5 * pitch - 0.9), y - 0.5 * DEPTH - 0.5, 0.5 * PALLET[2]],
        size: PALLET,
        rpy_deg: [0.0; 3],
        reflectance: 0.6,
    });
}

/// Adds one scanner in front of each cell and one behind every second cell.
fn scanners(
    scene: &mut Scene,
    wanted: &ProductionLine,
    pitch: f64,
    middle: &impl Fn(usize) -> f64,
    random: &mut Random,
) {
    for k in 0..wanted.n_cells {
        let side = if k % 2 == 0 { -1.0 } else { 1.0 };
        let x = middle(k) + random.between(-0.2, 0.2) * pitch;
        one(scene, format!("scan_{}", k + 1), [x, side * 0.5 * (DEPTH + AISLE)], wanted, random);
    }
}

/// Two scanners at the cell that is scanned again, registered to each other as well as rescans are.
fn new_scanners(
    scene: &mut Scene,
    wanted: &ProductionLine,
    [x, pitch]: [f64; 2],
    random: &mut Random,
) {
    scene.scanners.clear();
    for (k, side) in [-1.0, 1.0].into_iter().enumerate() {
        let x = x + random.between(-0.3, 0.3) * pitch;
        one(scene, format!("again_{}", k + 1), [x, side * 0.5 * (DEPTH + AISLE)], wanted, random);
    }
    let registration = |_: &crate::scene::Scanner| RegistrationError::drawn(OFF, random);
    let all: Vec<RegistrationError> = scene.scanners.iter().map(registration).collect();
    scene.scanners.iter_mut().zip(all).for_each(|(s, r)| s.registration = r);
}

fn one(
    scene: &mut Scene,
    name: String,
    xy: [f64; 2],
    wanted: &ProductionLine,
    random: &mut Random,
) {
    let raster = BeamRaster {
        elevation_deg: [-60.0, 70.0],
        step_deg: wanted.step_deg,
        ..BeamRaster::default()
    };
    let mut one = scanner(name, [xy[0], xy[1], random.between(1.6, 2.2)], raster);
    one.rpy_deg = [0.0, 0.0, random.between(-180.0, 180.0)];
    scene.scanners.push(one);
}
