//! How fast beams are cast, for `benches/README.md`: run with `--release -- --ignored --nocapture`.
#![allow(clippy::unwrap_used, clippy::print_stderr)]

mod library;

use simulate::Simulator;
use simulate::scene::Scanner;
use std::time::Instant;

#[test]
#[ignore = "a measurement"]
fn beams_a_second() {
    let models = library::load().models;
    let demo = simulate::demo_scene(1, &models).unwrap();
    let model = models
        .iter()
        .find(|m| m.name == simulate::demo_robots::WELDER)
        .unwrap();
    let paper = simulate::paper_scene(1, model, &model.home(), 5_000_000);
    for (name, scene) in [("demo", demo), ("paper", paper)] {
        for is_wide in [true, false] {
            let mut scene = scene.clone();
            if !is_wide {
                scene.scanners = scene
                    .scanners
                    .iter()
                    .map(|s| Scanner {
                        mixed: None,
                        ..s.clone()
                    })
                    .collect();
            }
            let start = Instant::now();
            let simulator = Simulator::new(&scene, &models).unwrap();
            let built = start.elapsed().as_secs_f64();
            let start = Instant::now();
            let (mut n, mut points) = (0, 0);
            for scan in 0..simulator.n_scans().min(2) {
                let columns = simulator.scan(scan).columns;
                n += columns.len();
                points += columns.n_points();
            }
            let seconds = start.elapsed().as_secs_f64();
            eprintln!(
                "{name}, wide beams {is_wide}: {} triangles built in {built:.2} s; {n} beams, {points} points, {:.2} M beams/s",
                simulator.n_triangles(),
                n as f64 / seconds / 1e6
            );
        }
    }
}
