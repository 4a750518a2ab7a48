//! Cases in, each done in a folder of its own; their rows, kept as they come, and one table of them
//! out.

use super::Journal;
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
pub(super) struct Case<R, T> {
    /// Name of its folder, where it is kept.
    pub(super) name: String,
    pub(super) row: R,
    pub(super) of: T,
}

/// Where cases are done, and what becomes of them.
pub(super) struct Cases<'a> {
    /// Names the files of rows and table.
    pub(super) name: &'a str,
    /// Where rows and table go; nowhere where left out.
    pub(super) out: Option<&'a Path>,
    /// Whether the folders of the cases are kept there.
    pub(super) keep: bool,
    /// Where they are else.
    pub(super) temporary: &'a Path,
}

impl Cases<'_> {
    /// Does all of them, one after the other: a case that fails is a row that says so.
    pub(super) fn run<R: CaseRow, T>(
        &self,
        cases: Vec<Case<R, T>>,
        case: impl Fn(&mut R, &T, &Path) -> Result<()>,
        table: impl Fn(&[R]) -> String,
        engine: &Engine,
    ) -> Result<String> {
        let file = |ending: &str| format!("{}.{ending}", self.name);
        let mut journal = self.out.map(|dir| Journal::create(dir, &file("jsonl"))).transpose()?;
        let mut rows = Vec::new();
        for Case { name, mut row, of } in cases {
            engine.cancel.check()?;
            let dir = match (self.out, self.keep) {
                (Some(out), true) => out.join(name),
                _ => self.temporary.join("case"),
            };
            if let Err(error) = case(&mut row, &of, &dir) {
                row.fail(error.to_string());
            }
            if !self.keep {
                let _ = std::fs::remove_dir_all(&dir);
            }
            if let Some(journal) = &mut journal {
                journal.add(&row)?;
            }
            engine.progress.say(&row.line());
            rows.push(row);
        }
        let table = table(&rows);
        if let Some(dir) = self.out {
            atomic::write(&dir.join(file("md")), table.as_bytes())?;
        }
        Ok(table)
    }
}
