//! The whole way from outside: a virtual scan of a robot of our own in, the robot found and its
//! points labelled out; and the same bytes for any number of threads.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use stillpoint::engine::Engine;
use stillpoint::estimate::estimate;
use stillpoint::eval::compare::Agreement;
use stillpoint::eval::demo::write_robots;
use stillpoint::eval::virtual_scan::{Formats, scan_scene};
use stillpoint::job::{FlagValues, Job, Means};
use stillpoint::plan;
use stillpoint::result::scene_export::{SceneFormat, SceneRequest, export_scene};

/// Beams of each of the six scanners: about 30 mm apart at 5 m, an eighth of what a crew would
/// take.
const N_BEAMS: u64 = 600_000;
/// Error of the base that so few points allow, metres.
const BASE: f64 = 0.003;
/// Error of a joint that is said to be determined, degrees.
const JOINT_DEG: f64 = 0.3;

/// A palletiser with its bars on a bare floor, scanned into `dir`.
fn scene(dir: &Path) -> PathBuf {
    let robots = dir.join("robots");
    write_robots(&robots).expect("the library is written");
    let library = robot::Library::load(&robots, &robot::Settings::without_clouds()).expect("loads");
    let model =
        &library.models[library.model(simulate::demo_robots::PALLETISER).expect("is there")];
    let posture: Vec<f64> = (0..model.n_free())
        .map(|j| {
            let [low, high] = model.limits(j);
            low + (high - low) * 0.6
        })
        .collect();
    let scene = simulate::paper_scene(7, model, &posture, N_BEAMS);
    let engine = Engine::new(2);
    scan_scene(&scene, &library.models, &dir.join("scans"), Formats::ALL, &engine).expect("scans");
    robots
}

fn run(input: PathBuf, scanners: Option<PathBuf>, robots: &Path, out: PathBuf, threads: usize) {
    run_job(&Job { scanners, ..job(input, robots, out, threads) });
}

fn job(input: PathBuf, robots: &Path, out: PathBuf, threads: usize) -> Job {
    let given = FlagValues { threads: Some(threads), ..FlagValues::default() };
    let means = Means::of(&given).expect("defaults hold");
    Job::new(vec![input], robots.to_path_buf(), out, means)
}

fn run_job(job: &Job) {
    let engine = Engine::new(job.means.n_threads);
    let planned = estimate(job, &engine).expect("it can be planned");
    plan::run(job, &engine).expect("the run ends well");
    let written = n_bytes(&job.out);
    let most = planned.store_bytes + planned.output_bytes;
    assert!(written <= most, "{written} bytes are written, `plan` said {most}");
}

/// Bytes of all files below a folder.
fn n_bytes(dir: &Path) -> u64 {
    let all = std::fs::read_dir(dir).expect("a folder").map(|e| e.expect("an entry").path());
    let own = |path: PathBuf| {
        if path.is_dir() { n_bytes(&path) } else { path.metadata().expect("a file").len() }
    };
    all.map(own).sum()
}

/// Every file below a folder but the store, by its name.
fn files(dir: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut out = BTreeMap::new();
    let mut folders = vec![dir.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            let name = path.strip_prefix(dir).expect("below").to_path_buf();
            if path.is_dir() {
                if name != Path::new("store") {
                    folders.push(path);
                }
            } else {
                out.insert(name, std::fs::read(&path).expect("a file"));
            }
        }
    }
    out
}

#[test]
fn the_robot_is_found_and_any_number_of_threads_gives_the_same_bytes() {
    let dir = tempfile::tempdir().expect("a folder");
    let robots = scene(dir.path());
    let input = dir.path().join("scans/scans.e57");
    for threads in [1, 2] {
        run(input.clone(), None, &robots, dir.path().join(format!("out{threads}")), threads);
    }
    let agreement =
        Agreement::of(&dir.path().join("out2"), &dir.path().join("scans/truth")).expect("compares");
    let found = agreement.robots[0].found.as_ref().expect("the robot is found");
    assert_eq!(found.model, simulate::demo_robots::PALLETISER);
    assert_eq!(agreement.n_invented, 0);
    assert!(found.base[0] < BASE, "base off by {} m", found.base[0]);
    assert!(agreement.worst_joint_deg() < JOINT_DEG, "{}", agreement.table());
    assert!(agreement.points.f1() > 0.97, "{}", agreement.table());
    space_is_told(&dir.path().join("out2"));
    links_stand_as_told(&dir.path().join("out2"));
    let (one, two) = (files(&dir.path().join("out1")), files(&dir.path().join("out2")));
    assert!(one.keys().eq(two.keys()), "the same files");
    assert!(one.len() > 10, "{:?}", one.keys());
    for (name, bytes) in &one {
        assert!(two[name] == *bytes, "{} differs", name.display());
    }
    scenes_are_the_same_and_load(dir.path(), &robots);
    page_shows_the_result(&dir.path().join("out2"));
}

/// Each format of scenes is written with the same bytes for any number of threads, and the URDF
/// stands where the result says.
fn scenes_are_the_same_and_load(dir: &Path, robots: &Path) {
    use SceneFormat::{Gltf, Mjcf, Moveit, Robodk, Sdf, Srdf, Urdf, Usd};
    let means = Means::of(&FlagValues::default()).expect("defaults hold");
    for (out, threads) in [("out1", 1), ("out2", 2)] {
        for format in [Urdf, Srdf, Moveit, Usd, Mjcf, Sdf, Gltf, Robodk] {
            let request = SceneRequest {
                out: dir.join(out),
                format,
                robots: Some(robots.to_path_buf()),
                package: None,
            };
            let engine = Engine::new(threads);
            let (written, _) = export_scene(&request, &means, &engine).expect("is written");
            assert!(written.iter().all(|path| path.is_file()), "{written:?}");
        }
    }
    let [one, two] = ["out1", "out2"].map(|out| files(&dir.join(out).join("export")));
    assert!(one.len() > 50 && one == two);
    let out = dir.join("out2");
    let urdf = out.join("export/urdf/R1/robot.urdf");
    let settings = robot::Settings::without_clouds();
    let (model, _) = robot::Model::load_urdf(&urdf, "R1", &settings).expect("loads");
    let result = export::ResultFile::read(&out).expect("a result");
    let entry = &result.robots[0];
    // Bars that follow the robot's joints follow in the URDF as well, but for one in a loop that is
    // no line of a joint.
    let known: std::collections::BTreeMap<&String, f64> =
        entry.joints.0.iter().chain(&entry.passive.0).map(|(name, value)| (name, *value)).collect();
    let free = model.free.iter().map(|&joint| &model.joints[joint].name);
    let posture: Vec<f64> = free.map(|name| known[name]).collect();
    assert_eq!(posture.len(), entry.joints.0.len() + 1);
    for ((name, stated), pose) in entry.link_poses.0.iter().zip(&model.poses(&posture)[1..]) {
        let off = (0..3).map(|i| (stated.xyz[i] - pose.translation.vector[i]).powi(2)).sum::<f64>();
        assert!(off.sqrt() < 1e-6, "{name} is off by {} m", off.sqrt());
    }
    // Files of an earlier scene go when they are no part of the new one; those of others stay.
    let folder = out.join("export/urdf");
    std::fs::create_dir(folder.join("R9")).expect("is made");
    for name in ["R9/robot.urdf", "mine.urdf"] {
        std::fs::write(folder.join(name), "").expect("writes");
    }
    let list = std::fs::read_to_string(folder.join("files.txt")).expect("text");
    std::fs::write(folder.join("files.txt"), list + "R9/robot.urdf\n").expect("writes");
    let robots = Some(robots.to_path_buf());
    let mut request = SceneRequest { out, format: Urdf, robots, package: None };
    export_scene(&request, &means, &Engine::new(1)).expect("is written");
    assert!(!folder.join("R9/robot.urdf").exists() && folder.join("mine.urdf").exists());
    // Another library is refused by name.
    let other = dir.join("other");
    request.robots = Some(other.clone());
    let path = other.join("demo_palletiser_2000/robot.urdf");
    for (old, new, what) in [
        ("joint_3\"", "joint_three\"", "other links or joints"),
        ("xyz=\"0 0 0.38\"", "xyz=\"0.1 0 0.38\"", "other frames of joints"),
    ] {
        write_robots(&other).expect("the library is written");
        let text = std::fs::read_to_string(&path).expect("text");
        assert!(text.contains(old), "{text}");
        std::fs::write(&path, text.replace(old, new)).expect("writes");
        let error = export_scene(&request, &means, &Engine::new(1)).expect_err("is refused");
        let words = error.to_string();
        assert!(words.contains("R1") && words.contains(what), "{words}");
        std::fs::remove_dir_all(&other).expect("is removed");
    }
}

/// The run has made a page of the result, which `report --html` leaves as it is; it holds the
/// result as it is, and a changed page is refused.
fn page_shows_the_result(out: &Path) {
    let report = |flag: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_stillpoint"));
        command.arg("report").arg(out).arg(flag).output().expect("starts")
    };
    let make = || {
        assert!(report("--html").status.success());
        std::fs::read_to_string(out.join("report.html")).expect("a page")
    };
    let list = std::fs::read_to_string(out.join("manifest.json")).expect("a list");
    assert!(list.contains("report.html"), "the page is one of the files of the result");
    let page = std::fs::read_to_string(out.join("report.html")).expect("a page");
    assert!(page == make(), "the same bytes");
    assert!(page.len() < 15_000_000, "{} bytes", page.len());
    let data = page.split_once("id=\"data\">").expect("data").1;
    let data = data.split_once("</script>").expect("its end").0;
    let result = std::fs::read_to_string(out.join("result.json")).expect("a result");
    let value = |text: &str| -> serde_json::Value { serde_json::from_str(text).expect("JSON") };
    let (data, result) = (value(data), value(&result));
    assert_eq!(data["result"], result);
    let points = data["n_points"].as_object().expect("counts").values();
    let n: u64 = points.map(|n| n.as_u64().expect("a count")).sum();
    let scans = result["labels"]["scans"].as_array().expect("scans").iter();
    let all: u64 = scans.map(|scan| scan["n_points"].as_u64().expect("a count")).sum();
    assert!(n <= all && n > all * 9 / 10, "{n} of {all} points");
    let view = page.split_once("id=\"view-data\">").expect("the view").1;
    let view = value(view.split_once("</script>").expect("its end").0);
    assert!(view["trees"][0]["loops"].as_array().is_some_and(|loops| !loops.is_empty()), "loops");
    assert!(view["robots"][0]["mesh"].is_u64(), "a body");
    let printed = report("--json");
    assert_eq!(value(&String::from_utf8_lossy(&printed.stdout))["result"], result);
    let path = out.join("report.html");
    let mut bytes = std::fs::read(&path).expect("a page");
    bytes[200] ^= 1;
    std::fs::write(&path, bytes).expect("writes");
    let refused = report("--html");
    assert_eq!(refused.status.code(), Some(4));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("report.html"));
}

/// Space about the robot: its body is its own, the air beside it was seen, the floor is fixed.
fn space_is_told(out: &Path) {
    let text = std::fs::read_to_string(out.join("result.json")).expect("a result");
    let result: export::ResultFile = serde_json::from_str(&text).expect("parses");
    let robot = &result.robots[0];
    let space = robot.space.as_ref().expect("the scans have beams");
    let bytes = std::fs::read(out.join(&space.grid)).expect("an array");
    let kinds = &bytes[bytes.len() - space.size.iter().product::<usize>()..];
    let at = |p: [f64; 3]| {
        let cell: [usize; 3] =
            std::array::from_fn(|i| ((p[i] - space.origin[i]) / space.edge) as usize);
        kinds[(cell[0] * space.size[1] + cell[1]) * space.size[2] + cell[2]]
    };
    let [x, y, z] = robot.base_pose.xyz;
    assert_eq!(at([x, y, z + 0.25]), 3, "inside the base");
    assert_eq!(at([x + 1.2, y + 1.2, z + 0.5]), 1, "beside the robot");
    assert_eq!(at([x + 1.2, y + 1.2, z]), 2, "the floor");
    assert!(space.free_m3 > 10.0 && space.unknown_m3 > 0.0, "{space:?}");
    for tree in [&space.octomap, &space.unknown] {
        let bytes = std::fs::read(out.join(tree)).expect("a tree");
        assert!(bytes.starts_with(b"# Octomap OcTree binary file"), "{tree}");
    }
}

/// The robot as a planner loads it, in the posture of its table, has each link where the result
/// says that it is; bars of its loops, too.
fn links_stand_as_told(out: &Path) {
    let robot = &export::ResultFile::read(out).expect("a result").robots[0];
    let folder = out.join("robots").join(&robot.id);
    let settings = robot::Settings::without_clouds();
    let (model, _) =
        robot::Model::load_urdf(&folder.join("robot.urdf"), "again", &settings).expect("loads");
    let table = std::fs::read_to_string(folder.join("joints.csv")).expect("a table");
    let row = |line: &str| {
        let (name, rest) = line.split_once(',')?;
        Some((name.trim_matches('"').to_owned(), rest.split(',').next()?.parse().ok()?))
    };
    let rows: BTreeMap<String, f64> = table.lines().skip(1).filter_map(row).collect();
    assert_eq!(rows.len(), robot.joints.0.len() + robot.passive.0.len(), "{table}");
    for (name, value) in robot.joints.0.iter().chain(&robot.passive.0) {
        assert!((rows[name] - value).abs() < 1e-8, "{name}: {value} against {}", rows[name]);
    }
    let posture: Vec<f64> = model.free.iter().map(|&j| rows[&model.joints[j].name]).collect();
    let poses = model.poses(&posture);
    assert_eq!(robot.link_poses.0.len(), robot.links.len());
    let told = |name: &str| {
        let pose = robot.link_poses.0.iter().find(|(link, _)| link == name).expect("each link").1;
        let [w, i, j, k] = pose.quat_wxyz;
        let turn = nalgebra::Unit::new_normalize(nalgebra::Quaternion::new(w, i, j, k));
        geometry::Pose::from_parts(pose.xyz.into(), turn)
    };
    let world_from_base = told(&robot.base_link);
    assert_eq!(told(&robot.base_link).translation.vector.as_slice(), robot.base_pose.xyz);
    for (link, pose) in model.links.iter().zip(poses) {
        let off = (world_from_base * pose).inv_mul(&told(&link.name));
        let [far, turned] = [off.translation.vector.norm(), off.rotation.angle()];
        assert!(far < 1e-6 && turned < 1e-6, "{} is {far} m, {turned} rad off", link.name);
    }
}

#[test]
fn las_without_scanner_positions_has_them_found_or_doubts_and_a_lying_count_is_refused() {
    let dir = tempfile::tempdir().expect("a folder");
    let robots = scene(dir.path());
    let scans = dir.path().join("scans/scans.las");
    let robot = |out: &str, find_scanners: bool| {
        let out = dir.path().join(out);
        run_job(&Job { find_scanners, ..job(scans.clone(), &robots, out.clone(), 2) });
        let mut found = export::ResultFile::read(&out).expect("a result").robots;
        assert_eq!(found.len(), 1);
        found.remove(0)
    };
    let seen = robot("found", true);
    assert_eq!(seen.model, simulate::demo_robots::PALLETISER);
    assert_eq!(seen.verdict, "trusted");
    // Points that may be of several scanners stay without one.
    let n_found = seen.scanners.0.iter().find(|(how, _)| how == "found").map_or(0, |s| s.1);
    assert!(n_found >= 4, "{:?}", seen.scanners.0);
    let truth = std::fs::read_to_string(dir.path().join("scans/truth/truth.json")).expect("truth");
    let truth = &simulate::Truth::from_json(&truth).expect("parses").robots[0];
    let off = (0..3).map(|i| (seen.base_pose.xyz[i] - truth.base_pose.xyz[i]).powi(2)).sum::<f64>();
    assert!(off.sqrt() < 0.003, "{:?} for {:?}", seen.base_pose.xyz, truth.base_pose.xyz);
    // Nothing proves free space where no scanner is known.
    let doubted = robot("unknown", false);
    assert_eq!(doubted.model, simulate::demo_robots::PALLETISER);
    assert_eq!(doubted.verdict, "doubtful");
    // Half of the points that are there, as a writer leaves it that was stopped.
    let mut bytes = std::fs::read(&scans).expect("reads");
    let n = u64::from_le_bytes(bytes[247..255].try_into().expect("eight bytes"));
    bytes[247..255].copy_from_slice(&(n / 2).to_le_bytes());
    bytes[107..111].copy_from_slice(&0_u32.to_le_bytes());
    std::fs::write(&scans, bytes).expect("writes");
    let settings = ingest::Settings::default();
    let error = ingest::open(&[scans], None, &settings, &contract::OneByOne).err().expect("lies");
    assert_eq!(error.kind(), contract::Kind::BadInput, "{error}");
}

#[test]
fn las_with_scanner_positions_finds_the_same_robot() {
    let dir = tempfile::tempdir().expect("a folder");
    let robots = scene(dir.path());
    let scanners = dir.path().join("scans/scanners.toml");
    let out = dir.path().join("out");
    run(dir.path().join("scans/scans.las"), Some(scanners), &robots, out.clone(), 2);
    let text = std::fs::read_to_string(out.join("result.json")).expect("a result");
    let result: export::ResultFile = serde_json::from_str(&text).expect("parses");
    assert_eq!(result.robots.len(), 1);
    assert_eq!(result.robots[0].model, simulate::demo_robots::PALLETISER);
    assert_eq!(result.labels.scans.len(), 1, "one triple for the file");
}
