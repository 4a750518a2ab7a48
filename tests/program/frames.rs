//! A cell that is scanned again in another frame, from outside: it is laid on the plant where that
//! is clear, as the result says, and refused elsewhere.

use geometry::{Pose, Vector};
use nalgebra::{Translation3, UnitQuaternion};
use std::path::{Path, PathBuf};
use stillpoint::cache::check;
use stillpoint::engine::Engine;
use stillpoint::eval::demo::write_robots;
use stillpoint::eval::virtual_scan::{Formats, scan_scene};
use stillpoint::job::{FlagValues, Job, Means, Outcome};
use stillpoint::plan;
use stillpoint::rescan::{Cell, Frame, RescanRequest, rescan};

/// A plant, what was scanned again of it, and another plant.
struct Plant {
    dir: tempfile::TempDir,
    /// The frame of the new scans from that of the plant.
    frame: Pose,
    /// Where the first new scanner stands in the plant.
    scanner: [f64; 3],
}

fn wanted(seed: u64) -> simulate::Plant {
    simulate::Plant {
        seed,
        n_robots: 2,
        n_rows: 1,
        n_scanners: 4,
        step_deg: 0.25,
        is_tight: false,
        moves: false,
    }
}

impl Plant {
    fn new() -> Self {
        let dir = tempfile::tempdir().expect("a folder");
        let robots = dir.path().join("robots");
        write_robots(&robots).expect("the library is written");
        let models =
            robot::Library::load(&robots, &robot::Settings::default()).expect("loads").models;
        let [then, now] = simulate::sessions(&wanted(21), &models).expect("is drawn");
        let [_, other] = simulate::sessions(&wanted(22), &models).expect("is drawn");
        // A turned map frame.
        let turn = UnitQuaternion::from_axis_angle(&Vector::z_axis(), 2.1);
        let frame = Pose::from_parts(Translation3::new(558_312.2, 5_240_857.4, 76.3), turn);
        let mut mapped = now.clone();
        for scanner in &mut mapped.scanners {
            let real = scanner.world_from_scan().expect("a pose");
            let stated = frame * scanner.stated_world_from_scan().expect("a pose");
            scanner.registration = simulate::scene::RegistrationError::between(&real, &stated);
        }
        let third = simulate::Scene { seed: now.seed ^ 99, ..now.clone() };
        let scenes = [(&then, "then"), (&mapped, "mapped"), (&third, "third"), (&other, "other")];
        for (scene, name) in scenes {
            let formats = Formats { labels: false, ..Formats::ALL };
            scan_scene(scene, &models, &dir.path().join(name), formats, &Engine::new(2))
                .expect("scans");
        }
        Self { dir, frame, scanner: now.scanners[0].position }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    fn job(&self, input: &str, out: &str) -> Job {
        let means = Means::of(&FlagValues::default()).expect("it can be set");
        Job::new(vec![self.path(input)], self.path("robots"), self.path(out), means)
    }

    /// Rescans into a folder, from a base, with this input, by what is said of its frame.
    fn rescan(&self, [base, input, out]: [&str; 3], frame: Frame) -> contract::Result<Outcome> {
        let scanners = input.ends_with("las").then(|| self.path("mapped/scanners.toml"));
        let job = Job { scanners, ..self.job(input, out) };
        let request = RescanRequest { base: self.path(base), cell: Cell::Seen, frame, job };
        rescan(&request, &Engine::new(2))
    }
}

fn changes(out: &Path) -> serde_json::Value {
    let text = std::fs::read_to_string(out.join("changes.json")).expect("a list of changes");
    serde_json::from_str(&text).expect("it parses")
}

/// Robots and things that differ, by kind.
fn kinds(changes: &serde_json::Value) -> (Vec<String>, Vec<String>) {
    let list = |name: &str| changes[name].as_array().cloned().unwrap_or_default();
    let word = |value: &serde_json::Value| value.as_str().unwrap_or_default().to_owned();
    let robots = list("robots").iter().map(|r| word(&r["change"]["kind"])).collect();
    (robots, list("things").iter().map(|t| word(&t["change"])).collect())
}

#[test]
fn new_scans_in_another_frame_are_laid_on_the_plant_or_refused() {
    let plant = Plant::new();
    plan::run(&plant.job("then/scans.e57", "base"), &Engine::new(2)).expect("the run ends well");

    let again = plant.rescan(["base", "mapped/scans.e57", "again"], Frame::Find);
    let text = again.expect("it is laid").summary;
    assert!(text.contains("another frame, found"), "{text}");
    is_laid(&plant, "again", "found");
    let whole = check(&plant.path("again"), &Engine::new(2)).expect("a result");
    assert_eq!(whole.wrong, [""; 0]);

    // A LAS file states coordinates of the map for each point; a person says about where it is.
    let [x, y, z] = plant.scanner;
    let yaw = -plant.frame.rotation.euler_angles().2.to_degrees() + 0.7;
    let rough = Frame::Rough([x + 0.15, y - 0.1, z, yaw]);
    plant.rescan(["base", "mapped/scans.las", "given"], rough).expect("it is laid");
    is_laid(&plant, "given", "given");
    points_lie_in_the_plant(&plant.path("given"));

    // What is gone on from it stands where the plant does.
    plant.rescan(["again", "third/scans.e57", "last"], Frame::Find).expect("it is in its frame");
    let last = changes(&plant.path("last"));
    assert!(last["frame"].is_null(), "{}", last["frame"]);
    let (robots, things) = kinds(&last);
    assert!(robots.iter().all(|k| k == "same") && things.is_empty(), "{robots:?} {things:?}");
    refuses(&plant);
}

/// The frame that a result names is the true one, and what was changed is found, and nothing else.
fn is_laid(plant: &Plant, out: &str, by: &str) {
    let all = changes(&plant.path(out));
    let frame = &all["frame"];
    assert_eq!(frame["by"], by, "{frame}");
    let number = |name: &str, i: usize| frame[name][i].as_f64().expect("a number");
    let xyz = [0, 1, 2].map(|i| number("xyz", i));
    let q = [0, 1, 2, 3].map(|i| number("quat_xyzw", i));
    let turn = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(q[3], q[0], q[1], q[2]));
    let found = Pose::from_parts(Translation3::from(Vector::from(xyz)), turn);
    let off = found * plant.frame;
    let at = nalgebra::Point3::from(plant.scanner);
    // The frame is what all new scans share; what each of them is off is told beside it.
    let shift = (off * at - at).norm();
    assert!(shift < 0.01 && off.rotation.angle() < 1e-3, "{shift} m, {}", off.rotation.angle());
    let result = export::ResultFile::read(&plant.path(out)).expect("a result");
    assert!(result.rescan.and_then(|r| r.frame).is_some_and(|f| f.by == by));
    let (robots, things) = kinds(&all);
    assert_eq!(robots.iter().filter(|k| *k != "same").count(), 1, "{robots:?}");
    assert_eq!(things, ["moved", "gone"], "{all:#}");
}

/// Tiles of the result hold points in the plant's hall only.
fn points_lie_in_the_plant(out: &Path) {
    let las = export::LasSettings::new(export::Quantum { scale: [1e-4; 3], offset: [0.0; 3] });
    for tile in std::fs::read_dir(out.join("tiles")).expect("a folder").flatten() {
        let read = export::read_tile(&tile.path(), &las, None, |points| {
            assert!(points.iter().all(|p| p.world.iter().all(|v| v.abs() < 50.0)));
            Ok(())
        });
        read.expect("a tile");
    }
}

/// Scans of elsewhere and frames that are contradicted are refused, by the name of the input and
/// with the way out, and leave no result.
fn refuses(plant: &Plant) {
    let tries = [
        ("other/scans.e57", Frame::Find),
        ("mapped/scans.e57", Frame::Stated),
        ("mapped/scans.e57", Frame::Rough([0.0, 0.0, 1.6, 10.0])),
    ];
    for (input, frame) in tries {
        let error = plant.rescan(["base", input, "none"], frame).expect_err("refused");
        assert_eq!(error.kind(), contract::Kind::BadInput, "{error}");
        let text = error.to_string();
        assert!(text.contains(input) && text.contains("--frame"), "{text}");
    }
    assert!(!plant.path("none/result.json").exists());
}
