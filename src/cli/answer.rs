//! Commands that another program calls in its own process: the same flags, checks and steps as on
//! the command line, with the answer as a value instead of on the terminal.

use super::flags::Line;
use super::say::{CommandAnswer, Say};
use super::{help, run};
use crate::engine::WatchedWork;
use clap::FromArgMatches;
use contract::{Error, Kind, Result};
use std::ffi::OsString;

/// Runs a command with these arguments (without the program's name). Nothing is printed, no handler
/// for Ctrl-C is installed: `watched` cancels, and receives the progress.
///
/// # Errors
/// Wrong arguments, as `Usage`; the error of the command.
pub fn answer(
    args: impl IntoIterator<Item = OsString>,
    watched: &WatchedWork,
) -> Result<CommandAnswer> {
    let args = std::iter::once("stillpoint".into()).chain(args);
    let line = help::command().try_get_matches_from(args);
    let mut line = line.and_then(|found| Line::from_arg_matches(&found)).map_err(|e| usage(&e))?;
    line.common.watched = Some(watched.clone());
    let say = Say::keeping();
    let code = run(&line, &say)?;
    Ok(CommandAnswer { code, ..say.kept() })
}

/// What is wrong with the arguments, in the first paragraph of what `clap` says of it.
fn usage(error: &clap::Error) -> Error {
    let text = error.to_string();
    let text = text.strip_prefix("error: ").unwrap_or(&text);
    let first = text.split("\n\n").next().unwrap_or(text);
    Error::new(Kind::Usage, first.split_whitespace().collect::<Vec<_>>().join(" "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::watched;

    fn told(args: &[&str]) -> Result<CommandAnswer> {
        let args: Vec<OsString> = args.iter().map(OsString::from).collect();
        watched(|own| answer(args, &own), |_| true)
    }

    #[test]
    fn a_command_answers_with_what_it_prints() {
        let told = told(&["config", "print", "--set", "fit.beam=77"]).expect("prints");
        assert_eq!(told.code, 0);
        assert!(told.text.contains("beam = 77"), "{}", told.text);
    }

    #[test]
    fn wrong_arguments_and_missing_files_are_errors() {
        let error = told(&["run", "--colour", "red"]).expect_err("a flag that is none");
        assert_eq!(error.kind(), Kind::Usage);
        assert!(error.to_string().contains("--colour"), "{error}");
        let error = told(&["inspect", "no/such.e57"]).expect_err("no file");
        assert_eq!((error.kind(), error.place()), (Kind::BadInput, Some("no/such.e57")));
        assert_eq!(told(&["--help"]).expect_err("no command").kind(), Kind::Usage);
    }
}
