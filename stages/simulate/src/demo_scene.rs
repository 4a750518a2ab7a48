//! Scenes for the demo and for measurements.

use crate::demo_robots::{ARM, PALLETISER, WELDER};
use crate::random::Random;
use crate::scene::{
    Anchor, BeamRaster, Building, CarriedBox, Column, Cuboid, Fence, FenceFilling, Furniture, Hose,
    RobotPlace, Scanner, Scene, SceneFloor, Section, StandShape, Tool, ToolShape,
};
use crate::spot::{RobotSpot, scanner};
use contract::{Error, Result};
use robot::Model;

/// Angle between the beams of the demo's scanners, degrees: 7.7 mm at 4 m, 3 million beams a
/// scanner.
const DEMO_STEP_DEG: f64 = 0.11;
/// Centre in the flange's frame and size of the carton, metres.
const CARTON: ([f64; 3], [f64; 3]) = ([0.0, 0.0, -0.33], [0.5, 0.35, 0.25]);

/// The cell of the demo: a hall with three demo robots in random postures with hoses, a tool and a
/// carried box, furniture, and four scanners. `models` must include the demo robots.
///
/// # Errors
/// `BadInput` if a demo robot is missing.
pub fn demo_scene(seed: u64, models: &[Model]) -> Result<Scene> {
    let mut scene = Scene {
        seed,
        hall: Some(Building { size: [12.0, 10.0, 5.0], walls: true, ceiling: true }),
        floor: Some(SceneFloor {
            size: None,
            tilt_deg: [0.12, -0.08],
            wave_amplitude: 0.003,
            wave_length: 4.0,
            levels: vec![],
        }),
        ..Scene::default()
    };
    furnish(&mut scene);
    let mut random = Random::keyed(&[seed, 0xD0]);
    for spot in demo_spots() {
        let model = find(models, spot.model)?;
        let place = spot.place(&mut scene, model, &mut random)?;
        scene.robots.push(place);
    }
    scene.robots[1].tool = Some(Tool {
        link: "tool0".into(),
        shape: ToolShape::Cups,
        xyz: [0.0; 3],
        rpy_deg: [180.0, 0.0, 0.0],
        length: 0.2,
    });
    scene.carried.push(CarriedBox {
        name: "carton".into(),
        robot: "R2".into(),
        link: "tool0".into(),
        xyz: CARTON.0,
        rpy_deg: [0.0; 3],
        size: CARTON.1,
    });
    scene.hoses = demo_hoses();
    for (i, (x, y, z)) in [(-5.4, 4.4, 1.9), (-0.6, -3.4, 1.7), (0.9, 1.3, 2.1), (5.4, 0.6, 1.6)]
        .into_iter()
        .enumerate()
    {
        let raster = BeamRaster {
            elevation_deg: [-60.0, 45.0],
            step_deg: DEMO_STEP_DEG,
            ..BeamRaster::default()
        };
        let mut scanner =
            scanner(format!("scan_{}", i + 1), [x, y, z + scene.ground(x, y)], raster);
        scanner.rpy_deg = [0.0, 0.0, random.between(-180.0, 180.0)];
        scene.scanners.push(scanner);
    }
    Ok(scene)
}

/// The test protocol of the paper behind the fitting method: one robot on a floor, six scanners on
/// a circle of 5 m at a height of 1.6 m, 2 mm noise. `posture` has one value for each free joint
/// (radians or metres); `n_beams` is the number of beams of each scanner.
#[must_use]
pub fn paper_scene(seed: u64, model: &Model, posture: &[f64], n_beams: u64) -> Scene {
    let joints = model.free.iter().zip(posture);
    let place = RobotPlace {
        name: "R1".into(),
        model: model.name.clone(),
        posture: joints.map(|(&j, v)| (model.joints[j].name.clone(), *v)).collect(),
        ..RobotPlace::default()
    };
    let scanners = (0..6).map(|k| {
        let (sin, cos) = (std::f64::consts::TAU * f64::from(k) / 6.0).sin_cos();
        let raster = BeamRaster { n_beams: Some(n_beams), ..BeamRaster::default() };
        let thin = scanner(format!("scan_{}", k + 1), [5.0 * cos, 5.0 * sin, 1.6], raster);
        Scanner { mixed: None, dropouts: 0.0, dark_dropouts: 0.0, ..thin }
    });
    Scene {
        seed,
        floor: Some(SceneFloor {
            size: Some([20.0, 20.0]),
            tilt_deg: [0.0; 2],
            wave_amplitude: 0.0,
            wave_length: 5.0,
            levels: vec![],
        }),
        robots: vec![place],
        scanners: scanners.collect(),
        ..Scene::default()
    }
}

fn demo_spots() -> [RobotSpot<'static>; 3] {
    [
        RobotSpot {
            name: "R1".into(),
            model: WELDER,
            xy: [-2.8, 1.6],
            stand: 0.0,
            side: 1.0,
            shape: StandShape::Plinth,
            // Its plugs face the controller, from which its supply comes.
            yaw_deg: [25.0, 105.0],
            load: None,
            min: [-5.6, -1.3],
            max: [-0.1, 4.7],
        },
        RobotSpot {
            name: "R2".into(),
            model: PALLETISER,
            xy: [3.0, -1.9],
            stand: 0.35,
            side: 0.9,
            shape: StandShape::Plinth,
            yaw_deg: [-180.0, 180.0],
            load: Some(CARTON),
            min: [0.3, -4.6],
            max: [5.6, 0.6],
        },
        RobotSpot {
            name: "R3".into(),
            model: ARM,
            xy: [3.2, 3.2],
            stand: 0.75,
            side: 0.45,
            shape: StandShape::Pedestal,
            yaw_deg: [-180.0, 180.0],
            load: None,
            min: [1.6, 1.8],
            max: [4.8, 4.7],
        },
    ]
}

fn furnish(scene: &mut Scene) {
    let furniture =
        |name: &str, xy, yaw_deg, size| Furniture { name: name.into(), xy, yaw_deg, size };
    scene.conveyors.push(furniture("infeed", [3.2, -4.3], 0.0, [4.4, 0.6, 0.7]));
    scene.benches.push(furniture("bench", [5.35, 3.2], 90.0, [1.6, 0.7, 0.9]));
    let fence =
        |name: &str, from, to, filling| Fence { name: name.into(), from, to, height: 2.0, filling };
    scene.fences.push(fence("east", [0.1, 0.6], [0.1, 4.8], FenceFilling::Wires));
    scene.fences.push(fence("south", [-5.8, -1.6], [-2.8, -1.6], FenceFilling::Wires));
    scene.fences.push(fence("panel", [5.75, -1.0], [5.75, 0.2], FenceFilling::Panel));
    let column =
        |xy, radius, section| Column { name: String::new(), xy, radius, height: 5.0, section };
    scene.columns.push(column([-5.6, -4.6], 0.2, Section::IBeam));
    scene.columns.push(column([0.0, -4.5], 0.18, Section::Round));
    let cuboid = |name: &str, at: [f64; 2], size: [f64; 3], yaw: f64, reflectance| {
        (name.to_owned(), at, size, yaw, reflectance)
    };
    for (name, at, size, yaw, reflectance) in [
        cuboid("controller", [-5.2, -3.4], [0.6, 0.8, 1.4], 0.0, 0.3),
        cuboid("crate", [-3.6, -3.6], [1.2, 0.8, 0.75], 20.0, 0.6),
        cuboid("crate on crate", [-2.3, -4.3], [0.6, 0.4, 0.45], -15.0, 0.5),
        cuboid("black cabinet", [1.2, 4.5], [0.8, 0.5, 1.8], 0.0, 0.08),
    ] {
        let z = scene.ground(at[0], at[1]) + 0.5 * size[2];
        scene.boxes.push(Cuboid {
            name,
            xyz: [at[0], at[1], z],
            size,
            rpy_deg: [0.0, 0.0, yaw],
            reflectance,
        });
    }
}

fn demo_hoses() -> Vec<Hose> {
    let on = |robot: &str, link: &str, xyz| Anchor {
        robot: Some(robot.into()),
        link: Some(link.into()),
        xyz,
    };
    let hose = |name: &str, anchors, radius, sag| Hose { name: name.into(), anchors, radius, sag };
    vec![
        hose(
            "dress pack",
            vec![
                on("R1", "link_3", [0.22, 0.10, 0.42]),
                on("R1", "link_4", [0.18, 0.03, 0.185]),
                on("R1", "link_4", [0.56, 0.03, 0.185]),
                on("R1", "gun_body", [0.17, 0.02, 0.16]),
            ],
            0.032,
            0.12,
        ),
        hose(
            "air",
            vec![
                on("R2", "link_3", [0.5, 0.06, 0.12]),
                on("R2", "wrist_plate", [0.05, 0.05, 0.12]),
            ],
            0.012,
            0.10,
        ),
        hose(
            "cable",
            vec![
                on("R3", "link_3", [-0.02, 0.05, 0.10]),
                on("R3", "link_4", [0.10, 0.01, 0.075]),
                on("R3", "link_6", [0.02, -0.05, 0.01]),
            ],
            0.008,
            0.10,
        ),
        Hose {
            name: "supply".into(),
            anchors: vec![
                on("R1", "base_link", [-0.58, 0.13, 0.20]),
                Anchor { robot: None, link: None, xyz: [-5.0, -3.4, 0.35] },
            ],
            radius: 0.025,
            sag: 0.04,
        },
    ]
}

fn find<'a>(models: &'a [Model], name: &str) -> Result<&'a Model> {
    models.iter().find(|m| m.name == name).ok_or_else(|| {
        Error::bad_input(format!("the library lacks a demo robot: \"{name}\""))
            .hint("write the files of `demo_robots::files` to a folder and load it")
    })
}
