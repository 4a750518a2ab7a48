//! Simulated scans of scenes whose result can be computed by hand.
#![allow(clippy::unwrap_used)]

mod common;

use contract::{Label, PointKind};
use simulate::scene::{
    Anchor, BeamRaster, Building, Column, Cuboid, Hose, Mixed, RobotPlace, Scanner, Scene,
    SceneFloor,
};
use simulate::{SimColumns, Simulator};

fn flat(size: f64) -> Option<SceneFloor> {
    Some(SceneFloor {
        size: Some([size, size]),
        tilt_deg: [0.0; 2],
        wave_amplitude: 0.0,
        wave_length: 5.0,
        levels: vec![],
    })
}

fn exact(step_deg: f64) -> Scanner {
    let raster = BeamRaster { step_deg, ..BeamRaster::default() };
    Scanner { name: "s".into(), raster, noise: 0.0, ..Scanner::default() }
}

fn scan(scene: &Scene) -> SimColumns {
    Simulator::new(scene, &[common::two_boxes()]).unwrap().scan(0).columns
}

#[test]
fn range_to_the_floor_is_exact_and_the_sky_does_not_answer() {
    let scene = Scene { floor: flat(20.0), scanners: vec![exact(0.5)], ..Scene::default() };
    let simulator = Simulator::new(&scene, &[]).unwrap();
    let frame = simulator.frame(0).clone();
    let columns = simulator.scan(0).columns;
    assert_eq!(columns.len(), (frame.n_rows * frame.n_cols) as usize);
    for i in 0..columns.len() {
        let (row, col) = columns.pixel(i);
        let d = frame.direction(row, col);
        let range = 1.6 / -d[2];
        let reaches = d[2] < 0.0 && (range * d[0]).abs() < 9.999 && (range * d[1]).abs() < 9.999;
        let passes = d[2] >= 0.0 || (range * d[0]).abs() > 10.001 || (range * d[1]).abs() > 10.001;
        if reaches {
            assert!(
                columns.hit[i] && (columns.range[i] - range).abs() < 2e-6,
                "{} {range}",
                columns.range[i]
            );
            assert!((columns.xyz[i][2] + 1.6).abs() < 2e-6);
            assert_eq!(columns.label[i], Label::FLOOR);
        } else if passes {
            assert!(
                !columns.hit[i] && columns.range[i] == 0.0 && columns.label[i] == Label::UNCERTAIN
            );
        }
    }
}

#[test]
fn range_to_a_column_is_that_of_a_cylinder() {
    let column = Column {
        name: String::new(),
        xy: [3.0, 0.0],
        radius: 0.3,
        height: 3.0,
        section: Default::default(),
    };
    let scene = Scene { columns: vec![column], scanners: vec![exact(0.2)], ..Scene::default() };
    let simulator = Simulator::new(&scene, &[]).unwrap();
    let (frame, columns) = (simulator.frame(0).clone(), simulator.scan(0).columns);
    let mut n = 0;
    for i in 0..columns.len() {
        let (row, col) = columns.pixel(i);
        let d = frame.direction(row, col);
        let flat = d[0].hypot(d[1]);
        let (x, y) = (d[0] / flat, d[1] / flat);
        let across = (3.0 * y).abs();
        let along = 3.0 * x - (0.3_f64.powi(2) - across.powi(2)).max(0.0).sqrt();
        let height = 1.6 + along * d[2] / flat;
        if across < 0.25 && x > 0.0 && (0.2..2.9).contains(&height) {
            // 48 facets are up to 0.64 mm inside the cylinder, and more along an oblique beam.
            assert!(columns.hit[i] && (columns.range[i] - along / flat).abs() < 0.002, "{i}");
            n += 1;
        }
    }
    assert!(n > 500, "{n}");
}

fn busy() -> Scene {
    let mut scanner = exact(0.5);
    scanner.noise = 0.002;
    scanner.jitter = 1e-5;
    scanner.dropouts = 0.05;
    scanner.dark_dropouts = 0.5;
    scanner.mixed = Some(Mixed::default());
    let place = RobotPlace {
        name: "r".into(),
        model: "two_boxes".into(),
        xyz: [2.0, 1.0, 0.0],
        ..Default::default()
    };
    let end = |robot: Option<&str>, xyz| Anchor {
        robot: robot.map(Into::into),
        link: robot.map(|_| "arm".into()),
        xyz,
    };
    let hose = Hose {
        name: "h".into(),
        anchors: vec![end(None, [0.5, 2.0, 2.0]), end(Some("r"), [1.0, 0.0, 0.2])],
        radius: 0.03,
        sag: 0.2,
    };
    Scene {
        seed: 5,
        hall: Some(Building { size: [8.0, 8.0, 4.0], walls: true, ceiling: true }),
        floor: Some(SceneFloor {
            size: None,
            tilt_deg: [0.2, -0.1],
            wave_amplitude: 0.004,
            wave_length: 3.0,
            levels: vec![],
        }),
        robots: vec![place],
        hoses: vec![hose],
        scanners: vec![Scanner { name: "first".into(), ..exact(1.0) }, scanner],
        ..Scene::default()
    }
}

#[test]
fn columns_are_the_same_however_they_are_split() {
    let scene = busy();
    let simulator = Simulator::new(&scene, &[common::two_boxes()]).unwrap();
    let whole = simulator.scan(1).columns;
    let n_rows = whole.n_rows as usize;
    for cols in [0..1, 0..7, 100..163, 719..720, 713..5000] {
        let part = simulator.columns(1, cols.clone());
        assert_eq!(part.len(), (cols.end.min(720) - cols.start) as usize * n_rows);
        let from = cols.start as usize * n_rows;
        let to = from + part.len();
        assert_eq!(part.xyz, whole.xyz[from..to]);
        assert_eq!(part.label, whole.label[from..to]);
        assert_eq!(
            (&part.hit[..], &part.mixed[..]),
            (&whole.hit[from..to], &whole.mixed[from..to])
        );
    }
    assert!(simulator.columns(1, 720..800).is_empty());
    let again = Simulator::new(&scene, &[common::two_boxes()]).unwrap();
    assert_eq!(again.scan(1).columns, whole);
}

#[test]
fn labels_distinguish_links_hoses_floor_and_hall() {
    let mut scene = busy();
    scene.scanners = vec![Scanner { mixed: Some(Mixed::default()), ..exact(0.2) }];
    scene.robots[0].posture.insert("turn".into(), 1.0);
    let columns = scan(&scene);
    let at = |i: usize| {
        let [x, y, z] = columns.xyz[i];
        [x, y, z + 1.6]
    };
    let mut seen = [0; 5];
    for i in (0..columns.len()).filter(|&i| columns.hit[i] && !columns.mixed[i]) {
        let [x, y, z] = at(i);
        let label = columns.label[i];
        let (dx, dy) = (x - 2.0, y - 1.0);
        let (along, across) =
            (dx * 1.0_f64.cos() + dy * 1.0_f64.sin(), dy * 1.0_f64.cos() - dx * 1.0_f64.sin());
        let in_arm = along > -0.01 && along < 1.01 && across.abs() < 0.11 && (z - 0.5).abs() < 0.11;
        let in_foot = dx.abs() < 0.21 && dy.abs() < 0.21 && z < 0.41;
        match (label.kind, label.robot, label.link) {
            (PointKind::Link, 0, 0) => assert!(in_foot, "{x} {y} {z}"),
            (PointKind::Link, 0, 1) => assert!(in_arm, "{x} {y} {z}"),
            (PointKind::Attachment, 0, -1) => assert!(z > 0.3, "{x} {y} {z}"),
            (PointKind::Floor, -1, -1) => assert!(z.abs() < 0.03, "{z}"),
            (PointKind::Fixed, -1, -1) => {
                assert!(x.abs() > 3.9 || y.abs() > 3.9 || z > 3.9, "{x} {y} {z}")
            }
            other => panic!("{other:?}"),
        }
        seen[match label.kind {
            PointKind::Link => label.link as usize,
            PointKind::Attachment => 2,
            PointKind::Floor => 3,
            _ => 4,
        }] += 1;
    }
    assert!(seen.iter().all(|n| *n > 50), "{seen:?}");
}

#[test]
fn wide_beams_hang_in_the_air_at_edges_and_nowhere_else() {
    let near = Cuboid {
        name: String::new(),
        xyz: [3.0, 0.0, 1.6],
        size: [0.1, 1.0, 1.0],
        rpy_deg: [0.0; 3],
        reflectance: 0.5,
    };
    let far = Cuboid { xyz: [3.5, 0.0, 1.6], size: [0.1, 4.0, 4.0], ..near.clone() };
    let mut scene =
        Scene { boxes: vec![near, far], scanners: vec![exact(0.05)], ..Scene::default() };
    scene.scanners[0].raster.elevation_deg = [-10.0, 10.0];
    scene.scanners[0].raster.azimuth_deg = [-14.03, 14.0];
    let on_face = |columns: &SimColumns, i: usize| {
        let [x, y, z] = columns.xyz[i];
        let side = (y.abs() - 0.5).abs() < 1e-3 || (z.abs() - 0.5).abs() < 1e-3;
        (x - 2.95).abs() < 1e-5
            || (x - 3.45).abs() < 1e-5
            || (side && x < 3.05)
            || ((x - 2.95).abs() < 0.0025 && y.abs() > 0.49)
            || ((x - 2.95).abs() < 0.0025 && z.abs() > 0.49)
    };
    let thin = scan(&scene);
    assert!((0..thin.len()).filter(|&i| thin.hit[i]).all(|i| on_face(&thin, i)));
    scene.scanners[0].mixed = Some(Mixed::default());
    let wide = scan(&scene);
    let floating: Vec<usize> =
        (0..wide.len()).filter(|&i| wide.hit[i] && !on_face(&wide, i)).collect();
    assert!(floating.len() > 200, "{}", floating.len());
    for &i in &floating {
        let [x, y, z] = wide.xyz[i];
        assert!(wide.mixed[i] && x > 2.95 && x < 3.45, "{x}");
        let edge = (0.5 * x / 2.95 - y.abs()).abs().min((0.5 * x / 2.95 - z.abs()).abs());
        assert!(edge < 0.003, "{edge}");
    }
    // At twice the depth over which parts are averaged, the stronger part wins and no point lies
    // between the surfaces.
    scene.boxes[1].xyz[0] = 4.5;
    let split = scan(&scene);
    assert!((0..split.len()).filter(|&i| split.hit[i]).all(|i| !split.mixed[i]));
}

#[test]
fn noise_and_dropouts_have_the_stated_size() {
    let mut scene = Scene { floor: flat(40.0), scanners: vec![exact(0.25)], ..Scene::default() };
    scene.scanners[0].raster.elevation_deg = [-60.0, -10.0];
    scene.scanners[0].noise = 0.002;
    scene.scanners[0].dropouts = 0.1;
    scene.scanners[0].range_bias = 0.003;
    let columns = scan(&scene);
    let n = columns.len() as f64;
    let lost = 1.0 - columns.n_points() as f64 / n;
    assert!((lost - 0.1).abs() < 0.005, "{lost}");
    let exact_range = |i: usize| 1.6 / -(columns.xyz[i][2] / columns.range[i]);
    let errors: Vec<f64> = (0..columns.len())
        .filter(|&i| columns.hit[i])
        .map(|i| columns.range[i] - exact_range(i))
        .collect();
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    let sigma =
        (errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / errors.len() as f64).sqrt();
    assert!((mean - 0.003).abs() < 2e-5 && (sigma - 0.002).abs() < 2e-5, "{mean} {sigma}");
}

#[test]
fn stated_pose_differs_from_the_true_one_by_the_registration_error() {
    let mut scene = busy();
    scene.origin = [400_000.0, 5_000_000.0, 100.0];
    scene.scanners[1].registration.xyz = [0.003, 0.0, 0.0];
    let simulator = Simulator::new(&scene, &[common::two_boxes()]).unwrap();
    let frame = simulator.frame(1);
    let shift =
        frame.world_from_scan.translation.vector - frame.true_world_from_scan.translation.vector;
    assert!((shift.norm() - 0.003).abs() < 1e-9);
    let truth = simulator.truth();
    assert_eq!(truth.robots[0].base_pose.xyz, [400_002.0, 5_000_001.0, 100.0]);
    assert_eq!(truth.robots[0].links, ["foot", "arm"]);
    assert_eq!(simulate::Truth::from_json(&truth.to_json().unwrap()).unwrap(), truth);
}

#[test]
fn a_scene_survives_its_file_and_mistakes_are_named() {
    let scene = busy();
    assert_eq!(Scene::from_toml(&scene.to_toml().unwrap()).unwrap(), scene);
    for (text, word) in [
        ("sed = 3", "sed"),
        ("[[box]]\nxyz = [0,0,0]\nsize = [1,1,-1]", "size"),
        ("[[box]]\nxyz = [0,0,nan]\nsize = [1,1,1]", "place"),
        ("[[scanner]]\nraster = {step_deg = 0.001}", "raster"),
        ("[[scanner]]\nquaternion_wxyz = [0,0,0,0]", "quaternion"),
        ("[[scanner]]\n[[scanner]]", "same name"),
        ("[[carried]]\nrobot = \"x\"\nlink = \"y\"\nxyz = [0,0,0]\nsize = [1,1,1]", "no robot"),
    ] {
        let error = Scene::from_toml(text).unwrap_err();
        assert_eq!(error.kind(), contract::Kind::BadInput);
        assert!(error.to_string().contains(word), "{error}");
    }
    let mut wrong = scene.clone();
    wrong.robots[0].posture.insert("twist".into(), 0.0);
    let error = Simulator::new(&wrong, &[common::two_boxes()]).err().unwrap().to_string();
    assert!(
        error.contains("robot \"r\"") && error.contains("twist") && error.contains("turn"),
        "{error}"
    );
}
