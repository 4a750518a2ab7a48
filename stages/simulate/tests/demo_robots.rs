//! The demo robots load without findings, and their loops close.
#![allow(clippy::unwrap_used, clippy::print_stderr)]

mod library;

use robot::Model;
use simulate::{Scene, Simulator, demo_robots};

fn spread(model: &Model, n: u32) -> Vec<Vec<f64>> {
    let mut random = simulate::random::Random::keyed(&[3]);
    (0..n)
        .map(|_| {
            (0..model.free.len())
                .map(|f| {
                    let [low, high] = model.limits(f);
                    random.between(low, high)
                })
                .collect()
        })
        .collect()
}

#[test]
fn every_robot_loads_without_complaint_and_has_its_joints() {
    let library = library::load();
    assert!(library.findings.is_empty(), "{:?}", library.findings);
    let free: Vec<(&str, usize)> =
        library.models.iter().map(|m| (m.name.as_str(), m.free.len())).collect();
    assert_eq!(
        free,
        [(demo_robots::ARM, 6), (demo_robots::PALLETISER, 4), (demo_robots::WELDER, 7)]
    );
    for model in &library.models {
        for link in model.links.iter().filter(|l| l.name != "tool0") {
            let n = link.mesh.triangles.len();
            eprintln!("{} {} {:?} {n}", model.name, link.name, link.role);
            assert!((400..12_000).contains(&n), "{} {}: {n} triangles", model.name, link.name);
        }
    }
}

#[test]
fn loops_close_at_every_posture() {
    let library = library::load();
    for model in &library.models {
        for posture in spread(model, 200) {
            let gap = model.loop_gap(&posture);
            assert!(gap < 1e-9, "{} {posture:?}: {gap}", model.name);
        }
    }
}

#[test]
fn the_demo_scene_stands_and_keeps_its_robots_out_of_the_floor() {
    let library = library::load();
    for seed in 0..6 {
        let scene = simulate::demo_scene(seed, &library.models).unwrap();
        assert_eq!(scene, Scene::from_toml(&scene.to_toml().unwrap()).unwrap());
        for place in &scene.robots {
            let model = library.models.iter().find(|m| m.name == place.model).unwrap();
            let posture: Vec<f64> =
                model.free.iter().map(|&j| place.posture[&model.joints[j].name]).collect();
            let poses = model.poses(&posture);
            for (link, pose) in model.links.iter().zip(&poses).skip(1) {
                for v in &link.mesh.vertices {
                    let p =
                        place.world_from_base() * pose * geometry::Point::from(v.map(f64::from));
                    assert!(
                        p.z > scene.ground(p.x, p.y) - 0.02,
                        "{seed} {} {}",
                        place.name,
                        link.name
                    );
                    assert!(
                        p.x.abs() < 6.0 && p.y.abs() < 5.0,
                        "{seed} {} {}",
                        place.name,
                        link.name
                    );
                }
            }
        }
    }
}

#[test]
fn each_robot_of_the_demo_is_seen_link_by_link() {
    let library = library::load();
    let mut scene = simulate::demo_scene(1, &library.models).unwrap();
    for scanner in &mut scene.scanners {
        scanner.raster.step_deg = 0.4;
    }
    let simulator = Simulator::new(&scene, &library.models).unwrap();
    let mut seen = std::collections::BTreeMap::new();
    for s in 0..simulator.n_scans() {
        let columns = simulator.scan(s).columns;
        for i in (0..columns.len()).filter(|&i| columns.hit[i]) {
            *seen.entry(columns.label[i]).or_insert(0) += 1;
        }
    }
    let truth = simulator.truth();
    for (label, n) in &seen {
        let name =
            truth.robots.get(label.robot as usize).and_then(|r| r.links.get(label.link as usize));
        eprintln!("{label:?} {name:?} {n}");
    }
    for (r, robot) in truth.robots.iter().enumerate() {
        let links = seen.keys().filter(|l| l.robot == r as i16 && l.link >= 0).count();
        let bodies = robot.links.iter().filter(|l| *l != "tool0").count();
        assert!(links + 1 >= bodies, "{}: {links} of {bodies} links are seen", robot.name);
    }
}

#[test]
fn a_hall_of_robots_can_be_drawn_and_scanned() {
    let library = library::load();
    let scene = simulate::hall(7, &library.models, 5, 200_000).unwrap();
    assert_eq!(scene.robots.len(), 5);
    let simulator = Simulator::new(&scene, &library.models).unwrap();
    let n: usize = (0..simulator.n_scans()).map(|s| simulator.scan(s).columns.n_points()).sum();
    assert!((150_000..230_000).contains(&n), "{n}");
}
