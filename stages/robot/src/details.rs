//! What a URDF says beyond geometry and kinematics: inertias, effort and velocity, friction, safety
//! limits, colours, and the elements of controllers and simulators. Nothing of it is used to find
//! robots; it is read again for scenes that are handed on.

use crate::extras::{self, UrdfExtra};
use crate::finding::Findings;
use crate::load::{read_sheet, urdf_in};
use crate::model::{JointKind, Model};
use crate::reading::{file_name, read_xml};
use crate::resolve::Roots;
use crate::settings::Settings;
use crate::urdf::{has_quaternions, turn};
use contract::{Error, Result, check_xml};
use geometry::{Pose, Vector};
use nalgebra::{Translation3, UnitQuaternion};
use roxmltree::{Document, Node};
use std::collections::BTreeMap;
use std::path::Path;

/// Mass and moments of a link.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inertial {
    /// Pose of the centre of mass and of the axes of the moments, in the link's frame.
    pub link_from_inertia: Pose,
    /// Mass, kg.
    pub mass: f64,
    /// Moments `xx, xy, xz, yy, yz, zz` about the centre of mass, kg m².
    pub moments: [f64; 6],
}

/// What a URDF says of a link.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LinkDetails {
    /// Mass and moments; `None` where the URDF gives none, or none that a body can have.
    pub inertial: Option<Inertial>,
    /// Red, green, blue and opacity from 0 to 1, of the first visual that has a colour.
    pub color: Option<[f64; 4]>,
    /// Name of the material of that visual.
    pub material: Option<String>,
}

/// Limits of URDF `<safety_controller>`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SafetyLimits {
    /// `k_position`, 1/s.
    pub k_position: f64,
    /// `k_velocity`, N·s/m or N·m·s/rad.
    pub k_velocity: f64,
    /// Lower soft limit, radians or metres.
    pub soft_lower: f64,
    /// Upper soft limit, radians or metres.
    pub soft_upper: f64,
}

/// What a URDF says of a joint.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct JointDetails {
    /// Largest torque or force, N·m or N; `None` where the URDF gives none or zero.
    pub effort: Option<f64>,
    /// Largest speed, rad/s or m/s; `None` where the URDF gives none or zero.
    pub velocity: Option<f64>,
    /// Damping, N·m·s/rad or N·s/m.
    pub damping: Option<f64>,
    /// Static friction, N·m or N.
    pub friction: Option<f64>,
    /// Soft limits.
    pub safety: Option<SafetyLimits>,
    /// Reference position at a rising edge, radians or metres.
    pub rising: Option<f64>,
    /// Reference position at a falling edge, radians or metres.
    pub falling: Option<f64>,
}

/// What a URDF says beyond geometry and kinematics, in the order of a model's links and joints.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ModelDetails {
    /// Of each link.
    pub links: Vec<LinkDetails>,
    /// Of each joint.
    pub joints: Vec<JointDetails>,
    /// Elements beside links and joints: `transmission`, `gazebo`, `ros2_control`.
    pub extras: Vec<UrdfExtra>,
}

impl ModelDetails {
    /// Details of a model about which nothing more is known.
    #[must_use]
    pub fn none(model: &Model) -> Self {
        Self {
            links: vec![LinkDetails::default(); model.links.len()],
            joints: vec![JointDetails::default(); model.joints.len()],
            extras: Vec::new(),
        }
    }

    /// Reads the URDF of the model in a folder, and those of its sub chains.
    ///
    /// # Errors
    /// If `robot.toml` or a URDF cannot be read.
    pub fn load(folder: &Path, model: &Model, settings: &Settings) -> Result<Self> {
        let mut findings = Findings::new(&file_name(folder));
        let roots = Roots::new(folder, folder.parent().filter(|p| !p.as_os_str().is_empty()))
            .map_err(|e| Error::from(e).at(folder.display()))?;
        let mut out = Self::none(model);
        let mut read = || {
            let sheet = read_sheet(folder, &roots, settings, &mut findings)?;
            let mut paths = vec![urdf_in(folder, &sheet, &roots, &mut findings)?];
            for written in sheet.sub_chain.iter().filter_map(|sub| sub.urdf.as_ref()) {
                let found = roots.find(written).map_err(|what| {
                    findings.fail("robot.toml: urdf", format!("{what} \"{written}\""), "");
                });
                paths.push(found.ok()?.path);
            }
            for path in paths {
                let name = file_name(&path);
                let text = read_xml(&path, settings.max_urdf_bytes, &name, &mut findings)?;
                let limits = settings.xml();
                let checked = check_xml(text.as_bytes(), &limits);
                checked.map_err(|what| findings.fail(&name, what, "repair the file")).ok()?;
                let document = Document::parse(&text);
                let document = document.map_err(|e| {
                    findings.fail(&name, format!("not well-formed XML ({e})"), "repair the file");
                });
                out.add(document.ok()?.root_element(), model);
            }
            Some(())
        };
        match read() {
            Some(()) => Ok(out),
            None => Err(findings.first_error()),
        }
    }

    /// Details of a model whose root is mounted on this one by a joint without details, as
    /// [`Model::with_tool`] orders links and joints.
    #[must_use]
    pub fn with_tool(&self, tool: &Self) -> Self {
        let mut out = self.clone();
        out.links.extend(tool.links.iter().cloned());
        out.joints.push(JointDetails::default());
        out.joints.extend(tool.joints.iter().cloned());
        // Tools may have names of their robot: elements know links and joints by number.
        let (links, joints) = (self.links.len(), self.joints.len() + 1);
        out.extras.extend(tool.extras.iter().map(|extra| extra.behind(links, joints)));
        out
    }

    /// Adds what one URDF says. What an earlier file has said of a link or joint stays.
    fn add(&mut self, root: Node, model: &Model) {
        let turns = has_quaternions(root);
        let colors: BTreeMap<&str, [f64; 4]> = children(root, "material")
            .filter_map(|m| Some((m.attribute("name")?, rgba(m)?)))
            .collect();
        for node in children(root, "link") {
            let name = node.attribute("name").map(str::trim);
            let at = model.links.iter().position(|l| Some(l.name.as_str()) == name);
            if let Some(own) = at.map(|l| &mut self.links[l]).filter(|own| **own == <_>::default())
            {
                *own = link(node, turns, &colors);
            }
        }
        for node in children(root, "joint") {
            let name = node.attribute("name").map(str::trim);
            let at = model.joints.iter().position(|j| Some(j.name.as_str()) == name);
            let moving = at.filter(|j| model.joints[*j].kind != JointKind::Fixed);
            if let Some(own) =
                moving.map(|j| &mut self.joints[j]).filter(|own| **own == <_>::default())
            {
                *own = joint(node);
            }
        }
        self.extras.extend(extras::of(root, model));
    }
}

fn children<'a, 'i: 'a>(node: Node<'a, 'i>, tag: &'a str) -> impl Iterator<Item = Node<'a, 'i>> {
    node.children().filter(move |n| n.tag_name().name() == tag)
}

fn child<'a, 'i: 'a>(node: Node<'a, 'i>, tag: &'a str) -> Option<Node<'a, 'i>> {
    children(node, tag).next()
}

/// `N` finite numbers of an attribute; `None` for anything else.
fn numbers<const N: usize>(node: Node, attribute: &str) -> Option<[f64; N]> {
    let words = node.attribute(attribute)?.split_whitespace();
    let all: Vec<f64> = words.map(str::parse).collect::<std::result::Result<_, _>>().ok()?;
    all.iter().all(|v| v.is_finite()).then_some(all)?.try_into().ok()
}

fn number(node: Node, attribute: &str) -> Option<f64> {
    numbers::<1>(node, attribute).map(|[v]| v)
}

fn rgba(material: Node) -> Option<[f64; 4]> {
    let color = numbers::<4>(child(material, "color")?, "rgba")?;
    Some(color.map(|v| v.clamp(0.0, 1.0)))
}

fn link(node: Node, turns: bool, colors: &BTreeMap<&str, [f64; 4]>) -> LinkDetails {
    let mut out = LinkDetails {
        inertial: child(node, "inertial").and_then(|n| inertial(n, turns)),
        ..LinkDetails::default()
    };
    for material in children(node, "visual").filter_map(|v| child(v, "material")) {
        let name = material.attribute("name").filter(|name| !name.is_empty());
        let color = rgba(material).or_else(|| colors.get(name?).copied());
        if color.is_some() {
            (out.color, out.material) = (color, name.map(String::from));
            break;
        }
    }
    out
}

fn inertial(node: Node, turns: bool) -> Option<Inertial> {
    let mass = number(child(node, "mass")?, "value").filter(|mass| *mass > 0.0)?;
    let tensor = child(node, "inertia")?;
    let mut moments = [0.0; 6];
    for (moment, name) in moments.iter_mut().zip(["ixx", "ixy", "ixz", "iyy", "iyz", "izz"]) {
        *moment = number(tensor, name).unwrap_or(0.0);
    }
    let [xx, xy, xz, yy, yz, zz] = moments;
    let matrix = nalgebra::Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
    let is_body = matrix.symmetric_eigenvalues().iter().all(|v| *v > 0.0);
    let place = child(node, "origin").map_or_else(Pose::identity, |n| pose(n, turns));
    is_body.then_some(Inertial { link_from_inertia: place, mass, moments })
}

/// The pose of an `<origin>`; what is missing or no number counts as zero.
fn pose(origin: Node, turns: bool) -> Pose {
    let xyz = numbers::<3>(origin, "xyz").unwrap_or_default();
    let quaternion = origin.attribute("quat_xyzw").filter(|_| turns).and_then(turn);
    let [r, p, y] = numbers::<3>(origin, "rpy").unwrap_or_default();
    let turned = quaternion.unwrap_or_else(|| UnitQuaternion::from_euler_angles(r, p, y));
    Pose::from_parts(Translation3::from(Vector::from(xyz)), turned)
}

fn joint(node: Node) -> JointDetails {
    let limit = child(node, "limit");
    let positive = |name| limit.and_then(|n| number(n, name)).filter(|v| *v > 0.0);
    let dynamics = child(node, "dynamics");
    let loss = |name| dynamics.and_then(|n| number(n, name)).filter(|v| *v >= 0.0);
    let calibration = child(node, "calibration");
    let edge = |name| calibration.and_then(|n| number(n, name));
    JointDetails {
        effort: positive("effort"),
        velocity: positive("velocity"),
        damping: loss("damping"),
        friction: loss("friction"),
        safety: child(node, "safety_controller").and_then(|n| {
            Some(SafetyLimits {
                k_position: number(n, "k_position").unwrap_or(0.0),
                k_velocity: number(n, "k_velocity")?,
                soft_lower: number(n, "soft_lower_limit").unwrap_or(0.0),
                soft_upper: number(n, "soft_upper_limit").unwrap_or(0.0),
            })
        }),
        rising: edge("rising"),
        falling: edge("falling"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const URDF: &str = r#"<robot name="arm" xmlns:x="http://x.org">
      <material name="red"><color rgba="1 0 0 1"/></material>
      <link name="base"><visual><geometry><box size="0.2 0.2 0.1"/></geometry>
        <material name="red"/></visual>
        <inertial><origin xyz="0 0 0.1"/><mass value="12.5"/>
          <inertia ixx="0.2" ixy="0.01" ixz="0" iyy="0.3" iyz="0" izz="0.4"/></inertial></link>
      <link name="arm"><visual><geometry><box size="0.1 0.1 1"/></geometry></visual>
        <inertial><mass value="1"/><inertia ixx="0" iyy="0" izz="0"/></inertial></link>
      <joint name="shoulder" type="revolute">
        <parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
        <limit lower="-2" upper="2" effort="150" velocity="1.5"/>
        <dynamics damping="0.7" friction="0.2"/>
        <safety_controller k_position="15" k_velocity="10" soft_lower_limit="-1.9"
          soft_upper_limit="1.9"/>
        <calibration rising="0.5"/>
      </joint>
      <transmission name="t"><joint name="shoulder"><i>a &amp; b</i></joint></transmission>
      <gazebo reference="arm"><x:mu1>0.2</x:mu1></gazebo>
    </robot>"#;

    #[test]
    fn everything_that_a_urdf_says_is_read() {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("robot.urdf"), URDF).expect("writes");
        let settings = Settings::without_clouds();
        let (model, _) = Model::load(folder.path(), &settings).expect("loads");
        let details = ModelDetails::load(folder.path(), &model, &settings).expect("loads");
        let base = &details.links[0];
        assert_eq!((base.color, base.material.as_deref()), (Some([1., 0., 0., 1.]), Some("red")));
        let inertial = base.inertial.expect("is stated");
        assert_eq!((inertial.mass, inertial.moments), (12.5, [0.2, 0.01, 0.0, 0.3, 0.0, 0.4]));
        assert_eq!(inertial.link_from_inertia, Pose::translation(0.0, 0.0, 0.1));
        assert_eq!(details.links[1], LinkDetails::default(), "no body has moments of zero");
        let joint = &details.joints[0];
        assert_eq!((joint.effort, joint.velocity), (Some(150.0), Some(1.5)));
        assert_eq!(
            (joint.damping, joint.friction, joint.rising),
            (Some(0.7), Some(0.2), Some(0.5))
        );
        assert_eq!(joint.safety.expect("is stated").soft_upper, 1.9);
        let link = |at: usize| model.links[at].name.as_str();
        let joint = |at: usize| model.joints[at].name.as_str();
        let text = |at: usize| details.extras[at].text(&link, &joint);
        assert_eq!(
            text(0),
            "<transmission name=\"t\"><joint name=\"shoulder\"><i>a &amp; b</i></joint></transmission>"
        );
        assert!(text(1).starts_with("<gazebo reference=\"arm\">"));
        assert!(text(1).contains("<x:mu1 xmlns:x=\"http://x.org\">0.2</x:mu1>"), "{}", text(1));
    }

    #[test]
    fn elements_of_a_tool_mean_its_own_links_and_joints() {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("robot.urdf"), URDF).expect("writes");
        let settings = Settings::without_clouds();
        let (model, _) = Model::load(folder.path(), &settings).expect("loads");
        let details = ModelDetails::load(folder.path(), &model, &settings).expect("loads");
        // The tool has the names of its robot.
        let dressed = model.with_tool(&model, 1, 0.0);
        let both = details.with_tool(&details);
        assert_eq!((both.links.len(), both.joints.len()), (4, 3));
        let link = |at: usize| ["base", "arm", "base_2", "arm_2"][at];
        let joint = |at: usize| dressed.joints[at].name.as_str();
        let text = |at: usize| both.extras[at].text(&link, &joint);
        assert!(text(0).contains("<joint name=\"shoulder\">"), "{}", text(0));
        assert!(text(1).contains("reference=\"arm\""), "{}", text(1));
        assert!(text(2).contains("/shoulder\">"), "{}", text(2));
        assert!(text(3).contains("reference=\"arm_2\""), "{}", text(3));
    }
}
