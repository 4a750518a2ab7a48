//! What each format is given: read back without other software, poses and limits compared with the
//! model's.

use geometry::{Pose, Vector};
use nalgebra::{Quaternion, Translation3, UnitQuaternion};
use robot::{Model, ModelDetails, Settings, hull};
use roxmltree::{Document, Node};
use scene::{FixedBox, FloorPatch, PlantRobot, PlantScene, SceneFiles};
use std::collections::BTreeMap;

/// An arm with a parallelogram, a slide, a joint without end, a follower and a locked joint. Names
/// are as bad as names may be.
const ARM: &str = r#"<robot name="arm">
  <link name="world"><visual><geometry><box size="0.4 0.4 0.2"/></geometry>
    <material name="red"><color rgba="1 0 0 1"/></material></visual>
    <inertial><mass value="80"/><inertia ixx="2" ixy="0.1" ixz="0" iyy="2" iyz="0" izz="3"/>
    </inertial></link>
  <link name="2 lower"><visual><geometry><box size="0.1 0.1 1"/></geometry></visual></link>
  <link name="2-lower"><visual><geometry><box size="1 0.1 0.1"/></geometry></visual></link>
  <link name="lever"><visual><geometry><box size="0.3 0.05 0.05"/></geometry></visual></link>
  <link name="rod"><visual><geometry><box size="0.05 0.05 1"/></geometry></visual></link>
  <link name="slide::x"><visual><geometry><box size="0.3 0.1 0.1"/></geometry></visual></link>
  <link name="spin"><visual><geometry><cylinder radius="0.1" length="0.1"/></geometry></visual></link>
  <link name="finger"><visual><geometry><box size="0.05 0.02 0.1"/></geometry></visual></link>
  <link name="tool0"/>
  <joint name="j1" type="revolute"><parent link="world"/><child link="2 lower"/>
    <origin xyz="0 0 0.5" rpy="0.1 0.2 0.3"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1.5" effort="1200" velocity="2.5"/>
    <dynamics damping="3" friction="1"/>
    <safety_controller k_position="20" k_velocity="30" soft_lower_limit="-0.9"
      soft_upper_limit="1.4"/></joint>
  <joint name="j2" type="revolute"><parent link="2 lower"/><child link="2-lower"/>
    <origin xyz="0 0 1"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="0" velocity="0"/></joint>
  <joint name="j3" type="prismatic"><parent link="2-lower"/><child link="slide::x"/>
    <origin xyz="1 0 0"/><axis xyz="1 0 0"/><limit lower="0" upper="0.4" effort="50" velocity="0.3"/></joint>
  <joint name="j4" type="continuous"><parent link="slide::x"/><child link="spin"/>
    <origin xyz="0.2 0 0"/><axis xyz="1 0 0"/><limit effort="9" velocity="4"/></joint>
  <joint name="j5" type="prismatic"><parent link="spin"/><child link="finger"/>
    <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="5" velocity="1"/>
    <mimic joint="j3" multiplier="0.5" offset="0.05"/></joint>
  <joint name="lever_joint" type="revolute"><parent link="2 lower"/><child link="lever"/>
    <origin xyz="0 0.2 0"/><axis xyz="0 1 0"/></joint>
  <joint name="rod_joint" type="revolute"><parent link="lever"/><child link="rod"/>
    <origin xyz="-0.3 0 0"/><axis xyz="0 1 0"/></joint>
  <joint name="locked" type="revolute"><parent link="spin"/><child link="tool0"/>
    <origin xyz="0.1 0 0"/><axis xyz="0 0 1"/><limit lower="0.3" upper="0.3" effort="1" velocity="1"/></joint>
  <transmission name="t1"><type>simple</type><joint name="j1"/></transmission>
  <gazebo><plugin name="control" filename="libcontrol.so"><a>1</a></plugin></gazebo>
  <gazebo reference="2 lower"><mu1>0.3</mu1></gazebo>
</robot>"#;

/// Lever and rod keep beside the lower arm and its joint with the upper one.
const LOOP: &str = r#"
[[sub_chain]]
name = "parallelogram"
kind = "RRR"
passive = ["lever_joint", "rod_joint"]
closures = [{ link_a = "rod", xyz_a = [0, 0, 1], link_b = "2-lower", xyz_b = [-0.3, 0, 0] }]
"#;

fn plant() -> PlantScene {
    let folder = tempfile::tempdir().expect("a folder");
    let dir = folder.path().join("arm");
    std::fs::create_dir(&dir).expect("is made");
    std::fs::write(dir.join("robot.urdf"), ARM).expect("writes");
    std::fs::write(dir.join("robot.toml"), LOOP).expect("writes");
    let settings = Settings::without_clouds();
    let (model, _) = Model::load(&dir, &settings).expect("loads");
    let details = ModelDetails::load(&dir, &model, &settings).expect("loads");
    let turn = UnitQuaternion::from_euler_angles(0.2, -0.1, 2.0);
    let piece = hull(&[[0.0; 3], [0.1, 0., 0.], [0., 0.1, 0.], [0., 0., 0.1]]).expect("a body");
    let robot = |id: &str, x: f64| PlantRobot {
        id: id.into(),
        world_from_base: Pose::from_parts(Translation3::new(x, 2.0, 0.5), turn),
        posture: vec![0.4, -0.3, 0.1, 2.0, 0.3],
        hanging: BTreeMap::from([(1, vec![piece.clone()])]),
        model: model.clone(),
        details: details.clone(),
    };
    PlantScene {
        name: "a plant".into(),
        robots: vec![robot("R1", 1.0), robot("R2", 4.0)],
        fixed: vec![FixedBox { center: [0.0, 0.0, 0.5], size: [0.2, 0.3, 1.0] }],
        touching: Vec::new(),
        floor: Some(FloorPatch { world_from_floor: Pose::identity(), size: [10.0, 8.0] }),
    }
}

fn text(files: &SceneFiles, path: &str) -> String {
    let file = files.files.iter().find(|file| file.path == path);
    let file = file.unwrap_or_else(|| panic!("there is no {path}"));
    String::from_utf8(file.bytes.clone()).expect("UTF-8")
}

fn numbers(words: &str) -> Vec<f64> {
    words.split_whitespace().map(|w| w.parse().expect("a number")).collect()
}

fn pose_of(xyz: &[f64], wxyz: &[f64]) -> Pose {
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(wxyz[0], wxyz[1], wxyz[2], wxyz[3]));
    Pose::from_parts(Translation3::new(xyz[0], xyz[1], xyz[2]), turn)
}

fn assert_same(a: &Pose, b: &Pose, what: &str) {
    let off = a.inverse() * b;
    let (shift, turn) = (off.translation.vector.norm(), off.rotation.angle());
    assert!(shift < 1e-9 && turn < 1e-7, "{what}: {shift} m, {turn} rad");
}

#[test]
fn a_urdf_stands_in_the_plant_and_loses_nothing() {
    let plant = plant();
    let written = scene::urdf(&plant, None).expect("writes");
    let folder = tempfile::tempdir().expect("a folder");
    for file in &written.files {
        let path = folder.path().join(&file.path);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("is made");
        std::fs::write(path, &file.bytes).expect("writes");
    }
    let robot = &plant.robots[1];
    let path = folder.path().join("R2/robot.urdf");
    let (model, findings) =
        Model::load_urdf(&path, "R2", &Settings::without_clouds()).expect("loads");
    assert!(findings.iter().all(|f| f.severity != robot::Severity::Error), "{findings:?}");
    // Lever and rod of the parallelogram follow, and the locked joint is fixed.
    assert_eq!(model.n_free(), 4);
    let poses = model.poses(&robot.posture[..4]);
    for (l, expected) in robot.world_from_links().iter().enumerate() {
        assert_same(&poses[l + 1], expected, &model.links[l + 1].name);
    }
    let urdf = text(&written, "R2/robot.urdf");
    for kept in [
        "<link name=\"world\"/>",
        "<link name=\"world_2\">",
        "<link name=\"2_lower\">",
        "lower=\"-1\" upper=\"1.5\" effort=\"1200\" velocity=\"2.5\"",
        "<dynamics damping=\"3\" friction=\"1\"/>",
        "k_position=\"20\" k_velocity=\"30\" soft_lower_limit=\"-0.9\" soft_upper_limit=\"1.4\"",
        "<mimic joint=\"j3\" multiplier=\"0.5\" offset=\"0.05\"/>",
        "<mimic joint=\"j2\" multiplier=\"1\" offset=\"0\"/>",
        "<mimic joint=\"j2\" multiplier=\"-1\" offset=\"0\"/>",
        "<color rgba=\"1 0 0 1\"/>",
        "<mass value=\"80\"/>",
        "ixx=\"2\" ixy=\"0.1\"",
        "<transmission name=\"t1\"><type>simple</type><joint name=\"j1\"/></transmission>",
        "<gazebo reference=\"2_lower\"><mu1>0.3</mu1></gazebo>",
        "filename=\"meshes/01_2_lower_hanging_0.stl\"",
    ] {
        assert!(urdf.contains(kept), "{kept} is missing in\n{urdf}");
    }
    assert!(!urdf.contains("velocity=\"0\"") && !urdf.contains("effort=\"0\""));
    let packed = scene::urdf(&plant, Some("cell")).expect("writes");
    assert!(text(&packed, "R1/robot.urdf").contains("package://cell/R1/meshes/00_world.stl"));
}

#[test]
fn an_srdf_has_the_posture_and_a_scene_the_other_robots() {
    let plant = plant();
    let written = scene::moveit(&plant, None).expect("writes");
    let srdf = text(&written, "R1/robot.srdf");
    let document = Document::parse(&srdf).expect("XML");
    let states = document.descendants().filter(|n| n.has_tag_name("group_state"));
    let joints = states.flat_map(|n| n.children().filter(|n| n.has_tag_name("joint")));
    let found: BTreeMap<&str, f64> = joints
        .map(|n| {
            (n.attribute("name").expect("a name"), numbers(n.attribute("value").expect("one"))[0])
        })
        .collect();
    assert_eq!(found, BTreeMap::from([("j1", 0.4), ("j2", -0.3), ("j3", 0.1), ("j4", 2.0)]));
    // Readers that know no groups take the first state of a name: it has all joints.
    let first = document.descendants().find(|n| n.has_tag_name("group_state")).expect("one");
    assert_eq!(first.children().filter(|n| n.has_tag_name("joint")).count(), found.len());
    assert!(srdf.contains("link1=\"world_2\" link2=\"2_lower\" reason=\"Adjacent\""), "{srdf}");
    let scene = text(&written, "R1/plant.scene");
    let lines: Vec<&str> = scene.lines().collect();
    assert_eq!(lines[..6], ["a_plant", "* fixed", "0 0 0", "0 0 0 1", "1", "box"]);
    assert_eq!(lines.last(), Some(&"."));
    let objects: Vec<&&str> = lines.iter().filter(|line| line.starts_with("* ")).collect();
    assert_eq!(objects[..3], [&"* fixed", &"* floor", &"* R2_00"]);
}

/// Poses of bodies, values of the key frame taken in the order of the file.
fn mjcf_poses(
    node: Node,
    pose: Pose,
    values: &mut std::vec::IntoIter<f64>,
    out: &mut BTreeMap<String, Pose>,
) {
    for body in node.children().filter(|n| n.has_tag_name("body")) {
        let read = |name: &str| numbers(body.attribute(name).unwrap_or("1 0 0 0"));
        let mut own = match body.attribute("pos") {
            Some(_) => pose * pose_of(&read("pos"), &read("quat")),
            None => pose,
        };
        if let Some(joint) = body.children().find(|n| n.has_tag_name("joint")) {
            let axis = Vector::from_column_slice(&numbers(joint.attribute("axis").expect("one")));
            let value = values.next().expect("a value");
            own *= match joint.attribute("type") {
                Some("slide") => Pose::from(axis * value),
                _ => Pose::from_parts(
                    Translation3::identity(),
                    UnitQuaternion::from_scaled_axis(axis * value),
                ),
            };
        }
        out.insert(body.attribute("name").expect("a name").to_owned(), own);
        mjcf_poses(body, own, values, out);
    }
}

#[test]
fn mjcf_stands_as_found_with_its_loop_closed() {
    let plant = plant();
    let written = scene::mjcf(&plant).expect("writes");
    let xml = text(&written, "plant.xml");
    let document = Document::parse(&xml).expect("XML");
    let find = |tag: &str| document.descendants().find(|n| n.has_tag_name(tag)).expect("is there");
    let qpos = numbers(find("key").attribute("qpos").expect("values"));
    assert_eq!(qpos.len(), 2 * 7, "seven joints, and none for what is locked");
    let mut poses = BTreeMap::new();
    mjcf_poses(find("worldbody"), Pose::identity(), &mut qpos.into_iter(), &mut poses);
    for robot in &plant.robots {
        for (link, expected) in robot.model.links.iter().zip(robot.world_from_links()) {
            let name = format!("{}/{}", robot.id, link.name);
            assert_same(&poses[&name], &expected, &name);
        }
    }
    let site = |name: &str| {
        let node = document.descendants().find(|n| n.attribute("name") == Some(name));
        let node = node.expect("a site");
        let body = node.parent().and_then(|n| n.attribute("name")).expect("a body");
        poses[body] * geometry::Point::from_slice(&numbers(node.attribute("pos").expect("one")))
    };
    assert!((site("R2/pin_0_a") - site("R2/pin_0_b")).norm() < 1e-9);
    assert!(xml.contains("range=\"-1 1.5\"") && xml.contains("actuatorfrcrange=\"-1200 1200\""));
    assert!(xml.contains("joint1=\"R1/j5\" joint2=\"R1/j3\" polycoef=\"0.05 0.5 0 0 0\""));
    // A joint whose range is empty would move freely.
    assert!(!xml.contains("R1/locked"));
}

#[test]
fn sdf_links_stand_as_found_and_limits_count_from_there() {
    let plant = plant();
    let written = scene::sdf(&plant).expect("writes");
    let sdf = text(&written, "plant.sdf");
    let document = Document::parse(&sdf).expect("XML");
    let child = |node: Node<'_, '_>, tag: &str| {
        let found = node.descendants().find(|n| n.has_tag_name(tag));
        found.and_then(|n| n.text()).map(str::to_owned)
    };
    let pose = |node: Node<'_, '_>| {
        let p = numbers(&child(node, "pose").expect("a pose"));
        pose_of(&p[..3], &[p[6], p[3], p[4], p[5]])
    };
    let models = document.descendants().filter(|n| n.has_tag_name("model"));
    let models: Vec<_> = models.filter(|n| n.attribute("name") != Some("fixed")).collect();
    let models: Vec<_> =
        models.into_iter().filter(|n| n.attribute("name") != Some("floor")).collect();
    assert_eq!(models.len(), 2);
    for (model, robot) in models.iter().zip(&plant.robots) {
        let links = model.children().filter(|n| n.has_tag_name("link"));
        for (link, expected) in links.zip(robot.world_from_links()) {
            assert_same(&(pose(*model) * pose(link)), &expected, "a link");
        }
        let names: Vec<&str> = (model.children())
            .filter(|n| n.has_tag_name("link") || n.has_tag_name("joint"))
            .filter_map(|n| n.attribute("name"))
            .collect();
        let unique: std::collections::BTreeSet<&&str> = names.iter().collect();
        assert_eq!(unique.len(), names.len());
        assert!(names.contains(&"slide__x") && names.contains(&"nworld"), "{names:?}");
        let joint = model.children().find(|n| n.attribute("name") == Some("j1")).expect("is there");
        let upper = numbers(&child(joint, "upper").expect("one"))[0];
        assert!((upper + 0.4 - 1.5).abs() < 1e-12);
    }
    assert!(sdf.contains("<joint name=\"pin_0\"") && sdf.contains("libcontrol.so"));
    assert!(written.notes.iter().any(|note| note.contains("mu1")), "{:?}", written.notes);
}

#[test]
fn usd_bodies_stand_as_found_and_limits_are_degrees() {
    let plant = plant();
    let written = scene::usd(&plant).expect("writes");
    let usda = text(&written, "plant.usda");
    let lines: Vec<&str> = usda.lines().map(str::trim).collect();
    let values = |line: &str| -> Vec<f64> {
        let inner = line.split(['(', ')']).nth(1).expect("brackets");
        inner.split(", ").map(|w| w.parse().expect("a number")).collect()
    };
    // Each prim that stands somewhere, in the order of the file: the base, then its links.
    let mut poses = Vec::new();
    for (at, line) in lines.iter().enumerate().filter(|(_, l)| l.contains("xformOp:translate =")) {
        poses.push(pose_of(&values(line), &values(lines[at + 1])));
    }
    let mut at = 2; // behind the fixed world and the floor
    for robot in &plant.robots {
        for (l, expected) in robot.world_from_links().iter().enumerate() {
            assert_same(&(poses[at] * poses[at + 1 + l]), expected, "a body");
        }
        at += 1 + robot.model.links.len();
    }
    assert!(usda.starts_with("#usda 1.0\n") && usda.contains("upAxis = \"Z\""));
    let upper = format!("float physics:upperLimit = {}", 1.5_f64.to_degrees());
    assert!(lines.contains(&upper.as_str()) && lines.contains(&"float physics:upperLimit = 0.4"));
    assert!(usda.contains("def Xform \"_2_lower\"") && usda.contains("def Xform \"_2_lower_2\""));
    assert!(usda.contains("bool physics:excludeFromArticulation = true"));
    assert!(!usda.contains("NaN") && !usda.contains("inf"));
}

#[test]
fn gltf_nodes_stand_as_found() {
    let plant = plant();
    let written = scene::gltf(&plant).expect("writes");
    let bytes = &written.files[0].bytes;
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().expect("four")) as usize;
    assert_eq!((&bytes[..4], word(4), word(8)), (&b"glTF"[..], 2, bytes.len()));
    let json: serde_json::Value = serde_json::from_slice(&bytes[20..20 + word(12)]).expect("JSON");
    let nodes = json["nodes"].as_array().expect("nodes");
    let list = |value: &serde_json::Value| -> Vec<f64> {
        value
            .as_array()
            .map_or_else(Vec::new, |all| all.iter().filter_map(|v| v.as_f64()).collect())
    };
    let mut found = BTreeMap::new();
    let mut waiting = vec![(0_usize, Pose::identity())];
    while let Some((at, above)) = waiting.pop() {
        let node = &nodes[at];
        let (p, q) = (list(&node["translation"]), list(&node["rotation"]));
        let p = if p.is_empty() { vec![0.0; 3] } else { p };
        let pose = above * pose_of(&p, &[q[3], q[0], q[1], q[2]]);
        found.insert(node["name"].as_str().expect("a name").to_owned(), pose);
        waiting.extend(list(&node["children"]).iter().map(|c| (*c as usize, pose)));
    }
    let y_up = UnitQuaternion::from_axis_angle(&Vector::x_axis(), -std::f64::consts::FRAC_PI_2);
    for robot in &plant.robots {
        for (link, expected) in robot.model.links.iter().zip(robot.world_from_links()) {
            let name = format!("{}/{}", robot.id, link.name);
            assert_same(&found[&name], &(y_up * expected), &name);
        }
    }
    let slide = nodes.iter().find(|n| n["name"] == "R1/slide::x").expect("is there");
    assert_eq!(slide["extras"]["joint"]["value"], 0.1);
    assert_eq!(list(&slide["extras"]["joint"]["limits"]), [0.0, 0.4]);
}

#[test]
fn a_script_for_robodk_has_degrees_and_millimetres() {
    let written = scene::robodk(&plant()).expect("writes");
    let script = text(&written, "plant.py");
    assert!(script.contains(&format!("\"j1\": {},", 0.4_f64.to_degrees())), "{script}");
    assert!(script.contains("\"j3\": 100,") && script.contains("(\"j1\", 1, 0.0),"));
    assert!(!script.contains("(\"j5\", 1"), "a follower is no joint of the station's robot");
}

#[test]
fn what_readers_misread_is_refused() {
    type Fault = fn(&mut PlantRobot);
    let faults: [(&str, Fault); 8] = [
        ("limit", |r| r.model.joints[0].limits = Some([1.0, -1.0])),
        ("limit", |r| r.model.joints[0].limits = Some([f64::NAN, 1.0])),
        ("limits", |r| r.model.joints[0].limits = None),
        ("axis", |r| r.model.joints[1].axis = nalgebra::Unit::new_unchecked(Vector::zeros())),
        ("quaternion", |r| {
            let zero = UnitQuaternion::new_unchecked(Quaternion::new(0.0, 0.0, 0.0, 0.0));
            r.model.joints[2].parent_from_joint.rotation = zero;
        }),
        ("base", |r| r.world_from_base.translation.x = f64::INFINITY),
        ("mesh", |r| {
            std::sync::Arc::make_mut(&mut r.model.links[0].mesh).triangles[0][1] = 1 << 20;
        }),
        ("posture", |r| r.posture.push(0.0)),
    ];
    for (word, fault) in faults {
        let mut plant = plant();
        fault(&mut plant.robots[0]);
        let error = scene::gltf(&plant).expect_err(word).to_string();
        assert!(error.contains(word) && error.contains("R1"), "{word}: {error}");
    }
    let mut plant = plant();
    plant.robots[1].id = "R1".into();
    assert!(scene::sdf(&plant).is_err());
}
