//! An open PTX file: what its blocks state, and where their points begin.

use crate::frame::FileFrame;
use crate::levels::Span;
use crate::oddities::Oddities;
use crate::reader::{MaskSeed, ScanSeed};
use crate::settings::Settings;
use crate::units::Units;
use std::path::PathBuf;

/// One scan of the file.
#[derive(Debug, Clone)]
pub(super) struct PtxScan {
    /// Number of rows.
    pub(super) n_rows: u64,
    /// Number of lines of points.
    pub(super) n_lines: u64,
    /// Number of values of a line.
    pub(super) n_columns: usize,
    /// Number of lines that are not `0 0 0`.
    pub(super) n_valid: u64,
    /// Byte offset of the points, and number of the line before.
    pub(super) points_at: (u64, u64),
    /// Metres per unit of the file.
    pub(super) metres: f64,
    /// Conversion from the file's coordinates (metres) to the scan frame.
    pub(super) frame: FileFrame,
    /// The intensities that become 0 and 65535.
    pub(super) intensity: Span,
    /// The step of the coordinates, metres; `None` where it is fine enough.
    pub(super) step: Option<f64>,
}

/// An open PTX file.
pub(super) struct PtxFile {
    pub(super) path: PathBuf,
    pub(super) settings: Settings,
    pub(super) masks: Vec<MaskSeed>,
    pub(super) scans: Vec<ScanSeed>,
    pub(super) blocks: Vec<PtxScan>,
    pub(super) units: Units,
    /// Counts of odd points, one entry a scan.
    pub(super) oddities: Vec<Oddities>,
}
