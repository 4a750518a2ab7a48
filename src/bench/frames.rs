//! Seeds and sizes in; plants whose new scans are in frames that are drawn, and lines of equal
//! cells, out: which of them a rescan laid on the plant, how exactly, which it refused, and which
//! it laid on a wrong place.

use super::cases::{Case, CaseRow, Cases};
use super::rescan::RescanBench;
use super::robots_of;
use crate::engine::Engine;
use crate::job::{Job, Means};
use crate::rescan::{Cell, Frame, Request, State, rescan};
use crate::reuse::Vouched;
use crate::scanning::{Formats, scan_scene};
use crate::{library, plan};
use contract::{Error, Kind, Result};
use export::ResultFile;
use geometry::{Pose, Vector};
use nalgebra::{Translation3, UnitQuaternion};
use serde::Serialize;
use simulate::random::Random;
use simulate::scene::RegistrationError;
use simulate::{Ends, Plant, ProductionLine, Scene, line, sessions};
use std::fmt::Write as _;
use std::path::Path;
use std::time::Instant;

/// What is drawn.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Suite {
    /// Plants of which one cell is scanned again, in the plant's frame.
    #[default]
    Same,
    /// The same, the new scans in frames that are drawn.
    Frames,
    /// Lines of equal cells, the new scans in frames that are drawn.
    Lines,
}

/// Shift of a frame, metres, at most.
const SHIFT: f64 = 50.0;
/// A scan that is laid farther off than this is wrong: metres, radians (0.02°).
const EXACT: (f64, f64) = (0.003, 0.000_349);
/// Cells of a line.
const N_CELLS: usize = 5;

/// One case.
#[derive(Debug, Clone, Default, Serialize)]
struct Row {
    seed: u64,
    failed: Option<String>,
    /// What stands at the ends of a line.
    ends: Option<String>,
    /// Shift in the plan, metres, and yaw, degrees, of the frame.
    frame: [f64; 3],
    /// `laid`, `refused`, or `wrong`.
    came: String,
    /// Largest error of a scan's place, metres, and turn, degrees.
    off: [f64; 2],
    /// Share of what can be compared that agrees, and by how much more other places are
    /// contradicted.
    share: f64,
    margin: Option<i64>,
    /// Why it was refused.
    why: Option<String>,
    /// Seconds of the rescan.
    seconds: f64,
}

/// Runs the cases; returns the table.
pub(super) fn frames(bench: &RescanBench, means: &Means, engine: &Engine) -> Result<String> {
    let temporary = tempfile::tempdir()?;
    let robots = robots_of(bench.robots.as_deref(), temporary.path())?;
    let quiet = engine.quiet();
    let name = if bench.suite == Suite::Lines { "lines" } else { "frames" };
    let (out, keep) = (bench.out.as_deref(), bench.keep);
    let place = Cases { name, out, keep, temporary: temporary.path() };
    let seed = |k: usize| bench.seed * 100_000 + k as u64;
    let draw = |k: usize| Case {
        name: seed(k).to_string(),
        row: Row { seed: seed(k), ..Row::default() },
        of: k,
    };
    let cases = (bench.first..bench.first + bench.n_cases).map(draw).collect();
    let case = |row: &mut Row, k: &usize, dir: &Path| {
        case(row, (bench, *k), (&robots, dir), (means, &quiet))
    };
    place.run(cases, case, table, engine)
}

fn case(
    row: &mut Row,
    (bench, k): (&RescanBench, usize),
    (robots, dir): (&Path, &Path),
    (means, engine): (&Means, &Engine),
) -> Result<()> {
    let models = library::load(robots, &means.settings.robot, None, engine)?.models;
    let [then, mut now] = scenes(row, (bench, k), &models)?;
    let frame = drawn(row);
    for scanner in &mut now.scanners {
        let (real, stated) = (scanner.world_from_scan()?, scanner.stated_world_from_scan()?);
        scanner.registration = RegistrationError::between(&real, &(frame * stated));
    }
    let formats = Formats { las: false, labels: false, ..Formats::ALL };
    for (scene, name) in [(&then, "then"), (&now, "now")] {
        scan_scene(scene, &models, &dir.join(name), formats, engine)?;
    }
    let job = |scans: &str, out: &str| {
        let inputs = vec![dir.join(scans).join("scans.e57")];
        Job::new(inputs, robots.to_path_buf(), dir.join(out), means.clone())
    };
    plan::run(&job("then", "base"), engine)?;
    let request = Request {
        base: dir.join("base"),
        cell: Cell::Seen,
        frame: Frame::Find,
        job: job("now", "again"),
    };
    let started = Instant::now();
    let came = rescan(&request, engine);
    row.seconds = started.elapsed().as_secs_f64();
    match came {
        Ok(_) => judge(row, (&then, &now), &dir.join("again")),
        Err(error) if error.kind() == Kind::BadInput => {
            row.came = "refused".into();
            row.why = Some(error.to_string());
            Ok(())
        }
        Err(error) => Err(error),
    }
}

/// The sessions of a case.
fn scenes(
    row: &mut Row,
    (bench, k): (&RescanBench, usize),
    models: &[robot::Model],
) -> Result<[Scene; 2]> {
    if bench.suite == Suite::Lines {
        let ends = [Ends::Open, Ends::Long, Ends::Walls][k % 3];
        row.ends = Some(format!("{ends:?}"));
        let wanted =
            ProductionLine { seed: row.seed, n_cells: N_CELLS, step_deg: bench.step_deg, ends };
        return Ok(line(&wanted, models)?.0);
    }
    let wanted = Plant {
        seed: row.seed,
        n_robots: bench.n_robots,
        n_rows: bench.n_robots.div_ceil(5),
        n_scanners: bench.n_scanners,
        step_deg: bench.step_deg,
        is_tight: false,
        moves: false,
    };
    sessions(&wanted, models)
}

/// A frame: what brings coordinates of the plant into those that files state.
fn drawn(row: &mut Row) -> Pose {
    let mut random = Random::keyed(&[row.seed, 0xF4A]);
    let (far, way) = (random.between(0.0, SHIFT), random.between(0.0, std::f64::consts::TAU));
    let yaw = random.between(-180.0, 180.0);
    row.frame = [far * way.cos(), far * way.sin(), yaw];
    let turn = UnitQuaternion::from_axis_angle(&Vector::z_axis(), yaw.to_radians());
    let shift = Vector::new(row.frame[0], row.frame[1], random.between(-2.0, 2.0));
    Pose::from_parts(Translation3::from(shift), turn)
}

/// Compares poses of the new scans, as they were laid, with the true ones.
fn judge(row: &mut Row, (then, now): (&Scene, &Scene), out: &Path) -> Result<()> {
    let laid = &State::read(&Vouched::open(out)?)?.scans[then.scanners.len()..];
    for (scan, scanner) in laid.iter().zip(&now.scanners) {
        let real = scanner.world_from_scan()?;
        let off = real.inverse() * scan.world_from_scan;
        row.off[0] = row.off[0].max(off.translation.vector.norm());
        row.off[1] = row.off[1].max(off.rotation.angle().to_degrees());
    }
    let is_exact = row.off[0] <= EXACT.0 && row.off[1].to_radians() <= EXACT.1;
    row.came = if is_exact { "laid" } else { "wrong" }.into();
    let entry = ResultFile::read(out)?.rescan.and_then(|rescan| rescan.frame);
    let entry = entry.ok_or_else(|| Error::new(Kind::Bug, "the result names no frame"))?;
    let (n, against) = (
        entry.n_on_old + entry.n_on_new,
        entry.n_where_old_saw_through + entry.n_where_new_saw_through,
    );
    row.share = n as f64 / (n + against).max(1) as f64;
    row.margin = entry.margin;
    Ok(())
}

impl CaseRow for Row {
    fn fail(&mut self, why: String) {
        self.failed = Some(why);
    }

    fn line(&self) -> String {
        if let Some(why) = &self.failed {
            return format!("{}: failed: {why}", self.seed);
        }
        let [x, y, yaw] = self.frame;
        let mut line = format!("{}: frame {x:.1}, {y:.1} m, {yaw:.1}°: {}", self.seed, self.came);
        if let Some(ends) = &self.ends {
            let _ = write!(line, " ({ends} ends)");
        }
        if let Some(why) = &self.why {
            let _ = write!(line, ": {why}");
        } else {
            let margin = self.margin.map_or("no other place".into(), |m| format!("margin {m}"));
            let _ = write!(
                line,
                ", off by {:.2} mm, {:.4}°, {:.1} % agree, {margin}",
                1e3 * self.off[0],
                self.off[1],
                100.0 * self.share
            );
        }
        let _ = write!(line, "; {:.1} s", self.seconds);
        line
    }
}

fn table(rows: &[Row]) -> String {
    let n = |came: &str| rows.iter().filter(|r| r.failed.is_none() && r.came == came).count();
    let n_failed = rows.iter().filter(|r| r.failed.is_some()).count();
    let mut out = format!(
        "{} cases: {} laid on within {:.0} mm and {:.2}°, {} refused, {} wrong, {n_failed} failed\n\n",
        rows.len(),
        n("laid"),
        1e3 * EXACT.0,
        EXACT.1.to_degrees(),
        n("refused"),
        n("wrong")
    );
    rows.iter().for_each(|row| {
        let _ = writeln!(out, "- {}", row.line());
    });
    out
}
