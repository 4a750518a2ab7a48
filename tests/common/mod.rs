//! What several tests run on: a small scene, its scans and its library of one model.

use std::path::Path;
use stillpoint::demo::write_robots;
use stillpoint::engine::Engine;
use stillpoint::scanning::{Formats, scan_scene};

/// A palletiser on a bare floor: `robots` and `scans` below a folder, with about so many beams of each scanner.
pub(crate) fn palletiser(dir: &Path, seed: u64, n_beams: u64) {
    let robots = dir.join("robots");
    write_robots(&robots).expect("the library is written");
    for other in ["demo_welder_2600", "demo_arm_1100"] {
        std::fs::remove_dir_all(robots.join(other)).expect("one model is enough");
    }
    let library = robot::Library::load(&robots, &robot::Settings::without_clouds()).expect("loads");
    let model = &library.models[0];
    let posture: Vec<f64> =
        (0..model.n_free()).map(|j| model.limits(j).into_iter().sum::<f64>() / 2.0).collect();
    let scene = simulate::paper_scene(seed, model, &posture, n_beams);
    let engine = Engine::new(2);
    scan_scene(&scene, &library.models, &dir.join("scans"), Formats::ALL, &engine).expect("scans");
}
