//! The command `schema`: JSON schemas of the files that the program reads and writes. They are made
//! from the types of these files by `scripts/schemas.py`.

use super::exit;
use super::program_flags::{SchemaFlags, SchemaName};
use super::say::Say;
use clap::ValueEnum;
use contract::{Error, Result};
use export::atomic;

/// The schema of a file.
fn text(name: SchemaName) -> &'static str {
    match name {
        SchemaName::Result => include_str!("../guide/schemas/result.schema.json"),
        SchemaName::Changes => include_str!("../guide/schemas/changes.schema.json"),
        SchemaName::Manifest => include_str!("../guide/schemas/manifest.schema.json"),
        SchemaName::Scanners => include_str!("../guide/schemas/scanners.schema.json"),
        SchemaName::Config => include_str!("../guide/schemas/config.schema.json"),
        SchemaName::Review => include_str!("../guide/schemas/review.schema.json"),
        SchemaName::Readings => include_str!("../guide/schemas/readings.schema.json"),
        SchemaName::Robot => include_str!("../guide/schemas/robot.schema.json"),
        SchemaName::Scene => include_str!("../guide/schemas/scene.schema.json"),
        SchemaName::Shards => include_str!("../guide/schemas/shards.schema.json"),
    }
}

/// Prints one schema, or writes all of them.
pub(super) fn schema(flags: &SchemaFlags, say: &Say) -> Result<u8> {
    if let Some(name) = flags.name {
        say.bytes(text(name).as_bytes());
    }
    let Some(out) = &flags.out else { return Ok(exit::OK) };
    let unwritten = |e| Error::of_file("the schemas cannot be written", out, e);
    std::fs::create_dir_all(out).map_err(unwritten)?;
    for name in SchemaName::value_variants() {
        let word = name.to_possible_value().map(|value| value.get_name().to_owned());
        let path = out.join(format!("{}.schema.json", word.unwrap_or_default()));
        atomic::write(&path, text(*name).as_bytes())?;
    }
    say.result(&format!("schemas in {}", out.display()));
    Ok(exit::OK)
}
