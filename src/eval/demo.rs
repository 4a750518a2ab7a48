//! The demo: builds the demo's robots, scans a virtual cell, runs the main job and compares the
//! result with the truth.

use super::compare::Agreement;
use super::virtual_scan::{Formats, scan_scene};
use crate::detect::library;
use crate::engine::Engine;
use crate::job::{Job, Means, Outcome};
use crate::plan;
use crate::result::run_record::{MeasuredRun, RunRecord};
use contract::{Error, Kind, Result};
use export::atomic;
use simulate::Scene;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Seed of the cell: any other gives another cell.
const SEED: u64 = 1;

/// By how much a joint of the cell stands elsewhere at another time, radians (20°).
const TURN: f64 = 0.349;

/// Keeps everything in `out`, or in a temporary folder. Each scanner sends about `n_beams` beams,
/// or as many as a crew would take.
pub fn run(
    out: Option<&Path>,
    n_beams: Option<u64>,
    means: &Means,
    engine: &Engine,
) -> Result<Outcome> {
    let temporary = out.is_none().then(tempfile::tempdir).transpose()?;
    let dir: PathBuf = match (out, &temporary) {
        (Some(out), _) => out.to_path_buf(),
        (None, Some(dir)) => dir.path().to_path_buf(),
        (None, None) => return Err(Error::new(Kind::Bug, "the demo has no folder")),
    };
    let robots = dir.join("robots");
    write_robots(&robots)?;
    let started = Instant::now();
    let models = library::load(&robots, &means.settings.robot, None, engine)?.models;
    let mut scene = simulate::demo_scene(SEED, &models)?;
    if n_beams.is_some() {
        scene.scanners.iter_mut().for_each(|scanner| scanner.raster.n_beams = n_beams);
    }
    atomic::write(&dir.join("scene.toml"), scene.to_toml()?.as_bytes())?;
    atomic::write(&dir.join("scene_later.toml"), later(&scene).to_toml()?.as_bytes())?;
    let truth = scan_scene(&scene, &models, &dir.join("scans"), Formats::ALL, engine)?;
    let scanned = started.elapsed().as_secs_f64();
    let job =
        Job::new(vec![dir.join("scans/scans.e57")], robots, dir.join("result"), means.clone());
    let n_scanning = engine.progress.reports().len();
    let started = Instant::now();
    let outcome = plan::run(&job, engine)?;
    let seconds = started.elapsed().as_secs_f64();
    let run = MeasuredRun {
        seconds,
        peak_memory_bytes: peak_memory(),
        stages: &engine.progress.reports()[n_scanning..],
    };
    RunRecord::keep(&job.out, &run, means, &outcome)?;
    let agreement = Agreement::of(&job.out, &dir.join("scans/truth"))?;
    let n_points: u64 = truth.scans.iter().map(|s| s.n_points).sum();
    let mut summary = outcome.summary;
    let _ = writeln!(summary, "\ncompared with the truth:\n{}", agreement.table());
    let _ = writeln!(
        summary,
        "{n_points} points; scanned in {scanned:.1} s, main job in {seconds:.1} s: {:.2} M points/s{}",
        n_points as f64 / seconds / 1e6,
        peak_memory().map_or_else(String::new, |b| format!(
            ", peak memory {:.0} MiB",
            b as f64 / f64::from(1 << 20)
        ))
    );
    if out.is_some() {
        let _ = writeln!(
            summary,
            "everything is in {0}; to look at in a browser: {0}/result/report.html",
            dir.display()
        );
    } else {
        let _ = writeln!(summary, "`stillpoint demo --out DIR` keeps scene, scans and results");
    }
    Ok(Outcome { summary, ..outcome })
}

/// The cell at another time: other errors of the scanner, and the last robot has turned. It is for
/// whoever tries a rescan.
fn later(scene: &Scene) -> Scene {
    let mut later = Scene { seed: scene.seed + 1, ..scene.clone() };
    if let Some(turned) = later.robots.last_mut().and_then(|r| r.posture.values_mut().next()) {
        *turned += TURN;
    }
    later
}

/// Writes the demo's robot library.
pub fn write_robots(dir: &Path) -> Result<()> {
    for file in simulate::demo_robots::files() {
        let path = dir.join(&file.0);
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(|e| Error::from(e).at(folder.display()))?;
        }
        atomic::write(&path, &file.1)?;
    }
    Ok(())
}

/// Largest resident memory of this process so far, bytes, where the system tells.
#[must_use]
pub fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
    let kib: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib * 1024)
}
