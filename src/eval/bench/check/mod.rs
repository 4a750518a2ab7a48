//! `bench check`: scans random cells, runs the main job and checks paths of their robots. Meshes
//! tell whether a path collides; the table counts false alarms and misses by reason.

mod bodies;
mod draw;
mod evidence;
mod met;
mod row;
mod scene_robot;
mod table;
mod truth;

use super::cases::{CaseToRun, Cases};
use super::request::{DrawnCases, PlantSize};
use crate::check::trajectory::Trajectory;
use crate::check::{CheckRequest, PathReport, RobotSite, at_robots};
use crate::detect::library;
use crate::engine::Engine;
use crate::eval::compare::Agreement;
use crate::eval::virtual_scan::{Formats, scan_scene};
use crate::job::{Job, Means};
use crate::plan;
use contract::{Error, Kind, Result};
use draw::DrawnPath;
use evidence::PointCounts;
use export::{ResultFile, atomic};
use robot::Model;
use row::{CheckRow, PathRow};
use scene_robot::SceneRobot;
use simulate::random::Random;
use simulate::{Plant, Scene, Shapes};
use std::path::Path;
use std::time::Instant;
use truth::PathTruths;

/// Request of the bench.
#[derive(Debug, Clone)]
pub struct CheckBench {
    /// Seed, library and folders.
    pub drawn: DrawnCases,
    /// Number of cells.
    pub n_cases: usize,
    /// Robots and scanners of each cell.
    pub size: PlantSize,
    /// Margin of the check, metres.
    pub margin: f64,
}

/// Runs the cells and returns the table.
///
/// # Errors
/// A library that cannot be read, files that cannot be written.
pub fn checks(bench: &CheckBench, means: &Means, engine: &Engine) -> Result<String> {
    let temporary = tempfile::tempdir()?;
    let robots = bench.drawn.library(temporary.path())?;
    let models = library::load(&robots, &means.settings.robot, None, engine)?.models;
    let quiet = engine.quiet();
    let place = Cases { name: "check", drawn: &bench.drawn, temporary: temporary.path() };
    let cases = CaseToRun::numbered(&bench.drawn, bench.n_cases, |seed| CheckRow {
        seed,
        ..CheckRow::default()
    });
    let case = |row: &mut CheckRow, _: &usize, dir: &Path| {
        Bench { bench, models: &models, robots: &robots, means, engine: &quiet }.case(row, dir)
    };
    let all = |rows: &[CheckRow]| {
        let write =
            |dir: &Path| atomic::write(&dir.join("check.csv"), table::csv(rows)?.as_bytes());
        let csv = bench.drawn.out.as_deref().map(write);
        let note = match csv {
            Some(Err(error)) => format!("check.csv could not be written: {error}\n"),
            _ => String::new(),
        };
        table::table(rows) + &note
    };
    place.run(cases, case, all, engine)
}

/// What is true around a robot.
struct SiteTruth<'a> {
    paths: &'a PathTruths<'a>,
    shapes: &'a Shapes,
}

/// What a check says of a robot's paths and of the points around it.
struct SeenSite {
    paths: Vec<PathRow>,
    points: PointCounts,
}

/// Library, engine and request that all cells share.
struct Bench<'a> {
    bench: &'a CheckBench,
    models: &'a [Model],
    robots: &'a Path,
    means: &'a Means,
    engine: &'a Engine,
}

impl Bench<'_> {
    fn case(&self, row: &mut CheckRow, dir: &Path) -> Result<()> {
        let &Self { bench, models, engine, .. } = self;
        let wanted = Plant { n_rows: 1, ..bench.size.plant(row.seed) };
        let started = Instant::now();
        let (scene, thin) = draw::cell(&wanted, models)?;
        std::fs::create_dir_all(dir).map_err(|e| Error::from(e).at(dir.display()))?;
        atomic::write(&dir.join("scene.toml"), scene.to_toml()?.as_bytes())?;
        let scans = dir.join("scans");
        scan_scene(&scene, models, &scans, Formats { las: false, ..Formats::ALL }, engine)?;
        row.seconds[0] = started.elapsed().as_secs_f64();
        let started = Instant::now();
        let (robots, out) = (self.robots.to_path_buf(), dir.join("result"));
        let job = Job::new(vec![scans.join("scans.e57")], robots, out, self.means.clone());
        plan::run(&job, engine)?;
        row.seconds[1] = started.elapsed().as_secs_f64();
        let started = Instant::now();
        let agreement = Agreement::of(&job.out, &scans.join("truth"))?;
        let shapes = Shapes::of(&scene, models)?;
        let unmet = met::unmet(&scene, &job.out, engine)?;
        row.n_robots = scene.robots.len();
        for (robot, thin) in thin.into_iter().enumerate() {
            let is_found = agreement.robots[robot]
                .found
                .as_ref()
                .is_some_and(|found| found.model == scene.robots[robot].model);
            if is_found {
                row.n_checked += 1;
                if let Some(robot) = SceneRobot::of(&scene, models, robot) {
                    let truth = PathTruths::new(&robot, &shapes, &unmet)?;
                    let truths = SiteTruth { paths: &truth, shapes: &shapes };
                    let seen = self.robot(&robot, truths, thin, &job.out, row.seed)?;
                    row.paths.extend(seen.paths);
                    for (name, own) in seen.points {
                        row.points.entry(name).or_default().add(own);
                    }
                }
            }
        }
        row.seconds[2] = started.elapsed().as_secs_f64();
        Ok(())
    }

    /// All paths of one robot, and the points around it.
    fn robot(
        &self,
        robot: &SceneRobot<'_>,
        SiteTruth { paths: truth, shapes }: SiteTruth<'_>,
        mut paths: Vec<DrawnPath>,
        out: &Path,
        seed: u64,
    ) -> Result<SeenSite> {
        let &SceneRobot { scene, number, .. } = robot;
        let mut random = Random::keyed(&[seed, number as u64, 0x9A7]);
        paths.extend(draw::paths(robot, &truth.met, &mut random)?);
        let request = CheckRequest {
            out: out.to_path_buf(),
            trajectories: Vec::new(),
            robot: None,
            robots: None,
            margin: self.bench.margin,
            degrees: false,
        };
        let choose = |result: &ResultFile, _: &_| Ok(vec![nearest(result, scene, number)?]);
        let look = |place: &RobotSite<'_>, _: &[usize]| {
            let one = |path: &DrawnPath| self.path(place, robot, path, truth);
            let points = evidence::counts(robot, shapes, place.obstacles())?;
            Ok(vec![SeenSite { paths: paths.iter().map(one).collect::<Result<_>>()?, points }])
        };
        let seen = at_robots(&request, choose, self.means, self.engine, look)?.pop();
        seen.ok_or_else(|| Error::new(Kind::Bug, "a robot was not looked at"))
    }

    /// One path.
    fn path(
        &self,
        place: &RobotSite<'_>,
        robot: &SceneRobot<'_>,
        path: &DrawnPath,
        truth: &PathTruths<'_>,
    ) -> Result<PathRow> {
        let (model, from) = (robot.model, &robot.posture[..]);
        self.engine.cancel.check()?;
        let margin = self.bench.margin;
        let asked = Trajectory {
            joints: model.free.iter().map(|&j| model.joints[j].name.clone()).collect(),
            points: vec![from.to_vec(), path.to.clone()],
            times: Vec::new(),
        };
        let report = place.check_path(&asked, self.engine)?;
        let (is, nearest) = truth.of(from, &path.to, margin);
        Ok(PathRow {
            robot: robot.scene.robots[robot.number].name.clone(),
            model: model.name.clone(),
            drawn: path.drawn,
            truth: is,
            gap: nearest.gap,
            nearest: format!("{} to {}", model.links[nearest.link].name, nearest.name),
            at: nearest.at,
            outcome: report.outcome.word().into(),
            doubts: report.doubts.iter().map(|d| d.word().into()).collect(),
            contacts: contacts(&report),
            from: from.to_vec(),
            to: path.to.clone(),
        })
    }
}

/// Index in the result of the robot that stands nearest to a robot of the scene.
fn nearest(result: &ResultFile, scene: &Scene, robot: usize) -> Result<usize> {
    let at = geometry::Vector::from(scene.robots[robot].xyz);
    let off = |i: &usize| (geometry::Vector::from(result.robots[*i].base_pose.xyz) - at).norm();
    let stands = |i: &usize| result.robots[*i].verdict != "refused";
    let all = (0..result.robots.len()).filter(stands);
    all.min_by(|a, b| off(a).total_cmp(&off(b)))
        .ok_or_else(|| Error::bad_input("no robot stands in the result"))
}

/// The nearest obstacle, as text.
fn contacts(report: &PathReport) -> Vec<String> {
    let words = |c: &clearance::Contact| {
        let as_found = if c.as_found { ", as found" } else { "" };
        let hangs = if c.is_attached { " (hangs)" } else { "" };
        let place = c.at.map_or(String::new(), |at| {
            let [x, y, z] =
                (report.world_from_base * at).coords.map(|v| (v * 1e3).round() * 1e-3).into();
            format!(" at {x} {y} {z}")
        });
        format!(
            "{:?} {:?} {}{hangs}{as_found} n{} gap {:.3}{place} on {:.2}",
            c.level,
            c.what,
            report.links.get(c.link).map_or("", |l| l),
            c.n,
            c.gap,
            c.worst
        )
    };
    report.contacts.iter().map(words).collect()
}
