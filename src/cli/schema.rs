//! The command `schema`: JSON schemas of the files that the program reads and writes. They are made
//! from the types of these files by `scripts/schemas.py`.

use super::exit;
use super::program_flags::SchemaFlags;
use super::say::Say;
use clap::ValueEnum;
use contract::{Error, Result};
use export::atomic;

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
}

impl SchemaName {
    fn text(self) -> &'static str {
        match self {
            Self::Result => include_str!("../guide/schemas/result.schema.json"),
            Self::Changes => include_str!("../guide/schemas/changes.schema.json"),
            Self::Manifest => include_str!("../guide/schemas/manifest.schema.json"),
            Self::Scanners => include_str!("../guide/schemas/scanners.schema.json"),
            Self::Config => include_str!("../guide/schemas/config.schema.json"),
            Self::Review => include_str!("../guide/schemas/review.schema.json"),
            Self::Readings => include_str!("../guide/schemas/readings.schema.json"),
            Self::Robot => include_str!("../guide/schemas/robot.schema.json"),
            Self::Scene => include_str!("../guide/schemas/scene.schema.json"),
        }
    }
}

/// Prints one schema, or writes all of them.
pub(super) fn schema(flags: &SchemaFlags, say: &Say) -> Result<u8> {
    if let Some(name) = flags.name {
        say.bytes(name.text().as_bytes());
    }
    let Some(out) = &flags.out else { return Ok(exit::OK) };
    let unwritten = |e| Error::of_file("the schemas cannot be written", out, e);
    std::fs::create_dir_all(out).map_err(unwritten)?;
    for name in SchemaName::value_variants() {
        let word = name.to_possible_value().map(|value| value.get_name().to_owned());
        let path = out.join(format!("{}.schema.json", word.unwrap_or_default()));
        atomic::write(&path, name.text().as_bytes())?;
    }
    say.result(&format!("schemas in {}", out.display()));
    Ok(exit::OK)
}
