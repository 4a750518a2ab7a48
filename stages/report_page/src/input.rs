//! What a page is made of: texts of the result, robots with their meshes, and places.

use contract::Label;
use geometry::{Aabb, Pose};
use robot::{Mesh, Model};

/// The texts of a result.
#[derive(Debug, Clone, Default)]
pub struct PageTexts {
    /// Title of the page: the name of the result's folder.
    pub title: String,
    /// Version of the program that makes the page.
    pub program: String,
    /// Content of `result.json`.
    pub result: String,
    /// Content of `changes.json`, after a rescan.
    pub changes: Option<String>,
    /// Summary of the run, for people.
    pub summary: String,
    /// Whether the run left something out.
    pub is_partial: bool,
    /// Times, rates and memory of the run, each with what it is about. They differ from run to run,
    /// so a page that is a file of the result has none.
    pub run: Vec<(String, String)>,
}

/// A point of the result.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PagePoint {
    /// World coordinates, metres.
    pub world: [f64; 3],
    /// What it belongs to.
    pub label: Label,
}

/// A position of a scanner.
#[derive(Debug, Clone, PartialEq)]
pub struct PageScanner {
    /// Name of its scan.
    pub name: String,
    /// World coordinates, metres.
    pub at: [f64; 3],
}

/// A closed loop of a robot, by names.
#[derive(Debug, Clone, PartialEq)]
pub struct PageLoop {
    /// Joints that it sets.
    pub passive: Vec<String>,
    /// Pins that hold it together.
    pub pins: Vec<PagePin>,
}

/// Two points of two links that coincide, seen along the axes of a loop.
#[derive(Debug, Clone, PartialEq)]
pub struct PagePin {
    /// Names of the links.
    pub links: [String; 2],
    /// The points in the frames of the links, metres.
    pub points: [[f64; 3]; 2],
}

/// A robot with body and place; robots stand in the order of the result.
#[derive(Debug, Clone)]
pub struct PageRobot {
    /// Its links and joints. The order of the links is that of the labels.
    pub model: Model,
    /// Pose `world_from_link` of each link, metres.
    pub world_from_link: Vec<Pose>,
    /// Its closed loops; empty where they are not known.
    pub loops: Vec<PageLoop>,
    /// Its surface: index of the link, and mesh in the link's frame.
    pub bodies: Vec<(usize, Mesh)>,
    /// Convex pieces of what hangs on it.
    pub hanging: Vec<(usize, Mesh)>,
}

impl PageRobot {
    /// Bounds of the robot in the world, metres.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        let all = self.bodies.iter().filter_map(|(link, mesh)| {
            let own = Aabb::of(mesh.vertices.iter().map(|v| v.map(f64::from)));
            Some((self.world_from_link.get(*link)?, own))
        });
        let solid = all.filter(|(_, own)| !own.is_empty());
        Aabb::of(solid.flat_map(|(pose, own)| {
            own.corners().map(|p| (pose * geometry::Point::from(p)).into())
        }))
    }
}

impl PageLoop {
    /// The closed loops of a model.
    #[must_use]
    pub fn of(model: &Model) -> Vec<Self> {
        let link = |l: usize| model.links[l].name.clone();
        let pin = |c: &robot::Closure| PagePin {
            links: [link(c.link_a), link(c.link_b)],
            points: [c.point_a.into(), c.point_b.into()],
        };
        let one = |l: &robot::ClosedLoop| Self {
            passive: l.passive.iter().map(|&j| model.joints[j].name.clone()).collect(),
            pins: l.closures.iter().map(pin).collect(),
        };
        model.loops.iter().map(one).collect()
    }
}
