//! A robot that its model fits poorly, from outside: runs with --calibrate find where a joint
//! really is, readings of the controller find where its zeros are, and the corrected model is a
//! model.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use stillpoint::engine::Engine;
use stillpoint::eval::demo::write_robots;
use stillpoint::eval::virtual_scan::{Formats, scan_scene};

/// Shift of one joint of the true robot, metres, in the joint's frame.
const SHIFT: [f64; 3] = [0.004, 0.0, -0.003];
/// What the controller's zeros are off by, radians.
const ZERO: f64 = 0.01;
const N_BEAMS: u64 = 600_000;

fn stillpoint(args: &[&dyn AsRef<std::ffi::OsStr>]) -> String {
    let done = Command::new(env!("CARGO_BIN_EXE_stillpoint"))
        .args(args.iter().map(|a| a.as_ref()))
        .args(["--progress", "none"])
        .output()
        .expect("the program starts");
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    String::from_utf8_lossy(&done.stdout).into_owned()
}

/// A robot whose third joint is elsewhere than its model has it, and the library that it is not
/// quite of.
fn true_robot(robots: &Path) -> (robot::Model, robot::Library) {
    let mut library =
        robot::Library::load(robots, &robot::Settings::without_clouds()).expect("loads");
    let at = library.model(simulate::demo_robots::PALLETISER).expect("is there");
    let model = &mut library.models[at];
    let joint = model.free[2];
    model.joints[joint].parent_from_joint *=
        geometry::Pose::translation(SHIFT[0], SHIFT[1], SHIFT[2]);
    (library.models[at].clone(), library)
}

/// A share of the way through the limits of each joint.
fn posture(model: &robot::Model, share: f64) -> Vec<f64> {
    let between = |[low, high]: [f64; 2]| low + (high - low) * share;
    (0..model.n_free()).map(|j| between(model.limits(j))).collect()
}

/// The robot scanned; the scans.
fn scanned(
    seed: u64,
    model: &robot::Model,
    library: &robot::Library,
    posture: &[f64],
    dir: &Path,
) -> PathBuf {
    let scene = simulate::paper_scene(seed, model, posture, N_BEAMS);
    scan_scene(&scene, &library.models, dir, Formats::ALL, &Engine::new(2)).expect("scans");
    dir.join("scans.e57")
}

/// Two postures of one robot whose third joint is elsewhere, scanned and run; the output folders.
fn runs(dir: &Path, robots: &Path) -> (Vec<PathBuf>, String) {
    let (model, library) = true_robot(robots);
    let mut readings = String::new();
    let outs = [0.4, 0.7].map(|share| {
        let posture = posture(&model, share);
        let out = dir.join(format!("out{share}"));
        let input = scanned(7, &model, &library, &posture, &dir.join(format!("scans{share}")));
        stillpoint(&[&"run", &input, &"--robots", &robots, &"--out", &out, &"--calibrate"]);
        let _ =
            writeln!(readings, "[[posture]]\nresult = {out:?}\nrobot = \"R1\"\n[posture.joints]");
        for (j, q) in posture.iter().enumerate() {
            let _ = writeln!(readings, "{} = {:.6}", model.joints[model.free[j]].name, q - ZERO);
        }
        out
    });
    (outs.to_vec(), readings)
}

#[test]
fn a_joint_that_is_elsewhere_is_found_and_the_model_corrected() {
    let dir = tempfile::tempdir().expect("a folder");
    let robots = dir.path().join("robots");
    write_robots(&robots).expect("the library is written");
    let (outs, readings) = runs(dir.path(), &robots);
    let (file, corrected) = (dir.path().join("readings.toml"), dir.path().join("corrected"));
    std::fs::write(&file, readings).expect("is written");
    let words = stillpoint(&[
        &"robots",
        &"calibrate",
        &outs[0],
        &outs[1],
        &"--robots",
        &robots,
        &"--out",
        &corrected,
        &"--readings",
        &file,
    ]);
    assert!(words.contains("from 2 postures"), "{words}");
    let load = |dir: &Path| {
        robot::Library::load(dir, &robot::Settings::without_clouds()).expect("loads").models
    };
    let nominal = load(&robots);
    let nominal =
        nominal.iter().find(|m| m.name == simulate::demo_robots::PALLETISER).expect("is there");
    let own = &load(&corrected)[0];
    assert_eq!(own.name, nominal.name);
    // What is written is a library, as all commands take one.
    let linted = stillpoint(&[&"robots", &"lint", &corrected]);
    assert!(linted.contains("0 errors"), "{linted}");
    for &joint in &nominal.free {
        let moved =
            nominal.joints[joint].parent_from_joint.inverse() * own.joints[joint].parent_from_joint;
        let truth = if joint == nominal.free[2] { SHIFT } else { [0.0; 3] };
        let axis = nominal.joints[joint].axis.into_inner();
        let off = moved.translation.vector - geometry::Vector::from(truth);
        let across = off - axis * off.dot(&axis);
        assert!(across.norm() < 0.0015, "{} {across:?}\n{words}", nominal.joints[joint].name);
    }
    refuses_to_overwrite(&outs[0], &robots);
    rescans(dir.path(), &outs[0], &robots);
    let zero = words.lines().find(|l| l.contains("zero off by")).expect("zeros are told");
    let value: f64 = zero.split_whitespace().nth(4).expect("a value").parse().expect("a number");
    assert!((value - ZERO.to_degrees()).abs() < 0.1, "{zero}");
}

/// The library is never written into.
fn refuses_to_overwrite(out: &Path, robots: &Path) {
    let own = robots.join(simulate::demo_robots::PALLETISER);
    let urdf = std::fs::read(own.join("robot.urdf")).expect("a URDF");
    for taken in [robots.to_path_buf(), own.clone(), own.join("corrected")] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_stillpoint"));
        command.args(["robots", "calibrate"]).arg(out).arg("--robots").arg(robots);
        let done = command.arg("--out").arg(&taken).output().expect("the program starts");
        assert_eq!(done.status.code(), Some(2), "{}", String::from_utf8_lossy(&done.stderr));
    }
    assert_eq!(std::fs::read(own.join("robot.urdf")).expect("a URDF"), urdf);
}

/// A rescan knows where the joints of a calibrated robot are: one that did not move is the same.
fn rescans(dir: &Path, base: &Path, robots: &Path) {
    let (model, library) = true_robot(robots);
    let new = scanned(8, &model, &library, &posture(&model, 0.4), &dir.join("new"));
    let out = dir.join("again");
    stillpoint(&[&"rescan", &"--base", &base, &new, &"--robots", &robots, &"--out", &out]);
    let text = std::fs::read_to_string(out.join("changes.json")).expect("a list of changes");
    let changes: serde_json::Value = serde_json::from_str(&text).expect("it parses");
    let found = changes["robots"].as_array().expect("robots");
    assert_eq!(found.len(), 1, "{changes:#}");
    assert_eq!(found[0]["change"]["kind"], "same", "{changes:#}");
    let entry = &export::ResultFile::read(&out).expect("a result").robots[0];
    assert!(entry.calibration.is_some());
}
