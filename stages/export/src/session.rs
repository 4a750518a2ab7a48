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
    /// The frame that the new scans are in, where it is not the plant's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frame: Option<CarriedEntry>,
    /// How the new scans stood to the plant, once they are in its frame.
    pub scans: Vec<RegistrationEntry>,
    /// Points of older scans that the new ones replace or prove gone.
    pub n_superseded: u64,
    /// What changed, relative to this file.
    pub changes: String,
}

/// How far a new scan was off the plant; its points are written as they are when that is taken
/// back.
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

/// The frame of new scans, found by the surfaces and beams of both sessions, and what speaks for
/// it. Evidence is counted in pieces of 0.04 m² of surfaces that are not level.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CarriedEntry {
    /// `found`, or `given` with `--frame` and refined.
    pub by: String,
    /// A place in the plant is the turned place in the new frame and this, metres …
    pub xyz: [f64; 3],
    /// … turned by this.
    pub quat_xyzw: [f64; 4],
    /// Middle of what was laid on the plant, plant's frame, metres.
    pub about: [f64; 3],
    /// Standard deviations of x, y, z, metres, and of the turn about z, radians, at that place.
    pub sigma: [f64; 4],
    /// RMS distance of the new surfaces from the plant's, metres.
    pub rms: f64,
    /// New surfaces that lie on surfaces of the plant.
    pub n_on_old: usize,
    /// New surfaces where earlier beams went through.
    pub n_where_old_saw_through: usize,
    /// Surfaces of the plant near the new scanners that lie on new surfaces.
    pub n_on_new: usize,
    /// Surfaces of the plant where new beams went through.
    pub n_where_new_saw_through: usize,
    /// By how much more the next best place is contradicted; none where no other place fits half
    /// as well.
    pub margin: Option<i64>,
}
