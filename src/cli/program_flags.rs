//! Flags of the commands about the program itself: settings, schemas, completions and manual pages.

use clap::{Args, Subcommand, ValueEnum};
use std::path::PathBuf;

#[derive(Debug, Subcommand)]
pub(super) enum ConfigCommand {
    /// Print all settings as they would be used, as a configuration file
    Print(ConfigPrintFlags),
}

#[derive(Debug, Args)]
pub(super) struct ConfigPrintFlags {
    /// Say beside each setting where its value comes from
    #[arg(long)]
    pub(super) origin: bool,
    /// Print only settings that differ from their defaults
    #[arg(long)]
    pub(super) changed: bool,
}

/// A file with a schema.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum SchemaName {
    /// result.json of a run
    Result,
    /// changes.json of a rescan
    Changes,
    /// manifest.json, the list of a result's files
    Manifest,
    /// A --scanners file
    Scanners,
    /// A --config file
    Config,
    /// A --review file
    Review,
    /// A --readings file of robots calibrate
    Readings,
    /// robot.toml of a model in a robot library
    Robot,
    /// A scene file of simulate
    Scene,
    /// The list of shards --json
    Shards,
}

#[derive(Debug, Args)]
pub(super) struct SchemaFlags {
    /// The file that the schema describes
    #[arg(value_name = "NAME", value_enum, required_unless_present = "out")]
    pub(super) name: Option<SchemaName>,
    /// Write all schemas to this folder
    #[arg(long, value_name = "DIR", conflicts_with = "name")]
    pub(super) out: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(super) struct CompletionsFlags {
    /// The shell
    pub(super) shell: clap_complete::Shell,
}

#[derive(Debug, Args)]
pub(super) struct ManualFlags {
    /// Folder of the pages, made if it is not there
    #[arg(value_name = "DIR")]
    pub(super) out: PathBuf,
}
