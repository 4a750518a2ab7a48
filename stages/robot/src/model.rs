//! The model of a robot: a tree of links and joints with meshes, free joints and closed loops.

use crate::closed_loop::ClosedLoop;
use geometry::{Aabb, Point, Pose, Vector};
use nalgebra::Unit;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Triangles of a link in the link's frame, metres, with all visuals of the link together.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Mesh {
    /// Vertices, metres.
    pub vertices: Vec<[f32; 3]>,
    /// Indices of three vertices each, counter-clockwise as seen from outside, if the file is
    /// right.
    pub triangles: Vec<[u32; 3]>,
}

/// Samples of the outer surface of a link, in the link's frame.
///
/// # Law
/// Any prefix is spread evenly over the surface, so that `points[..300]` is a coarse cloud of the
/// whole link.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct CadCloud {
    /// Positions of the samples, metres.
    #[serde(with = "geometry::raw_list")]
    pub points: Vec<[f32; 3]>,
    /// Outward unit normals.
    #[serde(with = "geometry::raw_list")]
    pub normals: Vec<[f32; 3]>,
    /// Mean distance between neighbouring samples, metres.
    pub spacing: f32,
    /// Area of the outer surface that the samples stand for, m².
    pub area: f32,
}

/// The part of a robot that a link belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Role {
    /// The main chain, whose joints set the posture.
    Main,
    /// A sub chain, which follows the main chain through a closed loop.
    Sub,
    /// The effector, that is the tool.
    Effector,
}

/// A rigid body of the robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Link {
    /// Name in the URDF.
    pub name: String,
    /// The part of the robot that it belongs to.
    pub role: Role,
    /// Index of the joint that carries it; `None` for the root.
    pub parent_joint: Option<usize>,
    /// Its surface; empty for a frame without a body. Copies of the model share the mesh and the
    /// samples.
    pub mesh: Arc<Mesh>,
    /// Samples of its outer surface; empty if the mesh is.
    pub cad: Arc<CadCloud>,
    /// Bounds of the mesh in the link's frame, metres.
    pub bounds: Aabb,
}

/// The type of a joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum JointKind {
    /// Rotates between limits, radians.
    Revolute,
    /// Rotates without limits, radians.
    Continuous,
    /// Translates between limits, metres.
    Prismatic,
    /// Does not move.
    Fixed,
}

/// What determines a joint's value.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Motion {
    /// The entry of the posture with this index.
    Free(usize),
    /// Another joint: the value is `multiplier · posture[free] + offset` (URDF `<mimic>`, with
    /// chains of mimics resolved).
    Mimic {
        /// Index of the entry of the posture that it follows.
        free: usize,
        /// Factor of that entry.
        multiplier: f64,
        /// Added to the product, in the joint's own unit.
        offset: f64,
    },
    /// The closed loop with this index.
    Loop(usize),
    /// Nothing; the joint is fixed.
    Fixed,
}

/// A joint of the tree.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Joint {
    /// Name in the URDF.
    pub name: String,
    /// Its type.
    pub kind: JointKind,
    /// Index of the link that carries it.
    pub parent: usize,
    /// Index of the link that it carries.
    pub child: usize,
    /// Pose of the joint in the parent link's frame at value zero (URDF `<origin>`), metres.
    pub parent_from_joint: Pose,
    /// Axis in the joint's frame, unit length.
    pub axis: Unit<Vector>,
    /// Lower and upper limit, radians or metres; `None` for continuous and fixed joints.
    pub limits: Option<[f64; 2]>,
    /// What determines its value.
    pub motion: Motion,
}

/// A rotation that maps a link's surface onto itself.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Symmetry {
    /// Index of the link.
    pub link: usize,
    /// Axis of the rotation in the link's frame, unit length.
    pub axis: Unit<Vector>,
    /// A point on the axis in the link's frame, metres.
    pub through: Point,
    /// The surface is unchanged by a rotation of 2π/order; 0 means by any rotation.
    pub order: u32,
}

/// A robot: links and joints in tree order (parents before children; `links[0]` is the root).
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Model {
    /// Name of its folder in the library.
    pub name: String,
    /// The links: bodies, and frames without a body.
    pub links: Vec<Link>,
    /// The joints; each link but the root is the child of exactly one.
    pub joints: Vec<Joint>,
    /// Indices of the free joints, in tree order; a posture has one value for each.
    pub free: Vec<usize>,
    /// The closed loops, in the order in which they are solved.
    pub loops: Vec<ClosedLoop>,
    /// Indices of the joints of the main chain, from the root to the tip.
    pub main_chain: Vec<usize>,
    /// Symmetries of links, from `robot.toml`.
    pub symmetries: Vec<Symmetry>,
    /// Standard deviation of a link's real surface from its mesh, metres: index of the link and
    /// value, where `robot.toml` gives one.
    pub mesh_sigmas: Vec<(usize, f64)>,
}

/// Poses and derivatives of all links at one posture.
#[derive(Debug, Clone, PartialEq)]
pub struct Kinematics {
    /// The pose `base_from_link` of each link; the base is the root link. Metres.
    pub base_from_link: Vec<Pose>,
    /// For each link and each free joint the twist `[v, w]` of the link in the base frame at unit
    /// rate of the joint: a point `p` (base frame) fixed to the link moves with `v + w × p`. The
    /// motion of mimic joints and closed loops is included.
    pub twists: Vec<Vec<[f64; 6]>>,
}
