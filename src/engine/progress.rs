//! Progress of stages on standard error, as bars, lines or JSON, and one report per stage for the
//! result. Only this module reads a clock.

mod course;
mod words;

use super::amount::Amount;
use contract::quote;
use course::Course;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::{IsTerminal, Write};
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError, Weak};
use std::time::{Duration, Instant};
pub(crate) use words::title;
use words::{StageState, bar_line, json, words};

/// How progress is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Mode {
    /// One bar for the whole run, with the name of the stage, for a terminal.
    Bar,
    /// A line every few seconds and at the end of each stage, for a log.
    Plain,
    /// One JSON object per line, for programs.
    Json,
    /// Nothing.
    None,
}

impl Mode {
    /// The mode that suits standard error: a bar on a terminal, else plain lines.
    #[must_use]
    pub fn fitting() -> Self {
        if std::io::stderr().is_terminal() { Self::Bar } else { Self::Plain }
    }
}

/// Time between two lines of a stage; five seconds keep the log of an hour readable.
const LINE_EVERY: Duration = Duration::from_secs(5);
/// Time between two JSON objects of a stage, short enough for a live display.
const JSON_EVERY: Duration = Duration::from_secs(1);
/// Time between two redraws of a bar.
const BAR_EVERY: Duration = Duration::from_millis(120);

/// The bar of a run. Its whole line is one message, so that name, bar and words always belong to
/// one stage; it is cut at the width of the terminal.
fn only_bar() -> ProgressBar {
    let bar = ProgressBar::new(0);
    if let Ok(style) = ProgressStyle::with_template("{wide_msg}") {
        bar.set_style(style);
    }
    bar
}

/// Time and amount of work of a finished stage, for `result.json`.
#[derive(Debug, Clone, PartialEq)]
pub struct StageReport {
    /// Name of the stage.
    pub name: String,
    /// Wall-clock time, seconds.
    pub seconds: f64,
    /// Number of items that passed through the stage.
    pub n_items: u64,
    /// Number of points that passed through the stage.
    pub n_points: u64,
    /// Number of bytes that passed through the stage.
    pub bytes: u64,
}

/// Receives and shows the progress of all stages. Clones share one state.
#[derive(Clone)]
pub struct Progress(Arc<Inner>);

struct Inner {
    mode: Mode,
    /// Whether lines are written as JSON objects.
    is_json: bool,
    out: Mutex<Box<dyn Write + Send>>,
    reports: Mutex<Vec<StageReport>>,
    bars: indicatif::MultiProgress,
    /// The only bar, where there is one: it shows the stage that was at work last.
    bar: Option<ProgressBar>,
    /// Whether stages that have ended leave a line above the bar.
    tells_stages: bool,
    /// What the run will probably go through.
    course: Mutex<Course>,
    /// Number of stages that have begun and not ended.
    n_running: AtomicUsize,
    start: Instant,
}

/// A running stage. Clones share one state.
#[derive(Clone)]
pub struct Stage(Arc<Running>);

/// Counter of the pieces of work within the items of a stage. Their number becomes known while an
/// item is worked on, and each may take minutes. Clones share one state.
#[derive(Clone, Default)]
pub struct Pieces(Arc<PieceCounts>);

#[derive(Default)]
struct PieceCounts {
    /// Number of pieces that are done.
    done: AtomicU64,
    /// Number of pieces that are known so far.
    known: AtomicU64,
    /// The stage whose progress shows the pieces.
    stage: OnceLock<Weak<Running>>,
}

struct Running {
    progress: Progress,
    name: String,
    total: Amount,
    start: Instant,
    /// Processor time of the process when the stage began, seconds.
    start_cpu: f64,
    done: [AtomicU64; 3],
    /// Milliseconds from `start` to the moment at which the next line is due.
    next_line: AtomicU64,
    finished: Mutex<bool>,
    pieces: Pieces,
}

impl Pieces {
    /// Adds `n` pieces that remain to be done.
    pub fn expect(&self, n: usize) {
        self.0.known.fetch_add(n as u64, Ordering::Relaxed);
        self.show();
    }

    /// Counts one piece as done.
    pub fn done(&self) {
        self.0.done.fetch_add(1, Ordering::Relaxed);
        self.show();
    }

    /// Numbers of pieces done and of pieces known so far.
    fn counts(&self) -> [u64; 2] {
        [&self.0.done, &self.0.known].map(|n| n.load(Ordering::Relaxed))
    }

    fn show(&self) {
        if let Some(stage) = self.0.stage.get().and_then(Weak::upgrade) {
            Stage(stage).add(0, 0, 0);
        }
    }
}

impl Progress {
    /// Shows progress on standard error.
    #[must_use]
    pub fn new(mode: Mode) -> Self {
        Self::to(mode, Box::new(std::io::stderr()))
    }

    /// Shows no progress, but writes notes, warnings and errors as JSON.
    #[must_use]
    pub fn json_without_progress() -> Self {
        Self::with(Mode::None, true, false, Box::new(std::io::stderr()))
    }

    /// Shows a bar, and a line above it for each stage that has ended.
    #[must_use]
    pub fn bar_with_stages() -> Self {
        Self::with(Mode::Bar, false, true, Box::new(std::io::stderr()))
    }

    /// Shows nothing; reports of stages are kept.
    #[must_use]
    pub fn silent() -> Self {
        Self::new(Mode::None)
    }

    /// Writes lines to `out`; bars always go to standard error.
    #[must_use]
    pub fn to(mode: Mode, out: Box<dyn Write + Send>) -> Self {
        Self::with(mode, mode == Mode::Json, false, out)
    }

    fn with(mode: Mode, is_json: bool, tells_stages: bool, out: Box<dyn Write + Send>) -> Self {
        let target = match mode {
            Mode::Bar => ProgressDrawTarget::stderr(),
            _ => ProgressDrawTarget::hidden(),
        };
        let bars = indicatif::MultiProgress::with_draw_target(target);
        let bar = (mode == Mode::Bar).then(|| bars.add(only_bar()));
        Self(Arc::new(Inner {
            mode,
            is_json,
            out: Mutex::new(out),
            reports: Mutex::new(Vec::new()),
            bars,
            bar,
            tells_stages,
            course: Mutex::default(),
            n_running: AtomicUsize::new(0),
            start: Instant::now(),
        }))
    }

    /// Begins a stage; zero in `total` means not known. It ends with [`Stage::finish`], or when its
    /// last clone goes.
    #[must_use]
    pub fn stage(&self, name: &str, total: Amount) -> Stage {
        self.stage_of(name, total, Pieces::default())
    }

    /// Like [`Progress::stage`], for a stage that also shows `pieces` of its items.
    #[must_use]
    pub fn stage_of(&self, name: &str, total: Amount, pieces: Pieces) -> Stage {
        self.course().begin(name);
        let is_first = self.0.n_running.fetch_add(1, Ordering::Relaxed) == 0;
        if let Some(bar) = self.0.bar.as_ref().filter(|_| is_first) {
            // What the bar said before it was wiped away is of another stage.
            let start = StageState::start(&total);
            bar.set_message(self.bar_line(name, &start));
            bar.reset();
        }
        let stage = Stage(Arc::new(Running {
            progress: self.clone(),
            name: name.to_owned(),
            total,
            start: Instant::now(),
            start_cpu: cpu_seconds(),
            done: Default::default(),
            next_line: AtomicU64::new(self.every().as_millis() as u64),
            finished: Mutex::new(false),
            pieces,
        }));
        // Pieces stay with the first stage that shows them.
        stage.0.pieces.0.stage.set(Arc::downgrade(&stage.0)).ok();
        stage
    }

    /// Says how long stages that are to come will take, seconds, in the order in which they will
    /// begin; replaces what was said of the same stages before. The bar shows how far the whole run
    /// is where this was said; `is_known` if it is more than a guess.
    pub(crate) fn expect(&self, stages: &[(&'static str, f64)], is_known: bool) {
        self.course().expect(stages, is_known);
    }

    /// Whether a person watches a bar.
    #[must_use]
    pub(crate) fn has_bar(&self) -> bool {
        self.0.bar.is_some()
    }

    fn course(&self) -> MutexGuard<'_, Course> {
        self.0.course.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The line of the bar while a stage is at work.
    fn bar_line(&self, name: &str, state: &StageState<'_>) -> String {
        let elapsed = self.0.start.elapsed().as_secs_f64();
        let share = state.done.share(state.total).unwrap_or(0.0);
        let whole = self.course().whole(name, share, state.seconds, elapsed);
        bar_line(name, state, whole, elapsed)
    }

    /// Reports of all finished stages, in the order in which they ended.
    #[must_use]
    pub fn reports(&self) -> Vec<StageReport> {
        self.0.reports.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Writes a line to standard error without spoiling a bar.
    pub fn say(&self, line: &str) {
        let said = if self.0.is_json {
            let said = serde_json::json!({"level": "info", "message": line}).to_string();
            quote::json(&said).into_owned()
        } else {
            quote::printed(line).into_owned()
        };
        self.0.bars.suspend(|| self.line(&said));
    }

    fn every(&self) -> Duration {
        match self.0.mode {
            Mode::Json => JSON_EVERY,
            Mode::Bar => BAR_EVERY,
            Mode::Plain | Mode::None => LINE_EVERY,
        }
    }

    /// A line that cannot be written does not end the run.
    fn line(&self, line: &str) {
        let mut out = self.0.out.lock().unwrap_or_else(PoisonError::into_inner);
        let _ = writeln!(out, "{line}");
    }
}

impl Stage {
    /// Adds items, points and bytes that were done, and shows a line when one is due.
    pub fn add(&self, items: u64, points: u64, bytes: u64) {
        let run = &self.0;
        for (counter, more) in run.done.iter().zip([items, points, bytes]) {
            counter.fetch_add(more, Ordering::Relaxed);
        }
        if run.progress.0.mode == Mode::None {
            return;
        }
        let now = run.start.elapsed();
        let due = run.next_line.load(Ordering::Relaxed);
        if (now.as_millis() as u64) < due {
            return;
        }
        let next = (now + run.progress.every()).as_millis() as u64;
        // Only the thread that moves the due time forward writes the line.
        if run.next_line.compare_exchange(due, next, Ordering::Relaxed, Ordering::Relaxed).is_ok() {
            run.show(now.as_secs_f64(), false);
        }
    }

    /// Ends the stage: its report is kept and a last line is shown. Further calls have no effect.
    pub fn finish(&self) {
        self.0.finish();
    }
}

impl Running {
    fn done(&self) -> Amount {
        let [items, points, bytes] = [0, 1, 2].map(|i| self.done[i].load(Ordering::Relaxed));
        Amount { items, points, bytes }
    }

    fn finish(&self) {
        let mut finished = self.finished.lock().unwrap_or_else(PoisonError::into_inner);
        if std::mem::replace(&mut *finished, true) {
            return;
        }
        let (done, seconds) = (self.done(), self.start.elapsed().as_secs_f64());
        self.progress.course().end(&self.name, seconds);
        self.show(seconds, true);
        let report = StageReport {
            name: self.name.clone(),
            seconds,
            n_items: done.items,
            n_points: done.points,
            bytes: done.bytes,
        };
        let reports = &self.progress.0.reports;
        reports.lock().unwrap_or_else(PoisonError::into_inner).push(report);
    }

    /// Shows this stage on the only bar. Where no stage runs any more, the bar is wiped away, so
    /// that results do not stand behind it.
    fn draw(&self, bar: &ProgressBar, state: &StageState<'_>) {
        let inner = &self.progress.0;
        if state.is_over {
            if inner.tells_stages && *state.done != Amount::default() {
                self.progress.say(&format!("{}: {}", title(&self.name), words(state)));
            }
            if inner.n_running.fetch_sub(1, Ordering::Relaxed) == 1 {
                bar.finish_and_clear();
            }
            return;
        }
        bar.set_message(self.progress.bar_line(&self.name, state));
    }

    fn show(&self, seconds: f64, last: bool) {
        let done = self.done();
        let state = StageState {
            done: &done,
            total: &self.total,
            pieces: self.pieces.counts(),
            seconds,
            cpu_seconds: cpu_seconds() - self.start_cpu,
            is_over: last,
        };
        match (self.progress.0.mode, &self.progress.0.bar) {
            (Mode::None, _) => {}
            (Mode::Json, _) => self.progress.line(&json(&self.name, &state)),
            (_, Some(bar)) => self.draw(bar, &state),
            // Nothing was there to be done.
            (_, None) if last && done == Amount::default() => {}
            (_, None) => {
                let words = words(&state);
                self.progress.line(&format!("{}: {words}", title(&self.name)));
            }
        }
    }
}

/// Processor time that this process has used so far, seconds; 0 where the system does not state it.
fn cpu_seconds() -> f64 {
    /// Indices of user and system time among the fields of `/proc/self/stat` after the process
    /// name, in ticks; Linux counts a hundred ticks per second for programs.
    const TIMES: [usize; 2] = [11, 12];
    const TICKS: f64 = 100.0;
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<&str> = text.rsplit(')').next().unwrap_or("").split_whitespace().collect();
    let ticks = |at: usize| fields.get(at).and_then(|f| f.parse::<f64>().ok()).unwrap_or(0.0);
    TIMES.iter().map(|at| ticks(*at)).sum::<f64>() / TICKS
}

impl Drop for Running {
    fn drop(&mut self) {
        self.finish();
    }
}

#[cfg(test)]
mod tests;
