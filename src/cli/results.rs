//! `verify`, `report` and `diff`: output folders of runs in; whether they are whole, what is in them, and how they differ,
//! out.

use super::flags::{Common, DiffFlags, OutFlags, ReportFlags};
use super::say::Say;
use crate::changes::{changes, words};
use crate::exit;
use crate::job::Outcome;
use crate::reuse::{Manifest, check};
use contract::{Error, Kind, Result};
use export::ResultFile;

pub(super) fn verify(flags: &OutFlags, common: &Common, say: &Say) -> Result<u8> {
    let engine = common.engine(&common.means()?)?;
    let checked = check(&flags.out, &engine)?;
    let n_files = checked.manifest.files.len();
    let n_bytes: u64 = checked.manifest.files.iter().map(|f| f.n_bytes).sum();
    match checked.wrong.split_first() {
        None => {
            say.result(&format!("{n_files} files, {n_bytes} bytes: as they were written"));
            Ok(exit::OK)
        }
        Some((first, others)) => {
            others.iter().for_each(|wrong| say.warning(wrong));
            Err(Error::bad_input(first.clone())
                .because(format!("{} of {n_files} files are wrong", others.len() + 1))
                .hint("run the same job again: what is whole is used again, the rest made anew"))
        }
    }
}

pub(super) fn report(flags: &ReportFlags, say: &Say) -> Result<u8> {
    let manifest = Manifest::read(&flags.out)?;
    if let Some(path) = &flags.junit {
        export::write_junit(path, &ResultFile::read(&flags.out)?)?;
    }
    let Manifest { summary, warnings, partial, .. } = manifest;
    say.outcome(&Outcome { summary, warnings, partial, reused: Vec::new() });
    Ok(if partial { exit::PARTIAL } else { exit::OK })
}

pub(super) fn diff(flags: &DiffFlags, say: &Say) -> Result<u8> {
    let (then, now) = (ResultFile::read(&flags.then)?, ResultFile::read(&flags.now)?);
    let changes = changes(&then, &now);
    if flags.json {
        let all = serde_json::json!({"schema": "stillpoint.diff/1", "robots": changes});
        let text = serde_json::to_string_pretty(&all).map_err(|e| {
            Error::new(Kind::Bug, "the answer cannot be written as JSON").because(e)
        })?;
        say.result(&text);
    } else {
        say.result(&words(&changes));
    }
    Ok(exit::OK)
}
