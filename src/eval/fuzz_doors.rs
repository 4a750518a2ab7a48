//! Access for the fuzz targets in `tests/fuzz`, compiled for them only: decodes files that only
//! this program writes.

use crate::cache;
use crate::result::plant_probe;
use contract::{Fit, Result};
use robot::{Finding, Model};
use std::path::Path;

/// A plant's file (`plant.bin`) with this body, its digest made right.
#[must_use]
pub fn plant_file(body: &[u8]) -> Vec<u8> {
    plant_probe::file(body)
}

/// The body of a plant's file of one scan and one robot.
#[must_use]
pub fn plant_body() -> Vec<u8> {
    plant_probe::body()
}

/// Reads the plant's file of a folder, and uses its numbers as a rescan does.
///
/// # Errors
/// As a rescan refuses it.
pub fn plant(out: &Path) -> Result<()> {
    plant_probe::read(out)
}

/// Reads a kept piece of either kind, its digest made right.
#[must_use]
pub fn piece(body: &[u8]) -> [bool; 2] {
    let bytes = [blake3::hash(body).as_bytes(), body].concat();
    let fits = cache::read::<Vec<Fit>>(&bytes);
    let model = cache::read::<(Option<Model>, Vec<Finding>)>(&bytes);
    [fits.is_some(), model.is_some()]
}

/// Bodies of kept pieces: fits, and a model.
#[must_use]
pub fn pieces(model: &Model) -> Vec<Vec<u8>> {
    let bodies = [
        cache::written(&vec![Fit::default()]),
        cache::written(&(Some(model), Vec::<Finding>::new())),
    ];
    bodies.into_iter().flatten().map(|bytes| bytes[32..].to_vec()).collect()
}

/// The file of a list of outputs, its digest made right.
#[must_use]
pub fn list_file(body: &[u8]) -> Vec<u8> {
    std::str::from_utf8(body)
        .map_or_else(|_| body.to_vec(), |text| cache::sealed(text).into_bytes())
}
