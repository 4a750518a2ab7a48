//! Uncertain points of a result that are no obstacles for `check`: they are no evidence of an
//! object, or lie on a robot. What is made for planners leaves them out by the same rule.

use super::subject::CheckedRobot;
use super::surroundings::Surroundings;
use super::{reported_robots, surrounded};
use crate::cache::VerifiedFiles;
use crate::engine::Engine;
use crate::job::Means;
use crate::result::plant_state::PlantState;
use clearance::{ObstacleKind, StrayCells};
use contract::{Fit, PointKind, Result};
use export::ResultFile;
use geometry::{Aabb, Point, Pose};
use std::path::Path;

/// Stray points around the robots of a result.
#[derive(Debug, Default)]
pub(crate) struct StrayPoints(Vec<RobotStrays>);

/// Those around one robot.
#[derive(Debug)]
struct RobotStrays {
    base_from_world: Pose,
    cells: StrayCells,
    /// Where points were looked at; world frame, metres.
    bounds: Aabb,
}

impl StrayPoints {
    /// Whether a point is uncertain and no obstacle to any robot that it is near to, and there is
    /// such a robot; world frame, metres. Of points that are known to be fixed none is left out: a
    /// part of a wall that few beams met behind the edge of a robot may look like strays.
    pub(crate) fn contains(&self, world: [f64; 3], kind: PointKind) -> bool {
        if kind != PointKind::Uncertain {
            return false;
        }
        let mut is_stray = false;
        for RobotStrays { base_from_world, cells, .. } in
            self.0.iter().filter(|robot| robot.bounds.contains(world))
        {
            let p = base_from_world * Point::from(world);
            match cells.contains(p.coords.into(), ObstacleKind::Uncertain) {
                Some(false) => return false,
                Some(true) => is_stray = true,
                None => {}
            }
        }
        is_stray
    }
}

/// The stray points around the robots of a published result, or around the one with an id.
/// `library` is the folder of their models; `None` for that of the run.
///
/// # Errors
/// Models or files of the result that cannot be read.
pub(crate) fn stray_points(
    out: &Path,
    (files, result, state): (&VerifiedFiles, &ResultFile, &PlantState),
    only: Option<&str>,
    library: Option<&Path>,
    means: &Means,
    engine: &Engine,
) -> Result<StrayPoints> {
    let (fits, models) = reported_robots(library, state, means, engine)?;
    let around = Surroundings { out, files, state, result };
    let mut all = Vec::new();
    for (number, fit) in &fits {
        let (entry, model) = (&result.robots[*number], &models[fit.model]);
        if entry.space.is_none() || only.is_some_and(|only| entry.id != only) {
            continue;
        }
        let robot = CheckedRobot { entry, number: *number, fit, model };
        robot.is_of_the_library(files.manifest())?;
        let others = fits.iter().filter(|(at, _)| at != number).map(|(at, fit)| (*at, fit));
        let others: Vec<(usize, &Fit)> = others.collect();
        let (_, obstacles) = surrounded(&robot, &around, &others, &models, 0.0, engine)?;
        let cells = obstacles.strays();
        let looked_at = cells.bounds().corners().map(|c| fit.world_from_base * Point::from(c));
        all.push(RobotStrays {
            base_from_world: fit.world_from_base.inverse(),
            bounds: Aabb::of(looked_at.iter().map(|c| c.coords.into())),
            cells,
        });
    }
    Ok(StrayPoints(all))
}
