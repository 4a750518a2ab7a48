//! Work on a thread of its own that another program watches: it is told the progress of stages, and
//! may cancel at any time.

use super::cancel::Cancel;
use super::progress::{Mode, Progress};
use contract::{Error, Kind, Result, fence};
use serde_json::Value;
use std::io::Write;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::sync::{Once, OnceLock};
use std::time::Duration;

/// Time between two calls of the watcher: a person who presses Ctrl-C notices no delay.
const EVERY: Duration = Duration::from_millis(50);

/// Cancellation and progress of watched work.
#[derive(Clone)]
pub struct WatchedWork {
    /// Cancellation flag of the work.
    pub cancel: Cancel,
    /// Receives the progress of the work.
    pub progress: Progress,
}

/// What a watcher is told.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Told {
    /// Progress of a stage.
    Stage {
        /// Name of the stage.
        name: String,
        /// Amount that is done.
        done: u64,
        /// Whole amount, where it is known: points, pieces of a search, or items of a list.
        total: Option<u64>,
    },
    /// A message for people.
    Note(String),
}

impl std::fmt::Debug for WatchedWork {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("WatchedWork").field("cancel", &self.cancel).finish_non_exhaustive()
    }
}

/// Runs work on its own thread. On this thread `watch` is called about twenty times a second with
/// what happened since the last call, and a last time at the end; when it returns false, the work
/// is cancelled. A panic in the work is an error of kind [`Kind::Bug`] and prints nothing.
///
/// # Errors
/// That of the work; a thread that cannot be started; a process that was forked after such work.
pub fn watched<T: Send>(
    work: impl FnOnce(WatchedWork) -> Result<T> + Send,
    mut watch: impl FnMut(Vec<Told>) -> bool,
) -> Result<T> {
    is_own_process()?;
    keep_panics_quiet();
    let (sender, lines) = mpsc::channel();
    let progress = Progress::to(Mode::Json, Box::new(Lines { sender, line: Vec::new() }));
    let cancel = Cancel::new();
    let own = WatchedWork { cancel: cancel.clone(), progress };
    std::thread::scope(|scope| {
        let run = move || fence::fenced(|| work(own));
        let worker = std::thread::Builder::new().name("stillpoint".into()).spawn_scoped(scope, run);
        let failed = |e| Error::new(Kind::Io, "a thread could not be started").because(e);
        let worker = worker.map_err(failed)?;
        loop {
            let (told, is_over) = received(&lines);
            if !watch(told) {
                cancel.set();
            }
            if is_over || worker.is_finished() {
                break;
            }
        }
        let done = worker.join().unwrap_or_else(|_| Err("its thread ended".to_owned()));
        watch(received(&lines).0);
        done.unwrap_or_else(|what| {
            Err(Error::new(Kind::Bug, format!("the work ended by a panic: {what}"))
                .hint("this is a fault of stillpoint: please report it with its input"))
        })
    })
}

/// Refuses to work in a process that was forked after work had been done: the threads stayed with
/// the parent, and work would wait for them for ever.
fn is_own_process() -> Result<()> {
    static FIRST: OnceLock<u32> = OnceLock::new();
    let own = std::process::id();
    if *FIRST.get_or_init(|| own) == own {
        return Ok(());
    }
    let what = "this process was forked from one in which stillpoint had worked already";
    Err(Error::new(Kind::Usage, what)
        .hint("start a new process instead, in Python with multiprocessing.get_context(\"spawn\")"))
}

/// Panics that are caught here become errors and do not print by themselves; all others, of the
/// program that this library is a part of, print as before.
fn keep_panics_quiet() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let usual = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            if fence::is_fenced() { fence::note(panic) } else { usual(panic) }
        }));
    });
}

/// Waits a moment for lines; returns what they say, and whether no more can come.
fn received(lines: &Receiver<Vec<u8>>) -> (Vec<Told>, bool) {
    let first = match lines.recv_timeout(EVERY) {
        Ok(line) => line,
        Err(ended) => return (Vec::new(), ended == RecvTimeoutError::Disconnected),
    };
    let all = std::iter::once(first).chain(lines.try_iter());
    (all.filter_map(|line| told(&line)).collect(), false)
}

/// What a line of progress says.
fn told(line: &[u8]) -> Option<Told> {
    let line: Value = serde_json::from_slice(line).ok()?;
    let number = |name: &str| line[name].as_u64();
    let Some(name) = line["stage"].as_str() else {
        return line["message"].as_str().map(|text| Told::Note(text.to_owned()));
    };
    let all = [("points", "points_total"), ("pieces", "pieces_known"), ("items", "items_total")];
    let known = all.iter().find(|(_, total)| number(total).is_some());
    let (unit, total) = known.copied().unwrap_or(("items", ""));
    Some(Told::Stage {
        name: name.to_owned(),
        done: number(unit).unwrap_or(0),
        total: number(total),
    })
}

/// A writer that hands on whole lines.
struct Lines {
    sender: Sender<Vec<u8>>,
    line: Vec<u8>,
}

impl Write for Lines {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        for part in bytes.split_inclusive(|b| *b == b'\n') {
            self.line.extend_from_slice(part);
            if part.ends_with(b"\n") {
                // Nobody listens any more once the watcher has ended.
                let _ = self.sender.send(std::mem::take(&mut self.line));
            }
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::Amount;

    #[test]
    fn a_watcher_is_told_stages_and_may_cancel() {
        let mut all = Vec::new();
        let work = |own: WatchedWork| {
            own.progress.say("hello");
            own.progress.stage("read", Amount::points(30)).add(1, 20, 0);
            while !own.cancel.is_set() {
                std::thread::yield_now();
            }
            own.cancel.check()
        };
        let done = watched(work, |told| {
            all.extend(told);
            all.len() < 2
        });
        assert_eq!(done.expect_err("cancelled").kind(), Kind::Cancelled);
        let stage = Told::Stage { name: "read".into(), done: 20, total: Some(30) };
        assert_eq!(all, [Told::Note("hello".into()), stage]);
    }

    #[test]
    fn a_panic_is_an_error() {
        let broken = watched(|_| -> Result<()> { panic!("index out of bounds") }, |_| true);
        let error = broken.expect_err("it panics");
        assert_eq!(error.kind(), Kind::Bug);
        assert!(error.to_string().contains("index out of bounds"), "{error}");
    }
}
