//! The robots of a result with what stands around them: the first step of all that is checked.

use super::subject::CheckedRobot;
use super::surroundings::Surroundings;
use crate::detect::library;
use crate::detect::robots::RobotList;
use crate::engine::{AllThreads, Engine};
use crate::job::Means;
use crate::result::plant_state::PlantState;
use clearance::{FARTHEST, Obstacles, RobotBody};
use contract::{Error, Fit, Kind, Result, Verdict};
use robot::Model;
use std::path::Path;

/// Greatest motion of any part between two checked postures, and a tolerance for rounding, metres.
const BETWEEN: f64 = 0.02;

/// Usual reach of attached bodies beyond the robot, metres; if one exceeds it, the surroundings are
/// gathered again.
const HUNG: f64 = 0.5;

/// The robot with attached bodies, and everything within its reach but itself.
pub(super) fn surrounded<'a>(
    robot: &CheckedRobot<'a>,
    around: &Surroundings<'_>,
    others: &[(usize, &Fit)],
    models: &[Model],
    margin: f64,
    engine: &Engine,
) -> Result<(RobotBody<'a>, Obstacles)> {
    let mut far = clearance::reach(robot.model) + margin + HUNG;
    loop {
        if far > FARTHEST {
            let what = format!("{} reaches {far:.0} m: that is too far to look", robot.entry.id);
            return Err(Error::new(Kind::Unsupported, what)
                .hint("correct the limits of its sliding joints in the URDF"));
        }
        let (hung, mut obstacles) = around.gather(robot, others, models, far, engine)?;
        let largest = obstacles.largest();
        let new = || RobotBody::new(robot.model, hung, margin, largest, &AllThreads);
        let mut body = engine.pool()?.install(new);
        let needed = body.farthest() + margin + BETWEEN;
        if needed <= far {
            body.remove_robot(&robot.found(), &mut obstacles);
            return Ok((body, obstacles));
        }
        far = needed + HUNG;
    }
}

/// A fit and its index in the result.
pub(super) type NumberedFit = (usize, Fit);

/// All reported robots with their indices, and their models.
pub(super) fn reported_robots(
    library: Option<&Path>,
    state: &PlantState,
    means: &Means,
    engine: &Engine,
) -> Result<(Vec<NumberedFit>, Vec<Model>)> {
    let dir = library.unwrap_or(&state.robots);
    let stands = |fit: &Fit| fit.verdict != Verdict::Refused;
    let (numbers, fits): (Vec<usize>, Vec<Fit>) =
        state.fits.iter().cloned().enumerate().filter(|(_, fit)| stands(fit)).unzip();
    let is_wanted = |name: &str| {
        let is_it = |fit: &Fit| {
            fit.model_name == name || fit.tool.as_ref().is_some_and(|tool| tool.model == name)
        };
        fits.iter().any(is_it)
    };
    if fits.is_empty() {
        return Ok((Vec::new(), Vec::new()));
    }
    let library = library::load_those(dir, is_wanted, &means.settings.robot, None, engine)?;
    let RobotList { fits, models } = library::robots_of(fits, &library)?;
    Ok((numbers.into_iter().zip(fits).collect(), models))
}
