//! Writes each robot as a URDF with its place in the plant, and with everything that the library's
//! URDF says of it.
//!
//! ```text
//! R1/robot.urdf     `world`, a fixed joint to the base, links, joints, controllers
//! R1/joints.yaml    the posture: name: value
//! R1/meshes/*.stl   metres, frames of the links
//! ```

use crate::joint_rules::JointRule;
use crate::names::{NameMap, NameRule};
use crate::output::{RobotToWrite, SceneFiles, body_color, names_by_robot, names_table};
use crate::physics::HANGING;
use crate::plant_scene::PlantScene;
use crate::text::{XmlText, num, nums};
use contract::{Result, quote};
use geometry::{Pose, roll_pitch_yaw};
use robot::JointKind;
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// Writes the URDFs of a scene; `package` makes mesh paths `package://`.
///
/// # Errors
/// A scene that [`PlantScene::check`] refuses.
pub fn urdf(scene: &PlantScene, package: Option<&str>) -> Result<SceneFiles> {
    scene.check()?;
    let robots = RobotToWrite::all(scene);
    let names = names_by_robot(&robots, NameRule::Urdf);
    let mut out = SceneFiles::default();
    robots.iter().for_each(|own| write(own, &names, package, &mut out));
    out.add("names.csv", names_table(&robots, &names));
    Ok(out)
}

/// Writes one robot.
pub(crate) fn write(
    own: &RobotToWrite<'_>,
    names: &NameMap,
    package: Option<&str>,
    out: &mut SceneFiles,
) {
    let folder = quote::file_name(&own.robot.id);
    out.add(format!("{folder}/robot.urdf"), text(own, names, package));
    out.add(format!("{folder}/joints.yaml"), posture(own, names));
    out.add_meshes(&format!("{folder}/meshes"), own.robot);
    out.note_robot(own.robot, &own.rules);
    let open = own.moving().filter(|j| own.rules.rules[*j] == JointRule::Loop);
    let open: Vec<&str> = open.map(|j| names.joint(own.at, j)).collect();
    if !open.is_empty() {
        out.notes.push(format!(
            "{}: a URDF has no closed loops; nothing moves {} (their found values are in joints.yaml)",
            own.robot.id,
            open.join(", ")
        ));
    }
}

/// The name of the robot in its URDF and SRDF, which must agree.
pub(crate) fn robot_name(own: &RobotToWrite<'_>) -> String {
    quote::file_name(&format!("{}_{}", own.robot.id, own.robot.model.name))
}

fn text(own: &RobotToWrite<'_>, names: &NameMap, package: Option<&str>) -> Vec<u8> {
    let mut xml = XmlText::new();
    xml.open("robot", &[("name", &robot_name(own))]);
    xml.comment("Metres and radians. The joint from the world is the robot's place in the plant.");
    own.robot.assumptions().iter().for_each(|words| xml.comment(words));
    xml.empty("link", &[("name", "world")]);
    xml.open("joint", &[("name", "world_from_base"), ("type", "fixed")]);
    origin(&mut xml, &own.robot.world_from_base);
    xml.empty("parent", &[("link", "world")]);
    xml.empty("child", &[("link", names.link(own.at, 0))]);
    xml.close();
    for (l, material) in materials(own, names).iter().enumerate() {
        link(own, l, names, (package, material), &mut xml);
    }
    (0..own.robot.model.joints.len()).for_each(|j| joint(own, j, names, &mut xml));
    let link_name = |l: usize| names.link(own.at, l);
    let joint_name = |j: usize| names.joint(own.at, j);
    for extra in &own.robot.details.extras {
        xml.raw(&extra.text(&link_name, &joint_name));
    }
    xml.finish()
}

/// Name of the material of what hangs on links.
const HANGING_NAME: &str = "hanging";

/// Name of each link's material: the library's, unless a link of another colour has it. Readers
/// take the first colour of a name for all.
fn materials(own: &RobotToWrite<'_>, names: &NameMap) -> Vec<String> {
    let mut taken = BTreeMap::from([(HANGING_NAME.to_owned(), HANGING)]);
    let details = own.robot.details.links.iter().enumerate();
    let name = details.map(|(l, details)| {
        let color = own.robot.color(l);
        let first = match &details.material {
            Some(name) => name.clone(),
            None => format!("unnamed_of_{}", names.link(own.at, l)),
        };
        let more = (2..).map(|k| format!("{first}_{k}"));
        let mut all = std::iter::once(first.clone()).chain(more);
        let fits = |name: &String| taken.get(name).is_none_or(|own| *own == color);
        let name = all.find(fits).unwrap_or(first);
        taken.insert(name.clone(), color);
        name
    });
    name.collect()
}

fn origin(xml: &mut XmlText, pose: &Pose) {
    let (p, rpy) = (pose.translation.vector, roll_pitch_yaw(&pose.rotation));
    let (xyz, rpy) = (nums(p.as_slice(), " "), nums(&rpy, " "));
    xml.empty("origin", &[("xyz", &xyz), ("rpy", &rpy)]);
}

fn link(
    own: &RobotToWrite<'_>,
    link: usize,
    names: &NameMap,
    (package, material): (Option<&str>, &str),
    xml: &mut XmlText,
) {
    let robot = own.robot;
    let folder = quote::file_name(&robot.id);
    xml.open("link", &[("name", names.link(own.at, link))]);
    let inertial = robot.inertial(link).value;
    xml.open("inertial", &[]);
    origin(xml, &inertial.link_from_inertia);
    xml.empty("mass", &[("value", &num(inertial.mass))]);
    let [xx, xy, xz, yy, yz, zz] = inertial.moments.map(num);
    let inertia = [("ixx", &*xx), ("ixy", &xy), ("ixz", &xz), ("iyy", &yy), ("iyz", &yz)];
    xml.empty("inertia", &[&inertia[..], &[("izz", &zz)]].concat());
    xml.close();
    for body in robot.bodies(link) {
        let name = &body.name;
        let path = package.map_or_else(
            || format!("meshes/{name}.stl"),
            |package| format!("package://{package}/{folder}/meshes/{name}.stl"),
        );
        for kind in ["visual", "collision"] {
            xml.open(kind, &[("name", &format!("{name}_{kind}"))]);
            xml.open("geometry", &[]);
            xml.empty("mesh", &[("filename", &path)]);
            xml.close();
            if kind == "visual" {
                let material = if body.hangs { HANGING_NAME } else { material };
                xml.open("material", &[("name", material)]);
                let rgba = nums(&body_color(robot, link, body.hangs), " ");
                xml.empty("color", &[("rgba", &rgba)]);
                xml.close();
            }
            xml.close();
        }
    }
    xml.close();
}

fn joint(own: &RobotToWrite<'_>, j: usize, names: &NameMap, xml: &mut XmlText) {
    let (robot, rule) = (own.robot, own.rules.rules[j]);
    let joint = &robot.model.joints[j];
    let limits = own.rules.limits[j];
    let kind = match joint.kind {
        _ if rule == JointRule::Fixed => "fixed",
        JointKind::Prismatic => "prismatic",
        JointKind::Revolute | JointKind::Continuous if limits.is_some() => "revolute",
        JointKind::Revolute | JointKind::Continuous => "continuous",
        JointKind::Fixed => "fixed",
    };
    xml.open("joint", &[("name", names.joint(own.at, j)), ("type", kind)]);
    // A locked joint stands at the only value that it has.
    let value = if rule == JointRule::Fixed { own.values[j] } else { 0.0 };
    origin(xml, &joint.parent_from_child(value));
    xml.empty("parent", &[("link", names.link(own.at, joint.parent))]);
    xml.empty("child", &[("link", names.link(own.at, joint.child))]);
    if rule != JointRule::Fixed {
        xml.empty("axis", &[("xyz", &nums(joint.axis.as_slice(), " "))]);
        let (effort, speed) = (num(robot.effort(j).value), num(robot.speed(j).value));
        let both = [("effort", &*effort), ("velocity", &*speed)];
        let [low, high] = limits.unwrap_or_default().map(num);
        let ends = [("lower", &*low), ("upper", &*high)];
        let ends = if limits.is_some() { &ends[..] } else { &[] };
        xml.empty("limit", &[ends, &both[..]].concat());
        details(own, j, xml);
    }
    if let JointRule::Follows { joint: driver, multiplier, offset } = rule {
        let [multiplier, offset] = [multiplier, offset].map(num);
        let driver = names.joint(own.at, driver);
        let all = [("joint", driver), ("multiplier", &*multiplier), ("offset", &*offset)];
        xml.empty("mimic", &all);
    }
    xml.close();
}

/// Dynamics, soft limits and calibration, where the library states them.
fn details(own: &RobotToWrite<'_>, j: usize, xml: &mut XmlText) {
    let details = &own.robot.details.joints[j];
    let mut pairs = |tag: &str, all: &[(&str, Option<f64>)]| {
        let written = all.iter().filter_map(|(name, value)| Some((*name, num((*value)?))));
        let written: Vec<(&str, String)> = written.collect();
        if !written.is_empty() {
            let all: Vec<(&str, &str)> = written.iter().map(|(n, v)| (*n, v.as_str())).collect();
            xml.empty(tag, &all);
        }
    };
    pairs("calibration", &[("rising", details.rising), ("falling", details.falling)]);
    pairs("dynamics", &[("damping", details.damping), ("friction", details.friction)]);
    if let Some(safety) = details.safety {
        pairs(
            "safety_controller",
            &[
                ("k_position", Some(safety.k_position)),
                ("k_velocity", Some(safety.k_velocity)),
                ("soft_lower_limit", Some(safety.soft_lower)),
                ("soft_upper_limit", Some(safety.soft_upper)),
            ],
        );
    }
}

fn posture(own: &RobotToWrite<'_>, names: &NameMap) -> Vec<u8> {
    let mut text = String::from("# The posture as it was found: radians, metres.\njoints:\n");
    for j in own.moving() {
        let name = quote::yaml(names.joint(own.at, j));
        let _ = writeln!(text, "  {name}: {}", num(own.values[j]));
    }
    text.into_bytes()
}
