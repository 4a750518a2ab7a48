//! Commands called from Python: work runs on another thread without the lock of the interpreter,
//! while this one calls back with progress and looks for Ctrl-C.

use crate::errors::{guarded, raised};
use contract::Result;
use pyo3::prelude::*;
use std::ffi::OsString;
use stillpoint::engine::{Told, WatchedWork, watched};

/// Runs a command of the program with these arguments: `(exit code, output, warnings, notes)`.
#[pyfunction]
#[pyo3(signature = (args, progress=None, note=None))]
#[allow(clippy::type_complexity)] // a tuple of Python, described in `_stillpoint.pyi`
pub(crate) fn call(
    py: Python<'_>,
    args: Vec<OsString>,
    progress: Option<Py<PyAny>>,
    note: Option<Py<PyAny>>,
) -> PyResult<(u8, String, Vec<String>, Vec<String>)> {
    guarded(py, || {
        let listener = Listener { progress, note };
        let answer = listener.hear(py, |own| stillpoint::cli::answer(args, &own))?;
        Ok((answer.code, answer.text, answer.warnings, answer.notes))
    })
}

/// Functions of Python that are called while work goes on.
pub(crate) struct Listener {
    /// Called with name of the stage, amount done, and whole amount or None.
    pub(crate) progress: Option<Py<PyAny>>,
    /// Called with a message.
    pub(crate) note: Option<Py<PyAny>>,
}

impl Listener {
    /// Runs work until it ends. An exception of a callback, or of a signal handler, cancels the
    /// work, and is raised when it has ended.
    pub(crate) fn hear<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(WatchedWork) -> Result<T> + Send,
    ) -> PyResult<T> {
        let mut raised_here: Option<PyErr> = None;
        let done = py.detach(|| {
            watched(work, |told| {
                let heard = Python::attach(|py| self.tell(py, told));
                // The first exception counts: later ones come of the same Ctrl-C pressed again.
                if let (Err(error), None) = (heard, &raised_here) {
                    raised_here = Some(error);
                }
                raised_here.is_none()
            })
        });
        match (raised_here, done) {
            (Some(error), _) if !is_interrupt(py, &error) => Err(error),
            // Work that ended before it noticed is done all the same, but was not wanted any more.
            (Some(cause), done) => {
                let interrupted = || contract::Error::new(contract::Kind::Cancelled, "interrupted");
                let error = raised(py, &done.err().unwrap_or_else(interrupted));
                error.set_cause(py, Some(cause));
                Err(error)
            }
            (None, done) => done.map_err(|error| raised(py, &error)),
        }
    }

    /// Calls back, and runs handlers of signals that came meanwhile.
    fn tell(&self, py: Python<'_>, told: Vec<Told>) -> PyResult<()> {
        py.check_signals()?;
        for told in told {
            match (told, &self.progress, &self.note) {
                (Told::Stage { name, done, total }, Some(progress), _) => {
                    progress.call1(py, (name, done, total))?;
                }
                (Told::Note(text), _, Some(note)) => {
                    note.call1(py, (text,))?;
                }
                _ => {}
            }
        }
        Ok(())
    }
}

/// Whether an exception is Ctrl-C.
fn is_interrupt(py: Python<'_>, error: &PyErr) -> bool {
    error.is_instance_of::<pyo3::exceptions::PyKeyboardInterrupt>(py)
}
