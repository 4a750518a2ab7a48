//! What looks right and is not: turns at a quarter turn of pitch, colours of one name, followers
//! that a format does not know, robots far from the origin or far from each other.

use geometry::{Pose, Vector};
use nalgebra::UnitQuaternion;
use robot::{Model, ModelDetails, Settings};
use scene::{FixedBox, FloorPatch, FoundHulls, PlantRobot, PlantScene, SceneFiles, TouchingBoxes};
use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI};

/// A joint without end drives a slide, as a screw does; two links have one material in two colours.
const SCREW: &str = r#"<robot name="screw">
  <link name="base"><visual><geometry><box size="0.2 0.2 0.2"/></geometry>
    <material name="paint"><color rgba="0.5 0 0 1"/></material></visual></link>
  <link name="nut"><visual><geometry><box size="0.1 0.1 0.1"/></geometry>
    <material name="paint"><color rgba="0 0.5 0 1"/></material></visual></link>
  <link name="rod"><visual><geometry><box size="0.02 0.02 0.4"/></geometry>
    <material name="paint"><color rgba="0.5 0 0 1"/></material></visual></link>
  <joint name="turn" type="continuous"><parent link="base"/><child link="nut"/>
    <origin xyz="0 0 0.2" rpy="0.4 1.5707963267948966 0.9"/><axis xyz="0 0 1"/></joint>
  <joint name="screw" type="prismatic"><parent link="base"/><child link="rod"/>
    <origin rpy="-2 -1.5707963267948966 0.2"/><axis xyz="0 0 1"/>
    <mimic joint="turn" multiplier="0.002"/></joint>
</robot>"#;

fn robot(id: &str, place: Vector, turn: UnitQuaternion<f64>) -> PlantRobot {
    let folder = tempfile::tempdir().expect("a folder");
    let dir = folder.path().join("screw");
    std::fs::create_dir(&dir).expect("is made");
    std::fs::write(dir.join("robot.urdf"), SCREW).expect("writes");
    let settings = Settings::without_clouds();
    let (model, _) = Model::load(&dir, &settings).expect("loads");
    PlantRobot {
        id: id.into(),
        details: ModelDetails::load(&dir, &model, &settings).expect("loads"),
        world_from_base: Pose::from_parts(place.into(), turn),
        posture: vec![2.5],
        hanging: BTreeMap::new(),
        model,
    }
}

fn plant(robots: Vec<PlantRobot>) -> PlantScene {
    PlantScene {
        name: "plant".into(),
        robots,
        fixed: vec![
            FixedBox { center: [0.5, 0.0, 0.0], size: [0.1; 3] },
            FixedBox { center: [90.0, 0.0, 0.0], size: [0.1; 3] },
        ],
        touching: Vec::new(),
        floor: Some(FloorPatch { world_from_floor: Pose::identity(), size: [10.0, 8.0] }),
    }
}

fn text(files: &SceneFiles, path: &str) -> String {
    let file = files.files.iter().find(|file| file.path == path);
    let file = file.unwrap_or_else(|| panic!("there is no {path}"));
    String::from_utf8_lossy(&file.bytes).into_owned()
}

#[test]
fn urdfs_stand_right_at_a_quarter_turn_of_pitch() {
    let turns = [(0.3, FRAC_PI_2, -2.0), (PI, 0.0, 1.1), (1.0, -FRAC_PI_2, 0.4)];
    for (roll, pitch, yaw) in turns {
        let turn = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
        let plant = plant(vec![robot("R1", Vector::new(1.0, 2.0, 3.0), turn)]);
        let written = scene::urdf(&plant, None).expect("writes");
        let folder = tempfile::tempdir().expect("a folder");
        for file in &written.files {
            let path = folder.path().join(&file.path);
            std::fs::create_dir_all(path.parent().expect("a folder")).expect("is made");
            std::fs::write(path, &file.bytes).expect("writes");
        }
        let path = folder.path().join("R1/robot.urdf");
        let (model, _) = Model::load_urdf(&path, "R1", &Settings::without_clouds()).expect("loads");
        let found = model.poses(&[2.5]);
        for (found, wanted) in found[1..].iter().zip(plant.robots[0].world_from_links()) {
            let off = found.inverse() * wanted;
            assert!(off.translation.vector.norm() < 1e-12 && off.rotation.angle() < 1e-7);
        }
    }
}

#[test]
fn colours_of_one_name_stay_two_and_are_linear_where_renderers_want_that() {
    let plant = plant(vec![robot("R1", Vector::zeros(), UnitQuaternion::identity())]);
    let urdf = text(&scene::urdf(&plant, None).expect("writes"), "R1/robot.urdf");
    let names: Vec<&str> = urdf.lines().filter(|line| line.contains("<material")).collect();
    let has = |line: &&str, name: &str| line.contains(&format!("name=\"{name}\""));
    assert_eq!(names.len(), 3);
    assert!(has(&names[0], "paint") && has(&names[1], "paint_2") && has(&names[2], "paint"));
    let gltf = text(&scene::gltf(&plant).expect("writes"), "plant.glb");
    assert!(gltf.contains("[0.214041,0.0,0.0,1.0]"));
}

#[test]
fn what_a_format_cannot_move_is_named() {
    let plant = plant(vec![robot("R1", Vector::zeros(), UnitQuaternion::identity())]);
    for written in [scene::sdf(&plant), scene::usd(&plant)] {
        let notes = written.expect("writes").notes;
        let is_named = |note: &String| note.contains("nothing moves screw");
        assert!(notes.iter().any(is_named), "{notes:?}");
    }
    // A slide without limits would be locked at zero.
    let urdf = text(&scene::urdf(&plant, None).expect("writes"), "R1/robot.urdf");
    assert!(urdf.contains("lower=\"-10000\" upper=\"10000\""), "{urdf}");
    // Planes are without end in simulators.
    let mjcf = text(&scene::mjcf(&plant).expect("writes"), "plant.xml");
    assert!(mjcf.contains("name=\"floor\" type=\"box\" size=\"5 4 0.05\""), "{mjcf}");
    assert!(!text(&scene::sdf(&plant).expect("writes"), "plant.sdf").contains("<plane>"));
}

#[test]
fn a_robot_far_from_the_origin_is_named() {
    let place = Vector::new(450_000.0, 0.0, 0.0);
    let far = plant(vec![robot("R1", place, UnitQuaternion::identity())]);
    let notes = scene::usd(&far).expect("writes").notes;
    assert!(notes.iter().any(|note| note.contains("450 km") && note.contains("54 mm")));
    let near = plant(vec![robot("R1", Vector::zeros(), UnitQuaternion::identity())]);
    assert!(!scene::usd(&near).expect("writes").notes.iter().any(|note| note.contains("km")));
}

#[test]
fn a_planning_scene_has_what_can_be_reached() {
    let turn = UnitQuaternion::identity();
    let robots = [("R1", 0.0), ("R2", 1.0), ("R3", 90.0)];
    let robots = robots.map(|(id, x)| robot(id, Vector::new(x, 0.0, 0.0), turn)).to_vec();
    // The slide's driver is without end: its rod counts where it stands at zero.
    let written = scene::moveit(&plant(robots), None).expect("writes");
    let scene = text(&written, "R1/plant.scene");
    let objects: Vec<&str> = scene.lines().filter(|line| line.starts_with("* ")).collect();
    assert_eq!(objects, ["* fixed", "* floor", "* R2_00", "* R2_01", "* R2_02"]);
    assert!(scene.contains("* fixed\n0 0 0\n0 0 0 1\n1\n"), "one box is near");
}

#[test]
fn a_script_for_robodk_takes_no_robot_twice_and_none_of_another_name() {
    let robots = ["R1", "R2"].map(|id| robot(id, Vector::zeros(), UnitQuaternion::identity()));
    let written = scene::robodk(&plant(robots.to_vec())).expect("writes");
    let script = text(&written, "plant.py");
    assert!(script.contains("\"R1\": \"screw\"") && script.contains("\"R2\": \"screw\""));
    assert!(script.contains("wanted in taken") && script.contains("item.Name() != wanted"));
}

#[test]
fn meshes_that_mujoco_refuses_are_split_or_left_out() {
    let mut own = robot("R1", Vector::zeros(), UnitQuaternion::identity());
    let large = std::sync::Arc::make_mut(&mut own.model.links[0].mesh);
    let box_of = large.triangles.clone();
    large.triangles = box_of.iter().copied().cycle().take(450_000).collect();
    std::sync::Arc::make_mut(&mut own.model.links[1].mesh).vertices.truncate(3);
    let small = std::sync::Arc::make_mut(&mut own.model.links[1].mesh);
    small.triangles = vec![[0, 1, 2]];
    let written = scene::mjcf(&plant(vec![own])).expect("writes");
    let meshes: Vec<usize> = (written.files.iter())
        .filter(|file| file.path.ends_with(".stl"))
        .map(|file| (file.bytes.len() - 84) / 50)
        .collect();
    assert_eq!(meshes, [200_000, 200_000, 50_000, 12]);
    let mjcf = text(&written, "plant.xml");
    assert!(mjcf.contains("<mesh name=\"R1/00_base_part_2\""), "{mjcf}");
    assert!(!mjcf.contains("01_nut"));
}

/// A start in contact throws a simulated robot away, and planners refuse it.
#[test]
fn what_meets_a_robot_as_found_is_apart_and_has_no_contact_with_it() {
    let turn = UnitQuaternion::from_euler_angles(0.3, 0.2, 0.1);
    let place = Vector::new(450_000.0, 5_000_000.0, 100.0);
    let robots = vec![robot("R1", place, turn)];
    let hulls = FoundHulls::of(&robots);
    let at = |x: f64| FixedBox { center: [place.x + x, place.y, place.z], size: [0.05; 3] };
    // The base's edge is 0.2 m, turned.
    assert_eq!(hulls.met_by(&at(0.12)), [[0, 0]]);
    assert!(hulls.met_by(&at(0.16)).is_empty());
    let mut plant = plant(robots);
    plant.touching = vec![TouchingBoxes { boxes: vec![at(0.12)], links: vec![[0, 0]] }];
    let mjcf = text(&scene::mjcf(&plant).expect("writes"), "plant.xml");
    assert!(mjcf.contains("<body name=\"touching_0\">"), "{mjcf}");
    assert!(mjcf.contains("<exclude body1=\"touching_0\" body2=\"R1/base\"/>"), "{mjcf}");
    let usd = text(&scene::usd(&plant).expect("writes"), "plant.usda");
    assert!(usd.contains("rel physics:filteredPairs = [</World/R1/base>]"), "{usd}");
    let moveit = scene::moveit(&plant, None).expect("writes");
    assert!(text(&moveit, "R1/plant.scene").contains("* touching_0\n"));
    assert!(
        text(&moveit, "R1/touching.yaml").contains("  touching_0: [\"base\"]\n  floor: [\"base\"]")
    );
    assert!(text(&scene::gltf(&plant).expect("writes"), "plant.glb").contains("meets_as_found"));
    let sdf = text(&scene::sdf(&plant).expect("writes"), "plant.sdf");
    let model = sdf.split("<model name=\"touching_0\">").nth(1).expect("is there");
    let model = model.split("</model>").next().expect("ends");
    assert!(model.contains("<visual") && !model.contains("<collision"), "{model}");
    plant.touching[0].links = vec![[0, 9]];
    assert!(scene::mjcf(&plant).is_err());
}

/// A library may state limits of a follower that its driver never meets.
#[test]
fn a_follower_outside_of_its_limits_is_not_forced_back() {
    let mut own = robot("R1", Vector::zeros(), UnitQuaternion::identity());
    own.model.joints[1].limits = Some([-1.0, -0.5]);
    let written = scene::mjcf(&plant(vec![own.clone()])).expect("writes");
    assert!(written.notes.iter().any(|note| note.contains("screw follow")), "{:?}", written.notes);
    assert!(!text(&written, "plant.xml").contains("range=\"-1 -0.5\""));
    own.model.joints[1].limits = Some([-1.0, 0.5]);
    let written = scene::mjcf(&plant(vec![own])).expect("writes");
    assert!(text(&written, "plant.xml").contains("range=\"-1 0.5\""));
}
