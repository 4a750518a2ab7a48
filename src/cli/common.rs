//! Flags of all commands, and what they come to together with configuration and environment.

use super::say::{Colours, LogFormat};
use crate::engine::progress::{Mode, Progress};
use crate::engine::{Engine, WatchedWork};
use crate::job::{FlagValues, Means};
use clap::Args;
use contract::Result;
use std::path::PathBuf;

/// Words that `--scanners` takes in place of a file.
const AUTO: &str = "auto";
const NONE: &str = "none";
/// Variable of the environment that names a configuration file.
const CONFIG: &str = "STILLPOINT_CONFIG";
/// Beginning of the names of variables that hold one setting each.
const SETTING: &str = "STILLPOINT_SET_";

/// Settings of the environment, sorted by name.
fn environment() -> Vec<(String, String)> {
    let text = |(name, value): (std::ffi::OsString, std::ffi::OsString)| {
        Some((name.into_string().ok()?, value.to_string_lossy().into_owned()))
    };
    let all = std::env::vars_os().filter_map(text);
    let mut own: Vec<_> = all.filter(|(name, _)| name.starts_with(SETTING)).collect();
    own.sort();
    own
}

/// Flags of all commands. `help.rs` hides those that a command does not use.
#[derive(Debug, Args)]
#[command(next_help_heading = "Common options")]
pub(super) struct Common {
    /// Upper bound of resident memory, for example 4GiB
    #[arg(long, global = true, value_name = "SIZE")]
    memory: Option<String>,
    /// Number of worker threads (default: one per core)
    #[arg(long, global = true, value_name = "N")]
    threads: Option<usize>,
    /// File of scanner poses (TOML or JSON), for formats without poses; "auto" finds them from the
    /// points, "none" leaves them unknown (default: those of the configuration, else auto)
    #[arg(long, global = true, value_name = "FILE")]
    scanners: Option<PathBuf>,
    /// Unit of the inputs' coordinates: m, cm, mm, km, in, ft, us-ft; NAME=UNIT for one file,
    /// us-ft/m for heights in another unit, several separated by commas (default: what each file
    /// declares, or metres)
    #[arg(long, global = true, value_name = "UNIT")]
    units: Option<String>,
    /// Configuration file with settings (TOML; default: that of STILLPOINT_CONFIG)
    #[arg(long, global = true, value_name = "FILE")]
    config: Option<PathBuf>,
    /// One setting, for example fit.beam=150; takes precedence over the configuration file and over
    /// variables of the environment (STILLPOINT_SET_FIT_BEAM=150)
    #[arg(long, global = true, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Method that finds postures: "beam" (default), or "paper", the link-by-link method of the
    /// paper
    #[arg(long, global = true, value_name = "NAME")]
    method: Option<String>,
    /// How progress is shown (default: a bar on a terminal, lines elsewhere)
    #[arg(long, global = true, value_enum, value_name = "HOW")]
    progress: Option<Mode>,
    /// How warnings and errors are written
    #[arg(long, global = true, value_enum, value_name = "HOW", default_value = "text")]
    pub(super) log_format: LogFormat,
    /// When verdicts, warnings and errors are coloured
    #[arg(long, global = true, value_enum, value_name = "WHEN", default_value = "auto")]
    pub(super) color: Colours,
    /// On a terminal, leave a line for each stage that has ended above the bar
    #[arg(long, short, global = true)]
    verbose: bool,
    /// Cancellation and progress of a program that calls the command in its own process.
    #[arg(skip)]
    pub(super) watched: Option<WatchedWork>,
}

impl Common {
    /// Combines and checks defaults, configuration and flags.
    pub(super) fn means(&self) -> Result<Means> {
        let method = self.method.iter().map(|name| format!("fit.method={name}"));
        let units = self.units.iter().map(|unit| format!("ingest.units=\"{unit}\""));
        with_environment(FlagValues {
            memory: self.memory.clone(),
            threads: self.threads,
            config: self.config.clone(),
            set: self.set.iter().cloned().chain(method).chain(units).collect(),
            ..FlagValues::default()
        })
    }

    #[cfg(test)]
    pub(super) fn threads(&self) -> Option<usize> {
        self.threads
    }

    /// The file of scanner poses: that of the flag, else that of the configuration.
    pub(super) fn scanners(&self, means: &Means) -> Option<PathBuf> {
        match self.word() {
            Some(_) => None,
            None => self.scanners.clone().or_else(|| means.scanners.clone()),
        }
    }

    /// Whether positions are found from the points where no file is given.
    pub(super) fn finds_scanners(&self) -> bool {
        self.word() != Some(NONE)
    }

    /// Whether the flag asks for positions from the points by name.
    pub(super) fn asks_for_scanners(&self) -> bool {
        self.word() == Some(AUTO)
    }

    /// The word that stands in place of a file.
    fn word(&self) -> Option<&str> {
        self.scanners.as_deref()?.to_str().filter(|word| [AUTO, NONE].contains(word))
    }

    /// How a terminal or a log shows progress.
    fn shown(&self) -> Progress {
        match (self.progress, self.log_format) {
            // With JSON requested, bars and lines for people are left out.
            (Some(Mode::None), LogFormat::Json) => Progress::json_without_progress(),
            (_, LogFormat::Json) => Progress::new(Mode::Json),
            (mode, LogFormat::Text) => match mode.unwrap_or_else(Mode::fitting) {
                Mode::Bar if self.verbose => Progress::bar_with_stages(),
                mode => Progress::new(mode),
            },
        }
    }

    /// An engine that shows progress and reacts to Ctrl-C, or to the program that watches it.
    /// Without a watcher it may be created only once.
    pub(super) fn engine(&self, means: &Means) -> Result<Engine> {
        let mut engine = bare_engine(means);
        match &self.watched {
            Some(watched) => {
                engine.progress = watched.progress.clone();
                engine.cancel = watched.cancel.clone();
            }
            None => {
                engine.progress = self.shown();
                engine.cancel.on_ctrl_c()?;
            }
        }
        Ok(engine)
    }
}

/// Settings from flags and the environment, and an engine with them, for a program that calls a
/// part of this one in its own process and watches it.
///
/// # Errors
/// Flags, a configuration or a variable of the environment that cannot be.
pub fn means_and_engine(flags: FlagValues, watched: &WatchedWork) -> Result<(Means, Engine)> {
    let means = with_environment(flags)?;
    let mut engine = bare_engine(&means);
    engine.progress = watched.progress.clone();
    engine.cancel = watched.cancel.clone();
    Ok((means, engine))
}

/// Settings from flags and the environment.
fn with_environment(flags: FlagValues) -> Result<Means> {
    let named = || std::env::var_os(CONFIG).map(PathBuf::from);
    let config = flags.config.or_else(named);
    Means::of(&FlagValues { config, environment: environment(), ..flags })
}

/// An engine with the threads and memory of these settings, which nobody watches yet.
fn bare_engine(means: &Means) -> Engine {
    let mut engine = Engine::new(means.n_threads);
    engine.channel_bytes = means.channel_bytes();
    engine.is_narrow = means.is_narrow();
    // Libraries that use rayon by themselves get the same number of threads; a pool that exists
    // already (in tests, and of an earlier call) is kept.
    let _ = rayon::ThreadPoolBuilder::new().num_threads(means.n_threads).build_global();
    engine
}
