//! Masses, torques and speeds that formats ask for: the library's, else an assumption that is
//! named.

use crate::plant_scene::PlantRobot;
use geometry::Pose;
use nalgebra::Translation3;
use robot::{Inertial, JointKind};

/// Density of a link's bounding box where its URDF states no mass, kg/m³: castings of robots with
/// motors fill about a tenth of their bounds with metal.
const ASSUMED_DENSITY: f64 = 500.0;
/// Mass of a frame without a body, kg: simulators refuse a moving body without mass.
const FRAME_MASS: f64 = 1e-3;
/// Smallest edge of a body whose moments are assumed, metres.
const SMALLEST_EDGE: f64 = 0.01;
/// Speed of joints whose URDF states none: 90°/s, that of the slow axes of large robots, rad/s.
const ASSUMED_SPEED: f64 = std::f64::consts::FRAC_PI_2;
/// Speed of slides whose URDF states none, m/s: that of linear axes under robots.
const ASSUMED_SLIDE: f64 = 1.0;
/// Torque or force of joints whose URDF states none, N·m or N: what no robot's joint exceeds by
/// much, so that planning is not limited by a number that nobody stated.
const ASSUMED_EFFORT: f64 = 1e4;

/// A number, and whether the library states it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Stated<T> {
    pub(crate) value: T,
    pub(crate) is_stated: bool,
}

fn stated<T>(own: Option<T>, assumed: impl FnOnce() -> T) -> Stated<T> {
    Stated { is_stated: own.is_some(), value: own.unwrap_or_else(assumed) }
}

impl PlantRobot {
    /// Mass and moments of a link.
    pub(crate) fn inertial(&self, link: usize) -> Stated<Inertial> {
        stated(self.details.links[link].inertial, || {
            let bounds = self.model.links[link].bounds;
            if bounds.is_empty() {
                return box_inertial(Pose::identity(), [SMALLEST_EDGE; 3], FRAME_MASS);
            }
            let center = Translation3::from(bounds.center().coords);
            let size = bounds.size().map(|edge| edge.max(SMALLEST_EDGE));
            let mass = ASSUMED_DENSITY * size.iter().product::<f64>();
            box_inertial(Pose::from_parts(center, Default::default()), size, mass)
        })
    }

    /// Largest torque or force of a joint, N·m or N.
    pub(crate) fn effort(&self, joint: usize) -> Stated<f64> {
        stated(self.details.joints[joint].effort, || ASSUMED_EFFORT)
    }

    /// Largest speed of a joint, rad/s or m/s.
    pub(crate) fn speed(&self, joint: usize) -> Stated<f64> {
        let slides = self.model.joints[joint].kind == JointKind::Prismatic;
        let assumed = if slides { ASSUMED_SLIDE } else { ASSUMED_SPEED };
        stated(self.details.joints[joint].velocity, || assumed)
    }

    /// Colour of a link: the library's, else grey.
    pub(crate) fn color(&self, link: usize) -> [f64; 4] {
        self.details.links[link].color.unwrap_or([0.75, 0.75, 0.78, 1.0])
    }

    /// What is assumed about the robot, in words; empty where its URDF states everything.
    pub(crate) fn assumptions(&self) -> Vec<String> {
        let joints = || (0..self.model.joints.len()).filter(|&j| self.moves(j));
        let with_body = |l: &usize| !self.model.links[*l].bounds.is_empty();
        let bodies: Vec<usize> = (0..self.model.links.len()).filter(with_body).collect();
        let n_mass = bodies.iter().filter(|l| !self.inertial(**l).is_stated).count();
        let n_speed = joints().filter(|&j| !self.speed(j).is_stated).count();
        let n_effort = joints().filter(|&j| !self.effort(j).is_stated).count();
        let mut out = Vec::new();
        let mut say = |n: usize, of: usize, what: &str, assumed: &str| {
            if n > 0 {
                let model = &self.model.name;
                out.push(format!(
                    "{}: the URDF of {model} states no {what} for {n} of {of}; {assumed}",
                    self.id
                ));
            }
        };
        let (n_links, n_joints) = (bodies.len(), joints().count());
        say(n_mass, n_links, "mass", "their bounding boxes at 500 kg/m³ are assumed");
        say(n_speed, n_joints, "velocity", "90°/s or 1 m/s is assumed");
        say(n_effort, n_joints, "effort", "10000 N·m or N is assumed");
        out
    }
}

/// Mass and moments of a homogeneous box.
fn box_inertial(link_from_inertia: Pose, size: [f64; 3], mass: f64) -> Inertial {
    let [x, y, z] = size.map(|edge| edge * edge * mass / 12.0);
    Inertial { link_from_inertia, mass, moments: [y + z, 0.0, 0.0, x + z, 0.0, x + y] }
}

/// Colour of what hangs on robots.
pub(crate) const HANGING: [f64; 4] = [0.9, 0.55, 0.1, 1.0];
/// Colour of what stands still and meets robots as found.
pub(crate) const TOUCHING: [f64; 4] = [0.75, 0.6, 0.45, 1.0];
/// Colour of what stands still.
pub(crate) const FIXED: [f64; 4] = [0.55, 0.58, 0.6, 1.0];
