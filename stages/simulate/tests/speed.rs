//! Speed of ray casting, for `benches/README.md`: run with `--release -- --ignored --nocapture`.
#![allow(clippy::unwrap_used, clippy::print_stderr)]

mod library;

use simulate::Simulator;
use simulate::scene::Scanner;

/// CPU time of this thread, seconds, which does not count other programs. Linux only.
fn cpu_seconds() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap();
    text.split_whitespace().next().unwrap().parse::<f64>().unwrap() * 1e-9
}

#[test]
#[ignore = "a measurement"]
fn beams_a_second() {
    let models = library::load().models;
    let demo = simulate::demo_scene(1, &models).unwrap();
    let model = models.iter().find(|m| m.name == simulate::demo_robots::WELDER).unwrap();
    let paper = simulate::paper_scene(1, model, &model.home(), 5_000_000);
    for (name, scene) in [("demo", demo), ("paper", paper)] {
        for is_wide in [true, false] {
            let mut scene = scene.clone();
            if !is_wide {
                scene.scanners =
                    scene.scanners.iter().map(|s| Scanner { mixed: None, ..s.clone() }).collect();
            }
            let start = cpu_seconds();
            let simulator = Simulator::new(&scene, &models).unwrap();
            let built = cpu_seconds() - start;
            let start = cpu_seconds();
            let (mut n, mut points) = (0, 0);
            for scan in 0..simulator.n_scans().min(1) {
                let columns = simulator.scan(scan).columns;
                n += columns.len();
                points += columns.n_points();
            }
            let seconds = cpu_seconds() - start;
            eprintln!(
                "{name}, wide beams {is_wide}: {} triangles built in {built:.2} s; {n} beams, {points} points, {:.2} M beams a CPU-second",
                simulator.n_triangles(),
                n as f64 / seconds / 1e6
            );
        }
    }
}
