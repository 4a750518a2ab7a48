//! How `result.json` states a scan and the position of its scanner.

use contract::{Scan, ScannerPosition};
use serde::{Deserialize, Serialize};

/// A scan, and where its scanner stood.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ScanEntry {
    /// Number of the scan, in the order of the inputs.
    pub scan: u32,
    /// Display name.
    pub name: String,
    /// How the position of the scanner is known: `stated` (by the file), `given` (with --scanners),
    /// `found` (from the points) or `unknown`.
    pub scanner: String,
    /// Position of the scanner in the world, metres; missing where it is unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub position: Option<[f64; 3]>,
    /// Standard deviation of a found position along x, y, z, metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma: Option<[f64; 3]>,
}

impl From<&Scan> for ScanEntry {
    fn from(scan: &Scan) -> Self {
        let is_known = scan.scanner != ScannerPosition::Unknown;
        Self {
            scan: scan.id.0,
            name: scan.name.clone(),
            scanner: scan.scanner.word().into(),
            position: is_known.then(|| scan.world_from_scan.translation.vector.into()),
            sigma: scan.scanner.sigma(),
        }
    }
}
