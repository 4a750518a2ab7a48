//! `bench plant`: runs the main job on suites of random cells and lines from files, and compares
//! robots and labels with the truth, as a table.

use super::cases::{CaseRow, CaseToRun, Cases};
use super::condition;
use super::condition::{Condition, Mounting, PLAIN};
use super::draw::draw;
use super::kinds;
use super::kinds::{KindScores, kind_table};
use super::labels::MIN_LINK_POINTS;
use super::request::{DrawnCases, check_suites, chosen};
use crate::detect::library;
use crate::engine::Engine;
use crate::eval::compare::Agreement;
use crate::eval::virtual_scan::{Formats, scan_scene};
use crate::job::{Job, Means};
use crate::plan;
use contract::{Error, Result};
use export::atomic;
use robot::Model;
use serde::Serialize;
use simulate::random::Random;
use simulate::scene::{RegistrationError, Scanner};
use simulate::{Plant, Scene, Work, WorkCell, work_cell};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Request of the bench.
#[derive(Debug, Clone)]
pub struct PlantBench {
    /// Seed, library and folders.
    pub drawn: DrawnCases,
    /// Names of suites; all where empty.
    pub suites: Vec<String>,
    /// Cases of each suite; its own number where left out.
    pub n_cases: Option<usize>,
}

/// A cell of three robots.
const CELL: Plant = Plant {
    seed: 0,
    n_robots: 3,
    n_rows: 1,
    n_scanners: 5,
    step_deg: 0.13,
    is_tight: false,
    moves: false,
};

/// Angle between the beams of scans of robots at work, degrees: hoses of 24 mm are three beams wide
/// 3 m away.
const WORK_STEP_DEG: f64 = 0.15;

/// Kind of the plant of a case.
enum Drawing {
    /// A plant, all of whose robots are known.
    Plant(Plant),
    /// A plant: the models of its robots are left out of the library.
    Strange(Plant),
    /// A plant whose scans are registered as scans usually are.
    Shifted(Plant),
    /// One robot in clutter, bolted to such a thing.
    Hung(Mounting),
    /// Robots at work.
    Working(Work),
}

impl Drawing {
    fn scene(&self, seed: u64, models: &[Model]) -> Result<Scene> {
        match self {
            Self::Plant(plant) | Self::Strange(plant) => {
                simulate::plant(&Plant { seed, ..plant.clone() }, models)
            }
            Self::Shifted(plant) => {
                let mut scene = simulate::plant(&Plant { seed, ..plant.clone() }, models)?;
                scene.scanners.iter_mut().enumerate().for_each(|(k, s)| shift(s, seed, k));
                Ok(scene)
            }
            Self::Working(work) => {
                let cell = WorkCell { seed, work: *work, n_scanners: 3, step_deg: WORK_STEP_DEG };
                work_cell(&cell, models)
            }
            Self::Hung(mount) => {
                let robots: Vec<usize> =
                    (0..models.len()).filter(|m| !models[*m].is_tool()).collect();
                let model = robots[seed as usize % robots.len()];
                let condition =
                    Condition { mount: *mount, mixed: true, clutter: 0.7, n_beams: 2e6, ..PLAIN };
                let case = condition::DrawnCase { suite: "mounts", seed, model, condition };
                Ok(draw(&case, &models[model])?.scene)
            }
        }
    }
}

/// Gives a scanner errors of registration and range.
fn shift(scanner: &mut Scanner, seed: u64, k: usize) {
    let mut random = Random::keyed(&[seed, k as u64, 0x5E]);
    let [shift, turn, bias] = condition::REGISTRATION;
    scanner.registration = RegistrationError::drawn([shift, turn], &mut random);
    scanner.range_bias = bias * random.normals()[0];
}

/// A suite: name, number of cases, and what the k-th is drawn from.
type PlantSuite = (&'static str, usize, fn(usize) -> Drawing);

/// Name of the suite whose robots are missing in the library.
const STRANGERS: &str = "strangers";

const SUITES: &[PlantSuite] = &[
    ("cells", 20, |_| Drawing::Plant(CELL)),
    ("lines", 5, |k| {
        Drawing::Plant(Plant { n_robots: 8 + k % 5, n_rows: 2, n_scanners: 10, ..CELL })
    }),
    ("tight", 10, |_| Drawing::Plant(Plant { is_tight: true, ..CELL })),
    ("two", 10, |_| Drawing::Plant(Plant { n_robots: 1, n_scanners: 2, ..CELL })),
    ("empty", 20, |_| Drawing::Plant(Plant { n_robots: 0, n_scanners: 3, ..CELL })),
    (STRANGERS, 10, |_| Drawing::Strange(Plant { n_robots: 1, n_scanners: 4, ..CELL })),
    ("moved", 20, |_| Drawing::Plant(Plant { n_robots: 2, n_scanners: 6, moves: true, ..CELL })),
    ("registered", 10, |k| {
        Drawing::Shifted(Plant { n_robots: [4, 1][k % 2], n_scanners: [6, 4][k % 2], ..CELL })
    }),
    ("mounts", 12, |k| Drawing::Hung([Mounting::Ceiling, Mounting::Wall, Mounting::Tilted][k % 3])),
    ("touch", 20, |_| Drawing::Working(Work::Touch)),
    ("carry", 20, |_| Drawing::Working(Work::Carry)),
    ("hoses", 20, |_| Drawing::Working(Work::Hoses)),
    ("joined", 20, |_| Drawing::Working(Work::Joined)),
];

/// Least number of points of an object that is examined for wrong labels.
const MIN_OBJECT_POINTS: u64 = 200;

/// One case.
#[derive(Debug, Clone, Default, Serialize)]
struct PlantRow {
    suite: String,
    seed: u64,
    failed: Option<String>,
    n_points: u64,
    n_robots: usize,
    /// Found at the right place; of those with the right model, or one that is said to be alike.
    n_found: usize,
    n_right: usize,
    /// Of the right ones trusted; of the wrong or unknown ones trusted.
    n_trusted: usize,
    n_wrong_trusted: usize,
    n_invented: usize,
    /// Robots that moved, and those of which both postures were found.
    n_moved: usize,
    n_both: usize,
    f1: f64,
    /// Intersection over union of each link.
    ious: Vec<f64>,
    /// Points by what they truly lie on.
    kinds: KindScores,
    /// Share of points of hoses, tools and parts that are said to move.
    attached: Option<f64>,
    /// Share of points that stand still said to move; and that of the thing that lost most, with
    /// its name.
    lost: f64,
    worst_lost: f64,
    worst_object: String,
    /// Largest error of a joint said to be determined, degrees.
    worst_joint: f64,
    seconds: f64,
    notes: Vec<String>,
}

/// Runs the suites; returns the table.
pub fn plants(bench: &PlantBench, means: &Means, engine: &Engine) -> Result<String> {
    // Large libraries take a minute to load.
    let cases = cases(bench)?;
    let temporary = tempfile::tempdir()?;
    let robots = bench.drawn.library(temporary.path())?;
    let models = library::load(&robots, &means.settings.robot, None, engine)?.models;
    chosen(&models, &[])?;
    let known = KnownRobots { folder: robots, models, kept: temporary.path().join("models") };
    let quiet = engine.quiet();
    let place = Cases { name: "plant", drawn: &bench.drawn, temporary: temporary.path() };
    let case =
        |row: &mut PlantRow, of: &Drawing, dir: &Path| run(row, of, &known, dir, means, &quiet);
    place.run(cases, case, table, engine)
}

fn cases(bench: &PlantBench) -> Result<Vec<CaseToRun<PlantRow, Drawing>>> {
    let names: Vec<&str> = SUITES.iter().map(|s| s.0).collect();
    check_suites(&bench.suites, &names)?;
    let wanted = |name: &str| bench.suites.is_empty() || bench.suites.iter().any(|s| s == name);
    let mut out = Vec::new();
    for (at, (name, n, draw)) in SUITES.iter().enumerate() {
        for k in bench.drawn.numbers(bench.n_cases.unwrap_or(*n)) {
            let seed = bench.drawn.seed * 100_000 + at as u64 * 1000 + k as u64;
            if wanted(name) {
                let row = PlantRow { suite: (*name).into(), seed, ..PlantRow::default() };
                out.push(CaseToRun { name: format!("{name}-{seed}"), row, of: draw(k) });
            }
        }
    }
    Ok(out)
}

/// The robots that stand in the plants.
struct KnownRobots {
    folder: PathBuf,
    models: Vec<Model>,
    /// Folder of loaded models, which the first run fills for later ones.
    kept: PathBuf,
}

/// One case: drawn, scanned, run, compared.
fn run(
    row: &mut PlantRow,
    drawing: &Drawing,
    known: &KnownRobots,
    dir: &Path,
    means: &Means,
    engine: &Engine,
) -> Result<()> {
    let models = &known.models;
    let scene = drawing.scene(row.seed, models)?;
    let is_strange = matches!(drawing, Drawing::Strange(_));
    atomic::write(&made(dir)?.join("scene.toml"), scene.to_toml()?.as_bytes())?;
    let scans = dir.join("scans");
    let truth = scan_scene(&scene, models, &scans, Formats { las: false, ..Formats::ALL }, engine)?;
    row.n_points = truth.scans.iter().map(|s| s.n_points).sum();
    let robots = if is_strange {
        let others = dir.join("robots");
        let strange: Vec<&str> = scene.robots.iter().map(|r| r.model.as_str()).collect();
        link_others(&known.folder, &made(&others)?, &strange)?;
        others
    } else {
        known.folder.clone()
    };
    let job = Job::new(vec![scans.join("scans.e57")], robots, dir.join("result"), means.clone());
    let models_of_job = job.output()?.models();
    if known.kept.exists() {
        crate::io::copy_folder::copy(&known.kept, &models_of_job)?;
    }
    let started = Instant::now();
    plan::run(&job, engine)?;
    row.seconds = started.elapsed().as_secs_f64();
    if !is_strange && !known.kept.exists() {
        crate::io::copy_folder::copy(&models_of_job, &known.kept)?;
    }
    let agreement = Agreement::of(&job.out, &scans.join("truth"))?;
    judge(row, &agreement);
    Ok(())
}

/// The folder, made.
fn made(dir: &Path) -> Result<PathBuf> {
    std::fs::create_dir_all(dir).map_err(|e| Error::from(e).at(dir.display()))?;
    Ok(dir.to_path_buf())
}

/// A library without some models.
fn link_others(library: &Path, to: &Path, without: &[&str]) -> Result<()> {
    for entry in std::fs::read_dir(library)? {
        let entry = entry?;
        let name = entry.file_name();
        if entry.path().is_dir() && !without.iter().any(|w| name == **w) {
            crate::io::copy_folder::copy(&entry.path(), &to.join(&name))?;
        }
    }
    Ok(())
}

fn judge(row: &mut PlantRow, agreement: &Agreement) {
    row.n_robots = agreement.robots.len();
    row.n_invented = agreement.n_invented;
    row.n_moved = agreement.robots.iter().filter(|r| r.n_postures > 1).count();
    for robot in &agreement.robots {
        let Some(found) = &robot.found else {
            row.notes.push(format!("{} ({}) not found", robot.name, robot.model));
            continue;
        };
        let is_trusted = found.verdict == "trusted";
        row.n_found += 1;
        row.n_right += usize::from(found.is_right);
        row.n_trusted += usize::from(found.is_right && is_trusted);
        row.n_wrong_trusted += usize::from(!found.is_right && is_trusted);
        row.n_both += usize::from(robot.n_postures > 1 && found.n_postures == robot.n_postures);
        if !found.is_right {
            row.notes.push(format!(
                "{} ({}) is {} {}",
                robot.name, robot.model, found.verdict, found.model
            ));
        } else if !is_trusted {
            row.notes.push(format!("{} ({}) is {}", robot.name, robot.model, found.verdict));
        }
    }
    row.worst_joint = agreement.worst_joint_deg();
    row.f1 = agreement.points.f1();
    row.ious = agreement.link_ious(MIN_LINK_POINTS);
    let share = |[part, whole]: [u64; 2]| part as f64 / whole.max(1) as f64;
    row.attached = (agreement.points.attached[1] > 0).then(|| share(agreement.points.attached));
    row.lost = share([agreement.points.fixed[1], agreement.points.fixed[0]]);
    row.kinds = KindScores::of(agreement);
    let still = agreement
        .objects
        .iter()
        .zip(&agreement.by_object)
        .filter(|(name, count)| count[0] >= MIN_OBJECT_POINTS && !kinds::moves(name));
    for (name, [all, lost, _]) in still {
        let lost = share([*lost, *all]);
        if lost > row.worst_lost {
            (row.worst_lost, row.worst_object) = (lost, name.clone());
        }
    }
}

impl CaseRow for PlantRow {
    fn fail(&mut self, why: String) {
        self.failed = Some(why);
    }

    fn line(&self) -> String {
        if let Some(why) = &self.failed {
            return format!("{} {}: failed: {why}", self.suite, self.seed);
        }
        let mut text = format!(
            "{} {}: {} of {} found, {} right, {} trusted, {} invented, F1 {:.4}, lost {:.4} %, most {:.2} % ({}), {:.1} s",
            self.suite,
            self.seed,
            self.n_found,
            self.n_robots,
            self.n_right,
            self.n_trusted,
            self.n_invented,
            self.f1,
            100.0 * self.lost,
            100.0 * self.worst_lost,
            self.worst_object,
            self.seconds
        );
        if self.n_moved > 0 {
            let _ = write!(text, ", {} of {} moved ones seen", self.n_both, self.n_moved);
        }
        if !self.notes.is_empty() {
            let _ = write!(text, "; {}", self.notes.join(", "));
        }
        text
    }
}

/// All suites for people.
fn table(rows: &[PlantRow]) -> String {
    let mut out = String::from(
        "| suite | cases | robots | found | right model | trusted | wrong, trusted | invented | moved, seen | F1 median / least | link IoU median / 10 % | attachments | fixed lost mean / largest % | thing that lost most % | s median |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    for (name, ..) in SUITES {
        let own: Vec<&PlantRow> = rows.iter().filter(|r| r.suite == *name).collect();
        if !own.is_empty() {
            let _ = writeln!(out, "| {name} | {} | {} |", counts(&own), figures(&own));
        }
    }
    out.push_str(&kind_table(SUITES.iter().map(|(name, ..)| {
        let own = rows.iter().filter(|r| r.suite == *name && r.failed.is_none());
        (*name, own.map(|r| (&r.kinds, r.f1)).collect())
    })));
    let odd = rows.iter().filter(|r| r.failed.is_some() || !r.notes.is_empty() || r.n_invented > 0);
    let odd: String = odd.map(|r| format!("\n- {}", r.line())).collect();
    if !odd.is_empty() {
        let _ =
            writeln!(out, "\nNot all found, right and trusted, or with a robot too many:\n{odd}");
    }
    out
}

/// Robots of a suite, as cells of its row.
fn counts(own: &[&PlantRow]) -> String {
    let sum = |of: fn(&PlantRow) -> usize| own.iter().map(|r| of(r)).sum::<usize>();
    format!(
        "{} | {} | {} | {} | {} | {} | {} | {} of {}",
        own.len(),
        sum(|r| r.n_robots),
        sum(|r| r.n_found),
        sum(|r| r.n_right),
        sum(|r| r.n_trusted),
        sum(|r| r.n_wrong_trusted),
        sum(|r| r.n_invented),
        sum(|r| r.n_both),
        sum(|r| r.n_moved)
    )
}

/// Labels and time of a suite, as cells of its row; a dash where nothing was to be compared.
fn figures(own: &[&PlantRow]) -> String {
    let sorted = |of: &dyn Fn(&PlantRow) -> Vec<f64>| {
        let done = own.iter().filter(|r| r.failed.is_none());
        let mut all: Vec<f64> = done.flat_map(|r| of(r)).collect();
        all.sort_by(f64::total_cmp);
        all
    };
    let at = |all: &[f64], share: f64, digits: usize| {
        let index = ((all.len() as f64 - 1.0) * share).round().max(0.0) as usize;
        all.get(index).map_or("–".into(), |v| format!("{v:.digits$}"))
    };
    // Points of unknown robots must not be labelled as those of a known one.
    let is_asked = |r: &PlantRow| r.n_robots > 0 && r.suite != STRANGERS;
    let f1 = sorted(&|r| if is_asked(r) { vec![r.f1] } else { vec![] });
    let ious = sorted(&|r| r.ious.clone());
    let attached = sorted(&|r| r.attached.filter(|_| is_asked(r)).into_iter().collect());
    let lost = sorted(&|r| vec![100.0 * r.lost]);
    let worst = sorted(&|r| vec![100.0 * r.worst_lost]);
    let seconds = sorted(&|r| vec![r.seconds]);
    format!(
        "{} / {} | {} / {} | {} | {:.4} / {} | {} | {}",
        at(&f1, 0.5, 4),
        at(&f1, 0.0, 4),
        at(&ious, 0.5, 3),
        at(&ious, 0.1, 3),
        at(&attached, 0.5, 3),
        lost.iter().sum::<f64>() / lost.len().max(1) as f64,
        at(&lost, 1.0, 4),
        at(&worst, 1.0, 2),
        at(&seconds, 0.5, 1)
    )
}
