//! Writes a scene as one binary glTF: a node for each link in the tree of the robot, the found
//! posture as it stands, and joints in the nodes' extras. glTF is y up: the root node turns z up.

use crate::joint_rules::JointRule;
use crate::names::{NameMap, NameRule};
use crate::output::{RobotToWrite, SceneFiles, body_color, fixed_color, linear, names_table};
use crate::plant_scene::{FixedGroup, PlantScene, box_mesh, slides};
use contract::{Error, Kind, Result};
use geometry::{Pose, Vector};
use robot::{JointKind, Mesh};
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Writes the scene.
///
/// # Errors
/// A scene that [`PlantScene::check`] refuses, or one of more than 4 GiB.
pub fn gltf(scene: &PlantScene) -> Result<SceneFiles> {
    scene.check()?;
    let robots = RobotToWrite::all(scene);
    let mut names = NameMap::new(NameRule::Free);
    robots.iter().for_each(|own| own.name_parts(&mut names, "", &format!("{}/", own.robot.id)));
    let mut file = GltfFile::default();
    // A quarter turn about x takes z up to y up.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    file.nodes.push(json!({
        "name": scene.name, "rotation": [-half, 0.0, 0.0, half],
        "extras": { "unit": "metre", "angles": "radian", "up": "z below this node" },
    }));
    let mut children = fixed(scene, &mut file);
    for own in &robots {
        children.push(link(own, 0, &own.robot.world_from_base, &names, &mut file));
    }
    file.set_children(0, children);
    let mut out = SceneFiles::default();
    out.add("plant.glb", file.finish()?);
    robots.iter().for_each(|own| out.note_robot(own.robot, &own.rules));
    out.add("names.csv", names_table(&robots, &names));
    Ok(out)
}

/// Parts of a file while they are gathered.
#[derive(Default)]
struct GltfFile {
    nodes: Vec<Value>,
    meshes: Vec<Value>,
    accessors: Vec<Value>,
    views: Vec<Value>,
    materials: Vec<Value>,
    /// Index of the material of each colour.
    colors: BTreeMap<[u64; 4], usize>,
    bytes: Vec<u8>,
}

fn fixed(scene: &PlantScene, file: &mut GltfFile) -> Vec<usize> {
    let mut children = Vec::new();
    for FixedGroup { name, boxes, links } in scene.fixed_groups() {
        let about = Vector::from(boxes[0].center);
        let mesh = file.mesh(&box_mesh(boxes, &about), fixed_color(links));
        let met = links.iter().map(|&[robot, link]| {
            let robot = &scene.robots[robot];
            json!({ "robot": robot.id, "link": robot.model.links[link].name })
        });
        let extras = json!({ "meets_as_found": met.collect::<Vec<_>>() });
        children.push(file.node(&name, &Pose::from(about), mesh, extras));
    }
    if let Some(floor) = &scene.floor {
        let [x, y] = floor.size.map(|edge| (edge / 2.0) as f32);
        let mesh = Mesh {
            vertices: vec![[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        };
        let mesh = file.mesh(&mesh, [0.8, 0.8, 0.8, 1.0]);
        children.push(file.node("floor", &floor.world_from_floor, mesh, json!({})));
    }
    children
}

/// Adds the node of a link and those that it carries; returns its index.
fn link(
    own: &RobotToWrite<'_>,
    link: usize,
    pose: &Pose,
    names: &NameMap,
    file: &mut GltfFile,
) -> usize {
    let robot = own.robot;
    let model = &robot.model;
    let mut extras = json!({ "robot": robot.id, "link": model.links[link].name });
    if link == 0 {
        extras["model"] = json!(model.name);
    }
    if let Some(j) = model.links[link].parent_joint {
        extras["joint"] = joint(own, j);
    }
    let at = file.node(names.link(own.at, link), pose, None, extras);
    let mut children = Vec::new();
    for body in robot.bodies(link) {
        let mesh = file.mesh(body.mesh, body_color(robot, link, body.hangs));
        let extras = json!({ "hangs": body.hangs });
        let name = format!("{}/{}", robot.id, body.name);
        children.push(file.node(&name, &Pose::identity(), mesh, extras));
    }
    for (j, joint) in model.joints.iter().enumerate().filter(|(_, joint)| joint.parent == link) {
        let pose = joint.parent_from_child(own.values[j]);
        children.push(self::link(own, joint.child, &pose, names, file));
    }
    file.set_children(at, children);
    at
}

/// What the extras of a link say of the joint that carries it.
fn joint(own: &RobotToWrite<'_>, j: usize) -> Value {
    let (robot, joint) = (own.robot, &own.robot.model.joints[j]);
    let rule = own.rules.rules[j];
    let kind = match joint.kind {
        _ if rule == JointRule::Fixed => "fixed",
        JointKind::Prismatic => "prismatic",
        JointKind::Fixed => "fixed",
        _ if own.rules.limits[j].is_some() => "revolute",
        _ => "continuous",
    };
    let mut out = json!({ "name": joint.name, "type": kind });
    if rule != JointRule::Fixed {
        out["unit"] = json!(if slides(joint) { "m" } else { "rad" });
        out["axis"] = json!(joint.axis.as_slice());
        out["value"] = json!(own.values[j]);
        let (p, q) = (joint.parent_from_joint.translation, joint.parent_from_joint.rotation);
        out["origin"] = json!({ "xyz": [p.x, p.y, p.z], "quat_xyzw": q.coords.as_slice() });
        out["velocity"] = json!(robot.details.joints[j].velocity);
        out["effort"] = json!(robot.details.joints[j].effort);
        out["limits"] = json!(own.rules.limits[j]);
    }
    match rule {
        JointRule::Follows { joint, multiplier, offset } => {
            let name = &robot.model.joints[joint].name;
            out["follows"] = json!({ "joint": name, "multiplier": multiplier, "offset": offset });
        }
        JointRule::Loop => out["set_by"] = json!("closed loop"),
        JointRule::Free | JointRule::Fixed => {}
    }
    out
}

impl GltfFile {
    fn node(&mut self, name: &str, pose: &Pose, mesh: Option<usize>, extras: Value) -> usize {
        let (p, q) = (pose.translation, pose.rotation.coords);
        let mut node = json!({
            "name": name, "translation": [p.x, p.y, p.z], "rotation": q.as_slice(),
            "extras": extras,
        });
        if let Some(mesh) = mesh {
            node["mesh"] = json!(mesh);
        }
        self.nodes.push(node);
        self.nodes.len() - 1
    }

    /// Sets the children of a node; an empty list is not valid.
    fn set_children(&mut self, node: usize, children: Vec<usize>) {
        if !children.is_empty() {
            self.nodes[node]["children"] = json!(children);
        }
    }

    fn material(&mut self, color: [f64; 4]) -> usize {
        let next = self.materials.len();
        let at = *self.colors.entry(color.map(f64::to_bits)).or_insert(next);
        if at == next {
            let mode = if color[3] < 1.0 { "BLEND" } else { "OPAQUE" };
            self.materials.push(json!({
                "pbrMetallicRoughness": {
                    "baseColorFactor": linear(color), "metallicFactor": 0.1, "roughnessFactor": 0.8,
                },
                "alphaMode": mode, "doubleSided": true,
            }));
        }
        at
    }

    /// Adds bytes, which begin at a multiple of four.
    fn view(&mut self, bytes: &[u8], target: u32) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let offset = self.bytes.len();
        self.bytes.extend_from_slice(bytes);
        self.views.push(json!({
            "buffer": 0, "byteOffset": offset, "byteLength": bytes.len(), "target": target,
        }));
        self.views.len() - 1
    }

    /// Adds a mesh without normals, which readers then draw flat; `None` without triangles.
    fn mesh(&mut self, mesh: &Mesh, color: [f64; 4]) -> Option<usize> {
        // Numbers of the format: kinds of buffers, and types of their entries.
        const ARRAY: u32 = 34962;
        const ELEMENTS: u32 = 34963;
        const FLOAT: u32 = 5126;
        const UNSIGNED: u32 = 5125;
        if mesh.triangles.is_empty() {
            return None;
        }
        let points: Vec<u8> =
            mesh.vertices.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        let corners: Vec<u8> =
            mesh.triangles.iter().flatten().flat_map(|i| i.to_le_bytes()).collect();
        let ends = |pick: fn(f32, f32) -> f32| {
            let all = mesh.vertices.iter().copied();
            all.reduce(|a, b| std::array::from_fn(|i| pick(a[i], b[i]))).unwrap_or_default()
        };
        let (low, high) = (ends(f32::min), ends(f32::max));
        let points = self.view(&points, ARRAY);
        self.accessors.push(json!({
            "bufferView": points, "componentType": FLOAT, "count": mesh.vertices.len(),
            "type": "VEC3", "min": low, "max": high,
        }));
        let corners = self.view(&corners, ELEMENTS);
        self.accessors.push(json!({
            "bufferView": corners, "componentType": UNSIGNED, "type": "SCALAR",
            "count": 3 * mesh.triangles.len(),
        }));
        let n = self.accessors.len();
        let material = self.material(color);
        self.meshes.push(json!({ "primitives": [{
            "attributes": { "POSITION": n - 2 }, "indices": n - 1, "material": material,
        }] }));
        Some(self.meshes.len() - 1)
    }

    /// The file: head, JSON, bytes.
    fn finish(mut self) -> Result<Vec<u8>> {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let mut all = json!({
            "asset": { "version": "2.0", "generator": "stillpoint" },
            "scene": 0, "scenes": [{ "nodes": [0] }], "nodes": self.nodes,
        });
        let parts = [
            ("meshes", self.meshes),
            ("accessors", self.accessors),
            ("bufferViews", self.views),
            ("materials", self.materials),
        ];
        for (name, part) in parts.into_iter().filter(|(_, part)| !part.is_empty()) {
            all[name] = Value::Array(part);
        }
        if !self.bytes.is_empty() {
            all["buffers"] = json!([{ "byteLength": self.bytes.len() }]);
        }
        let mut text = all.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let has_bytes = !self.bytes.is_empty();
        let n = 12 + 8 + text.len() + if has_bytes { 8 + self.bytes.len() } else { 0 };
        let too_long = |_| Error::new(Kind::OverBudget, "a glTF file holds at most 4 GiB");
        let mut out = b"glTF\x02\0\0\0".to_vec();
        out.extend(u32::try_from(n).map_err(too_long)?.to_le_bytes());
        let mut chunk = |kind: &[u8; 4], bytes: &[u8]| {
            out.extend((bytes.len() as u32).to_le_bytes());
            out.extend(kind);
            out.extend(bytes);
        };
        chunk(b"JSON", &text);
        if has_bytes {
            chunk(b"BIN\0", &self.bytes);
        }
        Ok(out)
    }
}
