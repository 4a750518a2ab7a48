//! Points of a result that are no obstacles to its robots, by the rule of `check`, which
//! finds them.

use super::plant_state::PlantState;
use crate::cache::VerifiedFiles;
use clearance::{ObstacleKind, StrayCells};
use contract::PointKind;
use export::ResultFile;
use geometry::{Aabb, Point, Pose};

/// A published result.
#[derive(Clone, Copy)]
pub(crate) struct Published<'a> {
    pub(crate) files: &'a VerifiedFiles,
    pub(crate) result: &'a ResultFile,
    pub(crate) state: &'a PlantState,
}

/// Stray points around the robots of a result.
#[derive(Debug, Default)]
pub(crate) struct StrayPoints(pub(crate) Vec<RobotStrays>);

/// Those around one robot.
#[derive(Debug)]
pub(crate) struct RobotStrays {
    pub(crate) base_from_world: Pose,
    pub(crate) cells: StrayCells,
    /// Where points were looked at; world frame, metres.
    pub(crate) bounds: Aabb,
}

impl StrayPoints {
    /// Whether a point is fixed or uncertain and no obstacle to any robot that it is near to, and
    /// there is such a robot; world frame, metres.
    pub(crate) fn contains(&self, world: [f64; 3], kind: PointKind) -> bool {
        let what = match kind {
            PointKind::Fixed => ObstacleKind::Fixed,
            PointKind::Uncertain => ObstacleKind::Uncertain,
            _ => return false,
        };
        let mut is_stray = false;
        let near = self.0.iter().filter(|robot| robot.bounds.contains(world));
        for RobotStrays { base_from_world, cells, .. } in near {
            let p = base_from_world * Point::from(world);
            match cells.contains(p.coords.into(), what) {
                Some(false) => return false,
                Some(true) => is_stray = true,
                None => {}
            }
        }
        is_stray
    }
}
