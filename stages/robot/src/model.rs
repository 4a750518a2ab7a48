//! The model of a robot: a tree of links and joints with their meshes, and which joints are free.

use crate::closed_loop::ClosedLoop;
use geometry::{Aabb, Point, Pose, Vector};
use nalgebra::Unit;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Triangles of a link in the link's frame, metres; all visuals of the link together.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Mesh {
    /// Corners.
    pub vertices: Vec<[f32; 3]>,
    /// Indices of corners, counter-clockwise from outside where the file is right about it.
    pub triangles: Vec<[u32; 3]>,
}

/// Samples on the outer surface of a link, in the link's frame.
///
/// # Law
/// Any prefix is spread evenly over the surface, so that `points[..300]` is the coarse cloud and
/// all of it the fine.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct CadCloud {
    /// Positions, metres.
    pub points: Vec<[f32; 3]>,
    /// Unit normals, outward.
    pub normals: Vec<[f32; 3]>,
    /// Mean distance between neighbouring samples, metres.
    pub spacing: f32,
    /// Outer surface that the samples stand for, m².
    pub area: f32,
}

/// What a link is part of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Role {
    /// Sets the posture.
    Main,
    /// Follows the main chain through a closed loop.
    Sub,
    /// Belongs to the tool.
    Effector,
}

/// A rigid body of the robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Link {
    /// As in the URDF.
    pub name: String,
    /// What it is part of.
    pub role: Role,
    /// The joint that carries it; `None` for the root.
    pub parent_joint: Option<usize>,
    /// Its surface; empty for frames without a body. Shared by copies of the model, as are its
    /// samples.
    pub mesh: Arc<Mesh>,
    /// Samples of its outer surface; empty where the mesh is.
    pub cad: Arc<CadCloud>,
    /// Bounds of the mesh in the link's frame, metres.
    pub bounds: Aabb,
}

/// How a joint moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum JointKind {
    /// Turns between limits, radians.
    Revolute,
    /// Turns without limits, radians.
    Continuous,
    /// Slides, metres.
    Prismatic,
    /// Does not move.
    Fixed,
}

/// What sets a joint's value.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Motion {
    /// Its own entry in the posture.
    Free(usize),
    /// `multiplier · posture[free] + offset` (URDF `<mimic>`; chains of mimics are already
    /// resolved).
    Mimic {
        /// Entry in the posture that it follows.
        free: usize,
        /// Factor.
        multiplier: f64,
        /// Added, in the joint's own unit.
        offset: f64,
    },
    /// The closed loop with this index.
    Loop(usize),
    /// Nothing.
    Fixed,
}

/// A joint of the tree.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Joint {
    /// As in the URDF.
    pub name: String,
    /// How it moves.
    pub kind: JointKind,
    /// Index of the link that carries it.
    pub parent: usize,
    /// Index of the link that it carries.
    pub child: usize,
    /// URDF `<origin>`.
    pub parent_from_joint: Pose,
    /// Axis in the joint's frame.
    pub axis: Unit<Vector>,
    /// Lower and upper limit, radians or metres; `None` for continuous and fixed joints.
    pub limits: Option<[f64; 2]>,
    /// What sets its value.
    pub motion: Motion,
}

/// A turn that leaves a link's surface as it is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Symmetry {
    /// Index of the link.
    pub link: usize,
    /// Axis of the turn, link frame.
    pub axis: Unit<Vector>,
    /// A point on the axis, link frame, metres.
    pub through: Point,
    /// Unchanged by a turn of 2π/order; 0: by any turn.
    pub order: u32,
}

/// A robot: links and joints in tree order (parents before children, `links[0]` is the root).
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Model {
    /// Name of its folder in the library.
    pub name: String,
    /// Bodies and frames.
    pub links: Vec<Link>,
    /// Joints; `joints[i].child` is carried by it and by no other.
    pub joints: Vec<Joint>,
    /// Indices of the free joints, in tree order: the posture has one value for each.
    pub free: Vec<usize>,
    /// Closed loops, in the order in which they are solved.
    pub loops: Vec<ClosedLoop>,
    /// Joints of the main chain, from the root to its tip.
    pub main_chain: Vec<usize>,
    /// Symmetries that `robot.toml` names.
    pub symmetries: Vec<Symmetry>,
    /// How far each link's mesh may be from the real surface, metres: index of the link and value,
    /// where `robot.toml` says so.
    pub mesh_sigmas: Vec<(usize, f64)>,
}

/// Where everything is at one posture.
#[derive(Debug, Clone, PartialEq)]
pub struct Kinematics {
    /// Pose of each link, base (root link) from link.
    pub base_from_link: Vec<Pose>,
    /// For each link, for each free joint: the twist of the link in the base frame for a unit rate
    /// of that joint: `[v, w]`, so that a point `p` (base frame, fixed to the link) moves with
    /// `v + w × p`. Exact: mimic and loop joints on the way are in it.
    pub twists: Vec<Vec<[f64; 6]>>,
}
