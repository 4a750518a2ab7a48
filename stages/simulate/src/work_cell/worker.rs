//! A robot of a scene while the scene is drawn, and what it does.

use crate::scene::{RobotPlace, Tool, pose};
use geometry::{Point, Pose};
use robot::Model;

/// What the robots of a scene do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Work {
    /// A tool touches a part that lies on a bench, a fixture or the floor, or ends just above it.
    Touch,
    /// Two or three robots carry parts; benches with parts stand between them.
    Carry,
    /// Two robots with hoses from the ceiling, the floor, columns and other links.
    Hoses,
    /// A robot that touches bench and conveyor, inside a fence of wires.
    Joined,
}

/// A robot of the scene while it is drawn.
pub(super) struct Worker<'a> {
    pub(super) model: &'a Model,
    /// Its reach from the base, metres.
    pub(super) reach: f64,
    pub(super) place: RobotPlace,
    /// Index of the link that carries the tool, and the tool.
    pub(super) tool: Option<(usize, Tool)>,
    /// Poses of all links in the world.
    pub(super) world_from_links: Vec<Pose>,
}

impl Worker<'_> {
    /// Pose of the tool's frame in the world.
    pub(super) fn world_from_tool(&self) -> Option<Pose> {
        let (link, tool) = self.tool.as_ref()?;
        Some(self.world_from_links[*link] * pose(tool.xyz, tool.rpy_deg))
    }

    /// Points on its links, world, with the index of the link.
    pub(super) fn surface(&self) -> impl Iterator<Item = (usize, Point)> + '_ {
        let links = self.model.links.iter().zip(&self.world_from_links).enumerate();
        links.flat_map(|(at, (link, pose))| {
            let points = link.cad.points.iter().step_by(5);
            points.map(move |p| (at, pose * Point::from(p.map(f64::from))))
        })
    }
}
