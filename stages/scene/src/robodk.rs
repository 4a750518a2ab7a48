//! Writes a scene as a Python script for RoboDK: millimetres and degrees, with tables that the user
//! may edit before it is run.
//!
//! ```text
//! plant.py          finds or places each robot, sets its base and joints, adds what stands still
//! meshes/*.stl      metres; the script scales them
//! ```

use crate::joint_rules::JointRule;
use crate::names::NameRule;
use crate::output::{RobotToWrite, SceneFile, SceneFiles, names_by_robot, names_table};
use crate::plant_scene::{
    FLOOR_DEPTH, FixedBox, FixedGroup, PlantRobot, PlantScene, box_mesh, slides,
};
use crate::text::{num, nums};
use contract::{Result, quote};
use geometry::{Pose, Vector, roll_pitch_yaw};
use std::fmt::Write as _;

/// The part of the script that is the same for all scenes.
const PROGRAM: &str = include_str!("robodk.py");

/// Writes the scene.
///
/// # Errors
/// A scene that [`PlantScene::check`] refuses.
pub fn robodk(scene: &PlantScene) -> Result<SceneFiles> {
    scene.check()?;
    let robots = RobotToWrite::all(scene);
    let names = names_by_robot(&robots, NameRule::Free);
    let mut out = SceneFiles::default();
    let mut text = String::from(
        "# Scene for RoboDK. Edit the tables, then run this script in RoboDK or beside it.\n\
         # Millimetres and degrees; poses are x, y, z, rx, ry, rz for robomath.xyzrpw_2_pose.\n\n\
         # Robot of the station for each robot of the plant; None shows its links as they stand.\n\
         STATION_NAMES = {\n",
    );
    for own in &robots {
        let _ = writeln!(text, "    {}: {},", string(&own.robot.id), string(&own.robot.model.name));
    }
    text.push_str(
        "}\n\n# Joints in the order of the station's robot: name here, sign, and what is added (degrees, mm).\n\
         JOINTS = {\n",
    );
    robots.iter().for_each(|own| joints(own, &mut text));
    text.push_str("}\n\n# Base and found values of all joints (degrees, mm).\nROBOTS = {\n");
    robots.iter().for_each(|own| robot(own, &mut text));
    text.push_str("}\n\n# Meshes of links in metres: file, pose in the world.\nLINKS = {\n");
    for own in &robots {
        links(own.robot, &mut text);
        out.add_meshes(&format!("meshes/{}", quote::file_name(&own.robot.id)), own.robot);
        out.notes.extend((own.rules.n_open > 0).then(|| {
            format!("{}: RoboDK has no closed loops; links stand as found", own.robot.id)
        }));
    }
    text.push_str("}\n\n# What stands still, in metres: name, file, pose.\nFIXED = [\n");
    fixed(scene, &mut text, &mut out);
    text.push_str("]\n\n");
    text.push_str(PROGRAM);
    out.files.insert(0, SceneFile { path: "plant.py".into(), bytes: text.into_bytes() });
    out.add("names.csv", names_table(&robots, &names));
    Ok(out)
}

/// A string of Python.
fn string(text: &str) -> String {
    // What JSON escapes, Python reads the same way; odd characters are escaped as well.
    quote::json(&serde_json::Value::from(text).to_string()).into_owned()
}

/// Millimetres and degrees: the rotations about x, y and z of URDF.
fn pose(pose: &Pose) -> String {
    let p = pose.translation.vector * 1e3;
    let [r, t, y] = roll_pitch_yaw(&pose.rotation).map(f64::to_degrees);
    format!("[{}]", nums(&[p.x, p.y, p.z, r, t, y], ", "))
}

fn joints(own: &RobotToWrite<'_>, text: &mut String) {
    let _ = writeln!(text, "    {}: [", string(&own.robot.id));
    for j in own.moving().filter(|j| own.rules.rules[*j] == JointRule::Free) {
        let _ = writeln!(text, "        ({}, 1, 0.0),", string(&own.robot.model.joints[j].name));
    }
    text.push_str("    ],\n");
}

fn robot(own: &RobotToWrite<'_>, text: &mut String) {
    let robot = own.robot;
    let _ = writeln!(
        text,
        "    {}: {{\n        \"base\": {},\n        \"joints\": {{",
        string(&robot.id),
        pose(&robot.world_from_base)
    );
    for j in own.moving() {
        let joint = &robot.model.joints[j];
        let value = own.values[j];
        let value = if slides(joint) { value * 1e3 } else { value.to_degrees() };
        let _ = writeln!(text, "            {}: {},", string(&joint.name), num(value));
    }
    text.push_str("        },\n    },\n");
}

fn links(robot: &PlantRobot, text: &mut String) {
    let _ = writeln!(text, "    {}: [", string(&robot.id));
    let folder = quote::file_name(&robot.id);
    for (l, world_from_link) in robot.world_from_links().iter().enumerate() {
        for body in robot.bodies(l) {
            let file = string(&format!("meshes/{folder}/{}.stl", body.name));
            let name = string(&robot.model.links[l].name);
            let _ = writeln!(text, "        ({name}, {file}, {}),", pose(world_from_link));
        }
    }
    text.push_str("    ],\n");
}

fn fixed(scene: &PlantScene, text: &mut String, out: &mut SceneFiles) {
    for FixedGroup { name, boxes, .. } in scene.fixed_groups() {
        let about = Vector::from(boxes[0].center);
        out.add(format!("meshes/{name}.stl"), box_mesh(boxes, &about).to_stl());
        let place = pose(&Pose::from(about));
        let _ = writeln!(text, "    (\"{name}\", \"meshes/{name}.stl\", {place}),");
    }
    if let Some(floor) = &scene.floor {
        let size = [floor.size[0], floor.size[1], FLOOR_DEPTH];
        let below = [0.0, 0.0, -size[2] / 2.0];
        let own = FixedBox { center: below, size };
        out.add("meshes/floor.stl", box_mesh(&[own], &Vector::zeros()).to_stl());
        let place = pose(&floor.world_from_floor);
        let _ = writeln!(text, "    (\"floor\", \"meshes/floor.stl\", {place}),");
    }
}
