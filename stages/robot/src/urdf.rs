//! Reads the links and joints of a URDF. The text is first reduced to what is used and checked,
//! since the URDF parser ignores words that are no numbers, stops at a second material, and
//! recurses as deep as the file is nested.

use crate::finding::Findings;
use contract::words::count;
use contract::{XmlLimits, check_xml};
use geometry::{Pose, Vector};
use nalgebra::{Quaternion, Translation3, UnitQuaternion};
use roxmltree::{Document, Node};
use std::fmt::Write as _;

/// Norm below which a quaternion is only rounding error and defines no orientation.
const SHORTEST_QUATERNION: f64 = 1e-6;

/// Links and joints of one file, not yet checked against one another.
#[derive(Debug, Default, Clone)]
pub(crate) struct UrdfDescription {
    pub(crate) links: Vec<RawLink>,
    pub(crate) joints: Vec<RawJoint>,
}

#[derive(Debug, Clone)]
pub(crate) struct RawLink {
    pub(crate) name: String,
    pub(crate) visuals: Vec<UrdfBody>,
    pub(crate) collisions: Vec<UrdfBody>,
}

#[derive(Debug, Clone)]
pub(crate) struct UrdfBody {
    pub(crate) link_from_body: Pose,
    pub(crate) shape: UrdfShape,
}

#[derive(Debug, Clone)]
pub(crate) enum UrdfShape {
    Box([f64; 3]),
    Cylinder { radius: f64, length: f64 },
    Capsule { radius: f64, length: f64 },
    Sphere(f64),
    Mesh { path: String, scale: [f64; 3] },
}

#[derive(Debug, Clone)]
pub(crate) struct RawJoint {
    pub(crate) name: String,
    pub(crate) kind: urdf_rs::JointType,
    pub(crate) parent: String,
    pub(crate) child: String,
    pub(crate) parent_from_joint: Pose,
    pub(crate) axis: [f64; 3],
    /// Lower and upper limit; `None` where the element is missing.
    pub(crate) limits: Option<[f64; 2]>,
    /// Name of the followed joint, multiplier, offset.
    pub(crate) mimic: Option<(String, f64, f64)>,
}

/// Reads a description; problems are added to `findings`.
pub(crate) fn read(
    text: &str,
    file: &str,
    limits: &XmlLimits,
    findings: &mut Findings,
) -> Option<UrdfDescription> {
    if let Err(what) = check_xml(text.as_bytes(), limits) {
        findings.fail(file, what, "repair the file");
        return None;
    }
    let document = match Document::parse(text) {
        Ok(document) => document,
        Err(error) => {
            findings.fail(file, format!("not well-formed XML ({error})"), "repair the file");
            return None;
        }
    };
    let root = document.root_element();
    if root.tag_name().name() != "robot" {
        let what =
            format!("a URDF opens with <robot>, this file with \"{}\"", root.tag_name().name());
        findings.fail(file, what, "give a URDF file");
        return None;
    }
    if is_xacro(root) {
        findings.fail(
            file,
            "this is xacro, not URDF",
            "expand it first: xacro in.xacro > robot.urdf",
        );
        return None;
    }
    let turns = has_quaternions(root);
    let clean = Cleaner { file, findings, turns, ends: line_ends(text) }.robot(root)?;
    match urdf_rs::read_from_string(&clean) {
        Ok(robot) => Some(describe(&robot, &document)),
        Err(error) => {
            findings.fail(file, format!("not a URDF ({error})"), "repair the file");
            None
        }
    }
}

fn is_xacro(root: Node) -> bool {
    let xacro = |uri: Option<&str>| uri.is_some_and(|u| u.contains("xacro"));
    root.descendants().any(|n| {
        xacro(n.tag_name().namespace())
            || (matches!(n.tag_name().name(), "link" | "joint")
                && n.attribute("name").is_some_and(|v| v.contains("${")))
    })
}

/// Whether `quat_xyzw` is supported: it is from URDF 1.1 on, and a file without a version is 1.0.
pub(crate) fn has_quaternions(root: Node) -> bool {
    let mut parts = root.attribute("version").unwrap_or("1.0").trim().split('.');
    let mut next = || parts.next().and_then(|p| p.parse::<u32>().ok()).unwrap_or(0);
    (next(), next()) >= (1, 1)
}

/// The unit quaternion of `quat_xyzw`; `None` where it is not four finite numbers of nonzero norm.
pub(crate) fn turn(quat_xyzw: &str) -> Option<UnitQuaternion<f64>> {
    let numbers: Vec<f64> =
        quat_xyzw.split_whitespace().map(str::parse).collect::<Result<_, _>>().ok()?;
    let [x, y, z, w] = numbers[..] else {
        return None;
    };
    UnitQuaternion::try_new(Quaternion::new(w, x, y, z), SHORTEST_QUATERNION)
}

/// Copies the part of a URDF that is used to a new text.
struct Cleaner<'a> {
    file: &'a str,
    findings: &'a mut Findings,
    /// Whether `quat_xyzw` is supported in this file.
    turns: bool,
    /// Byte offsets of the line ends: a file may have thousands of problems, and each message
    /// needs a line number.
    ends: Vec<usize>,
}

fn line_ends(text: &str) -> Vec<usize> {
    text.bytes().enumerate().filter(|(_, b)| *b == b'\n').map(|(at, _)| at).collect()
}

/// The number of values that an attribute must hold.
fn numbers_of(attribute: &str) -> Option<usize> {
    match attribute {
        "xyz" | "rpy" | "scale" | "size" => Some(3),
        "radius" | "length" | "lower" | "upper" | "multiplier" | "offset" => Some(1),
        _ => None,
    }
}

impl Cleaner<'_> {
    fn robot(&mut self, root: Node) -> Option<String> {
        let mut out = String::from("<robot name=\"robot\"");
        if let Some(version) = root.attribute("version") {
            attribute(&mut out, "version", version);
        }
        out.push('>');
        let mut right = true;
        for node in root.children().filter(Node::is_element) {
            match node.tag_name().name() {
                "link" => right &= self.link(node, &mut out),
                "joint" => right &= self.joint(node, &mut out),
                _ => {}
            }
        }
        out.push_str("</robot>");
        right.then_some(out)
    }

    fn place(&self, node: Node) -> String {
        let line = self.ends.partition_point(|end| *end < node.range().start) + 1;
        format!("{}:{line}: {}", self.file, node.tag_name().name())
    }

    fn link(&mut self, node: Node, out: &mut String) -> bool {
        let mut right = self.open(node, &["name"], &[], out, true);
        for body in
            node.children().filter(|n| matches!(n.tag_name().name(), "visual" | "collision"))
        {
            right &= self.body(body, out);
        }
        out.push_str("</link>");
        right
    }

    fn body(&mut self, node: Node, out: &mut String) -> bool {
        let tag = node.tag_name().name();
        let Some(geometry) = self.only(node, "geometry") else {
            self.findings.warn(
                self.place(node),
                "has no geometry and is ignored",
                "remove it or complete it",
            );
            return true;
        };
        let Some(shape) = geometry.children().find(Node::is_element) else {
            self.findings.warn(
                self.place(node),
                "has an empty geometry and is ignored",
                "remove it or complete it",
            );
            return true;
        };
        let (needs, may): (&[&str], &[&str]) = match shape.tag_name().name() {
            "mesh" => (&["filename"], &["scale"]),
            "box" => (&["size"], &[]),
            "cylinder" | "capsule" => (&["radius", "length"], &[]),
            "sphere" => (&["radius"], &[]),
            other => {
                let what = format!("a shape that is not known is ignored \"{other}\"");
                self.findings.warn(
                    self.place(node),
                    what,
                    "use mesh, box, cylinder, capsule or sphere",
                );
                return true;
            }
        };
        let _ = write!(out, "<{tag}>");
        let mut right = true;
        if let Some(origin) = self.only(node, "origin") {
            right &= self.origin(origin, out);
        }
        out.push_str("<geometry>");
        right &= self.open(shape, needs, may, out, false);
        let _ = write!(out, "</geometry></{tag}>");
        right
    }

    fn joint(&mut self, node: Node, out: &mut String) -> bool {
        let mut right = self.open(node, &["name", "type"], &[], out, true);
        let kind = node.attribute("type").unwrap_or_default();
        if !matches!(
            kind,
            "revolute" | "continuous" | "prismatic" | "fixed" | "floating" | "planar" | "spherical"
        ) {
            let what = format!("a joint type that is not known \"{kind}\"");
            self.findings.fail(
                self.place(node),
                what,
                "use revolute, continuous, prismatic or fixed",
            );
            right = false;
        }
        if let Some(origin) = self.only(node, "origin") {
            right &= self.origin(origin, out);
        }
        let parts: [(&str, &[&str], &[&str]); 5] = [
            ("parent", &["link"], &[]),
            ("child", &["link"], &[]),
            ("axis", &["xyz"], &[]),
            ("limit", &[], &["lower", "upper"]),
            ("mimic", &["joint"], &["multiplier", "offset"]),
        ];
        for (tag, needs, may) in parts {
            match self.only(node, tag) {
                // The axis of a fixed joint has no meaning, and some files contain invalid ones.
                Some(_) if kind == "fixed" && matches!(tag, "axis" | "limit" | "mimic") => {}
                Some(part) => right &= self.open(part, needs, may, out, false),
                None if matches!(tag, "parent" | "child") => {
                    self.findings.fail(
                        self.place(node),
                        format!("has no <{tag}>"),
                        "complete the joint",
                    );
                    right = false;
                }
                None => {}
            }
        }
        out.push_str("</joint>");
        right
    }

    /// Copies an origin; its quaternion is normalised, and left out where it is not supported.
    fn origin(&mut self, node: Node, out: &mut String) -> bool {
        let Some(written) = node.attribute("quat_xyzw") else {
            return self.open(node, &[], &["xyz", "rpy"], out, false);
        };
        let place = self.place(node);
        if !self.turns {
            let what = "quat_xyzw is supported from URDF version 1.1 on, and is ignored here";
            let way_out = "write rpy instead, or add version=\"1.1\" to <robot>";
            self.findings.warn(place, what, way_out);
            return self.open(node, &[], &["xyz", "rpy"], out, false);
        }
        if node.has_attribute("rpy") {
            let what = "has both rpy and quat_xyzw, which may contradict each other";
            self.findings.fail(place, what, "keep rpy");
            return false;
        }
        let Some(turn) = turn(written) else {
            let what = format!("quat_xyzw is no orientation \"{}\"", shortened(written));
            self.findings.fail(place, what, "write four finite numbers, not all zero: x y z w");
            return false;
        };
        let what = "quat_xyzw is applied here, but ignored by most other readers of URDF";
        self.findings.note(place, what, "write rpy, which all of them read");
        let right = node.attribute("xyz").is_none_or(|xyz| self.numbers(node, "xyz", xyz, 3));
        out.push_str("<origin");
        if let Some(xyz) = node.attribute("xyz") {
            attribute(out, "xyz", xyz);
        }
        let q = turn.coords;
        attribute(out, "quat_xyzw", &format!("{} {} {} {}", q.x, q.y, q.z, q.w));
        out.push_str("/>");
        right
    }

    /// The child element with that name; a second one is ignored with a warning.
    fn only<'n, 'i>(&mut self, node: Node<'n, 'i>, tag: &str) -> Option<Node<'n, 'i>> {
        let mut found = node.children().filter(|n| n.tag_name().name() == tag);
        let first = found.next();
        if found.next().is_some() {
            self.findings.warn(
                self.place(node),
                format!("has more than one <{tag}>; the first counts"),
                "keep one",
            );
        }
        first
    }

    /// Starts an element with the named attributes after checking their numbers.
    fn open(
        &mut self,
        node: Node,
        needs: &[&str],
        may: &[&str],
        out: &mut String,
        has_children: bool,
    ) -> bool {
        let mut right = true;
        let _ = write!(out, "<{}", node.tag_name().name());
        for &name in needs.iter().chain(may) {
            let Some(value) = node.attribute(name) else {
                if needs.contains(&name) {
                    let what = format!("has no attribute \"{name}\"");
                    self.findings.fail(self.place(node), what, "complete the element");
                    right = false;
                }
                continue;
            };
            if let Some(n) = numbers_of(name) {
                right &= self.numbers(node, name, value, n);
            }
            attribute(out, name, value);
        }
        if node.tag_name().name() == "limit" {
            // The parser requires a velocity, which is not used here.
            attribute(out, "velocity", "0");
        }
        out.push_str(if has_children { ">" } else { "/>" });
        right
    }

    fn numbers(&mut self, node: Node, name: &str, value: &str, n: usize) -> bool {
        let words = value.split_whitespace();
        let right = words.clone().count() == n
            && words.clone().all(|w| w.parse().is_ok_and(f64::is_finite));
        if !right {
            let what = format!(
                "{name} must be {} \"{}\"",
                count(n as u64, "finite number"),
                shortened(value)
            );
            self.findings.fail(self.place(node), what, "write numbers with spaces between them");
        }
        right
    }
}

fn shortened(value: &str) -> String {
    value.chars().take(60).collect()
}

fn attribute(out: &mut String, name: &str, value: &str) {
    let _ = write!(out, " {name}=\"");
    for c in value.trim().chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&apos;"),
            c => out.push(c),
        }
    }
    out.push('"');
}

fn pose(origin: &urdf_rs::Pose) -> Pose {
    let [r, p, y] = *origin.rpy;
    Pose::from_parts(
        Translation3::from(Vector::from(*origin.xyz)),
        UnitQuaternion::from_euler_angles(r, p, y),
    )
}

fn body(geometry: &urdf_rs::Geometry, origin: &urdf_rs::Pose) -> UrdfBody {
    use urdf_rs::Geometry as G;
    let shape = match geometry {
        G::Box { size } => UrdfShape::Box(**size),
        G::Cylinder { radius, length } => UrdfShape::Cylinder { radius: *radius, length: *length },
        G::Capsule { radius, length } => UrdfShape::Capsule { radius: *radius, length: *length },
        G::Sphere { radius } => UrdfShape::Sphere(*radius),
        G::Mesh { filename, scale } => {
            UrdfShape::Mesh { path: filename.clone(), scale: scale.map_or([1.0; 3], |s| *s) }
        }
    };
    UrdfBody { link_from_body: pose(origin), shape }
}

fn describe(robot: &urdf_rs::Robot, document: &Document) -> UrdfDescription {
    // The parser cannot tell a missing limit from a limit of zero.
    let limited: Vec<bool> = (document.root_element().children())
        .filter(|n| n.tag_name().name() == "joint")
        .map(|n| n.children().any(|c| c.tag_name().name() == "limit"))
        .collect();
    let links = (robot.links.iter())
        .map(|link| RawLink {
            name: link.name.clone(),
            visuals: link.visual.iter().map(|v| body(&v.geometry, &v.origin)).collect(),
            collisions: link.collision.iter().map(|c| body(&c.geometry, &c.origin)).collect(),
        })
        .collect();
    let joints = (robot.joints.iter().zip(limited))
        .map(|(joint, has_limits)| RawJoint {
            name: joint.name.clone(),
            kind: joint.joint_type.clone(),
            parent: joint.parent.link.clone(),
            child: joint.child.link.clone(),
            parent_from_joint: pose(&joint.origin),
            axis: *joint.axis.xyz,
            limits: has_limits.then_some([joint.limit.lower, joint.limit.upper]),
            mimic: (joint.mimic.as_ref())
                .map(|m| (m.joint.clone(), m.multiplier.unwrap_or(1.0), m.offset.unwrap_or(0.0))),
        })
        .collect();
    UrdfDescription { links, joints }
}
