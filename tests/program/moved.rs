//! Robots that somebody moved between two stations, from outside: both postures come out, each with
//! its scans, and points are labelled by the posture of their scan.

use std::path::Path;
use stillpoint::engine::Engine;
use stillpoint::eval::compare::Agreement;
use stillpoint::eval::demo::write_robots;
use stillpoint::eval::virtual_scan::{Formats, scan_scene};
use stillpoint::job::{FlagValues, Job, Means};
use stillpoint::plan;

const SEED: u64 = 5;
/// Share of points of links and of what hangs on them that come out as such, and the other way
/// round.
const F1: f64 = 0.97;

#[test]
fn a_robot_that_moved_between_stations_has_two_postures() {
    let dir = tempfile::tempdir().expect("a folder");
    let robots = dir.path().join("robots");
    write_robots(&robots).expect("the library is written");
    let models = robot::Library::load(&robots, &robot::Settings::default()).expect("loads").models;
    let wanted = simulate::Plant {
        seed: SEED,
        n_robots: 1,
        n_rows: 1,
        n_scanners: 6,
        step_deg: 0.2,
        is_tight: false,
        moves: true,
    };
    let scene = simulate::plant(&wanted, &models).expect("is drawn");
    let scans = dir.path().join("scans");
    scan_scene(&scene, &models, &scans, Formats { las: false, ..Formats::ALL }, &Engine::new(2))
        .expect("scans");
    let out = dir.path().join("out");
    let means = Means::of(&FlagValues::default()).expect("defaults hold");
    let inputs = vec![scans.join("scans.e57")];
    let job = Job::new(inputs, robots, out.clone(), means);
    plan::run(&job, &Engine::new(2)).expect("the run ends well");
    let agreement = Agreement::of(&out, &scans.join("truth")).expect("compares");
    assert_eq!(agreement.n_invented, 0, "{}", agreement.table());
    let robot = &agreement.robots[0];
    let found = robot.found.as_ref().expect("the robot is found");
    assert!(found.is_right, "it is a {}", found.model);
    assert_eq!([robot.n_postures, found.n_postures], [2, 2], "{}", agreement.table());
    assert!(agreement.points.f1() > F1, "{}", agreement.table());
    scans_are_shared_out(&out);
}

/// Every scan that shows a posture shows one only.
fn scans_are_shared_out(out: &Path) {
    let text = std::fs::read_to_string(out.join("result.json")).expect("a result");
    let result: export::ResultFile = serde_json::from_str(&text).expect("parses");
    let robot = &result.robots[0];
    let mut scans: Vec<u32> = robot
        .stands_in
        .iter()
        .chain(robot.stays.iter().flat_map(|s| &s.stands_in))
        .copied()
        .collect();
    assert!(!robot.stands_in.is_empty() && robot.stays.len() == 1);
    scans.sort_unstable();
    let n = scans.len();
    scans.dedup();
    assert_eq!(scans.len(), n, "{scans:?}");
}
