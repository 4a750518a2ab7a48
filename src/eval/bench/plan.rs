//! `bench plan`: draws halls with their own libraries, estimates each with `plan`, runs it, and
//! compares prediction and measurement. `scripts/plan_rates.py` computes the rates from its rows.

use super::journal::Journal;
use super::process_watch::{Watched, watch};
use super::throughput::{Scanned, ThroughputBench, arguments, scan};
use crate::detect::library;
use crate::engine::Engine;
use crate::estimate::{Estimate, estimate};
use crate::io::copy_folder;
use crate::job::{Job, Means, memory_words};
use contract::words::fixed;
use contract::{Error, Result};
use export::atomic;
use serde::Serialize;
use simulate::random::Random;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Request of the bench.
#[derive(Debug, Clone)]
pub struct PlanBench {
    /// Number of halls.
    pub n_halls: usize,
    /// Number of the first hall.
    pub first: usize,
    /// Seed of all random values.
    pub seed: u64,
    /// Robot library that the halls' own libraries are chosen from.
    pub robots: PathBuf,
    /// Where rows, table and, with `keep`, scans go.
    pub out: PathBuf,
    /// Whether scans are kept.
    pub keep: bool,
}

/// Numbers of robots in a hall: none, and many.
const N_ROBOTS: [usize; 10] = [0, 1, 1, 2, 3, 4, 5, 6, 8, 10];
/// Beams of a hall, fewest and most.
const BEAMS: [f64; 2] = [2e6, 30e6];
/// Fewest and most models of a hall's library.
const N_MODELS: [usize; 2] = [3, 12];
/// Fewest and most scanners of a hall, and scanners beyond the number of its robots.
const N_SCANS: [usize; 2] = [2, 12];
const MORE_SCANS: usize = 3;

/// Random values of a hall.
struct Hall {
    seed: u64,
    n_robots: usize,
    n_scans: usize,
    n_beams: u64,
    format: Scanned,
    models: Vec<String>,
}

/// One hall.
#[derive(Debug, Clone, Serialize)]
struct PlanRow {
    seed: u64,
    n_robots: usize,
    n_scans: usize,
    models: Vec<String>,
    library_bytes: u64,
    format: Scanned,
    n_threads: usize,
    /// Estimate of `plan`, and its time, seconds.
    planned: Estimate,
    plan_seconds: f64,
    /// The run: its stages, time, processor time and memory.
    measured: Watched,
    /// Bytes of the store and of what was written.
    store_bytes: u64,
    output_bytes: u64,
    /// Mean number of processes that waited for a processor in the last minute, where the system
    /// states it.
    load: f64,
}

/// Draws halls, plans and runs them; returns the table.
///
/// # Errors
/// A library or folder that cannot be used; a run that fails.
pub fn plans(bench: &PlanBench, means: &Means, engine: &Engine) -> Result<String> {
    let mut names = Vec::new();
    for entry in std::fs::read_dir(&bench.robots)
        .map_err(|e| Error::of_file("the library cannot be opened", &bench.robots, e))?
    {
        let path = entry?.path();
        if robot::urdf_of(&path).is_ok() {
            names.extend(path.file_name().map(|name| name.to_string_lossy().into_owned()));
        }
    }
    names.sort();
    let mut journal = Journal::create(&bench.out, "plan.jsonl")?;
    let mut rows = Vec::new();
    for k in bench.first..bench.first + bench.n_halls {
        engine.cancel.check()?;
        let row = run(bench, &Hall::drawn(bench.seed * 1000 + k as u64, &names), means, engine)?;
        journal.add(&row)?;
        engine.progress.say(&line(&row));
        rows.push(row);
    }
    let table = table(&rows);
    atomic::write(&bench.out.join("plan.md"), table.as_bytes())?;
    Ok(table)
}

impl Hall {
    fn drawn(seed: u64, names: &[String]) -> Self {
        let mut random = Random::keyed(&[seed, 0x97A]);
        let n_robots = N_ROBOTS[random.below(N_ROBOTS.len())];
        let n_scans = (N_SCANS[0] + n_robots + random.below(MORE_SCANS)).min(N_SCANS[1]);
        let n_beams = BEAMS[0] * (BEAMS[1] / BEAMS[0]).powf(random.unit());
        let format = [Scanned::Las, Scanned::E57][random.below(2)];
        let n_models = N_MODELS[0] + random.below(N_MODELS[1] - N_MODELS[0] + 1);
        let mut models = names.to_vec();
        while models.len() > n_models {
            models.remove(random.below(models.len()));
        }
        Self { seed, n_robots, n_scans, n_beams: n_beams as u64, format, models }
    }
}

fn run(bench: &PlanBench, hall: &Hall, means: &Means, engine: &Engine) -> Result<PlanRow> {
    let dir = bench.out.join(hall.seed.to_string());
    let (robots, scans, out) = (dir.join("robots"), dir.join("scans"), dir.join("result"));
    for model in &hall.models {
        copy_folder::copy(&bench.robots.join(model), &robots.join(model))?;
    }
    let input = scans.join(match hall.format {
        Scanned::Las | Scanned::Las20 => "scans.las",
        Scanned::E57 => "scans.e57",
    });
    if !scans.join("truth/truth.json").exists() {
        let drawing = ThroughputBench {
            sizes: Vec::new(),
            n_scans: Some(hall.n_scans),
            n_robots: hall.n_robots,
            n_runs: 1,
            format: hall.format,
            seed: hall.seed,
            robots: None,
            out: dir.clone(),
            keep: true,
            truth: false,
        };
        let quiet = engine.quiet();
        scan(&drawing, hall.n_beams, hall.n_scans, &scans, &robots, means, &quiet)?;
    }
    let _ = std::fs::remove_dir_all(&out);
    let scanners = hall.format != Scanned::E57;
    let job = Job {
        scanners: scanners.then(|| scans.join("scanners.toml")),
        ..Job::new(vec![input.clone()], robots.clone(), out.clone(), means.clone())
    };
    let started = Instant::now();
    let planned = estimate(&job, &engine.quiet())?;
    let plan_seconds = started.elapsed().as_secs_f64();
    let measured = watch(&arguments(&input, &scans, &robots, &out, means)?)?;
    let store_bytes = size(&out.join("store"))?;
    let output_bytes = size(&out)? - store_bytes;
    let _ = std::fs::remove_dir_all(if bench.keep { &out } else { &dir });
    Ok(PlanRow {
        seed: hall.seed,
        n_robots: hall.n_robots,
        n_scans: hall.n_scans,
        models: hall.models.clone(),
        library_bytes: library::bytes(&robots),
        format: hall.format,
        n_threads: means.n_threads,
        planned,
        plan_seconds,
        measured,
        store_bytes,
        output_bytes,
        load: load(),
    })
}

/// Bytes of all files below a folder.
fn size(folder: &Path) -> Result<u64> {
    let mut sum = 0;
    for entry in std::fs::read_dir(folder).map_err(|e| Error::from(e).at(folder.display()))? {
        let path = entry?.path();
        let meta = path.symlink_metadata()?;
        sum += if meta.is_dir() { size(&path)? } else { meta.len() };
    }
    Ok(sum)
}

/// Processes that ran or waited over the last minute, on average; not a number where the system
/// does not tell.
fn load() -> f64 {
    let text = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    text.split(' ').next().and_then(|first| first.parse().ok()).unwrap_or(f64::NAN)
}

impl PlanRow {
    /// Processor time of the run divided by its threads, seconds: its time on an otherwise idle
    /// machine.
    fn alone(&self) -> f64 {
        self.measured.cpu_seconds / self.n_threads as f64
    }
}

fn line(row: &PlanRow) -> String {
    let [least, most] = row.planned.seconds;
    format!(
        "hall {}: {} robots, {} models, {:.1} M points: {:.0} s of processors, {:.0} s; planned {least:.0} to {most:.0} s in {:.1} s",
        row.seed,
        row.n_robots,
        row.models.len(),
        row.planned.n_points as f64 / 1e6,
        row.measured.cpu_seconds,
        row.measured.seconds,
        row.plan_seconds
    )
}

/// Predicted and measured values, one line per hall.
fn table(rows: &[PlanRow]) -> String {
    let mut out = String::from(
        "| hall | robots | models | M points | plan took, s | time planned, s | measured, s | processors / threads, s | that / planned | memory planned | measured | disk planned | measured | load |\n",
    );
    let _ = writeln!(out, "|{}", " --- |".repeat(14));
    for row in rows {
        let PlanRow { planned, measured, .. } = row;
        let [least, most] = planned.seconds;
        let middle = (least * most).sqrt();
        let _ = writeln!(
            out,
            "| {} {:?} | {} | {} | {} | {:.1} | {least:.0} to {most:.0} | {:.0} | {:.0} | {} | {} | {} | {} | {} | {} |",
            row.seed,
            row.format,
            row.n_robots,
            row.models.len(),
            fixed(planned.n_points as f64 / 1e6, 1),
            row.plan_seconds,
            measured.seconds,
            row.alone(),
            fixed(row.alone() / middle, 2),
            memory_words(planned.memory_bytes),
            memory_words(measured.resident_bytes),
            memory_words(planned.store_bytes + planned.output_bytes),
            memory_words(row.store_bytes + row.output_bytes),
            fixed(row.load, 1)
        );
    }
    out
}
