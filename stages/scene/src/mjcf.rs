//! Writes a scene as MJCF for MuJoCo: one jointless body around all robots, loops as pins between
//! sites, followers as equalities, the found posture as key frame `as_found`.

use crate::joint_rules::JointRule;
use crate::link_pairs::link_pairs;
use crate::names::{NameMap, NameRule};
use crate::output::{RobotToWrite, SceneFiles, body_color, fixed_color, names_table};
use crate::plant_scene::{FLOOR_DEPTH, FixedGroup, LinkBody, PlantScene};
use crate::text::{XmlText, num, nums};
use contract::{Error, Kind, Result, quote};
use geometry::Pose;
use robot::{JointKind, Mesh, hull};
use std::borrow::Cow;
use std::collections::BTreeSet;

/// Writes the scene.
///
/// # Errors
/// A scene that [`PlantScene::check`] refuses.
pub fn mjcf(scene: &PlantScene) -> Result<SceneFiles> {
    scene.check()?;
    let robots = RobotToWrite::all(scene);
    let mut names = NameMap::new(NameRule::Mjcf);
    for own in &robots {
        own.name_parts(&mut names, "", &format!("{}/", own.robot.id));
    }
    let mut out = SceneFiles::default();
    let mut xml = XmlText::new();
    xml.open("mujoco", &[("model", &quote::file_name(&scene.name))]);
    xml.comment("Metres, radians, z up. The key frame as_found is the posture of the scans.");
    robots.iter().flat_map(|own| own.robot.assumptions()).for_each(|words| xml.comment(&words));
    let compiler = [("angle", "radian"), ("autolimits", "false"), ("balanceinertia", "true")];
    xml.empty("compiler", &[&compiler[..], &[("meshdir", "meshes")]].concat());
    xml.open("asset", &[]);
    robots.iter().for_each(|own| assets(own, &mut xml));
    xml.close();
    xml.open("worldbody", &[]);
    xml.empty("light", &[("pos", "0 0 20"), ("directional", "true")]);
    xml.open("body", &[("name", "plant")]);
    fixed(scene, &mut xml);
    for own in &robots {
        body(own, 0, &own.robot.world_from_base, &names, &mut xml);
    }
    xml.close();
    xml.close();
    contacts(scene, &robots, &names, &mut xml);
    equalities(&robots, &names, &mut xml);
    key_frame(&robots, &mut xml)?;
    out.add("plant.xml", xml.finish());
    for own in &robots {
        for piece in (0..own.robot.model.links.len()).flat_map(|link| pieces(own, link)) {
            out.add(format!("meshes/{}.stl", piece.name), piece.mesh.to_stl());
        }
        out.note_robot(own.robot, &own.rules);
    }
    out.add("names.csv", names_table(&robots, &names));
    Ok(out)
}

/// A mesh of a link as MuJoCo takes it.
struct MeshPiece<'a> {
    name: String,
    mesh: Cow<'a, Mesh>,
    hangs: bool,
}

/// The meshes of a link: those that are too large for MuJoCo in parts, and none that is too small.
fn pieces<'a>(own: &RobotToWrite<'a>, link: usize) -> Vec<MeshPiece<'a>> {
    /// Most triangles of a mesh that MuJoCo reads.
    const MOST: usize = 200_000;
    /// Fewest vertices.
    const FEWEST: usize = 4;
    let mut out = Vec::new();
    for LinkBody { name, mesh, hangs } in own.robot.bodies(link) {
        let name = format!("{}/{name}", quote::file_name(&own.robot.id));
        let places: BTreeSet<[u32; 3]> =
            mesh.vertices.iter().map(|v| v.map(|x| (x + 0.0).to_bits())).collect();
        if places.len() < FEWEST {
            continue;
        }
        if mesh.triangles.len() <= MOST {
            out.push(MeshPiece { name, mesh: Cow::Borrowed(mesh), hangs });
            continue;
        }
        for (k, part) in mesh.triangles.chunks(MOST).enumerate() {
            let part = Mesh { vertices: mesh.vertices.clone(), triangles: part.to_vec() };
            out.push(MeshPiece { name: format!("{name}_part_{k}"), mesh: Cow::Owned(part), hangs });
        }
    }
    out
}

fn assets(own: &RobotToWrite<'_>, xml: &mut XmlText) {
    for piece in (0..own.robot.model.links.len()).flat_map(|link| pieces(own, link)) {
        let (name, file) = (&piece.name, format!("{}.stl", piece.name));
        // Of a mesh that is no body the volume is not taken.
        xml.empty("mesh", &[("name", name), ("file", &file), ("inertia", "shell")]);
    }
}

fn pose_words(pose: &Pose) -> [String; 2] {
    let (p, q) = (pose.translation.vector, pose.rotation);
    [nums(p.as_slice(), " "), nums(&[q.w, q.i, q.j, q.k], " ")]
}

fn fixed(scene: &PlantScene, xml: &mut XmlText) {
    for FixedGroup { name, boxes, links } in scene.fixed_groups() {
        let rgba = nums(&fixed_color(links), " ");
        // Bodies are what pairs without contact are made of.
        xml.open("body", &[("name", &name)]);
        for own in boxes {
            let half = nums(&own.size.map(|edge| edge / 2.0), " ");
            let (pos, rgba) = (nums(&own.center, " "), &rgba);
            xml.empty("geom", &[("type", "box"), ("size", &half), ("pos", &pos), ("rgba", rgba)]);
        }
        xml.close();
    }
    if let Some(floor) = &scene.floor {
        // A plane would be without end.
        let below = Pose::translation(0.0, 0.0, -FLOOR_DEPTH / 2.0);
        let [pos, quat] = pose_words(&(floor.world_from_floor * below));
        let [x, y] = floor.size;
        let size = nums(&[x, y, FLOOR_DEPTH].map(|edge| edge / 2.0), " ");
        let place = [("pos", &*pos), ("quat", &quat), ("rgba", "0.8 0.8 0.8 1")];
        let body = [("name", "floor"), ("type", "box"), ("size", &size)];
        xml.empty("geom", &[&body[..], &place].concat());
    }
}

/// A link, what it carries, and the joint that carries it.
fn body(own: &RobotToWrite<'_>, link: usize, pose: &Pose, names: &NameMap, xml: &mut XmlText) {
    let robot = own.robot;
    let model = &robot.model;
    let [pos, quat] = pose_words(pose);
    let name = names.link(own.at, link);
    let place = [("name", name), ("pos", &*pos), ("quat", &quat)];
    xml.open("body", &[&place[..], &[("gravcomp", "1")]].concat());
    let inertial = robot.inertial(link).value;
    let (pos, [xx, xy, xz, yy, yz, zz]) = (inertial.link_from_inertia, inertial.moments);
    // MuJoCo takes no turn beside a full matrix.
    let turn = pos.rotation.to_rotation_matrix();
    let m = turn.matrix()
        * nalgebra::Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
        * turn.matrix().transpose();
    let full = nums(&[m[(0, 0)], m[(1, 1)], m[(2, 2)], m[(0, 1)], m[(0, 2)], m[(1, 2)]], " ");
    let (at, mass) = (nums(pos.translation.vector.as_slice(), " "), num(inertial.mass));
    xml.empty("inertial", &[("pos", &at), ("mass", &mass), ("fullinertia", &full)]);
    if let Some(j) = model.links[link].parent_joint {
        joint(own, j, names, xml);
    }
    for piece in pieces(own, link) {
        let rgba = nums(&body_color(robot, link, piece.hangs), " ");
        let shown = [("type", "mesh"), ("mesh", &*piece.name), ("rgba", &rgba), ("mass", "0")];
        // What is flat has no hull that could collide.
        let flat = [("contype", "0"), ("conaffinity", "0")];
        let is_flat = hull(&piece.mesh.vertices).is_none();
        xml.empty("geom", &[&shown[..], if is_flat { &flat } else { &[] }].concat());
    }
    for (k, pin) in own.rules.pins.iter().enumerate() {
        for (end, of, point) in [("a", pin.link_a, pin.point_a), ("b", pin.link_b, pin.point_b)] {
            if of == link {
                let pos = nums(point.coords.as_slice(), " ");
                xml.empty("site", &[("name", &site(own, k, end)), ("pos", &pos)]);
            }
        }
    }
    for (j, joint) in model.joints.iter().enumerate().filter(|(_, joint)| joint.parent == link) {
        let is_fixed = own.rules.rules[j] == JointRule::Fixed;
        let value = if is_fixed { own.values[j] } else { 0.0 };
        body(own, joint.child, &joint.parent_from_child(value), names, xml);
    }
    xml.close();
}

fn site(own: &RobotToWrite<'_>, pin: usize, end: &str) -> String {
    format!("{}/pin_{pin}_{end}", own.robot.id)
}

fn joint(own: &RobotToWrite<'_>, j: usize, names: &NameMap, xml: &mut XmlText) {
    if own.rules.rules[j] == JointRule::Fixed {
        return;
    }
    let (robot, joint) = (own.robot, &own.robot.model.joints[j]);
    let kind = if joint.kind == JointKind::Prismatic { "slide" } else { "hinge" };
    let axis = nums(joint.axis.as_slice(), " ");
    let name = names.joint(own.at, j);
    let mut all = vec![("name", name.to_owned()), ("type", kind.into()), ("axis", axis)];
    // Equal or swapped ends would be taken for a joint without limits.
    let range = own.rules.limits[j].filter(|[low, high]| low < high);
    all.push(("limited", range.is_some().to_string()));
    all.extend(range.map(|range| ("range", nums(&range, " "))));
    if let (JointRule::Free, Some(effort)) = (own.rules.rules[j], robot.details.joints[j].effort) {
        all.push(("actuatorfrclimited", "true".into()));
        all.push(("actuatorfrcrange", nums(&[-effort, effort], " ")));
    }
    let details = &robot.details.joints[j];
    all.extend(details.damping.map(|v| ("damping", num(v))));
    all.extend(details.friction.map(|v| ("frictionloss", num(v))));
    let all: Vec<(&str, &str)> = all.iter().map(|(n, v)| (*n, v.as_str())).collect();
    xml.empty("joint", &all);
}

fn contacts(scene: &PlantScene, robots: &[RobotToWrite<'_>], names: &NameMap, xml: &mut XmlText) {
    xml.open("contact", &[]);
    for FixedGroup { name, links, .. } in scene.fixed_groups() {
        for &[robot, link] in links {
            xml.empty("exclude", &[("body1", &name), ("body2", names.link(robot, link))]);
        }
    }
    for own in robots {
        for (a, b, _) in link_pairs(own.robot, &own.rules) {
            let [a, b] = [a, b].map(|link| names.link(own.at, link));
            xml.empty("exclude", &[("body1", a), ("body2", b)]);
        }
    }
    xml.close();
}

fn equalities(robots: &[RobotToWrite<'_>], names: &NameMap, xml: &mut XmlText) {
    xml.open("equality", &[]);
    for own in robots {
        for k in 0..own.rules.pins.len() {
            let [a, b] = ["a", "b"].map(|end| site(own, k, end));
            let name = format!("{}/pin_{k}", own.robot.id);
            xml.empty("connect", &[("name", &name), ("site1", &a), ("site2", &b)]);
        }
        for j in own.moving() {
            if own.is_held_by_pins(j) {
                continue;
            }
            if let JointRule::Follows { joint, multiplier, offset } = own.rules.rules[j] {
                let [follower, driver] = [j, joint].map(|j| names.joint(own.at, j));
                let line = nums(&[offset, multiplier, 0.0, 0.0, 0.0], " ");
                let both = [("joint1", follower), ("joint2", driver), ("polycoef", &*line)];
                xml.empty("joint", &both);
            }
        }
    }
    xml.close();
}

/// The found posture. A list that is too short would be filled up silently.
fn key_frame(robots: &[RobotToWrite<'_>], xml: &mut XmlText) -> Result<()> {
    let mut values = Vec::new();
    for own in robots {
        // Joints stand in the order of bodies: depth first, children in the order of the model.
        let mut waiting = vec![0];
        while let Some(link) = waiting.pop() {
            let carrier = own.robot.model.links[link].parent_joint;
            let moved = carrier.filter(|j| own.rules.rules[*j] != JointRule::Fixed);
            values.extend(moved.map(|j| own.values[j]));
            let carried = own.robot.model.joints.iter().filter(|j| j.parent == link);
            waiting.extend(carried.map(|j| j.child).collect::<Vec<_>>().into_iter().rev());
        }
    }
    let n: usize = robots.iter().map(|own| own.moving().count()).sum();
    if values.len() != n {
        let what = format!("the key frame has {} values for {n} joints", values.len());
        return Err(Error::new(Kind::Bug, what));
    }
    xml.open("keyframe", &[]);
    xml.empty("key", &[("name", "as_found"), ("qpos", &nums(&values, " "))]);
    xml.close();
    Ok(())
}
