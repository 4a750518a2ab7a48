//! Checks paths of robots of a result: where they come near to scanned surfaces, to other
//! robots, or to space that no scan has seen.
//!
//! In doubt a path is not free: uncertain points count as obstacles like fixed ones, and space
//! without beams is not free. Contacts that exist already in the found posture are reported
//! separately.

mod outlines;
mod report;
mod robot_surfaces;
mod subject;
mod surrounded;
mod surroundings;
pub mod trajectory;
mod words;

pub use report::{CheckRequest, PathDoubt, PathOutcome, PathReport};
pub(crate) use robot_surfaces::robot_surfaces;
pub use words::{json, words};

use crate::cache::VerifiedFiles;
use crate::engine::{Amount, Engine, Task};
use crate::job::{Job, Means};
use crate::result::plant_state::PlantState;
use clearance::{Contacts, Obstacles, PathWalk, RobotBody};
use contract::{Error, Fit, Kind, Result, Verdict};
use export::ResultFile;
use outlines::Outlines;
use std::collections::BTreeMap;
use std::path::PathBuf;
use subject::CheckedRobot;
use surrounded::{reported_robots, surrounded};
use surroundings::Surroundings;
use trajectory::Trajectory;

/// Checks paths: the reports, in the order of the request. What stands around a robot is gathered
/// once for all of its paths.
///
/// # Errors
/// There is no result or it lacks files for this, a path does not belong to its robot, or files
/// cannot be read.
pub fn check(request: &CheckRequest, means: &Means, engine: &Engine) -> Result<Vec<PathReport>> {
    let files = &request.trajectories;
    let paths = trajectory::read_all(files, means.settings.ingest.max_text_bytes)?;
    let choose = |result: &ResultFile, state: &PlantState| {
        let one = |(path, file): (&Trajectory, &PathBuf)| {
            chosen(request, result, state, path).map_err(|e| e.at(file.display()))
        };
        paths.iter().zip(files).map(one).collect()
    };
    // A stage for each of many paths would say little.
    let quiet = (paths.len() > 1).then(|| engine.quiet());
    let engine_of_paths = quiet.as_ref().unwrap_or(engine);
    at_robots(request, choose, means, engine, |place, own| {
        let total = Amount::items(own.len() as u64);
        let stage = quiet.is_some().then(|| engine.progress.stage("paths", total));
        let one = |&at: &usize| {
            let report = place.check_path(&paths[at], engine_of_paths);
            let mut report = report.map_err(|e| e.at(files[at].display()))?;
            report.trajectory.clone_from(&files[at]);
            stage.iter().for_each(|stage| stage.add(1, 0, 0));
            Ok(report)
        };
        own.iter().map(one).collect()
    })
}

/// A robot of a result with its surroundings, for checking several paths.
pub(crate) struct RobotSite<'a> {
    request: &'a CheckRequest,
    robot: &'a CheckedRobot<'a>,
    body: RobotBody<'a>,
    obstacles: Obstacles,
    /// Ids of all robots, by index.
    ids: Vec<String>,
    /// Whether parts of the run were left out.
    is_partial: bool,
}

/// Opens the result, selects a robot for each item with `choose`, and calls `then` once for each
/// selected robot with its surroundings and the indices of its items; what `then` returns for them,
/// in the order of the items.
///
/// # Errors
/// There is no result or it lacks files for this, files cannot be read, or an error of `choose` or
/// `then`.
pub(crate) fn at_robots<T>(
    request: &CheckRequest,
    choose: impl FnOnce(&ResultFile, &PlantState) -> Result<Vec<usize>>,
    means: &Means,
    engine: &Engine,
    mut then: impl FnMut(&RobotSite<'_>, &[usize]) -> Result<Vec<T>>,
) -> Result<Vec<T>> {
    let out = &request.out;
    // No run can use a result that was copied without its store.
    let _lock = out.join("store").is_dir().then(|| Job::hold_shared(out)).transpose()?;
    let files = VerifiedFiles::open(out)?;
    let (result, state) = (files.result()?, PlantState::read(&files)?);
    if result.robots.len() != state.fits.len() {
        return Err(Error::bad_input(
            "result.json and plant.bin of this folder are of different runs",
        )
        .at(out.display())
        .hint("run the same job again"));
    }
    let mut items: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (item, robot) in choose(&result, &state)?.into_iter().enumerate() {
        items.entry(robot).or_default().push(item);
    }
    let library = request.robots.as_deref();
    let (fits, models) = reported_robots(library, &state, means, engine)?;
    let robots: Vec<CheckedRobot<'_>> = (fits.iter())
        .map(|(number, fit)| {
            let (entry, model) = (&result.robots[*number], &models[fit.model]);
            CheckedRobot { entry, number: *number, fit, model }
        })
        .collect();
    robots.iter().try_for_each(|robot| robot.is_of_the_library(files.manifest()))?;
    let outlines = Outlines::default();
    let around = Surroundings { out, files: &files, state: &state, result: &result, outlines };
    let mut all: Vec<(usize, T)> = Vec::new();
    for (number, items) in items {
        let robot = robots.iter().find(|robot| robot.number == number);
        let robot = robot.ok_or_else(|| Error::new(Kind::Bug, "the selected robot has no fit"))?;
        let others: Vec<(usize, &Fit)> =
            fits.iter().filter(|(at, _)| *at != number).map(|(at, fit)| (*at, fit)).collect();
        let (body, obstacles) =
            surrounded(robot, &around, &others, &models, request.margin, engine)?;
        let site = RobotSite {
            request,
            robot,
            body,
            obstacles,
            ids: result.robots.iter().map(|r| r.id.clone()).collect(),
            is_partial: files.manifest().partial,
        };
        all.extend(items.iter().copied().zip(then(&site, &items)?));
    }
    all.sort_by_key(|(item, _)| *item);
    Ok(all.into_iter().map(|(_, one)| one).collect())
}

impl RobotSite<'_> {
    /// Everything around the robot.
    pub(crate) fn obstacles(&self) -> &Obstacles {
        &self.obstacles
    }

    /// Checks one path of the robot.
    ///
    /// # Errors
    /// A path that does not belong to the robot, or a cancelled run.
    pub(crate) fn check_path(&self, path: &Trajectory, engine: &Engine) -> Result<PathReport> {
        let &Self { request, robot, ref body, ref obstacles, .. } = self;
        let postures = robot.postures(path, request.degrees)?;
        let pairs: Vec<&[Vec<f64>]> = postures.windows(2).collect();
        let lay = |pair: &[Vec<f64>]| Ok(clearance::leg(body, &pair[0], &pair[1]));
        let legs = engine.fan_out(Task::new("path"), pairs, lay)?;
        let walk = PathWalk::new(body, obstacles, &postures, &legs, &robot.found());
        let contacts = contacts(&walk, engine)?;
        let impossible = robot.impossible(&postures, &legs, &contacts, request.degrees);
        let contacts = contacts.all();
        let mut report = robot.report(request, path, &contacts, impossible);
        report.n_postures = walk.n_postures();
        report.beam_spacing = walk.beam_spacing();
        report.ids.clone_from(&self.ids);
        if self.is_partial {
            let what = "parts of the run were left out: `stillpoint report` says which";
            report.warnings.push(what.into());
        }
        if robot.entry.space.is_none() {
            let what = "the result knows no space about the robot, so nothing is known to be free: it takes scanner positions and --set freespace.enabled=true";
            report.warnings.push(what.into());
        }
        Ok(report)
    }
}

/// Number of path segments that are checked before their contacts are merged.
const WAITING: usize = 1 << 12;

/// Contacts along the path.
fn contacts(walk: &PathWalk<'_>, engine: &Engine) -> Result<Contacts> {
    let mut all = Contacts::default();
    for from in (0..walk.n_pieces()).step_by(WAITING) {
        let some = (from..(from + WAITING).min(walk.n_pieces())).collect();
        let looked = engine.fan_out(Task::new("check"), some, |piece| Ok(walk.examine(piece)))?;
        looked.into_iter().for_each(|one| walk.add(one, &mut all));
    }
    Ok(all)
}

/// Index of the selected robot among those that are reported.
fn chosen(
    request: &CheckRequest,
    result: &ResultFile,
    state: &PlantState,
    path: &Trajectory,
) -> Result<usize> {
    let usage = |what: String, hint: String| Err(Error::new(Kind::Usage, what).hint(hint));
    let stands = |at: &usize| state.fits[*at].verdict != Verdict::Refused;
    let standing: Vec<usize> = (0..result.robots.len()).filter(stands).collect();
    let ids = |some: &[usize]| {
        let ids: Vec<&str> = some.iter().map(|&at| &*result.robots[at].id).collect();
        ids.join(", ")
    };
    if let Some(id) = &request.robot {
        let at = standing.iter().find(|&&at| result.robots[at].id == *id);
        return at.map_or_else(
            || {
                usage(
                    format!("no robot \"{id}\" stands there"),
                    format!("there are {}", ids(&standing)),
                )
            },
            |at| Ok(*at),
        );
    }
    let has =
        |at: usize, name: &String| result.robots[at].joints.0.iter().any(|(own, _)| own == name);
    let has_all = |at: &usize| path.joints.iter().all(|name| has(*at, name));
    let own: Vec<usize> = standing.into_iter().filter(has_all).collect();
    match own[..] {
        [one] => Ok(one),
        [] => usage(
            format!("no robot of the result has the joints {}", path.joints.join(", ")),
            "name them as result.json does".into(),
        ),
        _ => usage(
            "several robots of the result have these joints".into(),
            format!("name one with --robot: {}", ids(&own)),
        ),
    }
}
