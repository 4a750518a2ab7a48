//! What writers make: files with their content, and notes about what was assumed.

use crate::joint_rules::{JointRule, JointRules};
use crate::names::{NameMap, NameRule, Named};
use crate::physics::{FIXED, HANGING, TOUCHING};
use crate::plant_scene::{PlantRobot, PlantScene};
use contract::quote;
use robot::Motion;
use std::fmt::Write as _;

/// Distance from the origin beyond which single precision is named, metres: it is a tenth of a
/// millimetre there.
const FAR: f64 = 1e3;

/// A file of a scene.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SceneFile {
    /// Path below the folder of the scene, with `/`.
    pub path: String,
    /// Its content.
    pub bytes: Vec<u8>,
}

/// A scene in one format.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct SceneFiles {
    /// The files; the one to open comes first.
    pub files: Vec<SceneFile>,
    /// What was assumed or left out, in words.
    pub notes: Vec<String>,
}

impl SceneFiles {
    pub(crate) fn add(&mut self, path: impl Into<String>, bytes: Vec<u8>) {
        self.files.push(SceneFile { path: path.into(), bytes });
    }

    /// Adds the meshes of a robot to `folder`, in metres.
    pub(crate) fn add_meshes(&mut self, folder: &str, robot: &PlantRobot) {
        for link in 0..robot.model.links.len() {
            for body in robot.bodies(link) {
                self.add(format!("{folder}/{}.stl", body.name), body.mesh.to_stl());
            }
        }
    }

    /// Adds what is to be said of a robot in any format.
    pub(crate) fn note_robot(&mut self, robot: &PlantRobot, rules: &JointRules) {
        self.notes.extend(robot.assumptions());
        if !rules.widened.is_empty() {
            let name = |j: &usize| quote::shown(&robot.model.joints[*j].name).into_owned();
            self.notes.push(format!(
                "{}: {} follow others and stand outside of the limits that the library states for \
                 them; they are written with what the others let them reach",
                robot.id,
                rules.widened.iter().map(name).collect::<Vec<_>>().join(", ")
            ));
        }
        let far = robot.world_from_base.translation.vector.norm();
        if far > FAR {
            self.notes.push(format!(
                "{} stands {:.0} km from the origin: readers in single precision (frames of joints in \
                 USD, glTF, PyBullet) place it up to {:.0} mm off; a frame near the robots avoids it",
                robot.id,
                far / 1e3,
                far * f64::from(f32::EPSILON) * 1e3
            ));
        }
        if rules.n_open > 0 {
            self.notes.push(format!(
                "{}: pins of its loops that do not meet in most postures were left out: {}",
                robot.id, rules.n_open
            ));
        }
    }
}

/// A robot as all writers need it.
pub(crate) struct RobotToWrite<'a> {
    pub(crate) robot: &'a PlantRobot,
    /// Its number in the scene.
    pub(crate) at: usize,
    pub(crate) rules: JointRules,
    /// Value of each joint of the model.
    pub(crate) values: Vec<f64>,
}

impl<'a> RobotToWrite<'a> {
    /// The robots of a scene.
    pub(crate) fn all(scene: &'a PlantScene) -> Vec<Self> {
        (scene.robots.iter().enumerate())
            .map(|(at, robot)| Self {
                robot,
                at,
                rules: JointRules::of(robot),
                values: robot.values(),
            })
            .collect()
    }

    /// Whether a joint is moved by the pins of its loop where a format has them.
    pub(crate) fn is_held_by_pins(&self, joint: usize) -> bool {
        let is_in_loop = matches!(self.robot.model.joints[joint].motion, Motion::Loop(_));
        is_in_loop && self.rules.n_open == 0
    }

    /// Indices of the joints that are written as moving ones.
    pub(crate) fn moving(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.values.len()).filter(|j| self.rules.rules[*j] != JointRule::Fixed)
    }

    /// Names of the robot, its links and its joints, unique within the robot.
    pub(crate) fn names_within(&self, names: &mut NameMap) {
        let scope = self.robot.id.clone();
        self.name_parts(names, &scope, "");
    }

    /// Adds names of links and joints, each behind `before`.
    pub(crate) fn name_parts(&self, names: &mut NameMap, scope: &str, before: &str) {
        let model = &self.robot.model;
        names.add(Named::Robot, self.at, 0, "", &self.robot.id);
        for (l, link) in model.links.iter().enumerate() {
            names.add(Named::Link, self.at, l, scope, &format!("{before}{}", link.name));
        }
        for (j, joint) in model.joints.iter().enumerate() {
            names.add(Named::Joint, self.at, j, scope, &format!("{before}{}", joint.name));
        }
    }
}

/// The table of names: what the library calls each link and joint, and what the format does.
pub(crate) fn names_table(robots: &[RobotToWrite<'_>], names: &NameMap) -> Vec<u8> {
    let mut text = String::from("robot,kind,name,written\n");
    let mut row = |robot: &str, kind: &str, name: &str, written: &str| {
        let [robot, name, written] = [robot, name, written].map(quote::csv);
        let _ = writeln!(text, "{robot},{kind},{name},{written}");
    };
    for own in robots {
        let model = &own.robot.model;
        let id = &own.robot.id;
        row(id, "robot", id, names.robot(own.at));
        for (l, link) in model.links.iter().enumerate() {
            row(id, "link", &link.name, names.link(own.at, l));
        }
        for (j, joint) in model.joints.iter().enumerate() {
            row(id, "joint", &joint.name, names.joint(own.at, j));
        }
    }
    text.into_bytes()
}

/// A map of names that are unique within each robot.
pub(crate) fn names_by_robot(robots: &[RobotToWrite<'_>], rule: NameRule) -> NameMap {
    let mut names = NameMap::new(rule);
    for own in robots {
        names.reserve(Named::Link, &own.robot.id, "world");
        own.names_within(&mut names);
    }
    names
}

/// The colour of a body of a link.
pub(crate) fn body_color(robot: &PlantRobot, link: usize, hangs: bool) -> [f64; 4] {
    if hangs { HANGING } else { robot.color(link) }
}

/// A colour as renderers calculate with it: URDFs state it as screens show it (sRGB), USD and glTF
/// in proportion to light.
pub(crate) fn linear([r, g, b, opacity]: [f64; 4]) -> [f64; 4] {
    let one = |v: f64| {
        let light = if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) };
        (light * 1e6).round() / 1e6
    };
    [one(r), one(g), one(b), opacity]
}

/// The colour of what stands still; of what meets robots as found another one.
pub(crate) fn fixed_color(links: &[[usize; 2]]) -> [f64; 4] {
    if links.is_empty() { FIXED } else { TOUCHING }
}
