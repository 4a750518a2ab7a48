//! The command line as `clap` sees it, with help that lists commands by what they are for, and
//! each command's own options without those that it does not use.

use super::flags::Line;
use clap::{Command, CommandFactory};
use std::fmt::Write as _;

/// Commands in the order of the help.
const GROUPS: [(&str, &[&str]); 7] = [
    ("Find robots in scans", &["run", "plan", "rescan", "inspect", "scanners"]),
    ("Do a run on many machines", &["shards", "shard", "gather"]),
    ("Look at results", &["report", "verify", "diff", "history"]),
    ("Use results", &["export", "check"]),
    ("Robot libraries", &["robots"]),
    ("Try and measure", &["demo", "simulate", "bench"]),
    ("The program itself", &["config", "schema", "completions", "manual", "help"]),
];

/// Columns of a terminal of the usual size. Help is as wide on any other, so that pages and logs
/// that quote it agree.
const WIDTH: usize = 80;
/// Columns of a command's name in the list of commands, with the space around it.
const NAMES: usize = 15;

/// Options about coordinates of inputs, and the commands that read inputs of their users.
const OF_INPUTS: [&str; 2] = ["scanners", "units"];
const READ_INPUTS: [&str; 9] =
    ["run", "plan", "rescan", "shards", "shard", "gather", "inspect", "scanners", "config"];
/// Commands that search for robots, of which the method is chosen.
const SEARCH: [&str; 9] =
    ["run", "plan", "rescan", "shards", "shard", "gather", "demo", "bench", "config"];
/// Commands that read small files or none: neither memory nor threads nor settings matter to them.
const SMALL: [&str; 5] = ["diff", "history", "schema", "completions", "manual"];
const OF_WORK: [&str; 6] = ["memory", "threads", "config", "set", "progress", "verbose"];

/// The command line. Options that a command does not use are hidden from its help, but accepted, so
/// that scripts may give the same common options to every command.
pub(super) fn command() -> Command {
    let mut line = Line::command();
    let names: Vec<String> = line.get_subcommands().map(|c| c.get_name().to_owned()).collect();
    for name in &names {
        let hidden = OF_INPUTS.iter().filter(|_| !READ_INPUTS.contains(&&**name));
        let of_files = ["scanners"].iter().filter(|_| name == "scanners");
        let hidden =
            hidden.chain(of_files).chain(["method"].iter().filter(|_| !SEARCH.contains(&&**name)));
        let hidden = hidden.chain(OF_WORK.iter().filter(|_| SMALL.contains(&&**name)));
        // A command that has an argument already keeps it when common ones are handed down.
        let args: Vec<_> = line.get_arguments().filter(|a| a.is_global_set()).cloned().collect();
        let hidden: Vec<_> = hidden.map(|id| args.iter().find(|a| a.get_id() == *id)).collect();
        line = line.mut_subcommand(name, |mut command| {
            for arg in hidden.into_iter().flatten() {
                command = command.arg(arg.clone().hide(true));
            }
            command
        });
    }
    let groups = groups(&line);
    let line = line.term_width(WIDTH);
    line.help_template(format!("{{about}}\n\n{{usage-heading}} {{usage}}\n\n{groups}{{options}}"))
}

/// The list of commands by group.
fn groups(line: &Command) -> String {
    let mut text = String::new();
    for (group, names) in GROUPS {
        let _ = writeln!(text, "{group}:");
        for name in names {
            let about = line.find_subcommand(name).and_then(Command::get_about);
            let about =
                about.map_or_else(|| "Print the help of a command".into(), |a| a.to_string());
            let _ = writeln!(text, "  {name:<12} {}", wrapped(&about));
        }
        text.push('\n');
    }
    text
}

/// A text in lines beside the names of commands.
fn wrapped(about: &str) -> String {
    let mut lines = vec![String::new()];
    for word in about.split_whitespace() {
        let last = lines.last_mut().expect("there is one line from the start");
        if last.is_empty() {
            last.push_str(word);
        } else if NAMES + last.len() + 1 + word.len() <= WIDTH {
            last.push(' ');
            last.push_str(word);
        } else {
            lines.push(word.to_owned());
        }
    }
    lines.join(&format!("\n{:NAMES$}", ""))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_command_stands_in_one_group() {
        let mut listed: Vec<&str> = GROUPS.iter().flat_map(|(_, names)| *names).copied().collect();
        let line = command();
        let mut all: Vec<&str> = line.get_subcommands().map(Command::get_name).collect();
        all.push("help");
        listed.sort_unstable();
        all.sort_unstable();
        assert_eq!(listed, all);
    }

    #[test]
    fn no_help_is_wider_than_a_terminal() {
        fn check(command: &mut Command) {
            for help in [command.render_help(), command.render_long_help()] {
                let help = help.to_string();
                let wide = help.lines().find(|line| line.chars().count() > WIDTH);
                assert_eq!(wide, None, "{}", command.get_name());
            }
            command.get_subcommands_mut().for_each(check);
        }
        let mut line = command();
        line.build();
        check(&mut line);
    }

    #[test]
    fn common_options_are_accepted_where_they_are_not_shown() {
        let args = ["stillpoint", "verify", "out", "--units", "mm", "--threads", "3"];
        let found = command().try_get_matches_from(args).expect("parses");
        let verify = found.subcommand_matches("verify").expect("is the command");
        assert_eq!(verify.get_one::<usize>("threads"), Some(&3));
        let mut line = command();
        let verify = line.find_subcommand_mut("verify").expect("is there");
        let help = verify.render_long_help().to_string();
        assert!(!help.contains("--units"), "{help}");
    }
}
