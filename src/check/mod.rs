//! A result and a path of one of its robots in; where on the way the robot comes near to what the
//! scans saw, to other robots, or to what nobody has seen, out.
//!
//! In doubt a path is not free: points of which nobody knows stand in the way as fixed ones do,
//! space that no beam went through is not free, and what a part touched already where it was found
//! is told apart, not forgotten.

mod report;
mod subject;
mod surroundings;
pub mod trajectory;
mod words;

pub use report::{CheckRequest, PathDoubt, PathOutcome, PathReport};

use crate::cache::VerifiedFiles;
use crate::detect::library;
use crate::detect::robots::RobotList;

use crate::engine::{AllThreads, Engine, Task};
use crate::job::{Job, Means};
use crate::result::plant_state::PlantState;
use clearance::{Contacts, FARTHEST, Obstacles, PathWalk, RobotBody};
use contract::{Error, Fit, Kind, Result, Verdict};
use export::ResultFile;
use robot::Model;
use subject::CheckedRobot;
use surroundings::Surroundings;
use trajectory::Trajectory;

/// Checks a path.
///
/// # Errors
/// No result, or one without what this needs; a path that is none of the robot's; files that cannot
/// be read.
pub fn check(request: &CheckRequest, means: &Means, engine: &Engine) -> Result<PathReport> {
    let path = Trajectory::read(&request.trajectory, means.settings.ingest.max_text_bytes)?;
    let choose = |result: &ResultFile, state: &PlantState| chosen(request, result, state, &path);
    at_robot(request, choose, means, engine, |place| place.look(&path, engine))
}

/// A robot of a result, and all that stands around it: its paths can be looked at one after the
/// other.
pub(crate) struct RobotSite<'a> {
    request: &'a CheckRequest,
    robot: &'a CheckedRobot<'a>,
    body: RobotBody<'a>,
    obstacles: Obstacles,
    /// Ids of all robots, by their numbers.
    ids: Vec<String>,
    /// Whether parts of the run were left out.
    is_partial: bool,
}

/// Opens the result, and does something at the robot that is chosen.
///
/// # Errors
/// No result, or one without what this needs; what `choose` and `then` end with; files that cannot
/// be read.
pub(crate) fn at_robot<T>(
    request: &CheckRequest,
    choose: impl FnOnce(&ResultFile, &PlantState) -> Result<usize>,
    means: &Means,
    engine: &Engine,
    then: impl FnOnce(&RobotSite<'_>) -> Result<T>,
) -> Result<T> {
    let out = &request.out;
    // A result that was copied without its store has nobody at work in it.
    let _lock = out.join("store").is_dir().then(|| Job::hold_shared(out)).transpose()?;
    let files = VerifiedFiles::open(out)?;
    let (result, state) = (files.result()?, PlantState::read(&files)?);
    if result.robots.len() != state.fits.len() {
        return Err(Error::bad_input("the result and what is kept beside it are not of one run")
            .at(out.display())
            .hint("run the same job again"));
    }
    let number = choose(&result, &state)?;
    let (fits, models) = stood(request, &state, means, engine)?;
    let robots: Vec<CheckedRobot<'_>> = (fits.iter())
        .map(|(number, fit)| {
            let (entry, model) = (&result.robots[*number], &models[fit.model]);
            CheckedRobot { entry, number: *number, fit, model }
        })
        .collect();
    robots.iter().try_for_each(|robot| robot.is_of_the_library(files.manifest()))?;
    let robot = robots.iter().find(|robot| robot.number == number);
    let robot =
        robot.ok_or_else(|| Error::new(Kind::Bug, "the robot that is meant does not stand"))?;
    let around = Surroundings { out, files: &files, state: &state, result: &result };
    let others: Vec<(usize, &Fit)> =
        fits.iter().filter(|(at, _)| *at != number).map(|(at, fit)| (*at, fit)).collect();
    let (mut body, mut obstacles) = surrounded(robot, &around, &others, &models, request, engine)?;
    body.remove_robot(&robot.found(), &mut obstacles);
    then(&RobotSite {
        request,
        robot,
        body,
        obstacles,
        ids: result.robots.iter().map(|r| r.id.clone()).collect(),
        is_partial: files.manifest().partial,
    })
}

impl RobotSite<'_> {
    /// Looks along a path.
    ///
    /// # Errors
    /// A path that is none of the robot's; cancelled.
    pub(crate) fn look(&self, path: &Trajectory, engine: &Engine) -> Result<PathReport> {
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

/// The robot with what hangs on it, and all that they can get near to.
fn surrounded<'a>(
    robot: &CheckedRobot<'a>,
    around: &Surroundings<'_>,
    others: &[(usize, &Fit)],
    models: &[Model],
    request: &CheckRequest,
    engine: &Engine,
) -> Result<(RobotBody<'a>, Obstacles)> {
    let margin = request.margin;
    let mut far = clearance::reach(robot.model) + margin + HUNG;
    loop {
        if far > FARTHEST {
            let what = format!("{} reaches {far:.0} m: that is too far to look", robot.entry.id);
            return Err(Error::new(Kind::Unsupported, what).hint("mend the limits of its slides"));
        }
        let (hung, obstacles) = around.gather(robot, others, models, far, engine)?;
        let largest = obstacles.largest();
        let new = || RobotBody::new(robot.model, hung, margin, largest, &AllThreads);
        let body = engine.pool()?.install(new);
        let needed = body.farthest() + margin + BETWEEN;
        if needed <= far {
            return Ok((body, obstacles));
        }
        far = needed + HUNG;
    }
}

/// What parts may move between two postures, metres, and rounding.
const BETWEEN: f64 = 0.02;

/// What hangs on a robot mostly reaches no farther beyond it, metres; where it does, all is looked
/// at once more.
const HUNG: f64 = 0.5;

/// Pieces of a path that wait to be summed up.
const WAITING: usize = 1 << 12;

/// Looks along the path.
fn contacts(walk: &PathWalk<'_>, engine: &Engine) -> Result<Contacts> {
    let mut all = Contacts::default();
    for from in (0..walk.n_pieces()).step_by(WAITING) {
        let some = (from..(from + WAITING).min(walk.n_pieces())).collect();
        let looked = engine.fan_out(Task::new("check"), some, |piece| Ok(walk.examine(piece)))?;
        looked.into_iter().for_each(|one| walk.add(one, &mut all));
    }
    Ok(all)
}

/// The number of the robot that is meant, of those that stand.
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

/// A fit and its number in the result.
type Numbered = (usize, Fit);

/// All robots that stand, by number, and their models.
fn stood(
    request: &CheckRequest,
    state: &PlantState,
    means: &Means,
    engine: &Engine,
) -> Result<(Vec<Numbered>, Vec<Model>)> {
    let dir = request.robots.as_deref().unwrap_or(&state.robots);
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
