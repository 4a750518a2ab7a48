//! Clouds that lack something or say what is not so: a stated scanner position that cannot be right
//! is not used, one that is right is; what is dropped is counted; coordinates too coarse are
//! refused; a run that finds nothing says what was missing.
#![allow(clippy::print_stderr, reason = "a test that is skipped says so")]

use contract::{Kind, OneByOne};
use ingest::{KnownScanners, Sources};
use serde_json::Value;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use stillpoint::engine::Engine;
use stillpoint::eval::demo::write_robots;
use stillpoint::eval::virtual_scan::{Formats, scan_scene};
use stillpoint::job::{FlagValues, Job, Means, Outcome};
use stillpoint::plan;

/// A hall with things that stand before its walls, and three scanners whose beams are 0.6° apart:
/// sparser than any crew scans.
const HALL: &str = r#"
seed = 31
[hall]
size = [12.0, 10.0, 4.0]
[floor]
[[box]]
name = "a"
xyz = [1.0, 1.0, 0.75]
size = [1.0, 0.8, 1.5]
[[box]]
name = "b"
xyz = [-2.0, -1.5, 0.9]
size = [0.8, 1.2, 1.8]
[[box]]
name = "c"
xyz = [3.0, -2.5, 0.6]
size = [1.5, 0.7, 1.2]
[[column]]
xy = [-1.0, 2.0]
radius = 0.3
height = 4.0
[[fence]]
from = [-4.0, 3.5]
to = [2.0, 3.5]
height = 2.0
filling = "wires"
[[scanner]]
name = "s1"
position = [4.5, 3.0, 1.6]
raster = { n_beams = 120_000 }
noise = 0.002
[[scanner]]
name = "s2"
position = [-4.5, 0.5, 1.5]
raster = { n_beams = 120_000 }
noise = 0.002
[[scanner]]
name = "s3"
position = [0.5, -3.5, 1.7]
raster = { n_beams = 120_000 }
noise = 0.002
"#;

fn shared(name: &str) -> Option<PathBuf> {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared").join(name);
    if !path.exists() {
        eprintln!("skipped: no shared {name}");
        return None;
    }
    Some(path)
}

/// Scans of a LAS file whose scanners are all said to stand `off` from where they stood, metres.
fn opened(scans: &Path, off: [f64; 3]) -> Sources {
    let text = std::fs::read_to_string(scans.join("scanners.toml")).expect("scanners");
    let mut table: toml::Table = text.parse().expect("TOML");
    let entries = table["scanner"].as_array_mut().expect("a list");
    for entry in entries {
        let position = entry["position"].as_array_mut().expect("a position");
        for (value, off) in position.iter_mut().zip(off) {
            *value = toml::Value::Float(value.as_float().expect("a number") + off);
        }
    }
    let scanners = KnownScanners::parse(&table.to_string()).expect("scanners");
    let settings = ingest::Settings::default();
    ingest::open(&[scans.join("scans.las")], Some(&scanners), &settings, &OneByOne).expect("opens")
}

fn run(
    input: PathBuf,
    scanners: Option<PathBuf>,
    robots: PathBuf,
    out: PathBuf,
) -> contract::Result<Outcome> {
    let means = Means::of(&FlagValues { threads: Some(2), ..FlagValues::default() })
        .expect("defaults hold");
    let job = Job { scanners, ..Job::new(vec![input], robots, out, means) };
    plan::run(&job, &Engine::new(2))
}

fn warnings(out: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(out.join("result.json")).expect("a result");
    let result: Value = serde_json::from_str(&text).expect("JSON");
    let all = result["warnings"].as_array().expect("a list").iter();
    all.map(|w| w.as_str().expect("words").to_owned()).collect()
}

#[test]
fn right_positions_are_used_and_wrong_ones_are_not() {
    let dir = tempfile::tempdir().expect("a folder");
    let scans = dir.path().join("scans");
    let hall = simulate::Scene::from_toml(HALL).expect("a scene");
    scan_scene(&hall, &[], &scans, Formats::ALL, &Engine::new(2)).expect("scans");
    let right = opened(&scans, [0.0; 3]);
    assert!(right.scans.len() == 3 && right.scans.iter().all(contract::Scan::has_beams));
    // E57 files state their positions themselves.
    let file = [scans.join("scans.e57")];
    let own = ingest::open(&file, None, &ingest::Settings::default(), &OneByOne).expect("opens");
    assert!(own.scans.iter().all(contract::Scan::has_beams));
    for off in [[1.5, 0.0, 0.0], [0.0, -1.0, 0.8], [0.3, 0.2, -2.5]] {
        let wrong = opened(&scans, off);
        let n_used = wrong.scans.iter().filter(|s| s.has_beams()).count();
        assert!(n_used <= 1, "{off:?}: {n_used} of {} are used", wrong.scans.len());
        for scan in wrong.scans.iter().filter(|s| !s.has_beams()) {
            assert!(scan.notes.iter().any(|n| n.contains(ingest::MISPLACED)), "{:?}", scan.notes);
        }
    }
}

#[test]
fn a_position_that_cannot_be_right_does_not_cost_the_floor() {
    let Some(cloud) = shared("scans/robot-cell-covered/scenario1.laz") else { return };
    let dir = tempfile::tempdir().expect("a folder");
    let robots = dir.path().join("robots");
    write_robots(&robots).expect("the library is written");
    let scanners = dir.path().join("scanners.toml");
    std::fs::write(&scanners, "[[scanner]]\nposition = [0.0, 0.0, 0.0]\n").expect("written");
    let out = dir.path().join("out");
    run(cloud, Some(scanners), robots, out.clone()).expect("the run ends well");
    let said = warnings(&out);
    assert!(said.iter().any(|w| w.contains(ingest::MISPLACED)), "{said:?}");
    assert!(said.iter().any(|w| w.contains("no scan has a usable scanner position")), "{said:?}");
    assert!(said.iter().any(|w| w.contains("the points are sparse")), "{said:?}");
    let kinds = std::fs::read(out.join("labels/0.kind.npy")).expect("a mask");
    let n_floor = kinds[kinds.len() - 42_764..].iter().filter(|kind| **kind == 3).count();
    assert!(n_floor > 7_000, "{n_floor} points are floor");
}

#[test]
fn returns_at_the_scanner_are_dropped_counted_and_uncertain() {
    let Some(cloud) = shared("cases/e57-returns-at-origin/phantom.e57") else { return };
    let dir = tempfile::tempdir().expect("a folder");
    let robots = dir.path().join("robots");
    write_robots(&robots).expect("the library is written");
    let out = dir.path().join("out");
    run(cloud, None, robots, out.clone()).expect("the run ends well");
    let said = warnings(&out);
    assert!(said.iter().any(|w| w.contains("7200 points lie at the scanner itself")), "{said:?}");
    let kinds = std::fs::read(out.join("labels/0.kind.npy")).expect("a mask");
    let n_none = kinds[kinds.len() - 9_600..].iter().filter(|kind| **kind == 255).count();
    assert!(n_none >= 7_200, "{n_none} points are uncertain");
}

#[test]
fn coordinates_in_steps_of_half_a_metre_are_refused_by_name() {
    let dir = tempfile::tempdir().expect("a folder");
    let robots = dir.path().join("robots");
    write_robots(&robots).expect("the library is written");
    let mut text =
        "40\n25\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n".to_owned();
    for k in 0..1000_u32 {
        let at = |about: f32, by: f32| about + 10.0 * (f64::from(k) * f64::from(by)).sin() as f32;
        let _ =
            writeln!(text, "{} {} {}", at(412_300.0, 0.7), at(5_653_120.0, 1.3), at(87.0, 0.37));
    }
    let cloud = dir.path().join("coarse.ptx");
    std::fs::write(&cloud, text).expect("written");
    let refusal = run(cloud, None, robots, dir.path().join("out")).expect_err("it is refused");
    assert_eq!(refusal.kind(), Kind::BadInput);
    let words = refusal.to_string();
    assert!(words.contains("coarse.ptx") && words.contains("steps of 0.50 m"), "{words}");
}
