//! Writes a scene as an SDF 1.9 world. SDF has no start posture: links stand as they were found,
//! and values of joints count from there, so that the limits are shifted by the found values.

use crate::joint_rules::JointRule;
use crate::names::{NameMap, NameRule, Named};
use crate::output::{
    RobotToWrite, SceneFile, SceneFiles, body_color, fixed_color, names_by_robot, names_table,
};
use crate::plant_scene::{FLOOR_DEPTH, FixedGroup, PlantScene, box_mesh, slides};
use crate::text::{XmlText, num, nums};
use contract::{Result, quote};
use geometry::{Pose, Vector};
use robot::{ExtraNode, JointKind};
use std::collections::BTreeSet;

/// Writes the scene.
///
/// # Errors
/// A scene that [`PlantScene::check`] refuses.
pub fn sdf(scene: &PlantScene) -> Result<SceneFiles> {
    scene.check()?;
    let robots = RobotToWrite::all(scene);
    let mut names = names_by_robot(&robots, NameRule::Sdf);
    let mut out = SceneFiles::default();
    let mut xml = XmlText::new();
    xml.open("sdf", &[("version", "1.9")]);
    xml.comment("Metres, radians, z up. Links stand as found; joints count from there.");
    xml.open("world", &[("name", &quote::file_name(&scene.name))]);
    fixed(scene, &mut xml, &mut out);
    for own in &robots {
        own.robot.assumptions().iter().for_each(|words| xml.comment(words));
        xml.open("model", &[("name", names.robot(own.at))]);
        pose(&mut xml, &own.robot.world_from_base, None);
        let poses = own.robot.model.poses(&own.robot.posture);
        for (l, base_from_link) in poses.iter().enumerate() {
            link(own, l, base_from_link, names.link(own.at, l), &mut xml);
        }
        let base = names.link(own.at, 0).to_owned();
        // Behind all joints of the model there is one more number.
        let (at, n) = (own.at, own.values.len());
        let mount = names.add(Named::Joint, at, n, &own.robot.id, "world_from_base");
        xml.open("joint", &[("name", &mount), ("type", "fixed")]);
        xml.value("parent", &[], "world");
        xml.value("child", &[], &base);
        xml.close();
        for j in 0..own.values.len() {
            let joint = &own.robot.model.joints[j];
            let ends = [joint.parent, joint.child].map(|l| names.link(own.at, l));
            write_joint(own, j, names.joint(own.at, j), ends, &mut xml);
        }
        for (k, pin) in own.rules.pins.iter().enumerate() {
            let name = names.add(Named::Joint, at, n + 1 + k, &own.robot.id, &format!("pin_{k}"));
            xml.open("joint", &[("name", &name), ("type", "continuous")]);
            pose(&mut xml, &Pose::from(pin.point_b.coords), None);
            xml.value("parent", &[], names.link(at, pin.link_a));
            xml.value("child", &[], names.link(at, pin.link_b));
            xml.open("axis", &[]);
            xml.value("xyz", &[], &nums(pin.axis_b.as_slice(), " "));
            xml.close();
            xml.close();
        }
        plugins(own, &names, &mut xml, &mut out);
        xml.close();
        out.add_meshes(&format!("meshes/{}", quote::file_name(&own.robot.id)), own.robot);
        out.note_robot(own.robot, &own.rules);
    }
    out.files.insert(0, SceneFile { path: "plant.sdf".into(), bytes: xml.finish() });
    out.add("names.csv", names_table(&robots, &names));
    Ok(out)
}

fn pose(xml: &mut XmlText, pose: &Pose, relative_to: Option<&str>) {
    let (p, q) = (pose.translation.vector, pose.rotation.coords);
    let words = nums(&[p.x, p.y, p.z, q.x, q.y, q.z, q.w], " ");
    let format = [("rotation_format", "quat_xyzw")];
    let frame = relative_to.map(|frame| ("relative_to", frame));
    xml.value("pose", &format.into_iter().chain(frame).collect::<Vec<_>>(), &words);
}

fn material(xml: &mut XmlText, rgba: [f64; 4]) {
    xml.open("material", &[]);
    let words = nums(&rgba, " ");
    ["ambient", "diffuse"].iter().for_each(|tag| xml.value(tag, &[], &words));
    xml.close();
}

fn mesh(xml: &mut XmlText, uri: &str) {
    xml.open("geometry", &[]);
    xml.open("mesh", &[]);
    xml.value("uri", &[], uri);
    xml.close();
    xml.close();
}

/// What stands still: meshes of boxes about the middle of their first, and the floor.
fn fixed(scene: &PlantScene, xml: &mut XmlText, out: &mut SceneFiles) {
    if !scene.touching.is_empty() {
        let what = "what stands still and meets robots as found is only seen in SDF";
        out.notes.push(format!("{what}, where no pairs can be left out: the models touching_*"));
    }
    for FixedGroup { name, boxes, links } in scene.fixed_groups() {
        let about = Vector::from(boxes[0].center);
        let file = format!("meshes/{name}.stl");
        out.add(&*file, box_mesh(boxes, &about).to_stl());
        xml.open("model", &[("name", &name)]);
        xml.value("static", &[], "true");
        pose(xml, &Pose::from(about), None);
        xml.open("link", &[("name", &format!("{name}_link"))]);
        let kinds = ["visual", "collision"].into_iter();
        for kind in kinds.take(if links.is_empty() { 2 } else { 1 }) {
            xml.open(kind, &[("name", kind)]);
            mesh(xml, &file);
            if kind == "visual" {
                material(xml, fixed_color(links));
            }
            xml.close();
        }
        xml.close();
        xml.close();
    }
    if let Some(floor) = &scene.floor {
        xml.open("model", &[("name", "floor")]);
        xml.value("static", &[], "true");
        pose(xml, &floor.world_from_floor, None);
        xml.open("link", &[("name", "floor_link")]);
        for kind in ["visual", "collision"] {
            xml.open(kind, &[("name", kind)]);
            // A plane would be without end.
            pose(xml, &Pose::translation(0.0, 0.0, -FLOOR_DEPTH / 2.0), None);
            xml.open("geometry", &[]);
            xml.open("box", &[]);
            let [x, y] = floor.size;
            xml.value("size", &[], &nums(&[x, y, FLOOR_DEPTH], " "));
            xml.close();
            xml.close();
            xml.close();
        }
        xml.close();
        xml.close();
    }
}

fn link(own: &RobotToWrite<'_>, link: usize, base_from_link: &Pose, name: &str, xml: &mut XmlText) {
    let robot = own.robot;
    xml.open("link", &[("name", name)]);
    pose(xml, base_from_link, None);
    let inertial = robot.inertial(link).value;
    xml.open("inertial", &[]);
    pose(xml, &inertial.link_from_inertia, None);
    xml.value("mass", &[], &num(inertial.mass));
    xml.open("inertia", &[]);
    let tags = ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"];
    tags.iter().zip(inertial.moments).for_each(|(tag, value)| xml.value(tag, &[], &num(value)));
    xml.close();
    xml.close();
    let folder = quote::file_name(&robot.id);
    for body in robot.bodies(link) {
        for kind in ["visual", "collision"] {
            xml.open(kind, &[("name", &format!("{}_{kind}", body.name))]);
            mesh(xml, &format!("meshes/{folder}/{}.stl", body.name));
            if kind == "visual" {
                material(xml, body_color(robot, link, body.hangs));
            }
            xml.close();
        }
    }
    xml.close();
}

fn write_joint(own: &RobotToWrite<'_>, j: usize, name: &str, ends: [&str; 2], xml: &mut XmlText) {
    let (robot, joint) = (own.robot, &own.robot.model.joints[j]);
    let moves = own.rules.rules[j] != JointRule::Fixed;
    let limits = own.rules.limits[j];
    let kind = match joint.kind {
        _ if !moves => "fixed",
        JointKind::Prismatic => "prismatic",
        JointKind::Fixed => "fixed",
        _ if limits.is_some() => "revolute",
        _ => "continuous",
    };
    xml.open("joint", &[("name", name), ("type", kind)]);
    xml.value("parent", &[], ends[0]);
    xml.value("child", &[], ends[1]);
    if moves {
        xml.open("axis", &[]);
        xml.value("xyz", &[], &nums(joint.axis.as_slice(), " "));
        xml.open("limit", &[]);
        if let Some([low, high]) = limits {
            xml.value("lower", &[], &num(low - own.values[j]));
            xml.value("upper", &[], &num(high - own.values[j]));
        }
        xml.value("effort", &[], &num(robot.effort(j).value));
        xml.value("velocity", &[], &num(robot.speed(j).value));
        xml.close();
        let details = &robot.details.joints[j];
        if details.damping.is_some() || details.friction.is_some() {
            xml.open("dynamics", &[]);
            details.damping.iter().for_each(|v| xml.value("damping", &[], &num(*v)));
            details.friction.iter().for_each(|v| xml.value("friction", &[], &num(*v)));
            xml.close();
        }
        xml.close();
        let unit = if slides(joint) { "m" } else { "rad" };
        xml.comment(&format!("found at {} {unit}", num(own.values[j])));
    }
    xml.close();
}

/// Plugins of the library's `gazebo` elements for the whole model; all else of them is named.
fn plugins(own: &RobotToWrite<'_>, names: &NameMap, xml: &mut XmlText, out: &mut SceneFiles) {
    let link = |l: usize| names.link(own.at, l);
    let joint = |j: usize| names.joint(own.at, j);
    let mut left_out = BTreeSet::new();
    for extra in own.robot.details.extras.iter().filter(|extra| extra.tag == "gazebo") {
        let is_model = !extra.has("reference");
        for child in &extra.children {
            match child {
                ExtraNode::Element(element)
                    if is_model
                        && element.tag == "plugin"
                        && element.has("filename")
                        && element.has("name") =>
                {
                    xml.raw(&element.text(&link, &joint));
                }
                ExtraNode::Element(element) => drop(left_out.insert(element.tag.as_str())),
                ExtraNode::Text(_) => {}
            }
        }
    }
    let id = &own.robot.id;
    if !left_out.is_empty() {
        let all: Vec<&str> = left_out.into_iter().collect();
        let what = "of the library's gazebo elements SDF was given only plugins of the model";
        out.notes.push(format!("{id}: {what}; not {}", all.join(", ")));
    }
    let follows = |j: usize| matches!(own.rules.rules[j], JointRule::Follows { .. });
    let is_led = |j: &usize| follows(*j) && !own.is_held_by_pins(*j);
    let led: Vec<&str> = own.moving().filter(is_led).map(joint).collect();
    if !led.is_empty() {
        let what = "SDF 1.9 has no joints that follow others; nothing moves";
        out.notes.push(format!("{id}: {what} {}", led.join(", ")));
    }
}
