//! `bench check`: seeds in; cells scanned, run and then asked about paths of their robots, of which
//! the meshes tell whether they collide; false alarms and misses, by reason, out.

mod draw;
mod table;
mod truth;

use super::cases::{Case, CaseRow, Cases};
use super::robots_of;
use crate::check::trajectory::Trajectory;
use crate::check::{Place, Report, Request, at_robot};
use crate::detect::library;
use crate::engine::Engine;
use crate::eval::compare::Agreement;
use crate::eval::virtual_scan::{Formats, scan_scene};
use crate::job::{Job, Means};
use crate::plan;
use contract::{Error, Result};
use draw::{Drawn, DrawnPath};
use export::{ResultFile, atomic};
use robot::Model;
use serde::Serialize;
use simulate::random::Random;
use simulate::{Plant, Scene, Shapes};
use std::path::{Path, PathBuf};
use std::time::Instant;
use truth::{TOUCH, Truth};

/// What is drawn.
#[derive(Debug, Clone)]
pub struct CheckBench {
    /// Cells.
    pub n_cases: usize,
    /// Number of the first of them.
    pub first: usize,
    /// Seed of all.
    pub seed: u64,
    /// Robots of each cell.
    pub n_robots: usize,
    /// Scanners of each cell.
    pub n_scanners: usize,
    /// Angle between beams, degrees.
    pub step_deg: f64,
    /// What is nearer to a robot is in its way, metres.
    pub margin: f64,
    /// Robot library; the demo's robots where left out.
    pub robots: Option<PathBuf>,
    /// Where rows and tables go; scenes, scans and results, too, with `keep`.
    pub out: Option<PathBuf>,
    /// Keep scenes, scans and results.
    pub keep: bool,
}

/// What the scene says of a path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
enum True {
    /// It keeps the margin, and scanners saw all of its space and the margin about it.
    Free,
    /// It keeps the margin.
    Unseen,
    /// It comes nearer than the margin, and touches nothing.
    Grazes,
    /// It touches something.
    Collides,
}

/// A path that was checked.
#[derive(Debug, Clone, Serialize)]
struct PathRow {
    robot: String,
    model: String,
    drawn: Drawn,
    truth: True,
    /// Metres, to what, and where on the way.
    gap: f64,
    nearest: String,
    at: f64,
    /// What the check said.
    outcome: String,
    doubts: Vec<String>,
    /// What comes near, the worst first.
    contacts: Vec<String>,
    /// Waypoints, to look at it again.
    from: Vec<f64>,
    to: Vec<f64>,
}

/// A cell.
#[derive(Debug, Clone, Default, Serialize)]
struct Row {
    seed: u64,
    failed: Option<String>,
    n_robots: usize,
    /// Robots that were found as what they are.
    n_checked: usize,
    paths: Vec<PathRow>,
    /// Scanning, the main job, and checking with its truth, seconds.
    seconds: [f64; 3],
}

/// Runs the cells; returns the table.
///
/// # Errors
/// A library that cannot be read, files that cannot be written.
pub fn checks(bench: &CheckBench, means: &Means, engine: &Engine) -> Result<String> {
    let temporary = tempfile::tempdir()?;
    let robots = robots_of(bench.robots.as_deref(), temporary.path())?;
    let models = library::load(&robots, &means.settings.robot, None, engine)?.models;
    let quiet = engine.quiet();
    let place = Cases {
        name: "check",
        out: bench.out.as_deref(),
        keep: bench.keep,
        temporary: temporary.path(),
    };
    let seed = |k: usize| bench.seed * 100_000 + k as u64;
    let draw = |k: usize| Case {
        name: seed(k).to_string(),
        row: Row { seed: seed(k), ..Row::default() },
        of: (),
    };
    let cases = (bench.first..bench.first + bench.n_cases).map(draw).collect();
    let case = |row: &mut Row, _: &(), dir: &Path| {
        Bench { bench, models: &models, robots: &robots, means, engine: &quiet }.case(row, dir)
    };
    let all = |rows: &[Row]| {
        let write =
            |dir: &Path| atomic::write(&dir.join("check.csv"), table::csv(rows)?.as_bytes());
        let csv = bench.out.as_deref().map(write);
        let note = match csv {
            Some(Err(error)) => format!("check.csv could not be written: {error}\n"),
            _ => String::new(),
        };
        table::table(rows) + &note
    };
    place.run(cases, case, all, engine)
}

/// What all cells share.
struct Bench<'a> {
    bench: &'a CheckBench,
    models: &'a [Model],
    robots: &'a Path,
    means: &'a Means,
    engine: &'a Engine,
}

impl Bench<'_> {
    fn case(&self, row: &mut Row, dir: &Path) -> Result<()> {
        let &Self { bench, models, engine, .. } = self;
        let wanted = Plant {
            seed: row.seed,
            n_robots: bench.n_robots,
            n_rows: 1,
            n_scanners: bench.n_scanners,
            step_deg: bench.step_deg,
            is_tight: false,
            moves: false,
        };
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
        row.n_robots = scene.robots.len();
        for (robot, thin) in thin.into_iter().enumerate() {
            let is_found = agreement.robots[robot]
                .found
                .as_ref()
                .is_some_and(|found| found.model == scene.robots[robot].model);
            if is_found {
                row.n_checked += 1;
                row.paths.extend(self.robot((&scene, &shapes, robot), thin, &job.out, row.seed)?);
            }
        }
        row.seconds[2] = started.elapsed().as_secs_f64();
        Ok(())
    }

    /// All paths of one robot.
    fn robot(
        &self,
        (scene, shapes, robot): (&Scene, &Shapes, usize),
        mut paths: Vec<DrawnPath>,
        out: &Path,
        seed: u64,
    ) -> Result<Vec<PathRow>> {
        let Some((model, from)) = draw::robot_of(scene, self.models, robot) else {
            return Ok(Vec::new());
        };
        let truth = Truth::new(scene, shapes, (robot, model, &from))?;
        let mut random = Random::keyed(&[seed, robot as u64, 0x9A7]);
        let base = scene.robots[robot].world_from_base();
        paths.extend(draw::paths(scene, (model, &base, &from), &truth, &mut random)?);
        let request = Request {
            out: out.to_path_buf(),
            trajectory: PathBuf::new(),
            robot: None,
            robots: None,
            margin: self.bench.margin,
            degrees: false,
        };
        let choose = |result: &ResultFile, _: &_| number(result, scene, robot);
        let look = |place: &Place<'_>| {
            let one =
                |path: &DrawnPath| self.path(place, (scene, robot), (model, &from, path), &truth);
            paths.iter().map(one).collect::<Result<Vec<PathRow>>>()
        };
        at_robot(&request, choose, (self.means, self.engine), look)
    }

    fn path(
        &self,
        place: &Place<'_>,
        (scene, robot): (&Scene, usize),
        (model, from, path): (&Model, &[f64], &DrawnPath),
        truth: &Truth<'_>,
    ) -> Result<PathRow> {
        self.engine.cancel.check()?;
        let margin = self.bench.margin;
        let asked = Trajectory {
            joints: model.free.iter().map(|&j| model.joints[j].name.clone()).collect(),
            points: vec![from.to_vec(), path.to.clone()],
            times: Vec::new(),
        };
        let report = place.look(&asked, self.engine)?;
        let nearest = truth.along(from, &path.to, margin);
        let is = match nearest.gap {
            ..=TOUCH => True::Collides,
            gap if gap < margin => True::Grazes,
            _ if truth.is_seen(from, &path.to, margin) => True::Free,
            _ => True::Unseen,
        };
        Ok(PathRow {
            robot: scene.robots[robot].name.clone(),
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

/// The number in the result of a robot of the scene: the one that stands nearest.
fn number(result: &ResultFile, scene: &Scene, robot: usize) -> Result<usize> {
    let at = geometry::Vector::from(scene.robots[robot].xyz);
    let off = |i: &usize| (geometry::Vector::from(result.robots[*i].base_pose.xyz) - at).norm();
    let stands = |i: &usize| result.robots[*i].verdict != "refused";
    let all = (0..result.robots.len()).filter(stands);
    all.min_by(|a, b| off(a).total_cmp(&off(b)))
        .ok_or_else(|| Error::bad_input("no robot stands in the result"))
}

/// What comes near, in words.
fn contacts(report: &Report) -> Vec<String> {
    let words = |c: &clearance::Contact| {
        let as_found = if c.as_found { ", as found" } else { "" };
        let hangs = if c.hangs { " (hangs)" } else { "" };
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

impl PathRow {
    /// It keeps the margin, and something is said to be in its way.
    fn is_wolf(&self) -> bool {
        matches!(self.truth, True::Free | True::Unseen)
            && matches!(&*self.outcome, "near" | "blocked")
    }

    /// The reason that counts: the worst contact's kind, or the doubts.
    fn why(&self) -> String {
        if matches!(&*self.outcome, "near" | "blocked") {
            let worst = self.contacts.first().map_or("a joint cannot get there", |c| c);
            let hangs = if worst.contains("(hangs)") { ", what hangs on it" } else { "" };
            let kind: Vec<&str> = worst.split(' ').take(2).collect();
            return kind.join(" ") + hangs;
        }
        self.doubts.join(", ")
    }

    fn line(&self) -> String {
        format!(
            "{} ({}) {:?} {:?} {:.4} m {} at {:.2}: {} [{}] {}",
            self.robot,
            self.model,
            self.drawn,
            self.truth,
            self.gap,
            self.nearest,
            self.at,
            self.outcome,
            self.doubts.join(" "),
            self.contacts.first().map_or("", |c| c),
        )
    }
}

impl CaseRow for Row {
    fn fail(&mut self, why: String) {
        self.failed = Some(why);
    }

    fn line(&self) -> String {
        if let Some(why) = &self.failed {
            return format!("{}: failed: {why}", self.seed);
        }
        let count = |is: &dyn Fn(&PathRow) -> bool| self.paths.iter().filter(|p| is(p)).count();
        format!(
            "{}: {} of {} robots, {} paths; free in seen space {}, of them called free {}; colliding {}, missed {}; free, called near or blocked {}; scan {:.1} s, run {:.1} s, check {:.1} s",
            self.seed,
            self.n_checked,
            self.n_robots,
            self.paths.len(),
            count(&|p| p.truth == True::Free),
            count(&|p| p.truth == True::Free && p.outcome == "free"),
            count(&|p| p.truth == True::Collides),
            count(&|p| p.truth == True::Collides && p.outcome == "free"),
            count(&PathRow::is_wolf),
            self.seconds[0],
            self.seconds[1],
            self.seconds[2],
        )
    }
}
