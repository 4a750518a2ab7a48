//! An open E57 file: what its description states of its scans.

use super::scan::E57Scan;
use crate::oddities::Oddities;
use crate::reader::{MaskSeed, ScanSeed};
use crate::settings::Settings;
use crate::units::Units;
use std::path::PathBuf;

/// An open E57 file.
pub(super) struct E57File {
    pub(super) path: PathBuf,
    pub(super) settings: Settings,
    pub(super) masks: Vec<MaskSeed>,
    pub(super) scans: Vec<ScanSeed>,
    pub(super) files: Vec<E57Scan>,
    /// Counts of odd points, one entry a scan.
    pub(super) oddities: Vec<Oddities>,
    pub(super) facts: Vec<(String, String)>,
    pub(super) units: Units,
}
