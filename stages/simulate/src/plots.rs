//! Scenes of halls of any size: square plots with one robot each.

use crate::random::Random;
use crate::scene::{
    BeamRaster, Building, Column, Cuboid, Fence, FenceFilling, Scene, SceneFloor, Section,
    StandShape,
};
use crate::spot::{RobotSpot, scanner};
use contract::{Error, Result};
use robot::Model;

/// Side of the square that each robot of a hall has, metres.
const PLOT: f64 = 6.0;
/// Largest number of beams of one scanner: what a real one measures in some minutes.
const MAX_BEAMS: u64 = 20_000_000;

/// A hall of `n_robots` robots of the library on plots of 6 m, with scanners for about `n_points`
/// points.
///
/// `BadInput` if the library holds no robot, or one that is too large for its plot.
pub fn hall(seed: u64, models: &[Model], n_robots: usize, n_points: u64) -> Result<Scene> {
    let robots: Vec<&Model> = models.iter().filter(|m| !m.is_tool()).collect();
    if robots.is_empty() {
        return Err(Error::bad_input("the library holds no robot"));
    }
    let mut random = Random::keyed(&[seed, 0x4A11]);
    let cols = (n_robots as f64).sqrt().ceil().max(1.0) as usize;
    let rows = n_robots.div_ceil(cols).max(1);
    let size = [PLOT * cols as f64 + 2.0, PLOT * rows as f64 + 2.0, 7.0];
    let mut scene = Scene {
        seed,
        hall: Some(Building { size, walls: true, ceiling: true }),
        floor: Some(SceneFloor {
            size: None,
            tilt_deg: [0.05, 0.03],
            wave_amplitude: 0.004,
            wave_length: 7.0,
            levels: vec![],
        }),
        ..Scene::default()
    };
    let corner = |i: usize, j: usize| {
        [1.0 + PLOT * i as f64 - 0.5 * size[0], 1.0 + PLOT * j as f64 - 0.5 * size[1]]
    };
    for n in 0..n_robots {
        let from = corner(n % cols, n / cols);
        plot(&mut scene, robots[random.below(robots.len())], n, from, &mut random)?;
    }
    let n_scanners = (n_robots as u64).div_ceil(2).max(2).max(n_points.div_ceil(MAX_BEAMS));
    let n_spots = (cols + 1) * (rows + 1);
    let stride = spread(n_spots);
    for k in 0..n_scanners as usize {
        // Scanners stand where plots meet, which robots keep clear of.
        let spot = (k * stride) % n_spots;
        let [x, y] = corner(spot % (cols + 1), spot / (cols + 1));
        let (x, y) =
            (x.clamp(0.6 - 0.5 * size[0], 0.5 * size[0] - 0.6), y + random.between(-0.2, 0.2));
        let raster =
            BeamRaster { n_beams: Some(n_points.div_ceil(n_scanners)), ..BeamRaster::default() };
        let at = [x, y, scene.ground(x, y) + random.between(1.5, 2.2)];
        scene.scanners.push(scanner(format!("scan_{}", k + 1), at, raster));
    }
    Ok(scene)
}

/// A stride that visits all of `n` places, near and far in turn: the number coprime to `n` that is
/// nearest to the golden section.
fn spread(n: usize) -> usize {
    let coprime = |k: &usize| {
        let (mut a, mut b) = (n, *k);
        while b > 0 {
            (a, b) = (b, a % b);
        }
        a == 1
    };
    let golden = 0.618 * n as f64;
    (1..=n).filter(coprime).min_by_key(|k| ((*k as f64 - golden).abs() * 1e6) as u64).unwrap_or(1)
}

fn plot(
    scene: &mut Scene,
    model: &Model,
    n: usize,
    from: [f64; 2],
    random: &mut Random,
) -> Result<()> {
    let middle = from.map(|v| v + 0.5 * PLOT);
    let edge = |v: f64| v + 0.35;
    scene.boxes.push(Cuboid {
        name: format!("cabinet {n}"),
        xyz: [
            edge(from[0]),
            middle[1] + random.between(-1.0, 1.0),
            0.8 + scene.ground(from[0], middle[1]),
        ],
        size: [0.5, random.between(0.5, 1.2), 1.6],
        rpy_deg: [0.0; 3],
        reflectance: random.between(0.1, 0.9),
    });
    scene.columns.push(Column {
        name: String::new(),
        xy: [from[0] + 0.35, from[1] + 1.0],
        radius: 0.15,
        height: 6.9,
        section: if random.unit() < 0.5 { Section::Round } else { Section::IBeam },
    });
    if random.unit() < 0.5 {
        let y = from[1] + 0.1;
        scene.fences.push(Fence {
            name: String::new(),
            from: [from[0] + 1.0, y],
            to: [from[0] + PLOT - 1.0, y],
            height: 2.0,
            filling: FenceFilling::Wires,
        });
    }
    let spot = RobotSpot {
        name: format!("R{}", n + 1),
        model: &model.name,
        xy: middle,
        stand: [0.0, 0.25, 0.5][random.below(3)],
        side: 0.9,
        shape: StandShape::Plinth,
        yaw_deg: [-180.0, 180.0],
        load: None,
        min: from.map(|v| v + 0.7),
        max: from.map(|v| v + PLOT - 0.05),
    };
    let place = match spot.place(scene, model, random) {
        Ok(place) => place,
        // The largest robots fit into a plot in few postures, so that the home posture is used.
        Err(_) => spot.stand_only(scene, random),
    };
    scene.robots.push(place);
    Ok(())
}
