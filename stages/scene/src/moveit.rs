//! Writes what MoveIt is given beside a URDF: the SRDF with groups and the found posture, and the
//! planning scene with the fixed world and the other robots as they stand.
//!
//! ```text
//! R1/robot.srdf    groups, the state `as_found`, passive joints, pairs that may touch
//! R1/touching.yaml pairs of objects and links to be allowed in MoveIt's collision matrix
//! R1/plant.scene   the fixed world as boxes, the floor, the other robots' links as meshes
//! ```

use crate::joint_rules::JointRule;
use crate::link_pairs::{PairReason, link_pairs};
use crate::names::{NameMap, NameRule};
use crate::output::{RobotToWrite, SceneFiles, names_by_robot, names_table};
use crate::plant_scene::{FLOOR_DEPTH, FixedBox, FixedGroup, PlantRobot, PlantScene, size};
use crate::text::{XmlText, num, nums};
use crate::urdf;
use contract::{Result, quote};
use geometry::{Pose, Vector};
use std::fmt::Write as _;

/// Writes URDF and SRDF of each robot.
///
/// # Errors
/// A scene that [`PlantScene::check`] refuses.
pub fn srdf(scene: &PlantScene, package: Option<&str>) -> Result<SceneFiles> {
    written(scene, package, false)
}

/// Writes URDF, SRDF and planning scene of each robot.
///
/// # Errors
/// A scene that [`PlantScene::check`] refuses.
pub fn moveit(scene: &PlantScene, package: Option<&str>) -> Result<SceneFiles> {
    written(scene, package, true)
}

fn written(scene: &PlantScene, package: Option<&str>, with_scene: bool) -> Result<SceneFiles> {
    scene.check()?;
    let robots = RobotToWrite::all(scene);
    let names = names_by_robot(&robots, NameRule::Urdf);
    let mut out = SceneFiles::default();
    for own in &robots {
        let folder = quote::file_name(&own.robot.id);
        urdf::write(own, &names, package, &mut out);
        out.add(format!("{folder}/robot.srdf"), semantics(own, &names));
        if with_scene {
            let others: Vec<_> = robots.iter().filter(|other| other.at != own.at).collect();
            out.add(format!("{folder}/plant.scene"), planning_scene(scene, own.robot, &others));
            out.add(format!("{folder}/touching.yaml"), touching(scene, own, &names));
        }
    }
    out.add("names.csv", names_table(&robots, &names));
    Ok(out)
}

fn semantics(own: &RobotToWrite<'_>, names: &NameMap) -> Vec<u8> {
    let model = &own.robot.model;
    let joint = |j: usize| names.joint(own.at, j);
    let mut xml = XmlText::new();
    xml.open("robot", &[("name", &urdf::robot_name(own))]);
    let is_moved = |j: &usize| own.rules.rules[*j] == JointRule::Free;
    let (chain, others): (Vec<usize>, Vec<usize>) =
        own.moving().filter(is_moved).partition(|j| model.main_chain.contains(j));
    let ends = model.main_chain.first().zip(model.main_chain.last());
    if let Some((first, last)) = ends.filter(|_| !chain.is_empty()) {
        let base = names.link(own.at, model.joints[*first].parent);
        let tip = names.link(own.at, model.joints[*last].child);
        xml.open("group", &[("name", "arm")]);
        xml.empty("chain", &[("base_link", base), ("tip_link", tip)]);
        xml.close();
    }
    if !others.is_empty() {
        xml.open("group", &[("name", "others")]);
        others.iter().for_each(|j| xml.empty("joint", &[("name", joint(*j))]));
        xml.close();
    }
    let all: Vec<usize> = chain.iter().chain(&others).copied().collect();
    let has_both = !chain.is_empty() && !others.is_empty();
    if has_both {
        xml.open("group", &[("name", "all")]);
        ["arm", "others"].iter().for_each(|name| xml.empty("group", &[("name", name)]));
        xml.close();
    }
    // Of states of one name pinocchio takes the first: that of all joints.
    let groups = [("all", &all, has_both), ("arm", &chain, true), ("others", &others, true)];
    for (group, joints, _) in groups.iter().filter(|(_, joints, is)| *is && !joints.is_empty()) {
        xml.open("group_state", &[("name", "as_found"), ("group", group)]);
        for j in *joints {
            xml.empty("joint", &[("name", joint(*j)), ("value", &num(own.values[*j]))]);
        }
        xml.close();
    }
    for j in own.moving().filter(|j| own.rules.rules[*j] == JointRule::Loop) {
        xml.empty("passive_joint", &[("name", joint(j))]);
    }
    for (a, b, reason) in link_pairs(own.robot, &own.rules) {
        let reason = match reason {
            PairReason::Adjacent => "Adjacent",
            PairReason::Overlap => "Default",
        };
        let [a, b] = [a, b].map(|l| names.link(own.at, l));
        let pair = [("link1", a), ("link2", b), ("reason", reason)];
        xml.empty("disable_collisions", &pair);
    }
    xml.finish()
}

/// Objects of the planning scene that meet links as found: pairs for the matrix of allowed
/// collisions, which a `.scene` does not hold.
fn touching(scene: &PlantScene, own: &RobotToWrite<'_>, names: &NameMap) -> Vec<u8> {
    let mut text = String::from(
        "# Objects of plant.scene that meet links as found. Allow these pairs to collide, or the\n\
         # start state is refused.\nallowed:\n",
    );
    for FixedGroup { name, links, .. } in scene.fixed_groups() {
        let of_robot = links.iter().filter(|[robot, _]| *robot == own.at);
        let links: Vec<String> =
            of_robot.map(|[_, link]| quote::yaml(names.link(own.at, *link))).collect();
        if !links.is_empty() {
            let _ = writeln!(text, "  {name}: [{}]", links.join(", "));
        }
    }
    // The robot stands on it, if on anything.
    let base = quote::yaml(names.link(own.at, 0));
    let _ = writeln!(text, "  floor: [{base}]");
    text.into_bytes()
}

/// Position and quaternion, a line each.
fn pose_lines(text: &mut String, pose: &Pose) {
    let (p, q) = (pose.translation.vector, pose.rotation.coords);
    let _ = writeln!(text, "{}\n{}", nums(p.as_slice(), " "), nums(q.as_slice(), " "));
}

/// How far beyond a robot's reach things are kept, metres: it may be given something to carry.
const CARRIED: f64 = 2.0;

/// What stands around a robot, as far as it can reach: scenes of many robots would otherwise grow
/// with the square of their number.
fn planning_scene(scene: &PlantScene, own: &PlantRobot, others: &[&RobotToWrite<'_>]) -> Vec<u8> {
    let base = own.world_from_base.translation.vector;
    let reach = own.reach() + CARRIED;
    let is_near = |middle: &Vector, radius: f64| (middle - base).norm() <= reach + radius;
    let mut text = format!("{}\n", quote::file_name(&scene.name));
    let half = |own: &FixedBox| Vector::from(own.size).norm() / 2.0;
    for FixedGroup { name, boxes, .. } in scene.fixed_groups() {
        let near = boxes.iter().filter(|own| is_near(&Vector::from(own.center), half(own)));
        let near: Vec<&FixedBox> = near.collect();
        if near.is_empty() {
            continue;
        }
        object(&mut text, &name, &Pose::identity(), near.len());
        for own in near {
            let [x, y, z] = own.center;
            let _ = writeln!(text, "box\n{}", nums(&own.size, " "));
            pose_lines(&mut text, &Pose::translation(x, y, z));
            text.push_str("0 0 0 0\n");
        }
        text.push_str("0\n");
    }
    if let Some(floor) = &scene.floor {
        object(&mut text, "floor", &floor.world_from_floor, 1);
        let [x, y] = floor.size;
        let _ = writeln!(text, "box\n{}", nums(&[x, y, FLOOR_DEPTH], " "));
        pose_lines(&mut text, &Pose::translation(0.0, 0.0, -FLOOR_DEPTH / 2.0));
        text.push_str("0 0 0 0\n0\n");
    }
    for other in others {
        let poses = other.robot.world_from_links();
        for (link, pose) in poses.iter().enumerate() {
            let mut bodies = other.robot.bodies(link);
            bodies.retain(|body| is_near(&pose.translation.vector, size(body.mesh)));
            if bodies.is_empty() {
                continue;
            }
            let name = format!("{}_{link:02}", quote::file_name(&other.robot.id));
            object(&mut text, &name, pose, bodies.len());
            for body in bodies {
                let (vertices, triangles) = (&body.mesh.vertices, &body.mesh.triangles);
                let _ = writeln!(text, "mesh\n{} {}", vertices.len(), triangles.len());
                for [x, y, z] in vertices {
                    let _ = writeln!(text, "{x} {y} {z}");
                }
                for [a, b, c] in triangles {
                    let _ = writeln!(text, "{a} {b} {c}");
                }
                pose_lines(&mut text, &Pose::identity());
                text.push_str("0 0 0 0\n");
            }
            text.push_str("0\n");
        }
    }
    text.push_str(".\n");
    text.into_bytes()
}

/// Begins an object with a number of shapes. The blank behind the star tells the new format.
fn object(text: &mut String, name: &str, pose: &Pose, n_shapes: usize) {
    let _ = writeln!(text, "* {name}");
    pose_lines(text, pose);
    let _ = writeln!(text, "{n_shapes}");
}
