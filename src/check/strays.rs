//! Points of a result that are no obstacles for `check`: they are no evidence of an
//! object, or lie on a robot. What is made for planners leaves them out by the same rule.

use super::outlines::Outlines;
use super::subject::CheckedRobot;
use super::surrounded::{reported_robots, surrounded};
use super::surroundings::Surroundings;
use crate::engine::Engine;
use crate::job::Means;
use crate::result::stray_points::{Published, RobotStrays, StrayPoints};
use contract::{Fit, Result};
use geometry::{Aabb, Point};
use std::path::Path;

/// The stray points around the robots of a published result, or around the one with an id.
/// `library` is the folder of their models; `None` for that of the run.
///
/// # Errors
/// Models or files of the result that cannot be read.
pub(crate) fn stray_points(
    out: &Path,
    Published { files, result, state }: Published<'_>,
    only: Option<&str>,
    library: Option<&Path>,
    means: &Means,
    engine: &Engine,
) -> Result<StrayPoints> {
    let (fits, models) = reported_robots(library, state, means, engine)?;
    let around = Surroundings { out, files, state, result, outlines: Outlines::default() };
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
