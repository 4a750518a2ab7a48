//! The lattices of real scans, from their points and scanners from a file of poses. The scans are
//! not part of the repository; without them these tests report that they were skipped.
#![allow(clippy::unwrap_used, clippy::print_stderr)] // tests may panic, and say what they skip

use contract::{Lattice, OneByOne};
use ingest::{KnownScanners, Settings, Sources, Want, describe, open};
use std::path::{Path, PathBuf};

fn folder(name: &str) -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/scans").join(name);
    if !folder.is_dir() {
        eprintln!("skipped: no folder {name}");
        return None;
    }
    Some(folder)
}

/// Share of the points that are alone in their pixel, and number of points in a filled pixel.
fn filling(sources: &Sources, scan: usize) -> (f64, f64) {
    let lattice: Lattice = sources.scans[scan].lattice.expect("the scanner is known");
    let mut pixels = Vec::new();
    for strip in sources.strips(sources.scans[scan].input, Want::Coordinates).unwrap() {
        let strip = strip.unwrap();
        if strip.scan == sources.scans[scan].id {
            pixels.extend(strip.xyz.iter().map(|p| lattice.pixel(*p).0));
        }
    }
    pixels.sort_unstable();
    let (n_points, mut n_pixels, mut alone) = (pixels.len() as f64, 0.0, 0.0);
    for same in pixels.chunk_by(|a, b| a == b) {
        n_pixels += 1.0;
        alone += f64::from(u8::from(same.len() == 1));
    }
    (alone / n_points, n_points / n_pixels)
}

fn degrees(lattice: &Lattice) -> [f64; 2] {
    [lattice.row_step.to_degrees(), lattice.col_step.to_degrees()]
}

#[test]
fn depth_cameras_have_about_one_point_a_pixel() {
    for name in [
        "robot-lbr-med7-realsense",
        "robot-lbr-med7-zed2i",
        "robot-lbr-med7-zed-lowres",
        "robot-xarm7-realsense",
    ] {
        let Some(folder) = folder(name) else { continue };
        let scene = std::fs::read_to_string(folder.join("scene.json")).unwrap();
        let scene: serde_json::Value = serde_json::from_str(&scene).unwrap();
        let position = &scene["scanner_position_world"];
        let scanners =
            KnownScanners::parse(&format!("[[scanner]]\nposition = {position}")).unwrap();
        let path = folder.join(scene["files"][0].as_str().unwrap());
        let sources = open(&[path], Some(&scanners), &Settings::default(), &OneByOne).unwrap();
        assert!(sources.warnings.is_empty());
        let lattice = sources.scans[0].lattice.unwrap();
        let (alone, filled) = filling(&sources, 0);
        eprintln!("{name}: {:?} alone {alone:.3} points a pixel {filled:.3}", degrees(&lattice));
        assert!(filled < 1.6, "{name}: {filled}");
        assert!(
            degrees(&lattice).iter().all(|d| (0.03..1.0).contains(d)),
            "{name}: {:?}",
            degrees(&lattice)
        );
    }
}

#[test]
fn a_tilting_laser_without_rows_is_rebuilt() {
    let Some(folder) = folder("indoor-las") else {
        return;
    };
    let scanners = KnownScanners::parse("[[scanner]]\nposition = [0, 0, 0]").unwrap();
    let sources = open(
        &[folder.join("pcl__room_scan1.laz")],
        Some(&scanners),
        &Settings::default(),
        &OneByOne,
    )
    .unwrap();
    let (alone, filled) = filling(&sources, 0);
    eprintln!(
        "room: {:?} alone {alone:.3} points a pixel {filled:.3}",
        degrees(&sources.scans[0].lattice.unwrap())
    );
    // Each point occurs twice in this file.
    assert!((1.9..2.3).contains(&filled), "{filled}");
    let sources =
        open(&[folder.join("lgl__indoor.laz")], None, &Settings::default(), &OneByOne).unwrap();
    assert!(!sources.scans[0].has_beams());
    let text = describe(&sources, &OneByOne)[0].to_string();
    assert!(text.contains("scanner: not known") && text.contains("free-space"), "{text}");
}

#[test]
fn gridded_files_keep_their_grid() {
    let Some(kurt) = folder("kurt3d-corridor") else {
        return;
    };
    for name in ["kurt_2scans_cartesian.e57", "kurt_2scans_spherical.e57", "kurt_2scans.ptx"] {
        let sources = open(&[kurt.join(name)], None, &Settings::default(), &OneByOne).unwrap();
        assert_eq!(sources.scans.len(), 2, "{name}");
        for scan in 0..2 {
            let lattice = sources.scans[scan].lattice.unwrap();
            let [row, col] = degrees(&lattice);
            let (alone, filled) = filling(&sources, scan);
            eprintln!("{name} {scan}: {row:.4} {col:.4} alone {alone:.4} filled {filled:.3}");
            assert!(
                (row - 0.5).abs() < 0.005 && (col - 0.517).abs() < 0.005,
                "{name}: {row} {col}"
            );
            let axis = lattice.lattice_from_scan * nalgebra::Vector3::y();
            assert!((axis - nalgebra::Vector3::z()).norm() < 1e-9, "{name}: the axis is y");
            assert!(alone > 0.98, "{name}: {alone}");
        }
        let text = serde_json::to_string(&describe(&sources, &OneByOne)).unwrap();
        assert!(text.contains("\"structured\":true"), "{text}");
    }
    let Some(pump) = folder("e57-real-pump") else {
        return;
    };
    let sources =
        open(&[pump.join("pumpAVisualReferenceImage.e57")], None, &Settings::default(), &OneByOne)
            .unwrap();
    let [row, col] = degrees(&sources.scans[0].lattice.unwrap());
    let (alone, filled) = filling(&sources, 0);
    eprintln!("pump: {row:.4} {col:.4} alone {alone:.4} filled {filled:.3}");
    assert!((0.05..0.09).contains(&row) && (0.18..0.32).contains(&col), "{row} {col}");
    assert!(describe(&sources, &OneByOne)[0].to_string().contains("irregular"));
}
