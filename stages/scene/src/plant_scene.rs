//! The scene of a plant: robots as they were found, and what stands still around them.

use geometry::{Pose, Vector};
use robot::{Joint, JointKind, Mesh, Model, ModelDetails};
use std::collections::BTreeMap;

/// Thickness of the floor where it is written as a box, metres: it lies below the floor's surface.
pub(crate) const FLOOR_DEPTH: f64 = 0.1;

/// A plant or a cell: everything that a planner or simulator is given. Metres, radians, z up.
#[derive(Debug, Clone, Default)]
pub struct PlantScene {
    /// Name of the scene.
    pub name: String,
    /// The robots.
    pub robots: Vec<PlantRobot>,
    /// Boxes that together cover what stands still, but for what meets a robot as found.
    pub fixed: Vec<FixedBox>,
    /// What stands still and meets links of robots as found: contacts of these pairs mean nothing.
    pub touching: Vec<TouchingBoxes>,
    /// The floor, if one was found.
    pub floor: Option<FloorPatch>,
}

/// A box along the axes of the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FixedBox {
    /// Its middle, metres.
    pub center: [f64; 3],
    /// Its edges, metres.
    pub size: [f64; 3],
}

/// Boxes that meet the hulls of the same links as found.
#[derive(Debug, Clone, PartialEq)]
pub struct TouchingBoxes {
    /// The boxes.
    pub boxes: Vec<FixedBox>,
    /// Robots and links by their numbers.
    pub links: Vec<[usize; 2]>,
}

/// A rectangle of the floor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FloorPatch {
    /// Pose of its middle; z is the floor's normal.
    pub world_from_floor: Pose,
    /// Length along its x and y, metres.
    pub size: [f64; 2],
}

/// A robot in its found place and posture.
#[derive(Debug, Clone)]
pub struct PlantRobot {
    /// Identifier in the result: `R1`, `R2` …
    pub id: String,
    /// Its model, with its tool.
    pub model: Model,
    /// What its URDF says beyond geometry and kinematics.
    pub details: ModelDetails,
    /// Pose of its root link.
    pub world_from_base: Pose,
    /// Value of each free joint, radians or metres.
    pub posture: Vec<f64>,
    /// Convex pieces of what hangs on each link, by index of the link, in its frame.
    pub hanging: BTreeMap<usize, Vec<Mesh>>,
}

/// A mesh of a link, in the link's frame.
pub(crate) struct LinkBody<'a> {
    /// Name of its file, without folder and extension.
    pub(crate) name: String,
    pub(crate) mesh: &'a Mesh,
    /// Whether it hangs on the link, and is no part of its model.
    pub(crate) hangs: bool,
}

impl PlantRobot {
    /// Value of each joint of the model, radians or metres; zero for fixed joints.
    #[must_use]
    pub fn values(&self) -> Vec<f64> {
        self.model.joint_values(&self.posture)
    }

    /// Pose of each link in the world.
    #[must_use]
    pub fn world_from_links(&self) -> Vec<Pose> {
        let poses = self.model.poses(&self.posture);
        poses.iter().map(|base_from_link| self.world_from_base * base_from_link).collect()
    }

    /// The meshes of a link: its own, then what hangs on it.
    pub(crate) fn bodies(&self, link: usize) -> Vec<LinkBody<'_>> {
        let own = &self.model.links[link];
        let name = format!("{link:02}_{}", contract::quote::file_name(&own.name));
        let mut out = Vec::new();
        if !own.mesh.triangles.is_empty() {
            out.push(LinkBody { name: name.clone(), mesh: &own.mesh, hangs: false });
        }
        let pieces = self.hanging.get(&link).into_iter().flatten().enumerate();
        out.extend(pieces.map(|(k, mesh)| LinkBody {
            name: format!("{name}_hanging_{k}"),
            mesh,
            hangs: true,
        }));
        out
    }

    /// Upper bound of the distance of any part of the robot from its base's origin, metres.
    pub(crate) fn reach(&self) -> f64 {
        let ways = self.model.ways();
        let one = |(link, way): (usize, &f64)| {
            let bodies = self.bodies(link);
            way + bodies.iter().map(|body| size(body.mesh)).fold(0.0, f64::max)
        };
        ways.iter().enumerate().map(one).fold(0.0, f64::max)
    }

    /// Whether a joint moves: neither fixed, nor with equal limits.
    pub(crate) fn moves(&self, joint: usize) -> bool {
        let joint = &self.model.joints[joint];
        joint.kind != JointKind::Fixed && joint.limits.is_none_or(|[low, high]| low < high)
    }

    /// Name of a link of the model.
    pub(crate) fn link_name(&self, link: usize) -> &str {
        &self.model.links[link].name
    }
}

/// Largest distance of a vertex from the origin of the mesh, metres.
pub(crate) fn size(mesh: &Mesh) -> f64 {
    let of = |v: &[f32; 3]| Vector::from(v.map(f64::from)).norm();
    mesh.vertices.iter().map(of).fold(0.0, f64::max)
}

/// Whether values of the joint are metres.
pub(crate) fn slides(joint: &Joint) -> bool {
    joint.kind == JointKind::Prismatic
}

/// A part of what stands still.
pub(crate) struct FixedGroup<'a> {
    pub(crate) name: String,
    pub(crate) boxes: &'a [FixedBox],
    /// Robots and links that it meets as found, by their numbers.
    pub(crate) links: &'a [[usize; 2]],
}

impl PlantScene {
    /// What stands still: what meets no robot as found, then each group that does.
    pub(crate) fn fixed_groups(&self) -> Vec<FixedGroup<'_>> {
        let rest = FixedGroup { name: "fixed".into(), boxes: &self.fixed, links: &[] };
        let touching = self.touching.iter().enumerate().map(|(k, own)| FixedGroup {
            name: format!("touching_{k}"),
            boxes: &own.boxes,
            links: &own.links,
        });
        let rest = (!self.fixed.is_empty()).then_some(rest);
        rest.into_iter().chain(touching).collect()
    }
}

/// The meshes of all boxes as one, about a point of the world: coordinates of a plant far from its
/// origin do not fit into single precision.
pub(crate) fn box_mesh(boxes: &[FixedBox], about: &Vector) -> Mesh {
    /// Corners of the two triangles of each side; bits of a corner are the ends along x, y, z.
    const SIDES: [[u32; 3]; 12] = [
        [0, 2, 1],
        [1, 2, 3],
        [4, 5, 6],
        [5, 7, 6],
        [0, 1, 4],
        [1, 5, 4],
        [2, 6, 3],
        [3, 6, 7],
        [0, 4, 2],
        [2, 4, 6],
        [1, 3, 5],
        [3, 7, 5],
    ];
    let mut mesh = Mesh::default();
    for own in boxes {
        let first = mesh.vertices.len() as u32;
        for corner in 0..8_u32 {
            mesh.vertices.push(std::array::from_fn(|i| {
                let side = f64::from(corner >> i & 1) - 0.5;
                (own.center[i] - about[i] + side * own.size[i]) as f32
            }));
        }
        mesh.triangles.extend(SIDES.iter().map(|side| side.map(|corner| first + corner)));
    }
    mesh
}
