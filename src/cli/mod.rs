//! The command line: parses the arguments, runs the command and returns the exit code. Results are
//! written to standard output, everything else to standard error.

mod answer;
mod bench;
mod bench_flags;
mod common;
mod config;
mod demo;
pub mod exit;
mod flags;
mod help;
mod inspect;
mod keep_going;
mod manual;
mod program_flags;
mod results;
mod robots;
mod run;
mod say;
mod scanners;
mod scanners_flags;
mod schema;
mod shards;
mod simulate;

pub use answer::answer;
use bench_flags::BenchCommand;
use clap::FromArgMatches;
pub use common::means_and_engine;
use contract::{Error, Kind, Result, fence};
use flags::{Command, Line, RobotsCommand};
use program_flags::ConfigCommand;
pub use say::CommandAnswer;
use say::{LogFormat, Say};
use std::ffi::OsString;

/// Runs the program with these arguments (program name first) and returns the exit code.
#[must_use]
pub fn main(args: impl IntoIterator<Item = OsString>) -> u8 {
    let args: Vec<OsString> = args.into_iter().collect();
    let found = help::command().try_get_matches_from(&args);
    let line = match found.and_then(|found| Line::from_arg_matches(&found)) {
        Ok(line) => line,
        Err(error) => return refuse(&error, &args),
    };
    let say = Say::new(line.common.log_format).coloured(line.common.color);
    say.for_panics();
    let done = fence::fenced(|| run(&line, &say)).unwrap_or_else(|what| {
        Err(Error::new(Kind::Bug, format!("the program ended by a panic: {what}"))
            .hint("this is a fault of stillpoint: please report it with its input"))
    });
    done.unwrap_or_else(|error| {
        say.error(&error);
        exit::code(error.kind())
    })
}

/// Reports an invalid command line, in the log format that it requests as far as that can be
/// parsed.
fn refuse(error: &clap::Error, args: &[OsString]) -> u8 {
    if !error.use_stderr() {
        // Help and version are errors to clap, but no failures; nor is a closed pipe.
        let _ = error.print();
        return exit::OK;
    }
    let is_json = |pair: &[OsString]| pair[0] == "--log-format" && pair[1] == "json";
    if args.windows(2).any(is_json) || args.iter().any(|arg| arg == "--log-format=json") {
        let text = error.to_string();
        let text = text.strip_prefix("error: ").unwrap_or(&text).trim();
        Say::new(LogFormat::Json).error(&Error::new(Kind::Usage, text));
    } else {
        let _ = error.print();
    }
    exit::code(Kind::Usage)
}

fn run(line: &Line, say: &Say) -> Result<u8> {
    match &line.command {
        Command::Demo(flags) => demo::demo(flags, &line.common, say),
        Command::Inspect(flags) => inspect::inspect(flags, &line.common, say),
        Command::Scanners(flags) => scanners::scanners(flags, &line.common, say),
        Command::Run(flags) => run::run(flags, &line.common, say),
        Command::Plan(flags) => run::plan(flags, &line.common, say),
        Command::Rescan(flags) => run::rescan(flags, &line.common, say),
        Command::Shards(flags) => shards::list(flags, &line.common, say),
        Command::Shard(flags) => shards::make(flags, &line.common, say),
        Command::Gather(flags) => shards::gather(flags, &line.common, say),
        Command::Verify(flags) => results::verify(flags, &line.common, say),
        Command::Report(flags) => results::report(flags, &line.common, say),
        Command::Export(flags) => results::export(flags, &line.common, say),
        Command::Check(flags) => results::check_paths(flags, &line.common, say),
        Command::Diff(flags) => results::diff(flags, say),
        Command::History(flags) => results::history(flags, say),
        Command::Bench(BenchCommand::Accuracy(flags)) => {
            bench::bench_accuracy(flags, &line.common, say)
        }
        Command::Bench(BenchCommand::Plant(flags)) => bench::bench_plant(flags, &line.common, say),
        Command::Bench(BenchCommand::Check(flags)) => bench::bench_check(flags, &line.common, say),
        Command::Bench(BenchCommand::Plan(flags)) => bench::bench_plan(flags, &line.common, say),
        Command::Bench(BenchCommand::Rescan(flags)) => {
            bench::bench_rescan(flags, &line.common, say)
        }
        Command::Bench(BenchCommand::Scanners(flags)) => {
            bench::bench_scanners(flags, &line.common, say)
        }
        Command::Bench(BenchCommand::Throughput(flags)) => {
            bench::bench_throughput(flags, &line.common, say)
        }
        Command::Simulate(flags) => simulate::simulate(flags, &line.common, say),
        Command::Robots(RobotsCommand::Lint(flags)) => robots::lint(flags, &line.common, say),
        Command::Robots(RobotsCommand::Calibrate(flags)) => {
            robots::calibrate(flags, &line.common, say)
        }
        Command::Config(ConfigCommand::Print(flags)) => config::print(flags, &line.common, say),
        Command::Schema(flags) => schema::schema(flags, say),
        Command::Completions(flags) => Ok(manual::completions(flags, say)),
        Command::Manual(flags) => manual::manual(flags, say),
    }
}
