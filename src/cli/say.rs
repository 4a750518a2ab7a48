//! Output of the program: results on standard output; warnings and errors on standard error, as
//! text or JSON. All text is quoted (`contract::quote`), so that no name can control a terminal.

use crate::job::Outcome;
use contract::{Error, Kind, Result, fence, quote};
use std::io::Write;
use std::sync::{Mutex, PoisonError};

/// How warnings and errors are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum LogFormat {
    /// As text for people.
    Text,
    /// As JSON for programs, one object per line.
    Json,
}

/// The answer of a command that did not fail.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct CommandAnswer {
    /// Exit code: 0, 3 for success in part, 1 for the answer no.
    pub code: u8,
    /// What the command prints to standard output.
    pub text: String,
    /// Warnings.
    pub warnings: Vec<String>,
    /// Further messages: what was used again.
    pub notes: Vec<String>,
}

/// Writes results, warnings and errors.
pub(super) struct Say {
    format: LogFormat,
    /// What was said so far, where another program is to get it; nothing is printed then.
    kept: Option<Mutex<CommandAnswer>>,
}

/// A result as JSON, for [`Say::result`].
pub(super) fn json(value: &impl serde::Serialize) -> Result<String> {
    let text = serde_json::to_string_pretty(value)
        .map_err(|e| Error::new(Kind::Bug, "the answer cannot be written as JSON").because(e))?;
    Ok(quote::json(&text).into_owned())
}

impl Say {
    pub(super) fn new(format: LogFormat) -> Self {
        Self { format, kept: None }
    }

    /// Keeps all results and warnings instead of writing them.
    pub(super) fn keeping() -> Self {
        Self { format: LogFormat::Text, kept: Some(Mutex::default()) }
    }

    /// What was kept.
    pub(super) fn kept(self) -> CommandAnswer {
        self.kept.map_or_else(CommandAnswer::default, |kept| {
            kept.into_inner().unwrap_or_else(PoisonError::into_inner)
        })
    }

    /// Whether what is said is kept: `keep` then adds it.
    fn keeps(&self, keep: impl FnOnce(&mut CommandAnswer)) -> bool {
        let Some(kept) = &self.kept else { return false };
        keep(&mut kept.lock().unwrap_or_else(PoisonError::into_inner));
        true
    }

    /// Silences the default panic message: the code that catches a panic reports it in this format.
    /// With `RUST_BACKTRACE` set, developers also get the backtrace beside text.
    pub(super) fn for_panics(&self) {
        let wants_calls = std::env::var_os("RUST_BACKTRACE").is_some_and(|v| v != "0");
        let usual = std::panic::take_hook();
        let says_calls = wants_calls && self.format == LogFormat::Text;
        std::panic::set_hook(Box::new(move |panic| {
            fence::note(panic);
            if says_calls {
                usual(panic);
            }
        }));
    }

    /// Writes a result to standard output. A closed pipe is not an error.
    pub(super) fn result(&self, text: &str) {
        if self.keeps(|kept| kept.text += text) {
            return;
        }
        let mut out = std::io::stdout().lock();
        let _ = writeln!(out, "{}", quote::printed(text.trim_end())).and_then(|()| out.flush());
    }

    /// Writes bytes that the program made itself to standard output. A closed pipe is not an error.
    pub(super) fn bytes(&self, bytes: &[u8]) {
        if self.keeps(|kept| kept.text += &String::from_utf8_lossy(bytes)) {
            return;
        }
        let mut out = std::io::stdout().lock();
        let _ = out.write_all(bytes).and_then(|()| out.flush());
    }

    /// Writes the outcome of a run: warnings and pieces that were used again to standard error, the
    /// summary to standard output.
    pub(super) fn outcome(&self, outcome: &Outcome) {
        outcome.warnings.iter().chain(&outcome.notes).for_each(|warning| self.warning(warning));
        for piece in &outcome.reused {
            if self.keeps(|kept| kept.notes.push(format!("used again: {piece}"))) {
                continue;
            }
            self.line(&match self.format {
                LogFormat::Text => format!("used again: {piece}"),
                LogFormat::Json => {
                    serde_json::json!({"level": "info", "used_again": piece}).to_string()
                }
            });
        }
        self.result(&outcome.summary);
    }

    /// Writes a warning.
    pub(super) fn warning(&self, text: &str) {
        if self.keeps(|kept| kept.warnings.push(text.to_owned())) {
            return;
        }
        self.line(&match self.format {
            LogFormat::Text => format!("warning: {text}"),
            LogFormat::Json => serde_json::json!({"level": "warning", "message": text}).to_string(),
        });
    }

    /// Writes the error that ends the program.
    pub(super) fn error(&self, error: &Error) {
        self.line(&match self.format {
            LogFormat::Text => format!("error: {error}"),
            LogFormat::Json => serde_json::json!({
                "level": "error",
                "kind": word(error.kind()),
                "message": error.to_string(),
                "place": error.place(),
                "hint": error.way_out(),
            })
            .to_string(),
        });
    }

    fn line(&self, line: &str) {
        let line = match self.format {
            LogFormat::Text => quote::printed(line),
            LogFormat::Json => quote::json(line),
        };
        let _ = writeln!(std::io::stderr(), "{line}");
    }
}

fn word(kind: Kind) -> &'static str {
    match kind {
        Kind::BadInput => "bad_input",
        Kind::Unsupported => "unsupported",
        Kind::Io => "io",
        Kind::OverBudget => "over_budget",
        Kind::Usage => "usage",
        Kind::Cancelled => "cancelled",
        _ => "bug",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::Command;

    /// Set in the process that panics, to the format that it is to speak in.
    const CHILD: &str = "STILLPOINT_TEST_PANICS";

    /// A stand-in for a decoder that panics on a damaged file, on another thread as decoders' own
    /// threads do.
    fn decode() -> u8 {
        let of = |bytes: &[u8]| bytes[usize::from(bytes[0])];
        std::thread::scope(|scope| {
            let part = scope.spawn(|| of(&[9, 1, 2]));
            part.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        })
    }

    #[test]
    fn panics_that_are_caught_say_one_line_in_the_format_asked_for() {
        if let Ok(format) = std::env::var(CHILD) {
            let is_json = format == "json";
            let say = Say::new(if is_json { LogFormat::Json } else { LogFormat::Text });
            say.for_panics();
            let what = fence::fenced(decode).expect_err("it panics");
            say.error(&Error::bad_input("decompressing broke off").because(what).at("chunk 3"));
            return;
        }
        let name = "cli::say::tests::panics_that_are_caught_say_one_line_in_the_format_asked_for";
        let said = |format: &str| {
            let mut child = Command::new(std::env::current_exe().expect("a test"));
            child
                .args([name, "--exact", "--nocapture"])
                .env(CHILD, format)
                .env("RUST_BACKTRACE", "0");
            String::from_utf8(child.output().expect("runs").stderr).expect("text")
        };
        let words =
            "decompressing broke off (index out of bounds: the len is 3 but the index is 9 (";
        let text = said("text");
        assert_eq!(text.lines().count(), 1, "{text}");
        assert!(text.starts_with(&format!("error: chunk 3: {words}")), "{text}");
        assert!(text.contains("say.rs:"), "{text}");
        let json = said("json");
        let object: serde_json::Value = serde_json::from_str(&json).expect("one object");
        assert!(object["message"].as_str().is_some_and(|m| m.contains(words)), "{object}");
    }
}
