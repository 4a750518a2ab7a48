//! The robots of a result as they were scanned: which places are their own surfaces, so that
//! doubtful points there are nothing that a robot could hit.

use super::subject::CheckedRobot;
use super::surrounded::reported_robots;
use crate::detect::robots::poses;
use crate::engine::{Engine, Task};
use crate::job::Means;
use crate::result::mesh_export::Published;
use clearance::OwnSurface;
use contract::{Fit, Result};
use std::path::Path;

/// The surfaces of all reported robots of a published result, in all postures in which they were
/// scanned. `library` is the folder of their models; `None` for that of the run.
///
/// # Errors
/// Models that cannot be read, or are others than those of the run.
pub(crate) fn robot_surfaces(
    Published { files, result, state }: Published<'_>,
    library: Option<&Path>,
    means: &Means,
    engine: &Engine,
) -> Result<Vec<OwnSurface>> {
    let (fits, models) = reported_robots(library, state, means, engine)?;
    engine.fan_out(Task::new("robots"), fits, |(number, fit): (usize, Fit)| {
        let (entry, model) = (&result.robots[number], &models[fit.model]);
        CheckedRobot { entry, number, fit: &fit, model }.is_of_the_library(files.manifest())?;
        let all = std::iter::once(&fit).chain(&fit.stays);
        let postures: Vec<_> = all.map(|fit| poses(fit, model)).collect();
        Ok(OwnSurface::new(model, &postures))
    })
}
