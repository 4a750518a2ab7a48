//! A result and a path of one of its robots in; where on the way the robot comes near to what the scans saw, to other robots, or
//! to what nobody has seen, out.
//!
//! In doubt a path is not free: points of which nobody knows stand in the way as fixed ones do, space that no beam went through is
//! not free, and what a part touched already where it was found is told apart, not forgotten.

mod surroundings;
mod words;

use crate::engine::{AllThreads, Engine, Task};
use crate::job::{Job, Means};
use crate::library;
use crate::rescan::{State, models_of};
use crate::reuse::Manifest;
use crate::trajectory::Trajectory;
use clearance::{Body, Contact, Level, Walk, What};
use contract::{Error, Fit, Kind, Result, Verdict};
use export::{ResultFile, RobotEntry};
use geometry::{Point, Pose};
use robot::{JointKind, Model};
use std::path::PathBuf;
use surroundings::Surroundings;

/// Opening of a closed loop that is none, metres: less than a scanner sees.
const LOOP_GAP: f64 = 1e-4;
/// A value so far beyond its limit is rounding, radians or metres.
const ROUNDING: f64 = 1e-6;

/// What is to be checked.
#[derive(Debug, Clone)]
pub struct Request {
    /// Output folder of a run.
    pub out: PathBuf,
    /// File of the path.
    pub trajectory: PathBuf,
    /// Id of the robot; the only one that has all joints of the path where left out.
    pub robot: Option<String>,
    /// Library, where it is not where it was.
    pub robots: Option<PathBuf>,
    /// What is nearer is near, metres.
    pub margin: f64,
    /// Turning joints of the path are given in degrees.
    pub degrees: bool,
}

/// What a path came to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Outcome {
    /// Nothing is near, and all is known.
    Free,
    /// Nothing is near that was not as near where the robot was found; but not all is known.
    Open,
    /// Something is nearer than the margin.
    Near,
    /// Something is hit, or a joint cannot get there.
    Blocked,
}

/// Why a path is not known to be free.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, clap::ValueEnum)]
pub enum Doubt {
    /// It leads through space that no beam went through
    Unseen,
    /// It leads through points of which nobody knows, beside where the robot was found: most are its own
    Beside,
    /// Parts are as near to something as they were where the robot was found
    AsFound,
    /// The robot's posture is doubtful, or a joint is not determined that the path leaves as it was found
    Posture,
}

/// What was found.
pub struct Report {
    /// Id of the robot.
    pub robot: String,
    /// Names of its links.
    pub links: Vec<String>,
    /// World from its base.
    pub world_from_base: Pose,
    /// How near it comes to what.
    pub contacts: Vec<Contact>,
    /// What joints cannot do, in words, with the waypoint.
    pub impossible: Vec<(f64, String)>,
    /// Why it is not known to be free.
    pub doubts: Vec<Doubt>,
    /// What a person should know, in words.
    pub warnings: Vec<String>,
    /// The worst of all.
    pub outcome: Outcome,
    /// Waypoints, and postures that were looked at.
    pub n_waypoints: usize,
    /// See `n_waypoints`.
    pub n_postures: usize,
    /// When waypoints are reached, seconds, where the path says.
    pub times: Vec<f64>,
    /// What was asked for, metres.
    pub margin: f64,
    /// Ids of all robots, by their numbers.
    pub ids: Vec<String>,
}

/// A robot of a result.
struct Robot<'a> {
    entry: &'a RobotEntry,
    number: usize,
    fit: &'a Fit,
    model: &'a Model,
}

/// Checks a path.
///
/// # Errors
/// No result, or one without what this needs; a path that is none of the robot's; files that cannot be read.
pub fn check(request: &Request, means: &Means, engine: &Engine) -> Result<Report> {
    let out = &request.out;
    let manifest = Manifest::read(out)?;
    // A result that was copied without its store has nobody at work in it.
    let _lock = out.join("store").is_dir().then(|| Job::hold_shared(out)).transpose()?;
    let (result, state) = (ResultFile::read(out)?, State::read(out)?);
    if result.robots.len() != state.fits.len() {
        return Err(Error::bad_input("the result and what is kept beside it are not of one run")
            .at(out.display())
            .hint("run the same job again"));
    }
    let path = Trajectory::read(&request.trajectory)?;
    let number = chosen(request, &result, &path)?;
    let (fits, models) = stood(request, &state, means, engine)?;
    let stands = fits.iter().find(|(at, _)| *at == number).map(|(_, fit)| fit);
    let entry = &result.robots[number];
    let Some(fit) = stands else {
        return Err(Error::new(Kind::Usage, format!("{} was refused, or is gone", entry.id))
            .hint("check a path of a robot that stands there"));
    };
    let robot = Robot { entry, number, fit, model: &models[fit.model] };
    robot.is_of_the_library()?;
    let postures = robot.postures(&path, request.degrees)?;
    let around = Surroundings { out, manifest: &manifest, state: &state, result: &result };
    let others: Vec<(usize, &Fit)> =
        fits.iter().filter(|(at, _)| *at != number).map(|(at, fit)| (*at, fit)).collect();
    let (hung, mut obstacles) =
        around.gather(&robot, (&others, &models), request.margin, engine)?;
    let make = || Body::new(robot.model, hung, request.margin, &AllThreads);
    let body = engine.pool()?.install(make);
    let found: Vec<f64> = fit.joints.iter().map(|j| j.value).collect();
    body.set_beside(&found, &mut obstacles);
    let lay = || Walk::new((&body, &obstacles), &postures, &found, &AllThreads);
    let walk = engine.pool()?.install(lay);
    let pieces = (0..walk.n_pieces()).collect();
    let looked = engine.fan_out(Task::new("check"), pieces, |piece| Ok(walk.look(piece)))?;
    let contacts = walk.contacts(looked);
    let impossible = robot.impossible(&postures, walk.legs());
    let n_postures = walk.n_postures();
    let mut report = robot.report(request, &path, &contacts, impossible);
    report.n_postures = n_postures;
    report.ids = result.robots.iter().map(|r| r.id.clone()).collect();
    Ok(report)
}

/// The number of the robot that is meant.
fn chosen(request: &Request, result: &ResultFile, path: &Trajectory) -> Result<usize> {
    let usage = |what: String, hint: &str| Err(Error::new(Kind::Usage, what).hint(hint));
    if let Some(id) = &request.robot {
        let at = result.robots.iter().position(|r| r.id == *id);
        return at.map_or_else(
            || usage(format!("the result has no robot \"{id}\""), "its ids are R1, R2 …"),
            Ok,
        );
    }
    let has_all = |r: &RobotEntry| {
        path.joints.iter().all(|name| r.joints.0.iter().any(|(own, _)| own == name))
    };
    let own: Vec<usize> =
        (0..result.robots.len()).filter(|&at| has_all(&result.robots[at])).collect();
    match own[..] {
        [one] => Ok(one),
        [] => usage(
            format!("no robot of the result has the joints {}", path.joints.join(", ")),
            "name them as result.json does",
        ),
        _ => usage(
            format!("{} robots of the result have these joints", own.len()),
            "name one with --robot",
        ),
    }
}

/// All robots that stand, by number, and their models.
fn stood(
    request: &Request,
    state: &State,
    means: &Means,
    engine: &Engine,
) -> Result<(Vec<(usize, Fit)>, Vec<Model>)> {
    let dir = request.robots.as_deref().unwrap_or(&state.robots);
    let stands = |fit: &Fit| fit.verdict != Verdict::Refused;
    let (numbers, mut fits): (Vec<usize>, Vec<Fit>) =
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
    let library = library::load_those(dir, is_wanted, (&means.settings.robot, None), engine)?;
    let models = models_of(&mut fits, &library)?;
    Ok((numbers.into_iter().zip(fits).collect(), models))
}

impl Robot<'_> {
    /// Refuses a model that is no longer the one that was found.
    fn is_of_the_library(&self) -> Result<()> {
        let links = self.model.links.iter().map(|l| &l.name).eq(&self.entry.links);
        let joints = self.model.free.iter().map(|&j| &self.model.joints[j].name);
        if links && joints.eq(self.entry.joints.0.iter().map(|(name, _)| name)) {
            return Ok(());
        }
        let what = format!(
            "the library's {} has other links or joints than the result's",
            self.model.name
        );
        Err(Error::bad_input(what).hint("give the library of the run with --robots"))
    }

    /// The waypoints as whole postures: joints that the path does not name stay where they were found.
    fn postures(&self, path: &Trajectory, degrees: bool) -> Result<Vec<Vec<f64>>> {
        let columns: Vec<Option<usize>> = (self.fit.joints.iter())
            .map(|joint| path.joints.iter().position(|name| *name == joint.name))
            .collect();
        let has = |name: &&String| self.fit.joints.iter().any(|j| j.name == **name);
        if let Some(odd) = path.joints.iter().find(|name| !has(name)) {
            let known: Vec<&str> = self.fit.joints.iter().map(|j| &*j.name).collect();
            let what = format!("{} has no joint \"{odd}\"", self.entry.id);
            return Err(Error::bad_input(what).hint(format!("there are {}", known.join(", "))));
        }
        let slides =
            |joint: usize| self.model.joints[self.model.free[joint]].kind == JointKind::Prismatic;
        let value = |point: &[f64], joint: usize| match columns[joint] {
            Some(column) if degrees && !slides(joint) => point[column].to_radians(),
            Some(column) => point[column],
            None => self.fit.joints[joint].value,
        };
        let posture = |point: &Vec<f64>| (0..columns.len()).map(|j| value(point, j)).collect();
        Ok(path.points.iter().map(posture).collect())
    }

    /// What its joints cannot do, and where on the path.
    fn impossible(&self, path: &[Vec<f64>], legs: &[clearance::Leg]) -> Vec<(f64, String)> {
        let mut out = Vec::new();
        for (at, posture) in path.iter().enumerate() {
            for (free, value) in posture.iter().enumerate() {
                let joint = &self.model.joints[self.model.free[free]];
                let Some([low, high]) = joint.limits else { continue };
                if *value < low - ROUNDING || *value > high + ROUNDING {
                    let what = format!(
                        "{} is {value:.4}, beyond its limits {low:.4} to {high:.4}",
                        joint.name
                    );
                    out.push((at as f64, what));
                }
            }
            let gap = self.model.loop_gap(posture);
            if gap > LOOP_GAP {
                out.push((at as f64, format!("a closed loop stays open by {:.1} mm", gap * 1e3)));
            }
        }
        let jumps = legs.iter().enumerate().filter(|(_, leg)| leg.jumps);
        out.extend(
            jumps.map(|(at, _)| (at as f64, "a part jumps on the way from here".to_owned())),
        );
        out
    }

    fn report(
        &self,
        request: &Request,
        path: &Trajectory,
        contacts: &[Contact],
        impossible: Vec<(f64, String)>,
    ) -> Report {
        let (mut doubts, mut warnings) = (Vec::new(), Vec::new());
        if self.fit.verdict != Verdict::Trusted {
            let reasons = self.fit.reasons.join("; ");
            warnings.push(format!(
                "the posture of {} is {}: {reasons}",
                self.entry.id,
                self.fit.verdict.word()
            ));
            doubts.push(Doubt::Posture);
        }
        for joint in
            self.fit.joints.iter().filter(|j| !j.determined && !path.joints.contains(&j.name))
        {
            warnings
                .push(format!("{} is not determined, and the path does not give it", joint.name));
            doubts.push(Doubt::Posture);
        }
        let base = self.fit.base_sigma[..3].iter().map(|s| s * s).sum::<f64>();
        let sigma = (base + self.fit.tip_sigma.powi(2)).sqrt();
        if 3.0 * sigma > request.margin {
            warnings.push(format!(
                "base and tip are known to ± {:.1} mm: a margin of {:.1} mm is less than three times that",
                sigma * 1e3,
                request.margin * 1e3
            ));
        }
        let stands = |c: &&Contact| !c.as_found && c.what != What::Beside;
        let is = |level: Level| contacts.iter().filter(stands).any(|c| c.level >= level);
        if contacts.iter().any(|c| c.level == Level::Unseen) {
            doubts.push(Doubt::Unseen);
        }
        if contacts.iter().any(|c| c.what == What::Beside && !c.as_found) {
            doubts.push(Doubt::Beside);
        }
        if contacts.iter().any(|c| c.as_found && c.level > Level::Unseen) {
            doubts.push(Doubt::AsFound);
        }
        doubts.sort_unstable();
        doubts.dedup();
        let outcome = if is(Level::Hit) || !impossible.is_empty() {
            Outcome::Blocked
        } else if is(Level::Near) {
            Outcome::Near
        } else if doubts.is_empty() {
            Outcome::Free
        } else {
            Outcome::Open
        };
        Report {
            robot: self.entry.id.clone(),
            links: self.entry.links.clone(),
            world_from_base: self.fit.world_from_base,
            contacts: contacts.to_vec(),
            impossible,
            doubts,
            warnings,
            outcome,
            n_waypoints: path.points.len(),
            n_postures: 0,
            times: path.times.clone(),
            margin: request.margin,
            ids: Vec::new(),
        }
    }
}

impl Report {
    /// A point of the base's frame in the world.
    fn world(&self, p: &Point) -> [f64; 3] {
        (self.world_from_base * p).coords.into()
    }

    /// Whether the path may be gone where these doubts are allowed.
    #[must_use]
    pub fn passes(&self, allowed: &[Doubt]) -> bool {
        self.outcome <= Outcome::Open && self.doubts.iter().all(|doubt| allowed.contains(doubt))
    }
}
