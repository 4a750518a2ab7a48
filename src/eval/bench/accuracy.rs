//! `bench accuracy`: measures postures, standard deviations and verdicts on suites of random cells,
//! as tables.
//!
//! Each case is drawn from a seed, scanned in memory by the virtual scanner and sent through the
//! same stages as the main job, from strips of points on: nothing but the scans' points and stated
//! poses goes in. Suites and their goals follow METHOD.md §19.

use super::cell::{ScannedCell, Then};
use super::condition::{DrawnCase, FitMethod, Suites, cases, suite_names};
use super::journal::Journal;
use super::request::{DrawnCases, check_suites, chosen};
use super::score::{AccuracyRow, score};
use super::{draw, other_tables, plot, table};
use crate::detect::library;
use crate::detect::search::PreparedLibrary;
use crate::engine::Engine;
use crate::job::{Means, Method};
use contract::{Error, Kind, Result};
use export::atomic;
use robot::Model;
use std::path::Path;
use std::time::Instant;

/// Request of the bench.
#[derive(Debug, Clone)]
pub struct AccuracyBench {
    /// Seed, library and folders; only rows and tables are kept.
    pub drawn: DrawnCases,
    /// Names of suites; all where empty.
    pub suites: Vec<String>,
    /// Number of cases of each suite; `None` for the suite's own number.
    pub n_cases: Option<usize>,
    /// Only models whose name contains one of these; all where empty.
    pub models: Vec<String>,
    /// Whether each cell is searched for all models of the library, or only for the true one.
    pub whole_library: bool,
}

/// Runs the suites and returns the table.
pub fn accuracy(bench: &AccuracyBench, means: &Means, engine: &Engine) -> Result<String> {
    // Large libraries take a minute to load.
    check_suites(&bench.suites, &suite_names())?;
    let temporary = tempfile::tempdir()?;
    let robots = bench.drawn.library(temporary.path())?;
    let models = library::load(&robots, &means.settings.robot, None, engine)?.models;
    let chosen = chosen(&models, &bench.models)?;
    let numbers = Suites { names: &bench.suites, n_cases: bench.n_cases, drawn: &bench.drawn };
    let cases = cases(&numbers, &models, &chosen);
    let mut journal =
        bench.drawn.out.as_deref().map(|dir| Journal::create(dir, "accuracy.jsonl")).transpose()?;
    let library = PreparedLibrary::new(&models);
    let mut rows = Vec::with_capacity(cases.len());
    let store = tempfile::tempdir()?;
    // Messages of stages about single cells would hide those about cases.
    let mut quiet = Engine::new(engine.n_workers);
    quiet.cancel = engine.cancel.clone();
    for (i, case) in cases.iter().enumerate() {
        engine.cancel.check()?;
        let row = run(case, &library, bench.whole_library, store.path(), means, &quiet);
        let line = row.line();
        if let Some(journal) = &mut journal {
            journal.add(&row)?;
        }
        engine.progress.say(&format!("{}/{} {line}", i + 1, cases.len()));
        rows.push(row);
    }
    let table = table::table(&rows) + &other_tables::tables(&rows);
    if let Some(dir) = &bench.drawn.out {
        atomic::write(&dir.join("accuracy.md"), table.as_bytes())?;
        atomic::write(&dir.join("accuracy.csv"), table::csv(&rows)?.as_bytes())?;
        atomic::write(&dir.join("accuracy.json"), json(&rows)?.as_bytes())?;
        atomic::write(&dir.join("errors.svg"), plot::errors(&rows).as_bytes())?;
        atomic::write(&dir.join("reliability.svg"), plot::reliability(&rows).as_bytes())?;
    }
    Ok(table)
}

/// All rows, with the program version.
fn json(rows: &[AccuracyRow]) -> Result<String> {
    let whole = serde_json::json!({ "version": env!("CARGO_PKG_VERSION"), "rows": rows });
    serde_json::to_string_pretty(&whole)
        .map_err(|e| Error::new(Kind::Bug, "rows cannot be written").because(e))
}

/// Standard deviations of shift and turn for scans with exact poses: a nanometre, a nanoradian.
const HELD: f64 = 1e-9;

/// Runs one case; an error becomes a row.
fn run(
    case: &DrawnCase,
    library: &PreparedLibrary<'_>,
    whole_library: bool,
    store: &Path,
    means: &Means,
    engine: &Engine,
) -> AccuracyRow {
    let models = library.models();
    let started = Instant::now();
    let mount = draw::mount(case, models);
    let mut real = models.to_vec();
    if let Some(mount) = &mount {
        real[case.model] = mount.tooled(models, case.model);
    }
    let seen = draw::draw(case, &real[case.model]).and_then(|drawn| {
        let few = few(case, models, whole_library);
        let cell = ScannedCell::scan(&drawn.scene, &drawn.models(&real, case), engine)?;
        let mut settings = means.settings.clone();
        let truth = (drawn.world_from_base, drawn.posture.clone());
        let starts = draw::starts(case, &drawn);
        let then = match case.condition.way {
            FitMethod::FromTruth => Then::Adjust(Some(&truth)),
            FitMethod::SequentialAdjusted => Then::Adjust(None),
            _ if !starts.is_empty() => Then::Converge(&starts),
            _ => Then::Nothing,
        };
        match case.condition.way {
            FitMethod::Sequential | FitMethod::SequentialAdjusted => {
                settings.method = Method::Paper
            }
            FitMethod::ScansHeld => settings.fit.scan_sigma[..2].fill(HELD),
            FitMethod::Whole | FitMethod::FromTruth => {}
        }
        settings.fit.calibrate |= case.condition.calibrate;
        let search = |library: &PreparedLibrary<'_>| {
            cell.search(library, then, store, &settings, means, engine)
        };
        let found = match &few {
            Some(few) => search(&PreparedLibrary::new(few)),
            None => search(library),
        }?;
        Ok((drawn, found))
    });
    match seen {
        Ok((drawn, found)) => score(case, &real, mount.as_ref(), &drawn, &found),
        Err(error) => {
            AccuracyRow::failed(case, &models[case.model], &error, started.elapsed().as_secs_f64())
        }
    }
}

/// Models that a case is searched for, unless they are all of the library.
fn few(case: &DrawnCase, models: &[Model], whole_library: bool) -> Option<Vec<Model>> {
    if whole_library && case.condition.perturbed_deg == 0.0 {
        return None;
    }
    let tools = models.iter().filter(|m| case.condition.tool && m.is_tool());
    Some(std::iter::once(&models[case.model]).chain(tools).cloned().collect())
}
