//! What a result says of the session that it goes on from.

use serde::{Deserialize, Serialize};

/// A cell that was scanned again.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RescanEntry {
    /// Digest of the list of the result that it goes on from.
    pub base: String,
    /// Bounds of the cell, world, metres: least and greatest corner.
    pub cell: [[f64; 3]; 2],
    /// Inputs of this session, by their place among the inputs.
    pub inputs: Vec<u32>,
    /// Robots that were looked at again.
    pub robots: Vec<String>,
    /// How the new scans stood to the plant.
    pub scans: Vec<RegistrationEntry>,
    /// Points of older scans that the new ones replace or prove gone.
    pub n_superseded: u64,
    /// What changed, relative to this file.
    pub changes: String,
}

/// How far a new scan was off the plant; its points are written as they are when that is taken back.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RegistrationEntry {
    /// Name of the scan.
    pub scan: String,
    /// Shift that lays it on the plant, at the middle of the cell, metres, world axes.
    pub shift: [f64; 3],
    /// Turn about there, radians, world axes.
    pub turn: [f64; 3],
    /// Standard deviations of both.
    pub sigma: [f64; 6],
    /// RMS distance from the plant's surfaces before and after, metres.
    pub rms: [f64; 2],
}
