//! The suites of the rescan bench with new scans in other frames, and with lines of equal cells:
//! which are registered to the plant and how exactly, which are refused, and which are placed
//! wrongly.

use super::cases::{CaseRow, CaseToRun, Cases};
use super::request::{RescanBench, RescanSuite};
use crate::cache::VerifiedFiles;
use crate::detect::library;
use crate::engine::Engine;
use crate::eval::virtual_scan::{Formats, scan_scene};
use crate::job::{Job, Means};
use crate::plan;
use crate::rescan::{Cell, Frame, RescanRequest, rescan};
use crate::result::plant_state::PlantState;
use contract::{Error, Kind, Result};
use export::ResultFile;
use geometry::{Pose, Vector};
use nalgebra::{Translation3, UnitQuaternion};
use serde::Serialize;
use simulate::random::Random;
use simulate::scene::RegistrationError;
use simulate::{Ends, ProductionLine, Scene, line, sessions};
use std::fmt::Write as _;
use std::path::Path;
use std::time::Instant;

/// Greatest shift of a frame, metres.
const SHIFT: f64 = 50.0;
/// Error of a scan's pose beyond which its place is wrong: metres, radians (0.02°).
const EXACT: (f64, f64) = (0.003, 0.000_349);
/// Number of cells of a line.
const N_CELLS: usize = 5;

/// One case.
#[derive(Debug, Clone, Default, Serialize)]
struct FrameRow {
    seed: u64,
    failed: Option<String>,
    /// Objects at the ends of a line.
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
    /// Reason of a refusal.
    why: Option<String>,
    /// Seconds of the rescan.
    seconds: f64,
}

/// Draws plants or lines with new scans in other frames, rescans them, and returns the table.
pub fn frames(bench: &RescanBench, means: &Means, engine: &Engine) -> Result<String> {
    let temporary = tempfile::tempdir()?;
    let robots = bench.drawn.library(temporary.path())?;
    let quiet = engine.quiet();
    let name = if bench.suite == RescanSuite::Lines { "lines" } else { "frames" };
    let place = Cases { name, drawn: &bench.drawn, temporary: temporary.path() };
    let cases = CaseToRun::numbered(&bench.drawn, bench.n_cases, |seed| FrameRow {
        seed,
        ..FrameRow::default()
    });
    let case = |row: &mut FrameRow, k: &usize, dir: &Path| {
        case(row, &FrameCase { bench, number: *k, robots: &robots, means, engine: &quiet }, dir)
    };
    place.run(cases, case, table, engine)
}

/// The case that is run, with library and folders.
struct FrameCase<'a> {
    bench: &'a RescanBench,
    number: usize,
    robots: &'a Path,
    means: &'a Means,
    engine: &'a Engine,
}

fn case(row: &mut FrameRow, asked: &FrameCase<'_>, dir: &Path) -> Result<()> {
    let &FrameCase { bench, number, robots, means, engine } = asked;
    let models = library::load(robots, &means.settings.robot, None, engine)?.models;
    let [then, mut now] = scenes(row, bench, number, &models)?;
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
    let request = RescanRequest {
        base: dir.join("base"),
        cell: Cell::Seen,
        frame: Frame::Find,
        job: job("now", "again"),
    };
    let started = Instant::now();
    let came = rescan(&request, engine);
    row.seconds = started.elapsed().as_secs_f64();
    match came {
        Ok(_) => judge(row, &then, &now, &dir.join("again")),
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
    row: &mut FrameRow,
    bench: &RescanBench,
    number: usize,
    models: &[robot::Model],
) -> Result<[Scene; 2]> {
    if bench.suite == RescanSuite::Lines {
        let ends = [Ends::Open, Ends::Long, Ends::Walls][number % 3];
        row.ends = Some(format!("{ends:?}"));
        let wanted = ProductionLine {
            seed: row.seed,
            n_cells: N_CELLS,
            step_deg: bench.size.step_deg,
            ends,
        };
        return Ok(line(&wanted, models)?.0);
    }
    sessions(&bench.size.plant(row.seed), models)
}

/// A frame: what brings coordinates of the plant into those that files state.
fn drawn(row: &mut FrameRow) -> Pose {
    let mut random = Random::keyed(&[row.seed, 0xF4A]);
    let (far, way) = (random.between(0.0, SHIFT), random.between(0.0, std::f64::consts::TAU));
    let yaw = random.between(-180.0, 180.0);
    row.frame = [far * way.cos(), far * way.sin(), yaw];
    let turn = UnitQuaternion::from_axis_angle(&Vector::z_axis(), yaw.to_radians());
    let shift = Vector::new(row.frame[0], row.frame[1], random.between(-2.0, 2.0));
    Pose::from_parts(Translation3::from(shift), turn)
}

/// Compares the registered poses of the new scans with the true ones.
fn judge(row: &mut FrameRow, then: &Scene, now: &Scene, out: &Path) -> Result<()> {
    let laid = &PlantState::read(&VerifiedFiles::open(out)?)?.scans[then.scanners.len()..];
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

impl CaseRow for FrameRow {
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

fn table(rows: &[FrameRow]) -> String {
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
