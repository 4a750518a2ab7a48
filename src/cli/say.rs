//! What the program says: results to standard output; warnings and errors to standard error, as text or JSON.

use crate::job::Outcome;
use contract::{Error, Kind};
use std::io::Write;

/// How warnings and errors are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum LogFormat {
    /// For people.
    Text,
    /// One object a line, for programs.
    Json,
}

/// Speaks.
pub(super) struct Say {
    format: LogFormat,
}

impl Say {
    pub(super) fn new(format: LogFormat) -> Self {
        Self { format }
    }

    /// A result, on standard output. Nobody listening is no failure of ours.
    pub(super) fn result(&self, text: &str) {
        let mut out = std::io::stdout().lock();
        let _ = writeln!(out, "{}", text.trim_end()).and_then(|()| out.flush());
    }

    /// What a run came to: warnings and what was used again on standard error, its summary on standard output.
    pub(super) fn outcome(&self, outcome: &Outcome) {
        outcome.warnings.iter().for_each(|warning| self.warning(warning));
        for piece in &outcome.reused {
            self.line(&match self.format {
                LogFormat::Text => format!("used again: {piece}"),
                LogFormat::Json => {
                    serde_json::json!({"level": "info", "used_again": piece}).to_string()
                }
            });
        }
        self.result(&outcome.summary);
    }

    /// Something a person should know.
    pub(super) fn warning(&self, text: &str) {
        self.line(&match self.format {
            LogFormat::Text => format!("warning: {text}"),
            LogFormat::Json => serde_json::json!({"level": "warning", "message": text}).to_string(),
        });
    }

    /// Why the program ends.
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
