//! `bench throughput`: draws plants of given sizes, scans them to files and runs the main job in
//! its own process. Reports points per second of every stage beside the limits of the machine, and
//! resident memory.

use super::machine_limits::{Copied, copy, forget, memory};
use super::process_watch::{Watched, command, watch};
use crate::detect::library;
use crate::engine::Engine;
use crate::eval::demo;
use crate::eval::virtual_scan::{Formats, scan_scene};
use crate::job::{Means, memory_words};
use contract::{Error, Kind, Result};
use export::atomic;
use serde::{Deserialize, Serialize};
use simulate::Plant;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Request of the bench.
#[derive(Debug, Clone)]
pub struct ThroughputBench {
    /// Beams of each plant.
    pub sizes: Vec<u64>,
    /// Number of scanners; `None` for one per 50 million beams.
    pub n_scans: Option<usize>,
    /// Number of robots of each plant.
    pub n_robots: usize,
    /// Number of runs of each plant; the median counts.
    pub n_runs: usize,
    /// Format of the scans.
    pub format: Scanned,
    /// Seed of the plants.
    pub seed: u64,
    /// Robot library; the demo's robots where left out.
    pub robots: Option<PathBuf>,
    /// Folder of scans, results and figures.
    pub out: PathBuf,
    /// Whether scans are kept: the next bench of the same plant finds them.
    pub keep: bool,
    /// Whether the truth of each point is written beside the scans.
    pub truth: bool,
}

/// Format that the virtual scanner writes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Scanned {
    /// LAS 1.4, format 6: 30 bytes a point
    Las,
    /// LAS 1.4, format 0: 20 bytes a point
    Las20,
    /// E57, bit-packed, with rows and columns
    E57,
}

/// Number of beams of one scan where the number of scans is not given: a full scan of a common
/// scanner.
const SCAN_BEAMS: u64 = 50_000_000;
/// Most bytes that are copied to measure the disk: where the disk is short, the rest is taken in
/// proportion.
const MOST_COPIED: u64 = 8 << 30;
/// Elevations and azimuths of the drawn scanners, square degrees.
const DOME: f64 = 130.0 * 360.0;

/// One size.
#[derive(Debug, Clone, Serialize)]
struct ThroughputRow {
    n_points: u64,
    n_bytes: u64,
    n_scans: usize,
    n_robots: usize,
    format: Scanned,
    copied: Copied,
    /// Bytes per second that one thread copies in memory.
    memory: f64,
    /// Number of trusted robots of the median run.
    n_trusted: usize,
    /// All runs; the one of median time first.
    runs: Vec<Watched>,
}

/// Runs all sizes; returns the table.
pub fn throughput(bench: &ThroughputBench, means: &Means, engine: &Engine) -> Result<String> {
    made(&bench.out)?;
    let robots = match &bench.robots {
        Some(dir) => dir.clone(),
        None => {
            demo::write_robots(&bench.out.join("robots"))?;
            bench.out.join("robots")
        }
    };
    let mut rows = Vec::new();
    for &size in &bench.sizes {
        engine.cancel.check()?;
        let row = run(bench, size, &robots, means, engine)?;
        engine.progress.say(&line(&row));
        rows.push(row);
        let whole = serde_json::json!({ "version": env!("CARGO_PKG_VERSION"), "rows": rows });
        let text = serde_json::to_string_pretty(&whole)
            .map_err(|e| Error::new(Kind::Bug, "rows cannot be written").because(e))?;
        atomic::write(&bench.out.join("throughput.json"), text.as_bytes())?;
        atomic::write(&bench.out.join("throughput.md"), table(&rows).as_bytes())?;
        atomic::write(
            &bench.out.join("throughput.svg"),
            super::time_plot::plot(&points(&rows)).as_bytes(),
        )?;
    }
    Ok(table(&rows))
}

fn run(
    bench: &ThroughputBench,
    size: u64,
    robots: &Path,
    means: &Means,
    engine: &Engine,
) -> Result<ThroughputRow> {
    let n_scans = bench.n_scans.unwrap_or(size.div_ceil(SCAN_BEAMS).max(2) as usize);
    let dir = bench.out.join(format!("{size}"));
    let scans = dir.join("scans");
    let input = scans.join(match bench.format {
        Scanned::Las | Scanned::Las20 => "scans.las",
        Scanned::E57 => "scans.e57",
    });
    // The scanners' poses are the last to be written before the truth: with them all is there.
    let n_points = match counted(&scans) {
        Some(n) if input.exists() => n,
        _ => scan(bench, size, n_scans, &scans, robots, means, engine)?,
    };
    let n_bytes = std::fs::metadata(&input).map_err(|e| Error::from(e).at(input.display()))?.len();
    let copied = copy(&input, MOST_COPIED)?;
    let out = dir.join("result");
    let arguments = arguments(&input, &scans, robots, &out, means)?;
    let mut runs = Vec::new();
    for _ in 0..bench.n_runs.max(1) {
        engine.cancel.check()?;
        let _ = std::fs::remove_dir_all(&out);
        forget(&input)?;
        runs.push(watch(&arguments)?);
    }
    let n_trusted = trusted(&out);
    let _ = std::fs::remove_dir_all(if bench.keep { &out } else { &dir });
    runs.sort_by(|a, b| a.seconds.total_cmp(&b.seconds));
    let median = runs.len() / 2;
    runs.swap(0, median);
    let (n_robots, format) = (bench.n_robots, bench.format);
    let memory = memory();
    Ok(ThroughputRow {
        n_points,
        n_bytes,
        n_scans,
        n_robots,
        format,
        copied,
        memory,
        n_trusted,
        runs,
    })
}

/// Draws the plant and scans it; returns its number of points.
pub(super) fn scan(
    bench: &ThroughputBench,
    size: u64,
    n_scans: usize,
    scans: &Path,
    robots: &Path,
    means: &Means,
    engine: &Engine,
) -> Result<u64> {
    let models = library::load(robots, &means.settings.robot, None, engine)?.models;
    let plant = Plant {
        seed: bench.seed,
        n_robots: bench.n_robots,
        n_rows: 2,
        n_scanners: n_scans,
        step_deg: (DOME * n_scans as f64 / size as f64).sqrt(),
        is_tight: false,
        moves: false,
    };
    let scene = simulate::plant(&plant, &models)?;
    atomic::write(&made(scans)?.join("scene.toml"), scene.to_toml()?.as_bytes())?;
    let las = bench.format != Scanned::E57;
    let short = bench.format == Scanned::Las20;
    let truth = scan_scene(
        &scene,
        &models,
        scans,
        Formats { las, short, e57: !las, labels: bench.truth },
        engine,
    )?;
    Ok(truth.scans.iter().map(|s| s.n_points).sum())
}

/// Points of scans that are there already.
fn counted(scans: &Path) -> Option<u64> {
    #[derive(Deserialize)]
    struct TruthFile {
        scans: Vec<Scan>,
    }
    #[derive(Deserialize)]
    struct Scan {
        n_points: u64,
    }
    let text = std::fs::read_to_string(scans.join("truth/truth.json")).ok()?;
    let truth: TruthFile = serde_json::from_str(&text).ok()?;
    Some(truth.scans.iter().map(|s| s.n_points).sum())
}

/// Robots of a result that are trusted.
fn trusted(out: &Path) -> usize {
    let text = std::fs::read_to_string(out.join("result.json")).unwrap_or_default();
    let result: serde_json::Value = serde_json::from_str(&text).unwrap_or_default();
    let robots = result["robots"].as_array().map_or(&[][..], Vec::as_slice);
    robots.iter().filter(|r| r["verdict"] == "trusted").count()
}

/// The command line of the measured run, with the means of this one.
pub(super) fn arguments(
    input: &Path,
    scans: &Path,
    robots: &Path,
    out: &Path,
    means: &Means,
) -> Result<Vec<String>> {
    let mut out = command("run", input, robots, out, means)?;
    if input.extension().is_some_and(|e| e == "las") {
        out.extend(["--scanners".into(), scans.join("scanners.toml").display().to_string()]);
    }
    Ok(out)
}

fn made(dir: &Path) -> Result<&Path> {
    std::fs::create_dir_all(dir).map_err(|e| Error::from(e).at(dir.display()))?;
    Ok(dir)
}

impl ThroughputRow {
    fn median(&self) -> &Watched {
        &self.runs[0]
    }

    /// Time of the whole run divided by that of a copy of the same file.
    fn over_copy(&self) -> f64 {
        self.median().seconds / self.copied.seconds_for(self.n_bytes)
    }

    fn rate(&self) -> f64 {
        self.n_points as f64 / self.median().seconds
    }
}

fn line(row: &ThroughputRow) -> String {
    format!(
        "{:.0} M points: {:.1} s, {:.2} M points/s, {:.2} × copying the file, {} resident",
        row.n_points as f64 / 1e6,
        row.median().seconds,
        row.rate() / 1e6,
        row.over_copy(),
        memory_words(row.median().resident_bytes)
    )
}

fn table(rows: &[ThroughputRow]) -> String {
    let mut out = String::from(
        "| points | input | scans | robots, trusted | s | spread | M points/s | × copy | CPU s | resident | without mapped files |\n",
    );
    out.push_str(&format!("|{}\n", " --- |".repeat(11)));
    for row in rows {
        let (run, gb) = (row.median(), row.n_bytes as f64 / 1e9);
        let all = || row.runs.iter().map(|r| r.seconds);
        let _ = writeln!(
            out,
            "| {:.1} M | {gb:.2} GB {:?} | {} | {}, {} | {:.1} | {:.1} to {:.1} | {:.2} | {:.2} | {:.0} | {} | {} |",
            row.n_points as f64 / 1e6,
            row.format,
            row.n_scans,
            row.n_robots,
            row.n_trusted,
            run.seconds,
            all().fold(f64::MAX, f64::min),
            all().fold(0.0, f64::max),
            row.rate() / 1e6,
            row.over_copy(),
            run.cpu_seconds,
            memory_words(run.resident_bytes),
            memory_words(run.own_bytes)
        );
    }
    for row in rows {
        stages(&mut out, row);
    }
    out
}

/// Every stage of the median run.
fn stages(out: &mut String, row: &ThroughputRow) {
    let _ = writeln!(
        out,
        "\n{:.1} M points; copying the file, synced: {:.2} GB/s; copying memory, one thread: {:.1} GB/s.\n\n\
         | stage | s | M points/s | GB/s of the input | share of the copy's rate |\n| --- | --- | --- | --- | --- |",
        row.n_points as f64 / 1e6,
        row.copied.n_bytes as f64 / row.copied.seconds / 1e9,
        row.memory / 1e9
    );
    let per_point = row.n_bytes as f64 / row.n_points as f64;
    let copying = row.copied.n_bytes as f64 / row.copied.seconds;
    for stage in &row.median().stages {
        let rate = stage.points as f64 / stage.seconds.max(1e-3);
        let words = if stage.points == 0 {
            "– | – | –".into()
        } else {
            let bytes = rate * per_point;
            format!("{:.1} | {:.2} | {:.2}", rate / 1e6, bytes / 1e9, bytes / copying)
        };
        let _ = writeln!(out, "| {} | {:.1} | {words} |", stage.stage, stage.seconds);
    }
}

/// Points, seconds, and seconds of a copy of each size.
fn points(rows: &[ThroughputRow]) -> Vec<[f64; 3]> {
    let of = |row: &ThroughputRow| {
        [row.n_points as f64, row.median().seconds, row.copied.seconds_for(row.n_bytes)]
    };
    rows.iter().map(of).collect()
}
