//! Runs the cases of a bench, each in its own folder, and writes their rows as they come and one
//! table.

use super::journal::Journal;
use super::request::DrawnCases;
use crate::engine::Engine;
use contract::Result;
use export::atomic;
use serde::Serialize;
use std::path::Path;

/// Outcome of a case.
pub(super) trait CaseRow: Serialize {
    /// The case failed.
    fn fail(&mut self, why: String);

    /// The outcome as one line for people.
    fn line(&self) -> String;
}

/// A case to run: an empty row and its inputs.
pub(super) struct CaseToRun<R, T> {
    /// Name of its folder, if it is kept.
    pub(super) name: String,
    pub(super) row: R,
    pub(super) of: T,
}

impl<R> CaseToRun<R, usize> {
    /// The first `n` requested cases, each made from its own seed.
    pub(super) fn numbered(drawn: &DrawnCases, n: usize, row: impl Fn(u64) -> R) -> Vec<Self> {
        let case = |k: usize| {
            let seed = drawn.seed_of(k);
            Self { name: seed.to_string(), row: row(seed), of: k }
        };
        drawn.numbers(n).map(case).collect()
    }
}

/// Folders of the cases, and whether they are kept.
pub(super) struct Cases<'a> {
    /// Base name of the files of rows and table.
    pub(super) name: &'a str,
    /// Folder of rows and table, and whether the folders of cases are kept there.
    pub(super) drawn: &'a DrawnCases,
    /// Temporary folder of the cases otherwise.
    pub(super) temporary: &'a Path,
}

impl Cases<'_> {
    /// Runs all cases one after the other; a failed case becomes a row.
    pub(super) fn run<R: CaseRow, T>(
        &self,
        cases: Vec<CaseToRun<R, T>>,
        case: impl Fn(&mut R, &T, &Path) -> Result<()>,
        table: impl Fn(&[R]) -> String,
        engine: &Engine,
    ) -> Result<String> {
        let (out, keep) = (self.drawn.out.as_deref(), self.drawn.keep);
        let file = |ending: &str| format!("{}.{ending}", self.name);
        let mut journal = out.map(|dir| Journal::create(dir, &file("jsonl"))).transpose()?;
        let mut rows = Vec::new();
        for CaseToRun { name, mut row, of } in cases {
            engine.cancel.check()?;
            let dir = match (out, keep) {
                (Some(out), true) => out.join(name),
                _ => self.temporary.join("case"),
            };
            if let Err(error) = case(&mut row, &of, &dir) {
                row.fail(error.to_string());
            }
            if !keep {
                let _ = std::fs::remove_dir_all(&dir);
            }
            if let Some(journal) = &mut journal {
                journal.add(&row)?;
            }
            engine.progress.say(&row.line());
            rows.push(row);
        }
        let table = table(&rows);
        if let Some(dir) = out {
            atomic::write(&dir.join(file("md")), table.as_bytes())?;
        }
        Ok(table)
    }
}
