//! Completions for shells and manual pages, made of the same definitions as the help.

use super::exit;
use super::help;
use super::program_flags::{CompletionsFlags, ManualFlags};
use super::say::Say;
use contract::{Error, Result};

/// Prints the script for a shell.
pub(super) fn completions(flags: &CompletionsFlags, say: &Say) -> u8 {
    let mut script = Vec::new();
    clap_complete::generate(flags.shell, &mut help::command(), "stillpoint", &mut script);
    say.bytes(&script);
    exit::OK
}

/// Writes the pages, one for the program and one for each command.
pub(super) fn manual(flags: &ManualFlags, say: &Say) -> Result<u8> {
    let out = &flags.out;
    let unwritten = |e| Error::of_file("the manual pages cannot be written", out, e);
    std::fs::create_dir_all(out).map_err(unwritten)?;
    let line = help::command().disable_help_subcommand(true);
    clap_mangen::generate_to(line, out).map_err(unwritten)?;
    say.result(&format!("manual pages in {}", out.display()));
    Ok(exit::OK)
}
