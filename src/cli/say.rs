//! Output of the program: results on standard output; warnings and errors on standard error, as
//! text or JSON. All text is quoted (`contract::quote`), so that no name can control a terminal.

use crate::job::Outcome;
use contract::{Error, Kind, Result, fence, quote};
use std::io::{IsTerminal, Write};
use std::sync::{Mutex, PoisonError};

/// How warnings and errors are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum LogFormat {
    /// As text for people.
    Text,
    /// As JSON for programs, one object per line.
    Json,
}

/// When words are coloured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Colours {
    /// On a terminal, unless NO_COLOR is set.
    Auto,
    /// Always, also in files and pipes.
    Always,
    /// Never.
    Never,
}

impl Colours {
    fn are_on(self, is_terminal: bool) -> bool {
        let is_set = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
        let is_dumb = || std::env::var_os("TERM").is_some_and(|term| term == "dumb");
        match self {
            Self::Auto => is_terminal && !is_set("NO_COLOR") && !is_dumb(),
            Self::Always => true,
            Self::Never => false,
        }
    }
}

/// Codes that colour a word on a terminal, and the code that ends all.
const GREEN: &str = "\x1b[32m";
const YELLOW: &str = "\x1b[33m";
const RED: &str = "\x1b[31m";
const PLAIN: &str = "\x1b[0m";
/// Verdicts and words about joints, with what stands before them where they are such, and colours.
const COLOURED: [(&[&str], &str, &str); 5] = [
    (&[": ", ", "], "trusted", GREEN),
    (&[": ", ", "], "doubtful", YELLOW),
    (&[": ", ", "], "refused", RED),
    (&["° ", "mm "], "undetermined", RED),
    (&["° ", "mm "], "coarse", YELLOW),
];

/// The text with the words of [`COLOURED`] in colour.
fn coloured(text: &str) -> String {
    let mut text = text.to_owned();
    for (before, word, colour) in COLOURED {
        for before in before {
            let found = format!("{before}{word}");
            text = text.replace(&found, &format!("{before}{colour}{word}{PLAIN}"));
        }
    }
    text
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
    /// Whether standard output and standard error are coloured.
    colours: [bool; 2],
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
        Self { format, colours: [false; 2], kept: None }
    }

    /// The same with words in colour, as the user wishes and the terminal can.
    pub(super) fn coloured(mut self, wish: Colours) -> Self {
        let terminals = [std::io::stdout().is_terminal(), std::io::stderr().is_terminal()];
        self.colours = terminals.map(|is_terminal| wish.are_on(is_terminal));
        self
    }

    /// Keeps all results and warnings instead of writing them.
    pub(super) fn keeping() -> Self {
        Self { kept: Some(Mutex::default()), ..Self::new(LogFormat::Text) }
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
        self.print(text, false);
    }

    /// Writes a text to standard output, with verdicts in colour where it is for people.
    fn print(&self, text: &str, is_prose: bool) {
        if self.keeps(|kept| kept.text += text) {
            return;
        }
        let text = quote::printed(text.trim_end());
        let text = if is_prose && self.colours[0] { coloured(&text).into() } else { text };
        let mut out = std::io::stdout().lock();
        let _ = writeln!(out, "{text}").and_then(|()| out.flush());
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
        self.print(&outcome.summary, true);
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
            LogFormat::Text if self.colours[1] => headed(&quote::printed(line)).into(),
            LogFormat::Text => quote::printed(line),
            LogFormat::Json => quote::json(line),
        };
        let _ = writeln!(std::io::stderr(), "{line}");
    }
}

/// A line with its first word in colour where that says that something is wrong.
fn headed(line: &str) -> String {
    let heads = [("error:", RED), ("warning:", YELLOW)];
    let head = heads.iter().find_map(|(head, colour)| {
        line.strip_prefix(head).map(|rest| format!("{colour}{head}{PLAIN}{rest}"))
    });
    head.unwrap_or_else(|| line.to_owned())
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

    #[test]
    fn verdicts_are_coloured_and_nothing_else_is() {
        let line = "R1 arm at (0, 0, 0) m: doubtful, score 0.7\n  joint_1  2.9° ± 0.2° coarse";
        let words = coloured(line);
        assert!(words.contains("m: \x1b[33mdoubtful\x1b[0m, score"), "{words:?}");
        assert!(words.contains("° \x1b[33mcoarse\x1b[0m"), "{words:?}");
        let other = "note: joint 'x' is coarse; trusted_arm at (0, 0, 0) m";
        assert_eq!(coloured(other), other);
        assert_eq!(headed("error: x: y"), "\x1b[31merror:\x1b[0m x: y");
        assert_eq!(headed("used again: x"), "used again: x");
    }

    #[test]
    fn colours_follow_the_wish() {
        assert!(Colours::Always.are_on(false) && !Colours::Never.are_on(true));
        assert!(!Colours::Auto.are_on(false));
    }

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
