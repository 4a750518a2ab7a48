//! How a run went: times, rates and memory, which differ from run to run. They are kept in the
//! store beside the result, so that the result itself stays the same bytes.

use crate::cache::VerifiedFiles;
use crate::engine::progress::{StageReport, title};
use crate::io::own_paths::without_links;
use crate::job::{Means, Outcome, memory_words};
use contract::words::count;
use contract::{Error, Kind, Result};
use export::atomic;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Place of the record within an output folder.
const NAME: &str = "store/run.json";
/// Name and version of the format.
const SCHEMA: &str = "stillpoint.run/1";
/// Most bytes of a record that are read.
const MOST: u64 = 1 << 20;

/// Times, rates and memory of the run that made a result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunRecord {
    schema: String,
    /// Digest of the list of files of the result.
    result: String,
    /// Wall-clock time, seconds.
    seconds: f64,
    /// Greatest resident memory, bytes, where the system tells.
    peak_memory_bytes: Option<u64>,
    /// Limit of memory, bytes.
    memory_bytes: u64,
    /// Number of worker threads.
    n_threads: usize,
    /// Messages about pieces of earlier runs that were used again.
    reused: Vec<String>,
    stages: Vec<RecordedStage>,
}

/// Time and work of a stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct RecordedStage {
    name: String,
    seconds: f64,
    n_items: u64,
    n_points: u64,
}

/// What was measured of a run that has ended.
pub struct MeasuredRun<'a> {
    /// Wall-clock time, seconds.
    pub seconds: f64,
    /// Greatest resident memory, bytes, where the system tells.
    pub peak_memory_bytes: Option<u64>,
    /// Reports of its stages, in the order in which they ended.
    pub stages: &'a [StageReport],
}

impl RunRecord {
    /// Keeps the record of the run that has just published the result in `out`. A result that was
    /// used again as a whole keeps the record of its own run.
    ///
    /// # Errors
    /// There is no result, or the record cannot be written.
    pub fn keep(out: &Path, run: &MeasuredRun<'_>, means: &Means, outcome: &Outcome) -> Result<()> {
        let result = VerifiedFiles::open(out)?.digest().to_owned();
        if Self::of_result(out, &result).is_some() {
            return Ok(());
        }
        let stage = |report: &StageReport| RecordedStage {
            name: report.name.clone(),
            seconds: report.seconds,
            n_items: report.n_items,
            n_points: report.n_points,
        };
        let did_something = |report: &&StageReport| report.n_items + report.n_points > 0;
        let record = Self {
            schema: SCHEMA.into(),
            result,
            seconds: run.seconds,
            peak_memory_bytes: run.peak_memory_bytes,
            memory_bytes: means.memory_bytes,
            n_threads: means.n_threads,
            reused: outcome.reused.clone(),
            stages: run.stages.iter().filter(did_something).map(stage).collect(),
        };
        let text = serde_json::to_string_pretty(&record).map_err(|e| {
            Error::new(Kind::Bug, "the record of the run cannot be written").because(e)
        })?;
        atomic::write(&without_links(out, NAME)?, (text + "\n").as_bytes())
    }

    /// The record of the result with this digest of its list of files; `None` where it is missing,
    /// cannot be read or belongs to another result.
    #[must_use]
    pub fn of_result(out: &Path, digest: &str) -> Option<Self> {
        let path = without_links(out, NAME).ok()?;
        let is_short = path.metadata().is_ok_and(|meta| meta.is_file() && meta.len() <= MOST);
        let text = is_short.then(|| std::fs::read(&path).ok()).flatten()?;
        let record: Self = serde_json::from_slice(&text).ok()?;
        (record.schema == SCHEMA && record.result == digest).then_some(record)
    }

    /// Lines for people: what each is about, and its words.
    pub(crate) fn words(&self) -> Vec<(String, String)> {
        let mut lines = vec![(
            "time".into(),
            format!("{:.1} s, {}", self.seconds, count(self.n_threads as u64, "thread")),
        )];
        let limit = memory_words(self.memory_bytes);
        let peak = self.peak_memory_bytes.map_or_else(|| "unknown".into(), memory_words);
        lines.push(("memory".into(), format!("{peak} at most, {limit} allowed")));
        for stage in &self.stages {
            let rate = stage.n_points as f64 / stage.seconds.max(1e-3) / 1e6;
            let words = match stage.n_points {
                0 => format!("{:>7.1} s, {}", stage.seconds, count(stage.n_items, "item")),
                n => format!("{:>7.1} s, {n} points, {rate:.1} M points/s", stage.seconds),
            };
            lines.push((format!("  {}", title(&stage.name)), words));
        }
        lines.extend(self.reused.iter().map(|piece| ("used again".into(), piece.clone())));
        lines
    }
}
