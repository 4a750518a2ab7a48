//! Scenes of robots at work: the same seed draws the same scene, each family holds what it is
//! named after, and the rest of a hose behind its first clamp stands still.
#![allow(clippy::unwrap_used)]

mod common;

use contract::PointKind;
use robot::{Library, Model, Settings};
use simulate::scene::{Anchor, BeamRaster, Hose, RobotPlace, Scanner, Scene};
use simulate::{Simulator, Work, WorkCell, demo_robots, work_cell};

/// The demo robots with their CAD clouds, on which hoses are placed.
fn models() -> Vec<Model> {
    let dir = tempfile::tempdir().unwrap();
    for (path, bytes) in demo_robots::files() {
        let path = dir.path().join(path);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, bytes).unwrap();
    }
    Library::load(dir.path(), &Settings::default()).unwrap().models
}

fn drawn(work: Work, seed: u64, models: &[Model]) -> Scene {
    work_cell(&WorkCell { seed, work, n_scanners: 3, step_deg: 0.2 }, models).unwrap()
}

#[test]
fn each_family_holds_what_it_is_named_after_and_a_seed_draws_one_scene() {
    let models = models();
    let (mut n_carried, mut n_hoses) = (0, 0);
    for seed in 0..3 {
        let touch = drawn(Work::Touch, seed, &models);
        assert_eq!(touch, drawn(Work::Touch, seed, &models));
        // What a tool touches lies on something.
        let has_part = touch.boxes.iter().any(|b| b.name == "part");
        assert!(!has_part || touch.boxes.len() + touch.benches.len() >= 2);
        let carry = drawn(Work::Carry, seed, &models);
        assert!(carry.robots.len() >= 2 && carry.benches.len() + 1 == carry.robots.len());
        n_carried += carry.carried.len();
        n_hoses += drawn(Work::Hoses, seed, &models).hoses.len();
        let joined = drawn(Work::Joined, seed, &models);
        assert_eq!((joined.fences.len(), joined.conveyors.len(), joined.benches.len()), (4, 1, 1));
    }
    assert!(n_carried >= 1 && n_hoses >= 3, "{n_carried} {n_hoses}");
}

#[test]
fn a_hose_stands_still_behind_its_first_clamp() {
    let clamp = |xyz| Anchor { robot: None, link: None, xyz };
    let arm = Anchor { robot: Some("R1".into()), link: Some("arm".into()), xyz: [0.9, 0.0, 0.2] };
    let scene = Scene {
        robots: vec![RobotPlace {
            name: "R1".into(),
            model: "two_boxes".into(),
            ..RobotPlace::default()
        }],
        hoses: vec![Hose {
            name: "supply".into(),
            anchors: vec![arm, clamp([2.0, 0.0, 1.5]), clamp([2.0, 1.5, 1.5])],
            radius: 0.03,
            sag: 0.0,
        }],
        scanners: vec![Scanner {
            name: "s".into(),
            position: [1.5, -3.0, 1.6],
            raster: BeamRaster { step_deg: 0.2, ..BeamRaster::default() },
            noise: 0.0,
            ..Scanner::default()
        }],
        ..Scene::default()
    };
    let simulator = Simulator::new(&scene, &[common::two_boxes()]).unwrap();
    let objects = simulator.truth().objects.clone();
    let columns = simulator.scan(0).columns;
    let place = |name: &str| objects.iter().position(|o| o == name).unwrap();
    let of = |name: &str| {
        let place = place(name);
        let on = (0..columns.len())
            .filter(|&i| columns.hit[i] && usize::from(columns.object[i]) == place);
        on.map(|i| columns.label[i].kind).collect::<Vec<_>>()
    };
    let (moving, rest) = (of("hose supply"), of("line supply"));
    assert!(moving.len() > 30 && moving.iter().all(|k| *k == PointKind::Attachment));
    assert!(rest.len() > 30 && rest.iter().all(|k| *k == PointKind::Fixed));
}
