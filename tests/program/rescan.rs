//! A cell that is scanned again, from outside: what was changed is found and nothing else, what was
//! not touched stays as it was, byte for byte, and a rescan can be gone on from in its turn.

use contract::SpaceKind;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use stillpoint::cache::{Manifest, check};
use stillpoint::engine::Engine;
use stillpoint::eval::compare::Agreement;
use stillpoint::eval::demo::write_robots;
use stillpoint::eval::virtual_scan::{Formats, scan_scene};
use stillpoint::job::{FlagValues, Job, Means};
use stillpoint::plan;
use stillpoint::rescan::{Cell, Frame, RescanRequest, rescan};

const SEED: u64 = 11;
/// Share of points of links and of what hangs on them that come out as such, and the other way
/// round, in the cell.
const F1: f64 = 0.98;

/// Two sessions of a small plant with three robots, and the result of the first.
struct Plant {
    dir: tempfile::TempDir,
    n_masks: usize,
    /// Where the robot stands that moves, in the second session.
    robot: [f64; 3],
    /// Number of robots in the result of the first.
    n_robots: usize,
}

impl Plant {
    fn new() -> Self {
        let dir = tempfile::tempdir().expect("a folder");
        let robots = dir.path().join("robots");
        write_robots(&robots).expect("the library is written");
        let models =
            robot::Library::load(&robots, &robot::Settings::default()).expect("loads").models;
        let wanted = simulate::Plant {
            seed: SEED,
            n_robots: 3,
            n_rows: 1,
            n_scanners: 5,
            step_deg: 0.2,
            is_tight: false,
            moves: false,
        };
        let [then, now] = simulate::sessions(&wanted, &models).expect("is drawn");
        let (n_masks, robot) = (then.scanners.len(), now.robots[0].xyz);
        for (scene, name) in [(then, "then"), (now, "now")] {
            let formats = Formats { las: false, ..Formats::ALL };
            scan_scene(&scene, &models, &dir.path().join(name), formats, &Engine::new(2))
                .expect("scans");
        }
        let mut plant = Self { dir, n_masks, robot, n_robots: 0 };
        plan::run(&plant.job("then", "base"), &Engine::new(2)).expect("the run ends well");
        plant.n_robots = n_robots(&plant.path("base"));
        plant
    }

    fn path(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    fn job(&self, scans: &str, out: &str) -> Job {
        let given = FlagValues { set: vec!["export.copc=true".into()], ..FlagValues::default() };
        let means = Means::of(&given).expect("it can be set");
        let inputs = vec![self.path(scans).join("scans.e57")];
        Job::new(inputs, self.path("robots"), self.path(out), means)
    }

    fn request(&self, base: &str, out: &str) -> RescanRequest {
        let (base, job) = (self.path(base), self.job("now", out));
        RescanRequest { base, cell: Cell::Seen, frame: Frame::Find, job }
    }

    fn run(&self, args: &[&str]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_stillpoint"));
        command.current_dir(self.dir.path()).args(["--progress", "none"]).args(args);
        command.output().expect("the program starts")
    }
}

/// Number of robots in a result that are not refused.
fn n_robots(out: &Path) -> usize {
    let all = export::ResultFile::read(out).expect("a result").robots;
    all.iter().filter(|robot| robot.verdict != "refused").count()
}

/// Points that a LAS 1.4 file says it holds.
fn n_points(path: &Path) -> u64 {
    let bytes = std::fs::read(path).expect("a file");
    u64::from_le_bytes(bytes[247..255].try_into().expect("eight bytes"))
}

fn changes(out: &Path) -> serde_json::Value {
    let text = std::fs::read_to_string(out.join("changes.json")).expect("a list of changes");
    serde_json::from_str(&text).expect("it parses")
}

/// Both use one plant, which takes longer to scan and to run than either of them.
#[test]
fn cells_that_are_scanned_again() {
    let plant = Plant::new();
    std::thread::scope(|both| {
        both.spawn(|| a_rescanned_cell_is_brought_up_to_date(&plant));
        both.spawn(|| a_robot_that_the_earlier_result_missed_did_not_appear(&plant));
    });
}

fn a_rescanned_cell_is_brought_up_to_date(plant: &Plant) {
    let engine = Engine::new(2);
    rescan(&plant.request("base", "again"), &engine).expect("the rescan ends well");
    let out = plant.path("again");

    // What was changed is found, and nothing else.
    let changes = changes(&out);
    let robots = changes["robots"].as_array().expect("robots");
    let moved: Vec<_> = robots.iter().filter(|r| r["change"]["kind"] != "same").collect();
    assert_eq!(moved.len(), 1, "{robots:#?}");
    let result = export::ResultFile::read(&out).expect("a result");
    let entry = result.robots.iter().find(|r| moved[0]["now"] == r.id.as_str()).expect("it");
    let off = (0..2).map(|i| (entry.base_pose.xyz[i] - plant.robot[i]).powi(2)).sum::<f64>();
    assert!(off.sqrt() < 0.05, "the robot that moved stands at {:?}", plant.robot);
    let things = changes["things"].as_array().expect("things");
    let kinds: Vec<_> = things.iter().filter_map(|t| t["change"].as_str()).collect();
    assert_eq!(kinds, ["moved", "gone"], "{things:#?}");
    // Two scanners do not see the backs of things, and it is said where; what they do say something
    // of is not among that.
    let unseen = changes["fixed_not_compared"].as_array().expect("regions");
    assert!(!unseen.is_empty());
    let side = |bounds: &serde_json::Value, k: usize, i: usize| bounds[k][i].as_f64().expect("m");
    for region in unseen {
        let bounds = &region["bounds"];
        let is_in_cell = (0..3).all(|i| {
            side(bounds, 1, i) > side(&changes["cell"], 0, i)
                && side(bounds, 0, i) < side(&changes["cell"], 1, i)
        });
        let holds_gone = things.iter().map(|t| &t["then"]).any(|then| {
            (0..2).all(|i| {
                let middle = 0.5 * (side(then, 0, i) + side(then, 1, i));
                (side(bounds, 0, i)..side(bounds, 1, i)).contains(&middle)
            })
        });
        assert!(is_in_cell && !holds_gone, "{region}");
    }

    // Masks of the new scans, and the robots of the whole plant, agree with the truth.
    let agreement = Agreement::of_session(&out, &plant.path("now/truth"), plant.n_masks);
    let agreement = agreement.expect("compares");
    assert_eq!(agreement.n_invented, 0, "{}", agreement.table());
    assert!(agreement.robots.iter().all(|r| r.found.as_ref().is_some_and(|f| f.is_right)));
    assert!(agreement.worst_joint_deg() < 0.3, "{}", agreement.table());
    assert!(agreement.points.f1() > F1, "{}", agreement.points.f1());

    // All is whole, and masks of the earlier scans are the same files.
    for name in ["base", "again"] {
        assert_eq!(check(&plant.path(name), &engine).expect("a result").wrong, [""; 0], "{name}");
    }
    let digest = |out: &Path| {
        let files = Manifest::read(out).expect("a list").files;
        files.into_iter().find(|f| f.path == "labels/0.kind.npy").expect("a mask").digest
    };
    assert_eq!(digest(&plant.path("base")), digest(&out));
    // The cloud of the whole plant holds what its tiles hold: it is made again.
    let held = |out: &Path| {
        let tiles = std::fs::read_dir(out.join("tiles")).expect("a folder").flatten();
        let in_tiles: u64 = tiles.map(|tile| n_points(&tile.path())).sum();
        assert_eq!(n_points(&out.join(export::COPC)), in_tiles);
        in_tiles
    };
    assert_ne!(held(&plant.path("base")), held(&out));
    for name in ["base", "again"] {
        spaces_hold_what_tiles_hold(&plant.path(name));
    }
    exports_leave_out_what_is_superseded(plant, things);
    goes_on(plant, &out);
}

/// Old points that the new session supersedes are gone from scans that are given back, from clouds
/// and from meshes: clouds and meshes hold the same points, and no more of a mesh is where a thing
/// was taken away than around single points that no new beam contradicts.
fn exports_leave_out_what_is_superseded(plant: &Plant, things: &[serde_json::Value]) {
    let export = |name: &str, more: &[&str]| {
        let output = plant.run(&[&["export", name, "--to"], more].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        plant.path(name).join("export")
    };
    let gone = things.iter().find(|t| t["change"] == "gone").expect("a thing that is gone");
    let bound = |k: usize, i: usize| gone["then"][k][i].as_f64().expect("metres");
    // Points beside the bounds may belong to the floor and to neighbours.
    let is_inside =
        |at: &[f64]| (0..3).all(|i| at[i] > bound(0, i) + 0.05 && at[i] < bound(1, i) - 0.05);
    let meshed = |name: &str| {
        let folder = export(name, &["mesh", "--mesh-format", "obj"]).join("mesh");
        let text = std::fs::read_to_string(folder.join("fixed.obj")).expect("a mesh");
        let corner = |line: &str| -> Vec<f64> {
            line.split(' ').map(|v| v.parse().expect("metres")).collect()
        };
        let corners = text.lines().filter_map(|line| line.strip_prefix("v ")).map(corner);
        let inside: Vec<Vec<f64>> = corners.filter(|at| is_inside(at)).collect();
        let report = std::fs::read_to_string(folder.join("mesh.json")).expect("a report");
        let report: serde_json::Value = serde_json::from_str(&report).expect("it parses");
        let n = |which: &str| report.pointer(which).and_then(serde_json::Value::as_u64);
        let own = n("/left_out/uncertain_points_on_robots").expect("a number");
        let loose = n("/left_out/uncertain_points_in_the_air_beside_robots").expect("a number");
        assert!(loose > 0, "{report}");
        (inside, n("/points").expect("a number") + own + loose)
    };
    let (before, _) = meshed("base");
    let (after, n_meshed) = meshed("again");
    let n = before.len();
    assert!(n > 200 && after.len() < n / 10, "{n} corners, then {after:?}, in {gone}");

    let valid = |name: &str| -> u64 {
        let file = export(name, &["e57"]).join("e57/scans.e57");
        let mut reader = e57::E57Reader::from_file(file).expect("an E57 file");
        let clouds = reader.pointclouds();
        let count = |cloud: &e57::PointCloud| {
            let points = reader.pointcloud_simple(cloud).expect("points");
            let is_valid = |point: &e57::Point| {
                matches!(point.cartesian, e57::CartesianCoordinate::Valid { .. })
            };
            points.map(|point| point.expect("a point")).filter(is_valid).count() as u64
        };
        clouds.iter().map(count).sum()
    };
    // Points of robots, which were flagged before, may be superseded, too.
    let files = std::fs::read_dir(plant.path("again").join("labels")).expect("a folder").flatten();
    let lists = files.map(|file| file.path());
    let lists = lists.filter(|path| path.to_string_lossy().ends_with(".superseded.npy"));
    let n_superseded: usize =
        lists.map(|path| export::read_places(&path, u64::MAX).expect("places").len()).sum();
    let n_flagged = valid("base") - valid("again");
    assert!(n_flagged > 1000 && n_flagged <= n_superseded as u64, "{n_flagged}, {n_superseded}");
    let text = std::fs::read(export("again", &["ply"]).join("fixed.ply")).expect("a cloud");
    let head = String::from_utf8_lossy(&text[..2000]).into_owned();
    assert!(head.contains(&format!("element vertex {n_meshed}\n")), "{n_meshed}: {head}");
}

/// Each point of the tiles lies in a voxel that says so, in the space of each robot that has one
/// there; and what is said to be fixed has points. Tiles have coordinates rounded to 0.1 mm: a
/// point may lie in the voxel beside.
fn spaces_hold_what_tiles_hold(out: &Path) {
    let robots = export::ResultFile::read(out).expect("a result").robots;
    let space = |r: &export::RobotEntry| r.space.as_ref().expect("one").read(out).expect("voxels");
    let spaces: Vec<_> = robots.iter().map(space).collect();
    let quantum = export::Quantum { scale: [1e-4; 3], offset: [0.0; 3] };
    let las = export::LasSettings::new(quantum);
    let mut fixed: Vec<BTreeSet<usize>> = vec![BTreeSet::new(); spaces.len()];
    let (mut n_others, mut lost) = (0, Vec::new());
    for tile in std::fs::read_dir(out.join("tiles")).expect("a folder").flatten() {
        let read = export::read_tile(&tile.path(), &las, None, |points| {
            for (i, space) in spaces.iter().enumerate() {
                for point in points {
                    let near = |k: usize| {
                        let off = [0, 1, 2].map(|a| if k >> a & 1 == 1 { 6e-5 } else { -6e-5 });
                        space.grid().index([0, 1, 2].map(|a| point.world[a] + off[a]))
                    };
                    let Some(places) = (0..8).map(near).collect::<Option<Vec<_>>>() else {
                        continue;
                    };
                    let kind = contract::Space::kind_of(point.label, i);
                    let holds = |at: &usize| match (kind, space.voxels()[*at]) {
                        (SpaceKind::Fixed, there) => there == SpaceKind::Fixed,
                        (SpaceKind::Other, there) => there.is_obstacle(),
                        (_, there) => there == SpaceKind::Robot || there.is_obstacle(),
                    };
                    n_others += usize::from(kind == SpaceKind::Other);
                    lost.extend((!places.iter().any(holds)).then_some((i, point.world, kind)));
                    if kind == SpaceKind::Fixed {
                        fixed[i].extend(places);
                    }
                }
            }
            Ok(())
        });
        read.expect("a tile");
    }
    assert!(lost.is_empty(), "{} lost: {:?}", lost.len(), &lost[..lost.len().min(9)]);
    assert!(n_others > 1000, "robots stand within reach of one another: {n_others}");
    for (space, fixed) in spaces.iter().zip(fixed) {
        let voxels = space.voxels().iter().enumerate();
        let said: Vec<usize> =
            voxels.filter(|(_, k)| **k == SpaceKind::Fixed).map(|(at, _)| at).collect();
        let n_empty = said.iter().filter(|at| !fixed.contains(at)).count();
        assert_eq!(n_empty, 0, "of {} voxels that are said to be fixed", said.len());
    }
}

fn a_robot_that_the_earlier_result_missed_did_not_appear(plant: &Plant) {
    let review = format!("[[robot]]\nat = {:?}\nverdict = \"reject\"\n", plant.robot);
    std::fs::write(plant.path("review.toml"), review).expect("writes");
    let args = ["run", "then/scans.e57", "--robots", "robots", "--out", "missed/blind"];
    let blind = plant.run(&[&args[..], &["--review", "review.toml"]].concat());
    assert!(blind.status.success(), "{}", String::from_utf8_lossy(&blind.stderr));
    assert_eq!(n_robots(&plant.path("missed/blind")) + 1, plant.n_robots);

    // Its scans show how it stood, though: it is said to have moved from there.
    rescan(&plant.request("missed/blind", "missed/again"), &Engine::new(2))
        .expect("the rescan ends well");
    let changes = changes(&plant.path("missed/again"));
    let robots = changes["robots"].as_array().expect("robots");
    let others: Vec<_> = robots.iter().filter(|r| r["change"]["kind"] != "same").collect();
    assert!(others.len() == 1 && others[0]["was_missed"] == true, "{robots:#?}");
    assert!(others[0]["change"]["kind"] == "moved" && others[0]["then"].is_null(), "{robots:#?}");
    let things = changes["things"].as_array().expect("things");
    let kinds: Vec<_> = things.iter().filter_map(|t| t["change"].as_str()).collect();
    assert_eq!(kinds, ["moved", "gone"], "{things:#?}");
    let truth = plant.path("now/truth");
    let agreement = Agreement::of_session(&plant.path("missed/again"), &truth, plant.n_masks);
    let agreement = agreement.expect("compares");
    assert!(agreement.robots.iter().all(|r| r.found.as_ref().is_some_and(|f| f.is_right)));
    assert!(agreement.points.f1() > F1, "{}", agreement.points.f1());
}

/// Rescans of rescans, and what is refused.
fn goes_on(plant: &Plant, out: &Path) {
    let said = |output: &Output| String::from_utf8_lossy(&output.stderr).into_owned();
    let unchanged = rescan(&plant.request("base", "again"), &Engine::new(2)).expect("ends well");
    assert!(unchanged.reused[0].starts_with("everything"), "{:?}", unchanged.reused);
    // The new scans are part of it now; neither they nor the same folder can be given again.
    let known = plant.run(&["rescan", "--base", "again", "now/scans.e57", "--out", "third"]);
    assert_eq!(known.status.code(), Some(2), "{}", said(&known));
    assert!(said(&known).contains("part of the earlier result"), "{}", said(&known));
    let over = plant.run(&["rescan", "--base", "base", "now/scans.e57", "--out", "base"]);
    assert_eq!(over.status.code(), Some(2), "{}", said(&over));
    let nobody =
        plant.run(&["rescan", "--base", "base", "now/scans.e57", "--out", "x", "--robot", "R9"]);
    assert!(nobody.status.code() == Some(2) && said(&nobody).contains("R9"), "{}", said(&nobody));
    let lists = export::ResultFile::read(out).expect("a result").labels.scans;
    assert!(lists.iter().any(|scan| scan.superseded.is_some()), "{lists:?}");
    // The sessions of the plant; without the first, the second is as whole as before.
    let listed = plant.run(&["history", ".", "--json"]);
    let listed: serde_json::Value = serde_json::from_slice(&listed.stdout).expect("a list");
    let names: Vec<_> = (0..2).map(|i| (&listed[i]["name"], &listed[i]["base"])).collect();
    assert!(names[0].0 == "base" && names[1].0 == "again" && names[1].1 == "base", "{listed}");
    let own = |i: usize| listed[i]["n_own_bytes"].as_u64().zip(listed[i]["n_bytes"].as_u64());
    assert!(own(1).is_some_and(|(own, all)| own < all), "{listed}");
    let removed = plant.run(&["history", ".", "--remove", "base"]);
    assert!(removed.status.success(), "{}", said(&removed));
    assert!(!plant.path("base").exists());
    assert_eq!(check(out, &Engine::new(2)).expect("a result").wrong, [""; 0]);
}
