//! Scanner positions that a cloud does not state are found from its points, by `scanners` and by a
//! run; where they cannot be found, it is said why.

use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};
use stillpoint::engine::Engine;
use stillpoint::eval::virtual_scan::{Formats, scan_scene};

/// A hall with furniture and three tilted scanners.
const HALL: &str = r#"
seed = 77
[hall]
size = [13.0, 9.0, 4.5]
[floor]
[[box]]
name = "a"
xyz = [1.5, 1.0, 0.75]
size = [1.0, 0.8, 1.5]
[[box]]
name = "b"
xyz = [-2.0, -1.5, 0.9]
size = [0.8, 1.2, 1.8]
[[column]]
xy = [-1.0, 2.0]
radius = 0.3
height = 4.5
[[scanner]]
name = "s1"
position = [4.5, 3.0, 1.6]
rpy_deg = [1.5, -0.7, 30.0]
raster = { n_beams = 300_000 }
noise = 0.002
registration = { xyz = [0.004, -0.002, 0.001], rpy_deg = [0.02, 0.05, -0.1] }
[[scanner]]
name = "s2"
position = [-4.5, 0.5, 1.5]
rpy_deg = [-0.8, 1.1, 200.0]
raster = { n_beams = 400_000 }
noise = 0.003
dropouts = 0.05
[[scanner]]
name = "s3"
position = [0.5, -3.5, 1.7]
raster = { n_beams = 350_000 }
noise = 0.001
"#;

fn stillpoint(dir: &Path, args: &[&str]) -> Output {
    let program = env!("CARGO_BIN_EXE_stillpoint");
    let args = args.iter().copied().chain(["--progress", "none"]);
    Command::new(program).args(args).current_dir(dir).output().expect("starts")
}

fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|e| panic!("{e}: {}", String::from_utf8_lossy(&output.stderr)))
}

/// The hall's scans, in `scans`.
fn hall() -> tempfile::TempDir {
    let dir = tempfile::tempdir().expect("a folder");
    let hall = simulate::Scene::from_toml(HALL).expect("a scene");
    let formats = Formats { labels: false, ..Formats::ALL };
    scan_scene(&hall, &[], &dir.path().join("scans"), formats, &Engine::new(2)).expect("scans");
    dir
}

/// Positions that the scans' own file of scanners states.
fn stated(dir: &Path) -> Vec<[f64; 3]> {
    let text = std::fs::read_to_string(dir.join("scans/scanners.toml")).expect("scanners");
    let known = ingest::KnownScanners::parse(&text).expect("parses");
    known.entries.iter().map(|e| e.world_from_scan.translation.vector.into()).collect()
}

/// Writes the LAS file again with its records as `change` leaves them.
fn changed(dir: &Path, name: &str, change: impl Fn(&mut Vec<Vec<u8>>)) {
    let mut bytes = std::fs::read(dir.join("scans/scans.las")).expect("reads");
    let start = u32::from_le_bytes(bytes[96..100].try_into().expect("four")) as usize;
    let len = usize::from(u16::from_le_bytes(bytes[105..107].try_into().expect("two")));
    let mut records: Vec<Vec<u8>> = bytes[start..].chunks_exact(len).map(<[u8]>::to_vec).collect();
    change(&mut records);
    bytes.truncate(start);
    bytes.extend(records.concat());
    std::fs::write(dir.join(name), bytes).expect("writes");
}

fn without_ids(records: &mut [Vec<u8>]) {
    records.iter_mut().for_each(|r| r[20..22].fill(0));
}

/// Asserts that each stated position is found within a millimetre, and nothing else.
fn assert_found(setups: &Value, dir: &Path) {
    let setups = setups.as_array().expect("a list");
    let truth = stated(dir);
    assert_eq!(setups.len(), truth.len(), "{setups:?}");
    for at in truth {
        let off = |setup: &Value| {
            (0..3)
                .map(|a| (setup["position"][a].as_f64().expect("a number") - at[a]).powi(2))
                .sum::<f64>()
                .sqrt()
        };
        assert!(setups.iter().any(|setup| off(setup) < 0.001), "{at:?}: {setups:?}");
    }
}

#[test]
fn positions_are_found_written_and_used() {
    let dir = hall();
    let at = dir.path();
    let args = ["scanners", "scans/scans.las", "--json"];
    let one = stillpoint(at, &[&args[..], &["--threads", "1"]].concat());
    let four = stillpoint(at, &[&args[..], &["--threads", "4", "--out", "found.toml"]].concat());
    assert_eq!(one.status.code(), Some(0), "{}", String::from_utf8_lossy(&one.stderr));
    assert!(one.stdout == four.stdout, "the answer depends on threads");
    let found = json(&one);
    assert_eq!(found["schema"], "stillpoint.scanners/1");
    assert_found(&found["clouds"][0]["setups"], at);
    let seen =
        stillpoint(at, &["inspect", "scans/scans.las", "--scanners", "found.toml", "--json"]);
    let scans = json(&seen)["inputs"][0]["scans"].as_array().expect("a list").clone();
    assert_eq!(scans.len(), 3);
    assert!(scans.iter().all(|s| s["scanner_known"] == true && s["lattice"].is_object()));
    let by_name = stillpoint(at, &["inspect", "scans/scans.las", "--scanners", "auto", "--json"]);
    // A quaternion that is read is made of unit length again, which may change its last digit.
    let at_once = json(&by_name)["inputs"][0]["scans"].clone();
    for (one, other) in scans.iter().zip(at_once.as_array().expect("a list")) {
        assert_eq!(one["world_from_scan"]["xyz"], other["world_from_scan"]["xyz"]);
        let step = |scan: &Value| scan["lattice"]["row_step_deg"].as_f64().expect("a number");
        assert!((step(one) - step(other)).abs() < 1e-9);
    }
    let plain = json(&stillpoint(at, &["inspect", "scans/scans.las", "--json"]));
    assert_eq!(plain["inputs"][0]["scans"][0]["scanner_known"], false);
}

#[test]
fn points_without_ids_are_told_apart_by_their_places() {
    let dir = hall();
    let at = dir.path();
    changed(at, "merged.las", |records| without_ids(records));
    let found = stillpoint(at, &["scanners", "merged.las", "--out", "found.toml", "--json"]);
    assert_eq!(found.status.code(), Some(0), "{}", String::from_utf8_lossy(&found.stderr));
    assert_found(&json(&found)["clouds"][0]["setups"], at);
    let text = std::fs::read_to_string(at.join("found.toml")).expect("written");
    let known = ingest::KnownScanners::parse(&text).expect("parses");
    let n_points: Vec<u64> = {
        let truth = std::fs::read_to_string(at.join("scans/truth/truth.json")).expect("truth");
        let truth: Value = serde_json::from_str(&truth).expect("JSON");
        truth["scans"]
            .as_array()
            .expect("a list")
            .iter()
            .map(|s| s["n_points"].as_u64().expect("a count"))
            .collect()
    };
    let mut ends: Vec<u64> =
        known.entries.iter().flat_map(|e| e.places.last()).map(|p| p[1] + 1).collect();
    ends.sort_unstable();
    let mut total = 0;
    for (end, n) in ends.iter().zip(n_points) {
        total += n;
        assert!(end.abs_diff(total) < 100, "{ends:?} {total}");
    }
    // Tiles in turn: the file is read once.
    changed(at, "turns.las", |records| {
        without_ids(records);
        let third = records.len() / 3;
        let pieces: Vec<Vec<Vec<u8>>> =
            records.chunks(third / 40).map(<[Vec<u8>]>::to_vec).collect();
        let n = pieces.len();
        *records = (0..n).map(|i| pieces[i * 41 % n].clone()).collect::<Vec<_>>().concat();
    });
    let found = stillpoint(at, &["scanners", "turns.las", "--out", "turns.toml", "--json"]);
    assert_found(&json(&found)["clouds"][0]["setups"], at);
    let seen = stillpoint(at, &["inspect", "turns.las", "--scanners", "turns.toml", "--json"]);
    let scans = json(&seen)["inputs"][0]["scans"].clone();
    let n_known = scans.as_array().expect("a list").iter().filter(|s| s["scanner_known"] == true);
    assert_eq!(n_known.count(), 3, "{scans}");
}

/// World points of the records of a scan of the hall, in their order.
fn points_of(dir: &Path, source: u16) -> Vec<[f64; 3]> {
    let bytes = std::fs::read(dir.join("scans/scans.las")).expect("reads");
    let start = u32::from_le_bytes(bytes[96..100].try_into().expect("four")) as usize;
    let len = usize::from(u16::from_le_bytes(bytes[105..107].try_into().expect("two")));
    let float = |at: usize| f64::from_le_bytes(bytes[at..at + 8].try_into().expect("eight"));
    let world = |record: &[u8]| {
        [0, 1, 2].map(|a| {
            let steps = i32::from_le_bytes(record[4 * a..4 * a + 4].try_into().expect("four"));
            f64::from(steps) * float(131 + 8 * a) + float(155 + 8 * a)
        })
    };
    let is_own = |record: &&[u8]| u16::from_le_bytes([record[20], record[21]]) == source;
    bytes[start..].chunks_exact(len).filter(is_own).map(world).collect()
}

#[test]
fn lists_of_points_in_their_order_give_their_scanners() {
    let dir = hall();
    let at = dir.path();
    let scans = [1, 2, 3].map(|source| points_of(at, source));
    let lines = |points: &[[f64; 3]], between: &str| -> String {
        let line = |p: &[f64; 3]| p.map(|v| format!("{v:.4}")).join(between) + "\n";
        points.iter().map(line).collect()
    };
    let pts = |points: &[[f64; 3]]| format!("{}\n{}", points.len(), lines(points, " "));
    std::fs::write(at.join("hall.pts"), scans.iter().map(|p| pts(p)).collect::<String>())
        .expect("writes");
    let csv = format!("x;y;z\n{}", lines(&scans[0], ";"));
    std::fs::write(at.join("one.csv"), csv).expect("writes");
    let n = scans[1].len();
    let xyz = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n";
    let head = format!("VERSION 0.7\n{xyz}WIDTH {n}\nHEIGHT 1\nPOINTS {n}\nDATA binary\n");
    let floats = scans[1].iter().flatten().flat_map(|v| (*v as f32).to_le_bytes());
    let pcd: Vec<u8> = head.bytes().chain(floats).collect();
    std::fs::write(at.join("two.pcd"), pcd).expect("writes");
    let found = stillpoint(at, &["scanners", "hall.pts", "--json"]);
    assert_eq!(found.status.code(), Some(0), "{}", String::from_utf8_lossy(&found.stderr));
    let of_blocks: Vec<Value> = json(&found)["clouds"]
        .as_array()
        .expect("a list")
        .iter()
        .flat_map(|cloud| cloud["setups"].as_array().expect("a list").clone())
        .collect();
    assert_found(&Value::from(of_blocks), at);
    let seen = stillpoint(
        at,
        &["inspect", "hall.pts", "one.csv", "two.pcd", "--scanners", "auto", "--json"],
    );
    assert_eq!(seen.status.code(), Some(0), "{}", String::from_utf8_lossy(&seen.stderr));
    let inputs = json(&seen)["inputs"].as_array().expect("a list").clone();
    let scans: Vec<&Value> =
        inputs.iter().flat_map(|input| input["scans"].as_array().expect("a list")).collect();
    assert_eq!(scans.len(), 5);
    assert!(scans.iter().all(|s| s["scanner_known"] == true && s["lattice"].is_object()));
    // All setups in one list: found, but no scanners file can tell their points apart.
    let unified = lines(&points_all(at), " ");
    std::fs::write(at.join("all.xyz"), unified).expect("writes");
    let found = json(&stillpoint(at, &["scanners", "all.xyz", "--json"]))["clouds"][0].clone();
    assert_found(&found["setups"], at);
    assert!(found["setups"].as_array().expect("a list").iter().all(|s| s["is_usable"] == false));
    assert!(found["unknown"].as_str().is_some_and(|cause| cause.contains("written as LAS")));
}

fn points_all(dir: &Path) -> Vec<[f64; 3]> {
    [1, 2, 3].into_iter().flat_map(|source| points_of(dir, source)).collect()
}

/// The records in an order that has nothing to do with that of measurement.
fn shuffled(records: &mut Vec<Vec<u8>>) {
    let n = records.len();
    // A step without a divisor in common with the number of records visits all of them.
    let step = (n * 5 / 8..n).find(|s| gcd(*s, n) == 1).expect("a step");
    *records = (0..n).map(|i| records[(i * step) % n].clone()).collect();
}

#[test]
fn a_shuffled_cloud_gives_positions_and_whose_its_points_are() {
    let dir = hall();
    let at = dir.path();
    changed(at, "shuffled.las", |records| {
        // Ids tell the truth afterwards.
        shuffled(records);
    });
    let args = ["scanners", "shuffled.las", "--out", "found.toml", "--json"];
    let found = stillpoint(at, &[&args[..], &["--threads", "2"]].concat());
    assert_eq!(found.status.code(), Some(0), "{}", String::from_utf8_lossy(&found.stderr));
    let one = stillpoint(at, &["scanners", "shuffled.las", "--json", "--threads", "1"]);
    assert!(one.stdout == found.stdout, "the answer depends on threads");
    let cloud = json(&found)["clouds"][0].clone();
    assert_found(&cloud["setups"], at);
    let setups = cloud["setups"].as_array().expect("a list");
    assert!(setups.iter().all(|s| s["is_usable"] == true), "{cloud}");
    let is_told = |s: &Value| s["evidence"].as_str().is_some_and(|e| e.contains("without order"));
    assert!(setups.iter().all(is_told), "{cloud}");
    for scanners in ["found.toml", "auto"] {
        let args = ["inspect", "shuffled.las", "--scanners", scanners, "--json"];
        let scans = json(&stillpoint(at, &args))["inputs"][0]["scans"].clone();
        let is_known = |s: &&Value| s["scanner_known"] == true && s["lattice"].is_object();
        let n_known = scans.as_array().expect("a list").iter().filter(is_known).count();
        assert_eq!(n_known, 3, "{scans}");
    }
    assert_owned(at);
    let over = stillpoint(at, &["scanners", "shuffled.las", "--out", "shuffled.las"]);
    assert_eq!(over.status.code(), Some(2));
}

/// Asserts that the points of `shuffled.las` are given to their scanners, whose ids they have, and
/// hardly one to another.
fn assert_owned(dir: &Path) {
    let text = std::fs::read_to_string(dir.join("found.toml")).expect("written");
    let known = ingest::KnownScanners::parse(&text).expect("parses");
    let (path, settings) = (dir.join("shuffled.las"), ingest::Settings::default());
    let sources = ingest::open(&[path], Some(&known), &settings, &contract::OneByOne);
    let sources = sources.expect("opens");
    let mut counts = std::collections::BTreeMap::<(u32, u16), usize>::new();
    for strip in sources.strips(contract::InputId(0), ingest::Want::Everything).expect("reads") {
        let strip = strip.expect("reads");
        for id in strip.attributes.expect("all attributes").source_id {
            *counts.entry((strip.scan.0, id)).or_default() += 1;
        }
    }
    let total: usize = counts.values().sum();
    let mut n_own = 0;
    for scan in 0..3 {
        let of = |id: u16| counts.get(&(scan, id)).copied().unwrap_or_default();
        let all = [of(1), of(2), of(3)];
        let most = all.into_iter().max().unwrap_or_default();
        let others = all.iter().sum::<usize>() - most;
        assert!(others * 1000 < most, "{counts:?}");
        n_own += most;
    }
    assert!(2 * n_own > total, "{counts:?}");
}

#[test]
fn a_run_uses_the_position_of_a_shuffled_scan() {
    let dir = hall();
    let at = dir.path();
    changed(at, "one.las", |records| {
        records.retain(|r| r[20] == 2);
        without_ids(records);
        shuffled(records);
    });
    // The header counts the records that were left out, too.
    let bytes = std::fs::read(at.join("one.las")).expect("reads");
    std::fs::write(at.join("one.las"), counted(bytes)).expect("writes");
    stillpoint::eval::demo::write_robots(&at.join("robots")).expect("a library");
    let run = |out: &str, more: &[&str]| {
        let args = ["run", "one.las", "--robots", "robots", "--out", out];
        let output = stillpoint(at, &[&args[..], more].concat());
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        let text = std::fs::read(at.join(out).join("result.json")).expect("a result");
        serde_json::from_slice::<Value>(&text).expect("JSON")
    };
    let found = run("found", &[]);
    let scans = found["inputs"][0]["scans"].as_array().expect("a list");
    assert_eq!(scans.len(), 1);
    assert!(scans[0]["scanner"] == "found" && scans[0]["sigma"][0].as_f64() < Some(0.001));
    let truth = stated(at)[1];
    for (a, truth) in truth.iter().enumerate() {
        let found = scans[0]["position"][a].as_f64().expect("a number");
        assert!((found - truth).abs() < 0.001, "{scans:?} {truth:?}");
    }
    let listed = stillpoint(at, &["scanners", "one.las", "--out", "one.toml"]);
    assert_eq!(listed.status.code(), Some(0), "{}", String::from_utf8_lossy(&listed.stdout));
    let given = run("given", &["--scanners", "one.toml"]);
    assert_eq!(found["labels"], given["labels"]);
}

/// The file with the number of records that it holds in its header.
fn counted(mut bytes: Vec<u8>) -> Vec<u8> {
    let start = u32::from_le_bytes(bytes[96..100].try_into().expect("four")) as usize;
    let len = usize::from(u16::from_le_bytes(bytes[105..107].try_into().expect("two")));
    let n = ((bytes.len() - start) / len) as u64;
    if bytes[107..111] != [0; 4] {
        bytes[107..111].copy_from_slice(&(n as u32).to_le_bytes());
    }
    bytes[247..255].copy_from_slice(&n.to_le_bytes());
    bytes[255..263].copy_from_slice(&n.to_le_bytes());
    bytes
}

fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

#[test]
fn a_run_uses_found_positions_says_so_and_is_the_same_again() {
    let dir = hall();
    let at = dir.path();
    stillpoint::eval::demo::write_robots(&at.join("robots")).expect("a library");
    let run = |out: &str, more: &[&str]| {
        let args = ["run", "scans/scans.las", "--robots", "robots", "--out", out];
        let output = stillpoint(at, &[&args[..], more].concat());
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        let text = std::fs::read(at.join(out).join("result.json")).expect("a result");
        (serde_json::from_slice::<Value>(&text).expect("JSON"), output)
    };
    let (found, _) = run("found", &["--threads", "1"]);
    let scans = found["inputs"][0]["scans"].as_array().expect("a list");
    assert_eq!(scans.len(), 3);
    assert!(scans.iter().all(|s| s["scanner"] == "found" && s["sigma"][0].as_f64() < Some(0.001)));
    let warnings = found["warnings"].to_string();
    assert!(!warnings.contains("position is not known"), "{warnings}");
    let (again, output) = run("found", &["--threads", "2"]);
    assert_eq!(found, again);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(
        said.contains("unchanged") || said.contains("reused") || said.contains("again"),
        "{said}"
    );
    let (unknown, _) = run("unknown", &["--scanners", "none"]);
    let scans = unknown["inputs"][0]["scans"].as_array().expect("a list");
    assert!(scans.iter().all(|s| s["scanner"] == "unknown" && s["position"].is_null()));
    let (given, _) = run("given", &["--scanners", "scans/scanners.toml"]);
    let scans = given["inputs"][0]["scans"].as_array().expect("a list");
    assert!(scans.iter().all(|s| s["scanner"] == "given" && s["sigma"].is_null()));
}

/// Setups of the points of a real file in their order, with those that it states.
fn of_real(name: &str) -> Option<(setups::FoundSetups, Vec<[f64; 3]>)> {
    let path =
        std::path::PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/scans").join(name);
    if !path.exists() {
        return None;
    }
    let settings = ingest::Settings::default();
    let sources = ingest::open(&[path], None, &settings, &contract::OneByOne).expect("opens");
    let mut points: Vec<[f64; 3]> = Vec::new();
    for strip in sources.strips(contract::InputId(0), ingest::Want::Coordinates).expect("reads") {
        let strip = strip.expect("reads");
        let pose = sources.scans[strip.scan.0 as usize].world_from_scan;
        points.extend(
            strip
                .xyz
                .iter()
                .map(|p| -> [f64; 3] { (pose * nalgebra::Point3::from(p.map(f64::from))).into() }),
        );
    }
    let window = |(i, points): (usize, &[[f64; 3]])| setups::ScanWindow {
        place: i as u64 * 512,
        source: 0,
        points: points.to_vec(),
    };
    let windows: Vec<setups::ScanWindow> = points.chunks(512).enumerate().map(window).collect();
    let at = sources.scans.iter().map(|s| s.world_from_scan.translation.vector.into()).collect();
    Some((setups::find(&windows, &setups::SetupLimits::default()), at))
}

#[test]
fn real_scanners_are_found_where_they_stood() {
    let off = |a: [f64; 3], b: [f64; 3]| (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt();
    for (name, n) in [
        ("kurt3d-corridor/kurt_2scans.ptx", 2),
        ("kurt3d-corridor/kurt_2scans_cartesian.e57", 2),
        ("e57-real-pump/pumpAVisualReferenceImage.e57", 0),
    ] {
        let Some((found, truth)) = of_real(name) else { continue };
        assert!(found.setups.len() >= n, "{name}: {:?}", found.cause);
        for setup in &found.setups {
            let nearest =
                truth.iter().map(|at| off(*at, setup.position())).fold(f64::INFINITY, f64::min);
            assert!(nearest < 0.005, "{name}: {nearest} m off: {setup:?}");
        }
        assert!(found.setups.len() <= truth.len());
    }
}
