//! Writes a scene as USD text: robots as articulations of rigid bodies, joints with limits in
//! degrees and metres, loops as joints outside of the articulation. Bodies stand as they were
//! found.
//!
//! ```text
//! plant.usda            the scene: metres, kilograms, z up
//! meshes/R1_00_….usda   a mesh each
//! ```

use crate::joint_rules::{JointRule, ScenePin};
use crate::names::{NameMap, NameRule, Named};
use crate::output::{
    RobotToWrite, SceneFile, SceneFiles, body_color, fixed_color, names_by_robot, names_table,
};
use crate::plant_scene::{FixedGroup, PlantScene, box_mesh, slides};
use crate::text::num;
use crate::usd_text::{UsdText, mesh_file, point, quaternion};
use contract::{Result, quote};
use geometry::{Pose, Vector};
use nalgebra::{Translation3, Unit, UnitQuaternion};
use robot::Mesh;
use std::f64::consts::PI;

/// Writes the scene.
///
/// # Errors
/// A scene that [`PlantScene::check`] refuses.
pub fn usd(scene: &PlantScene) -> Result<SceneFiles> {
    scene.check()?;
    let robots = RobotToWrite::all(scene);
    let mut names = names_by_robot(&robots, NameRule::Usd);
    let mut out = SceneFiles::default();
    let mut text = UsdText::stage(&scene.name);
    text.open("def Xform \"World\" (\n    kind = \"assembly\"\n)");
    text.line("def PhysicsScene \"physicsScene\"\n{\n}");
    fixed(scene, &names, &mut text, &mut out);
    for own in &robots {
        robot(own, &mut names, &mut text, &mut out);
        out.note_robot(own.robot, &own.rules);
        let is_other = |j: &usize| match own.rules.rules[*j] {
            JointRule::Follows { joint, .. } => !is_like(own, *j, joint),
            _ => false,
        };
        let led = own.moving().filter(is_other).map(|j| names.joint(own.at, j));
        let led: Vec<&str> = led.collect();
        if !led.is_empty() {
            let what = "in USD a joint follows only one of its own type; nothing moves";
            out.notes.push(format!("{}: {what} {}", own.robot.id, led.join(", ")));
        }
    }
    out.files.insert(0, SceneFile { path: "plant.usda".into(), bytes: text.finish() });
    out.add("names.csv", names_table(&robots, &names));
    Ok(out)
}

fn fixed(scene: &PlantScene, names: &NameMap, text: &mut UsdText, out: &mut SceneFiles) {
    for FixedGroup { name, boxes, links } in scene.fixed_groups() {
        let about = Vector::from(boxes[0].center);
        let mesh = box_mesh(boxes, &about);
        out.add(format!("meshes/{name}.usda"), mesh_file(&mesh, fixed_color(links), "none"));
        text.open(&format!(
            "def Xform \"{name}\" (\n    prepend references = @./meshes/{name}.usda@\n)"
        ));
        text.place(&Pose::from(about));
        if !links.is_empty() {
            let path = |[robot, link]: &[usize; 2]| {
                format!("</World/{}/{}>", names.robot(*robot), names.link(*robot, *link))
            };
            let all: Vec<String> = links.iter().map(path).collect();
            text.open("over \"mesh\" (\n    prepend apiSchemas = [\"PhysicsFilteredPairsAPI\"]\n)");
            text.line(&format!("rel physics:filteredPairs = [{}]", all.join(", ")));
            text.close();
        }
        text.close();
    }
    if let Some(floor) = &scene.floor {
        let [x, y] = floor.size.map(|edge| (edge / 2.0) as f32);
        let mesh = Mesh {
            vertices: vec![[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        };
        out.add("meshes/floor.usda", mesh_file(&mesh, [0.8, 0.8, 0.8, 1.0], "none"));
        text.open("def Xform \"Floor\" (\n    prepend references = @./meshes/floor.usda@\n)");
        text.place(&floor.world_from_floor);
        text.close();
    }
}

fn robot(own: &RobotToWrite<'_>, names: &mut NameMap, text: &mut UsdText, out: &mut SceneFiles) {
    let root = names.robot(own.at).to_owned();
    text.open(&format!(
        "def Xform \"{root}\" (\n    prepend apiSchemas = [\"PhysicsArticulationRootAPI\"]\n)"
    ));
    text.custom_text("model", &own.robot.model.name);
    text.place(&own.robot.world_from_base);
    let path = format!("/World/{root}");
    let poses = own.robot.model.poses(&own.robot.posture);
    for (l, pose) in poses.iter().enumerate() {
        link(own, l, pose, names.link(own.at, l), text, out);
    }
    let (at, n) = (own.at, own.values.len());
    let mount = names.add(Named::Joint, at, n, &own.robot.id, "world_from_base");
    text.open(&format!("def PhysicsFixedJoint \"{mount}\""));
    text.line(&format!("rel physics:body1 = <{path}/{}>", names.link(at, 0)));
    frames(&own.robot.world_from_base, &Pose::identity(), text);
    text.close();
    for j in 0..n {
        joint(own, j, names, &path, text);
    }
    for (k, pin) in own.rules.pins.iter().enumerate() {
        let name = names.add(Named::Joint, at, n + 1 + k, &own.robot.id, &format!("pin_{k}"));
        let [a, b] = [pin.link_a, pin.link_b].map(|l| names.link(at, l));
        text.open(&format!("def PhysicsRevoluteJoint \"{name}\""));
        text.line("bool physics:excludeFromArticulation = true");
        text.line("uniform token physics:axis = \"X\"");
        text.line(&format!("rel physics:body0 = <{path}/{a}>"));
        text.line(&format!("rel physics:body1 = <{path}/{b}>"));
        let [from_a, from_b] = pin_frames(pin, &poses);
        frames(&from_a, &from_b, text);
        text.close();
    }
    text.close();
}

/// Frames of a pin whose x is its axis, and which agree in the found posture.
fn pin_frames(pin: &ScenePin, poses: &[Pose]) -> [Pose; 2] {
    let turn = x_along(&pin.axis_a);
    let from_a = Pose::from_parts(Translation3::from(pin.point_a.coords), turn);
    let in_b = poses[pin.link_b].rotation.inverse() * poses[pin.link_a].rotation * turn;
    [from_a, Pose::from_parts(Translation3::from(pin.point_b.coords), in_b)]
}

/// The rotation that takes x to an axis.
fn x_along(axis: &Unit<Vector>) -> UnitQuaternion<f64> {
    UnitQuaternion::rotation_between(&Vector::x(), axis)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector::z_axis(), PI))
}

fn frames(from_0: &Pose, from_1: &Pose, text: &mut UsdText) {
    for (end, pose) in [(0, from_0), (1, from_1)] {
        let (p, q) = (point(&pose.translation.vector), quaternion(&pose.rotation));
        text.line(&format!("point3f physics:localPos{end} = {p}"));
        text.line(&format!("quatf physics:localRot{end} = {q}"));
    }
}

fn link(
    own: &RobotToWrite<'_>,
    link: usize,
    base_from_link: &Pose,
    name: &str,
    text: &mut UsdText,
    out: &mut SceneFiles,
) {
    let robot = own.robot;
    text.open(&format!(
        "def Xform \"{name}\" (\n    prepend apiSchemas = [\"PhysicsRigidBodyAPI\", \"PhysicsMassAPI\"]\n)"
    ));
    text.custom_text("name", robot.link_name(link));
    text.place(base_from_link);
    let inertial = robot.inertial(link).value;
    let [xx, xy, xz, yy, yz, zz] = inertial.moments;
    let matrix = nalgebra::Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
    let own_axes = matrix.symmetric_eigen();
    let mut axes = own_axes.eigenvectors;
    if axes.determinant() < 0.0 {
        axes.column_mut(2).neg_mut();
    }
    let axes = nalgebra::Rotation3::from_matrix_unchecked(axes);
    let turn = inertial.link_from_inertia.rotation * UnitQuaternion::from_rotation_matrix(&axes);
    text.line(&format!("float physics:mass = {}", num(inertial.mass)));
    let center = point(&inertial.link_from_inertia.translation.vector);
    text.line(&format!("point3f physics:centerOfMass = {center}"));
    text.line(&format!("float3 physics:diagonalInertia = {}", point(&own_axes.eigenvalues)));
    text.line(&format!("quatf physics:principalAxes = {}", quaternion(&turn)));
    let id = quote::file_name(&robot.id);
    for (k, body) in robot.bodies(link).into_iter().enumerate() {
        let file = format!("meshes/{id}_{}.usda", body.name);
        let color = body_color(robot, link, body.hangs);
        out.add(&*file, mesh_file(body.mesh, color, "convexHull"));
        text.open(&format!("def Xform \"body_{k}\" (\n    prepend references = @./{file}@\n)"));
        text.close();
    }
    text.close();
}

/// The first lines of a joint: its type, name, and the schemas that apply.
fn joint_head(own: &RobotToWrite<'_>, j: usize, name: &str) -> String {
    let slides = slides(&own.robot.model.joints[j]);
    let kind = match own.rules.rules[j] {
        JointRule::Fixed => "Fixed",
        _ if slides => "Prismatic",
        _ => "Revolute",
    };
    let schema = match own.rules.rules[j] {
        JointRule::Free if slides => Some("PhysicsDriveAPI:linear"),
        JointRule::Free => Some("PhysicsDriveAPI:angular"),
        JointRule::Follows { joint, .. } if is_like(own, j, joint) => Some("NewtonMimicAPI"),
        JointRule::Fixed | JointRule::Loop | JointRule::Follows { .. } => None,
    };
    let head = format!("def Physics{kind}Joint \"{name}\"");
    schema.map_or(head.clone(), |schema| {
        format!("{head} (\n    prepend apiSchemas = [\"{schema}\"]\n)")
    })
}

/// Whether a follower is of the type of its driver: the schema knows no others.
fn is_like(own: &RobotToWrite<'_>, j: usize, driver: usize) -> bool {
    let joints = &own.robot.model.joints;
    slides(&joints[j]) == slides(&joints[driver])
}

fn joint(own: &RobotToWrite<'_>, j: usize, names: &NameMap, path: &str, text: &mut UsdText) {
    let (robot, joint) = (own.robot, &own.robot.model.joints[j]);
    let rule = own.rules.rules[j];
    let slides = slides(joint);
    // Degrees, or metres.
    let unit = |value: f64| num(if slides { value } else { value.to_degrees() });
    let drive = if slides { "linear" } else { "angular" };
    text.open(&joint_head(own, j, names.joint(own.at, j)));
    text.custom_text("name", &joint.name);
    let [a, b] = [joint.parent, joint.child].map(|l| names.link(own.at, l));
    text.line(&format!("rel physics:body0 = <{path}/{a}>"));
    text.line(&format!("rel physics:body1 = <{path}/{b}>"));
    let turn = x_along(&joint.axis);
    if rule == JointRule::Fixed {
        frames(&joint.parent_from_child(own.values[j]), &Pose::identity(), text);
        text.close();
        return;
    }
    let turned = |pose: Pose| pose * turn;
    frames(&turned(joint.parent_from_joint), &turned(Pose::identity()), text);
    text.line("uniform token physics:axis = \"X\"");
    if let Some([low, high]) = own.rules.limits[j] {
        text.line(&format!("float physics:lowerLimit = {}", unit(low)));
        text.line(&format!("float physics:upperLimit = {}", unit(high)));
    }
    text.line(&format!("custom double stillpoint:found = {}", num(own.values[j])));
    text.line(&format!("float newton:velocityLimit = {}", unit(robot.speed(j).value)));
    for (word, value) in [
        ("damping", robot.details.joints[j].damping),
        ("friction", robot.details.joints[j].friction),
    ] {
        let written = value.map(|v| format!("custom double stillpoint:{word} = {}", num(v)));
        written.iter().for_each(|line| text.line(line));
    }
    match rule {
        JointRule::Free => drives(drive, &unit(own.values[j]), robot.effort(j).value, text),
        JointRule::Follows { joint: driver, multiplier, offset } if is_like(own, j, driver) => {
            text.line(&format!("float newton:mimicCoef0 = {}", unit(offset)));
            text.line(&format!("float newton:mimicCoef1 = {}", num(multiplier)));
            let driver = names.joint(own.at, driver);
            text.line(&format!("rel newton:mimicJoint = <{path}/{driver}>"));
        }
        _ => {}
    }
    text.close();
}

/// A drive that holds the found posture. It pushes by acceleration, so that it needs no masses.
fn drives(drive: &str, target: &str, effort: f64, text: &mut UsdText) {
    /// Stiffness, 1/s²; with the damping the joint comes to rest without swinging.
    const STIFFNESS: f64 = 1e3;
    /// Damping, 1/s: critical for the stiffness.
    const DAMPING: f64 = 63.0;
    let attribute = |name: &str| format!("drive:{drive}:physics:{name}");
    text.line(&format!("uniform token {} = \"acceleration\"", attribute("type")));
    text.line(&format!("float {} = {}", attribute("maxForce"), num(effort)));
    text.line(&format!("float {} = {target}", attribute("targetPosition")));
    text.line(&format!("float {} = {}", attribute("stiffness"), num(STIFFNESS)));
    text.line(&format!("float {} = {}", attribute("damping"), num(DAMPING)));
}
