//! Runs a command of this program in its own process, and records the time of each stage and its
//! resident memory.

use crate::job::Means;
use contract::{Error, Kind, Result};
use serde::{Deserialize, Serialize};
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Time between two samples of a process.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// One stage of a run.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct StageTime {
    pub(super) stage: String,
    pub(super) seconds: f64,
    pub(super) points: u64,
    /// Time of processors, seconds; 0 where the system does not tell.
    #[serde(default)]
    pub(super) cpu_seconds: f64,
}

/// Measurements of a process.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Watched {
    pub(super) seconds: f64,
    pub(super) stages: Vec<StageTime>,
    /// Largest resident memory, bytes: all of it, and without pages of mapped files.
    pub(super) resident_bytes: u64,
    pub(super) own_bytes: u64,
    /// Time of processors, seconds.
    pub(super) cpu_seconds: f64,
}

/// The command line of a measured run, with the means of this one.
pub(super) fn command(
    name: &str,
    input: &Path,
    robots: &Path,
    out: &Path,
    means: &Means,
) -> Result<Vec<String>> {
    let text = |path: &Path| path.display().to_string();
    let mut all: Vec<String> = vec![
        name.into(),
        text(input),
        "--robots".into(),
        text(robots),
        "--out".into(),
        text(out),
        "--memory".into(),
        means.memory_bytes.to_string(),
        "--threads".into(),
        means.n_threads.to_string(),
    ];
    for (key, value) in means.settings.all() {
        all.extend(["--set".into(), format!("{key}={value}")]);
    }
    Ok(all)
}

/// Runs this program with these arguments and watches it.
pub(super) fn watch(arguments: &[String]) -> Result<Watched> {
    let failed = |e: std::io::Error| Error::new(Kind::Io, "a run cannot be started").because(e);
    let program = std::env::current_exe().map_err(failed)?;
    let before = children_seconds();
    let started = Instant::now();
    let mut child = Command::new(program)
        .args(arguments)
        .args(["--progress", "json"])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(failed)?;
    let told = child.stderr.take().map(BufReader::new);
    let (resident, own, is_over) = (AtomicU64::new(0), AtomicU64::new(0), AtomicBool::new(false));
    let pid = child.id();
    let mut stages = Vec::new();
    let mut last = String::new();
    let status = std::thread::scope(|scope| {
        scope.spawn(|| {
            while !is_over.load(Ordering::Relaxed) {
                let [all, anonymous] = memory_of(pid);
                resident.fetch_max(all, Ordering::Relaxed);
                own.fetch_max(anonymous, Ordering::Relaxed);
                std::thread::sleep(LOOK_EVERY);
            }
        });
        for line in told.into_iter().flat_map(BufRead::lines).map_while(std::io::Result::ok) {
            match serde_json::from_str::<Event>(&line) {
                Ok(Event { event, stage }) if event == "stage_end" => stages.push(stage),
                Ok(_) => {}
                Err(_) => last = line,
            }
        }
        let status = child.wait();
        is_over.store(true, Ordering::Relaxed);
        status
    });
    let seconds = started.elapsed().as_secs_f64();
    match status.map_err(failed)?.code() {
        // Done, or done in part.
        Some(0 | 3) => {}
        _ => return Err(Error::new(Kind::Io, "the measured run failed").because(last)),
    }
    let cpu_seconds = children_seconds() - before;
    let [resident_bytes, own_bytes] = [resident, own].map(AtomicU64::into_inner);
    Ok(Watched { seconds, stages, resident_bytes, own_bytes, cpu_seconds })
}

/// A line that the program tells.
#[derive(Deserialize)]
struct Event {
    event: String,
    #[serde(flatten)]
    stage: StageTime,
}

/// Largest resident memory so far, and that which is of no file now, bytes; 0 where the system does
/// not tell.
fn memory_of(pid: u32) -> [u64; 2] {
    let text = std::fs::read_to_string(format!("/proc/{pid}/status")).unwrap_or_default();
    ["VmHWM:", "RssAnon:"].map(|name| {
        let line = text.lines().find_map(|l| l.strip_prefix(name));
        let number = line.and_then(|l| l.split_whitespace().next()?.parse::<u64>().ok());
        number.unwrap_or(0) << 10
    })
}

/// Time of processors that ended processes of this one have used so far, seconds; 0 where the
/// system does not tell.
fn children_seconds() -> f64 {
    /// Fields of `/proc/self/stat` after the name, and ticks of a second, which Linux fixes for
    /// programs.
    const TIMES: [usize; 2] = [13, 14];
    const TICKS: f64 = 100.0;
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<&str> = text.rsplit(')').next().unwrap_or("").split_whitespace().collect();
    let ticks = |at: usize| fields.get(at).and_then(|f| f.parse::<f64>().ok()).unwrap_or(0.0);
    TIMES.iter().map(|at| ticks(*at)).sum::<f64>() / TICKS
}
