//! Cases in, each done in a folder of its own; their rows, kept as they come, and one table of them
//! out.

use super::journal::Journal;
use super::request::DrawnCases;
use crate::engine::Engine;
use contract::Result;
use export::atomic;
use serde::Serialize;
use std::path::Path;

/// What a case came to.
pub(super) trait CaseRow: Serialize {
    /// It could not be done to its end.
    fn fail(&mut self, why: String);

    /// One line for people.
    fn line(&self) -> String;
}

/// A row to fill in, and what it is filled from.
pub(super) struct CaseToRun<R, T> {
    /// Name of its folder, where it is kept.
    pub(super) name: String,
    pub(super) row: R,
    pub(super) of: T,
}

impl<R> CaseToRun<R, usize> {
    /// The first `n` cases that are asked for, a seed each; each is made from its number.
    pub(super) fn numbered(drawn: &DrawnCases, n: usize, row: impl Fn(u64) -> R) -> Vec<Self> {
        let case = |k: usize| {
            let seed = drawn.seed_of(k);
            Self { name: seed.to_string(), row: row(seed), of: k }
        };
        drawn.numbers(n).map(case).collect()
    }
}

/// Where cases are done, and what becomes of them.
pub(super) struct Cases<'a> {
    /// Names the files of rows and table.
    pub(super) name: &'a str,
    /// Where rows and table go, and whether the folders of the cases are kept there.
    pub(super) drawn: &'a DrawnCases,
    /// Where they are else.
    pub(super) temporary: &'a Path,
}

impl Cases<'_> {
    /// Does all of them, one after the other: a case that fails is a row that says so.
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
