//! Draws the demo robots and the demo scene for people: run with `--ignored`, and look into the
//! folder that is printed.
#![allow(clippy::unwrap_used, clippy::print_stderr)]

mod library;

use robot::Model;
use simulate::scene::{BeamRaster, RobotPlace, Scanner, Scene, SceneFloor};
use simulate::{SimColumns, Simulator};
use std::path::Path;

/// Colour of a label, shaded by the intensity of the return.
fn colour(columns: &SimColumns, i: usize) -> [u8; 3] {
    if !columns.hit[i] {
        return [235, 240, 250];
    }
    let label = columns.label[i];
    let base: [f32; 3] = match label.link {
        -1 => [0.75, 0.75, 0.72],
        link => [
            [1.0, 0.55, 0.1],
            [0.95, 0.8, 0.2],
            [0.5, 0.75, 1.0],
            [0.6, 0.9, 0.5],
            [0.95, 0.6, 0.75],
            [0.75, 0.65, 1.0],
            [0.9, 0.9, 0.9],
        ][link as usize % 7],
    };
    let light = (columns.intensity[i] / 0.7).clamp(0.0, 1.0).powf(0.8);
    base.map(|c| (255.0 * c * light) as u8)
}

fn picture(simulator: &Simulator, scanner: usize, path: &Path) {
    let scan = simulator.scan(scanner);
    let (rows, cols) = (scan.frame.n_rows as usize, scan.frame.n_cols as usize);
    let mut bytes = format!("P6\n{cols} {rows}\n255\n").into_bytes();
    for y in 0..rows {
        for x in 0..cols {
            bytes.extend(colour(&scan.columns, (cols - 1 - x) * rows + rows - 1 - y));
        }
    }
    std::fs::write(path, bytes).unwrap();
    eprintln!("{}", path.display());
}

fn looking(name: &str, from: [f64; 3], at: [f64; 3], half_deg: f64) -> Scanner {
    let d = [0, 1, 2].map(|i| at[i] - from[i]);
    let elevation = d[2].atan2(d[0].hypot(d[1])).to_degrees();
    let raster = BeamRaster {
        elevation_deg: [elevation - half_deg, elevation + half_deg],
        azimuth_deg: [-half_deg, half_deg],
        step_deg: half_deg / 300.0,
        n_beams: None,
    };
    let yaw = d[1].atan2(d[0]).to_degrees();
    Scanner {
        name: name.into(),
        position: from,
        rpy_deg: [0.0, 0.0, yaw],
        raster,
        noise: 0.0,
        ..Scanner::default()
    }
}

fn views(model: &Model, posture: &[f64], tag: &str, folder: &Path) {
    let reach = model.bounds_at(posture).size().into_iter().fold(0.0, f64::max);
    let place = RobotPlace {
        name: "r".into(),
        model: model.name.clone(),
        posture: model
            .free
            .iter()
            .zip(posture)
            .map(|(&j, v)| (model.joints[j].name.clone(), *v))
            .collect(),
        ..Default::default()
    };
    let middle = model.bounds_at(posture).center();
    let from = |x: f64, y: f64, z: f64| {
        [middle.x + x * reach * 2.5, middle.y + y * reach * 2.5, middle.z + z * reach * 2.5]
    };
    let at = [middle.x, middle.y, middle.z];
    let scene = Scene {
        floor: Some(SceneFloor {
            size: Some([8.0, 8.0]),
            tilt_deg: [0.0; 2],
            wave_amplitude: 0.0,
            wave_length: 5.0,
            levels: vec![],
        }),
        robots: vec![place],
        scanners: vec![
            looking("front_left", from(0.75, 0.6, 0.35), at, 15.0),
            looking("right", from(0.1, -1.0, 0.1), at, 15.0),
            looking("back_left", from(-0.6, 0.8, 0.4), at, 15.0),
        ],
        ..Scene::default()
    };
    let simulator = Simulator::new(&scene, std::slice::from_ref(model)).unwrap();
    for k in 0..3 {
        picture(&simulator, k, &folder.join(format!("{}_{tag}_{k}.ppm", model.name)));
    }
}

trait Bounds {
    fn bounds_at(&self, posture: &[f64]) -> geometry::Aabb;
}

impl Bounds for Model {
    fn bounds_at(&self, posture: &[f64]) -> geometry::Aabb {
        let poses = self.poses(posture);
        let points = self.links.iter().zip(&poses).flat_map(|(link, pose)| {
            link.mesh.vertices.iter().map(move |v| {
                let p = pose * geometry::Point::new(v[0].into(), v[1].into(), v[2].into());
                [p.x, p.y, p.z]
            })
        });
        geometry::Aabb::of(points)
    }
}

#[test]
#[ignore = "makes pictures for people"]
fn demo_robots() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    for model in &library::load().models {
        views(model, &model.home(), "home", folder);
        let posture: Vec<f64> = (0..model.free.len())
            .map(|f| {
                let [low, high] = model.limits(f);
                low + (high - low) * [0.45, 0.68, 0.62, 0.6, 0.7, 0.4, 0.8][f]
            })
            .collect();
        views(model, &posture, "bent", folder);
    }
}

#[test]
#[ignore = "makes pictures for people"]
fn demo_scene() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let models = library::load().models;
    for seed in 1..4 {
        let mut scene = simulate::demo_scene(seed, &models).unwrap();
        let from = [[5.5, -4.5, 4.6], [-0.6, -3.4, 1.7], [0.4, 4.7, 4.0]];
        let at = [[-0.5, 0.5, 0.5], [-2.8, 1.6, 1.0], [3.0, -1.5, 1.0]];
        let half = [38.0, 30.0, 30.0];
        scene.scanners = (0..3).map(|k| looking(&k.to_string(), from[k], at[k], half[k])).collect();
        let simulator = Simulator::new(&scene, &models).unwrap();
        for k in 0..3 {
            picture(&simulator, k, &folder.join(format!("scene_{seed}_{k}.ppm")));
        }
    }
}
