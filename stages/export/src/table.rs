//! Writes the legend of masks and clouds, `labels/table.json`.

use crate::atomic;
use crate::record::CLASSES;
use crate::result::RobotEntry;
use contract::{Error, Kind, PointKind, Result};
use serde_json::json;
use std::path::Path;

/// Writes `labels/table.json`: the meaning of the numbers in masks and clouds.
///
/// # Errors
/// If the file cannot be written.
pub fn write_table(out: &Path, robots: &[RobotEntry]) -> Result<()> {
    let kinds = [
        (PointKind::Fixed, "fixed"),
        (PointKind::Link, "link"),
        (PointKind::Attachment, "attachment"),
        (PointKind::Floor, "floor"),
        (PointKind::Uncertain, "uncertain"),
    ];
    let kinds: Vec<_> =
        kinds.iter().map(|(kind, name)| json!({"value": *kind as u8, "name": name})).collect();
    let robots: Vec<_> = robots
        .iter()
        .enumerate()
        .map(|(i, r)| json!({"value": i, "id": r.id, "model": r.model, "links": r.links}))
        .collect();
    let classes: Vec<_> =
        CLASSES.iter().map(|(_, value, name)| json!({"value": value, "name": name})).collect();
    let table = json!({
        "schema": "stillpoint.labels/1",
        "kinds": kinds,
        "robots": robots,
        "none": -1,
        "las": {
            "classification": classes,
            "extra_bytes": {"RobotId": "index of the robot + 1, 0 for none", "LinkId": "index of the link + 1, 0 for none"},
        },
    });
    let text = serde_json::to_string_pretty(&table)
        .map_err(|e| Error::new(Kind::Bug, "label table does not serialize").because(e))?;
    atomic::write(&out.join("labels/table.json"), (text + "\n").as_bytes())
}
