//! The rescan of a cell in `result.json`.

use serde::{Deserialize, Serialize};

/// A cell that was scanned again.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RescanEntry {
    /// Digest of the file list of the earlier result.
    pub base: String,
    /// Bounds of the cell, world, metres: lowest and highest corner.
    pub cell: [[f64; 3]; 2],
    /// Indices of the inputs of this session.
    pub inputs: Vec<u32>,
    /// Ids of the robots that were searched again.
    pub robots: Vec<String>,
    /// The frame of the new scans, if it is not the plant's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frame: Option<CarriedEntry>,
    /// Registration errors of the new scans, in the plant's frame.
    pub scans: Vec<RegistrationEntry>,
    /// Number of points of older scans that the new ones replace or prove gone.
    pub n_superseded: u64,
    /// Path of the list of changes, relative to this file.
    pub changes: String,
}

/// Registration error of a new scan relative to the plant; the scan's points are written with the
/// correction applied.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RegistrationEntry {
    /// Name of the scan.
    pub scan: String,
    /// Shift that aligns the scan with the plant, at the centre of the cell, metres, world axes.
    pub shift: [f64; 3],
    /// Rotation vector about that centre, radians, world axes.
    pub turn: [f64; 3],
    /// Standard deviations of `shift` (metres) and `turn` (radians).
    pub sigma: [f64; 6],
    /// RMS distance from the plant's surfaces before and after, metres.
    pub rms: [f64; 2],
}

/// The frame of new scans, with the evidence for it. Evidence is counted in pieces of 0.04 m² of
/// surfaces that are not level.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CarriedEntry {
    /// `found`, or `given` if `--frame` gave it and it was refined.
    pub by: String,
    /// Translation of the pose `plant_from_new_frame`, metres.
    pub xyz: [f64; 3],
    /// Rotation of that pose, unit quaternion.
    pub quat_xyzw: [f64; 4],
    /// Centroid of the aligned surfaces, plant frame, metres.
    pub about: [f64; 3],
    /// Standard deviations of x, y, z (metres) and of the rotation about z (radians), at that
    /// place.
    pub sigma: [f64; 4],
    /// RMS distance of the new surfaces from the plant's, metres.
    pub rms: f64,
    /// Number of new surface pieces that lie on surfaces of the plant.
    pub n_on_old: usize,
    /// Number of new surface pieces where earlier beams passed through.
    pub n_where_old_saw_through: usize,
    /// Number of surface pieces of the plant, near the new scanners, that lie on new surfaces.
    pub n_on_new: usize,
    /// Number of surface pieces of the plant where new beams passed through.
    pub n_where_new_saw_through: usize,
    /// By how many more pieces the next best place is contradicted; `None` where no other place
    /// fits half as well.
    pub margin: Option<i64>,
}
