//! What several tests run on: a small scene, its scans and its library of one model.

use simulate::scene::Cuboid;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use stillpoint::engine::Engine;
use stillpoint::eval::demo::write_robots;
use stillpoint::eval::virtual_scan::{Formats, scan_scene};

/// A palletiser on a bare floor: `robots` and `scans` below a folder, with about so many beams of
/// each scanner.
pub(crate) fn palletiser(dir: &Path, seed: u64, n_beams: u64) {
    simulated(dir, "scans", (seed, n_beams), |scene| scene);
}

/// The same robot beside two boxes, by which rescans are registered: `robots`, and the folder of
/// the scans.
pub(crate) fn boxed_cell(dir: &Path, scans: &str, seed: u64, n_beams: u64) {
    let cuboid = |xyz: [f64; 3], size: [f64; 3]| Cuboid {
        name: "box".into(),
        xyz,
        size,
        rpy_deg: [0.0; 3],
        reflectance: 0.5,
    };
    simulated(dir, scans, (seed, n_beams), |scene| simulate::Scene {
        boxes: vec![
            cuboid([2.4, 2.9, 0.5], [1.2, 0.8, 1.0]),
            cuboid([-3.1, 1.2, 0.7], [0.6, 1.6, 1.4]),
        ],
        ..scene
    });
}

/// The cell with boxes, scanned into so many files: `robots`, and the folders `scans0`, `scans1`...
pub(crate) fn cell_of_files(dir: &Path, n_files: usize, seed: u64, n_beams: u64) {
    for file in 0..n_files {
        simulated(dir, &format!("scans{file}"), (seed, n_beams), |mut scene| {
            let all = scene.scanners.into_iter().enumerate();
            let own = all.filter(|(i, _)| i % n_files == file).map(|(_, scanner)| scanner);
            scene.scanners = own.collect();
            scene
        });
    }
}

fn simulated(
    dir: &Path,
    scans: &str,
    (seed, n_beams): (u64, u64),
    more: impl Fn(simulate::Scene) -> simulate::Scene,
) {
    let robots = dir.join("robots");
    write_robots(&robots).expect("the library is written");
    for other in ["demo_welder_2600", "demo_arm_1100"] {
        let _ = std::fs::remove_dir_all(robots.join(other));
    }
    let library = robot::Library::load(&robots, &robot::Settings::without_clouds()).expect("loads");
    let model = &library.models[0];
    let posture: Vec<f64> =
        (0..model.n_free()).map(|j| model.limits(j).into_iter().sum::<f64>() / 2.0).collect();
    let scene = more(simulate::paper_scene(seed, model, &posture, n_beams));
    let engine = Engine::new(2);
    scan_scene(&scene, &library.models, &dir.join(scans), Formats::ALL, &engine).expect("scans");
}

/// Copies a folder with all that is in it.
pub(crate) fn copy_folder(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).expect("a folder");
    for entry in std::fs::read_dir(from).expect("a folder") {
        let path = entry.expect("an entry").path();
        let place = to.join(path.file_name().expect("a name"));
        if path.is_dir() {
            copy_folder(&path, &place);
        } else {
            std::fs::copy(&path, &place).expect("copies");
        }
    }
}

/// Every file of a result, by its name.
pub(crate) fn files(out: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut all = BTreeMap::new();
    let mut folders = vec![out.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() && !path.ends_with("store") {
                folders.push(path);
            } else if path.is_file() {
                let name = path.strip_prefix(out).expect("below").to_path_buf();
                all.insert(name, std::fs::read(&path).expect("a file"));
            }
        }
    }
    all
}
