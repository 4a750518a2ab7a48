//! Forward kinematics: the poses of all links at a posture, and their derivatives by the free
//! joints.

use crate::closed_loop::ClosedLoop;
use crate::model::{Joint, JointKind, Kinematics, Model, Motion};
use geometry::{Point, Pose, Vector};
use nalgebra::{Translation3, UnitQuaternion};
use std::f64::consts::PI;

/// A model with fewer free joints in its main chain is a gripper or a gun and no robot; the
/// smallest palletisers have four.
const MIN_ROBOT_JOINTS: usize = 3;

impl Joint {
    /// The pose `parent_from_child` of the links that the joint connects, at a value of the joint
    /// (radians or metres).
    #[must_use]
    pub fn parent_from_child(&self, value: f64) -> Pose {
        match self.kind {
            JointKind::Fixed => self.parent_from_joint,
            JointKind::Prismatic => {
                let shift = Translation3::from(self.axis.into_inner() * value);
                self.parent_from_joint * Pose::from_parts(shift, UnitQuaternion::identity())
            }
            JointKind::Revolute | JointKind::Continuous => {
                self.parent_from_joint * UnitQuaternion::from_axis_angle(&self.axis, value)
            }
        }
    }
}

/// A model with the values of its joints; those of passive joints may not be solved yet.
pub(crate) struct Placing<'a> {
    pub(crate) model: &'a Model,
    pub(crate) posture: Vec<f64>,
    pub(crate) values: Vec<f64>,
}

impl<'a> Placing<'a> {
    /// Sets free and mimic joints and leaves the loops open.
    pub(crate) fn open(model: &'a Model, posture: &[f64]) -> Self {
        let mut placing =
            Self { model, posture: posture.to_vec(), values: vec![0.0; model.joints.len()] };
        placing.set_followers();
        placing
    }

    fn set_followers(&mut self) {
        for (value, joint) in self.values.iter_mut().zip(&self.model.joints) {
            match joint.motion {
                Motion::Free(free) => *value = self.posture[free],
                Motion::Mimic { free, multiplier, offset } => {
                    *value = multiplier * self.posture[free] + offset
                }
                Motion::Loop(_) | Motion::Fixed => {}
            }
        }
    }

    /// Sets all joints; loops are closed as far as possible.
    pub(crate) fn closed(model: &'a Model, posture: &[f64]) -> Self {
        let mut placing = Self::open(model, posture);
        for closed_loop in &model.loops {
            closed_loop.solve(&mut placing);
        }
        placing
    }

    /// Changes to another posture and solves all loops that come before `until`.
    pub(crate) fn move_to(&mut self, posture: Vec<f64>, until: &ClosedLoop) {
        self.posture = posture;
        self.set_followers();
        for closed_loop in self.model.loops.iter().take_while(|l| !std::ptr::eq(*l, until)) {
            closed_loop.solve(self);
        }
    }

    /// The pose `base_from_link` of a link.
    fn pose(&self, link: usize) -> Pose {
        let mut pose = Pose::identity();
        let mut at = link;
        while let Some(j) = self.model.links[at].parent_joint {
            let joint = &self.model.joints[j];
            pose = joint.parent_from_child(self.values[j]) * pose;
            at = joint.parent;
        }
        pose
    }

    /// Converts a point from a link's frame to the base frame.
    pub(crate) fn point(&self, link: usize, point: &Point) -> Point {
        self.pose(link) * point
    }

    /// Origin and direction of a joint's axis in the base frame.
    pub(crate) fn axis(&self, joint: usize) -> (Point, Vector) {
        let j = &self.model.joints[joint];
        let base_from_joint = self.pose(j.parent) * j.parent_from_joint;
        (base_from_joint.translation.vector.into(), base_from_joint * j.axis.into_inner())
    }

    /// The link that carries a joint, and the joint's origin in the frame of that link.
    pub(crate) fn carrier(&self, joint: usize) -> (usize, Point) {
        let j = &self.model.joints[joint];
        (j.parent, j.parent_from_joint.translation.vector.into())
    }

    pub(crate) fn turns(&self, joint: usize) -> bool {
        matches!(self.model.joints[joint].kind, JointKind::Revolute | JointKind::Continuous)
    }

    /// Velocity of the point `p` (base frame) of a link at unit rate of one joint.
    pub(crate) fn moves(&self, joint: usize, link: usize, p: &Point) -> Vector {
        if !self.model.hangs_on(link, joint) {
            return Vector::zeros();
        }
        let (origin, axis) = self.axis(joint);
        match self.model.joints[joint].kind {
            JointKind::Fixed => Vector::zeros(),
            JointKind::Prismatic => axis,
            JointKind::Revolute | JointKind::Continuous => axis.cross(&(p - origin)),
        }
    }

    /// Velocity of the point `p` (base frame) of a link at these rates of all joints.
    pub(crate) fn velocity(&self, link: usize, p: &Point, rates: &[f64]) -> Vector {
        let mut velocity = Vector::zeros();
        let mut at = link;
        while let Some(j) = self.model.links[at].parent_joint {
            if rates[j] != 0.0 {
                velocity += self.moves(j, link, p) * rates[j];
            }
            at = self.model.joints[j].parent;
        }
        velocity
    }

    fn poses(&self) -> Vec<Pose> {
        let mut poses: Vec<Pose> = Vec::with_capacity(self.model.links.len());
        for link in &self.model.links {
            poses.push(match link.parent_joint {
                Some(j) => {
                    let joint = &self.model.joints[j];
                    poses[joint.parent] * joint.parent_from_child(self.values[j])
                }
                None => Pose::identity(),
            });
        }
        poses
    }

    /// The rate of each joint at unit rate of one free joint.
    fn rates(&self, free: usize) -> Vec<f64> {
        let mut rates: Vec<f64> = (self.model.joints.iter())
            .map(|joint| match joint.motion {
                Motion::Free(f) if f == free => 1.0,
                Motion::Mimic { free: f, multiplier, .. } if f == free => multiplier,
                _ => 0.0,
            })
            .collect();
        for closed_loop in &self.model.loops {
            let passive = closed_loop.rates(self, &rates);
            for (&joint, rate) in closed_loop.passive.iter().zip(passive) {
                rates[joint] = rate;
            }
        }
        rates
    }
}

impl Model {
    /// Upper bound of the distance of any part of the robot from the base's origin, metres: the sum
    /// of the distances from joint to joint along the longest chain, plus the size of the last
    /// link.
    #[must_use]
    pub fn reach(&self) -> f64 {
        let mut longest = 0.0_f64;
        for (link, way) in self.links.iter().zip(self.ways()) {
            let size =
                link.cad.points.iter().take(500).map(|p| f64::from(p[0].hypot(p[1]).hypot(p[2])));
            longest = longest.max(way + size.fold(0.0, f64::max));
        }
        longest
    }

    /// For each link the largest distance that its origin can have from the base's, metres: the sum
    /// of the distances from joint to joint, with the strokes of prismatic joints.
    #[must_use]
    pub fn ways(&self) -> Vec<f64> {
        let mut ways = vec![0.0_f64; self.links.len()];
        for (l, link) in self.links.iter().enumerate() {
            if let Some(j) = link.parent_joint {
                let joint = &self.joints[j];
                let stroke = match (joint.kind, joint.limits) {
                    (JointKind::Prismatic, Some(limits)) => limits[0].abs().max(limits[1].abs()),
                    _ => 0.0,
                };
                ways[l] =
                    ways[joint.parent] + joint.parent_from_joint.translation.vector.norm() + stroke;
            }
        }
        ways
    }

    /// For each link, whether a joint that moves lies between it and the base.
    #[must_use]
    pub fn moving(&self) -> Vec<bool> {
        let mut moving = vec![false; self.links.len()];
        for joint in &self.joints {
            let turns = joint.kind != JointKind::Fixed && joint.motion != Motion::Fixed;
            moving[joint.child] = moving[joint.parent] || turns;
        }
        moving
    }

    /// Number of free joints, which is the length of a posture.
    #[must_use]
    pub fn n_free(&self) -> usize {
        self.free.len()
    }

    /// The pose `base_from_link` of each link at a posture (radians or metres a free joint).
    ///
    /// # Panics
    /// If the length of `posture` is not the number of free joints.
    #[must_use]
    pub fn poses(&self, posture: &[f64]) -> Vec<Pose> {
        assert_eq!(posture.len(), self.free.len(), "a posture has one value for each free joint");
        Placing::closed(self, posture).poses()
    }

    /// Poses and twists of all links at a posture (radians or metres a free joint).
    ///
    /// # Panics
    /// If the length of `posture` is not the number of free joints.
    #[must_use]
    pub fn kinematics(&self, posture: &[f64]) -> Kinematics {
        assert_eq!(posture.len(), self.free.len(), "a posture has one value for each free joint");
        let placing = Placing::closed(self, posture);
        let base_from_link = placing.poses();
        let rates: Vec<Vec<f64>> = (0..self.free.len()).map(|free| placing.rates(free)).collect();
        let mut twists: Vec<Vec<[f64; 6]>> = Vec::with_capacity(self.links.len());
        for link in &self.links {
            let Some(j) = link.parent_joint else {
                twists.push(vec![[0.0; 6]; self.free.len()]);
                continue;
            };
            let joint = &self.joints[j];
            let mut row = twists[joint.parent].clone();
            let base_from_joint = base_from_link[joint.parent] * joint.parent_from_joint;
            let unit = unit_twist(joint, &base_from_joint);
            for (twist, rates) in row.iter_mut().zip(&rates) {
                for (t, u) in twist.iter_mut().zip(unit) {
                    *t += u * rates[j];
                }
            }
            twists.push(row);
        }
        Kinematics { base_from_link, twists }
    }

    /// Value of each joint at a posture, in the order of `joints`, radians or metres; zero for
    /// fixed joints.
    #[must_use]
    pub fn joint_values(&self, posture: &[f64]) -> Vec<f64> {
        Placing::closed(self, posture).values
    }

    /// The largest gap that the closed loops have at a posture, metres; zero for a robot without
    /// loops.
    #[must_use]
    pub fn loop_gap(&self, posture: &[f64]) -> f64 {
        let placing = Placing::closed(self, posture);
        self.loops.iter().map(|l| l.gap(&placing)).fold(0.0, f64::max)
    }

    /// The home posture: zero for each free joint, clamped to its limits.
    #[must_use]
    pub fn home(&self) -> Vec<f64> {
        (0..self.free.len())
            .map(|free| self.limits(free))
            .map(|[lower, upper]| 0.0_f64.clamp(lower, upper))
            .collect()
    }

    /// Lower and upper limit of a free joint, radians or metres; ±π for continuous joints.
    #[must_use]
    pub fn limits(&self, free: usize) -> [f64; 2] {
        self.joints[self.free[free]].limits.unwrap_or([-PI, PI])
    }

    /// Whether the model is a gripper or a gun: it has fewer than three free joints in its main
    /// chain.
    #[must_use]
    pub fn is_tool(&self) -> bool {
        let free = |j: &&usize| matches!(self.joints[**j].motion, Motion::Free(_));
        self.main_chain.iter().filter(free).count() < MIN_ROBOT_JOINTS
    }

    /// Index of the link with this name.
    #[must_use]
    pub fn link(&self, name: &str) -> Option<usize> {
        self.links.iter().position(|l| l.name == name)
    }

    /// Whether a joint lies between the root and a link.
    #[must_use]
    pub fn hangs_on(&self, link: usize, joint: usize) -> bool {
        let mut at = link;
        while let Some(j) = self.links[at].parent_joint {
            if j == joint {
                return true;
            }
            at = self.joints[j].parent;
        }
        false
    }
}

/// Twist `[v, w]` of a joint's child in the base frame at unit rate.
fn unit_twist(joint: &Joint, base_from_joint: &Pose) -> [f64; 6] {
    let axis = base_from_joint * joint.axis.into_inner();
    match joint.kind {
        JointKind::Fixed => [0.0; 6],
        JointKind::Prismatic => [axis.x, axis.y, axis.z, 0.0, 0.0, 0.0],
        JointKind::Revolute | JointKind::Continuous => {
            let v = base_from_joint.translation.vector.cross(&axis);
            [v.x, v.y, v.z, axis.x, axis.y, axis.z]
        }
    }
}
