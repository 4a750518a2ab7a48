//! Inputs, scans and masks: what the headers of the files say before any point is read.

use crate::{Lattice, PointRaster};
use geometry::{Aabb, Pose};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Index of an input file, in the order of the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct InputId(pub u32);
/// Index of a scan over all inputs, in the order of the inputs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct ScanId(pub u32);
/// Index of a mask over all inputs, in the order of the inputs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct MaskId(pub u32);

/// The form in which points are given: a file format, or memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Format {
    /// ASTM E2807 (E57).
    E57,
    /// Leica's gridded text format.
    Ptx,
    /// ASPRS LAS 1.0–1.4.
    Las,
    /// Compressed LAS.
    Laz,
    /// Text: a count, then a line a point, once or several times.
    Pts,
    /// Text of one line a point, with or without names of columns (XYZ, CSV, TXT, ASC).
    Xyz,
    /// PLY, whose vertices are the points.
    Ply,
    /// PCD of the Point Cloud Library.
    Pcd,
    /// No file: arrays in memory that another program handed over.
    Memory,
}

/// One input file.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Input {
    /// Index of the file on the command line.
    pub id: InputId,
    /// Path as given by the user.
    pub path: PathBuf,
    /// Format of the file, by its content.
    pub format: Format,
    /// Length of the file, bytes.
    pub n_bytes: u64,
}

/// The points that share one triple of output files (`labels/N.*.npy`): one scan of an E57 or PTX
/// file, or a whole LAS or LAZ file.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Mask {
    /// Index of the mask.
    pub id: MaskId,
    /// The input file of its points.
    pub input: InputId,
    /// Display name: that of the scan, or of the file.
    pub name: String,
    /// Length of the mask: the number of points that the file does not flag as invalid. Text
    /// formats state no number, so it is `None` until the file was read.
    pub n_points: Option<u64>,
}

/// How the position of a scanner is known.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub enum ScannerPosition {
    /// The file states it.
    Stated,
    /// A person gave it.
    Given,
    /// It was found from the points.
    Found {
        /// Standard deviation along each axis of the world, metres.
        sigma: [f64; 3],
    },
    /// It is not known.
    #[default]
    Unknown,
}

impl ScannerPosition {
    /// `stated`, `given`, `found` or `unknown`.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Stated => "stated",
            Self::Given => "given",
            Self::Found { .. } => "found",
            Self::Unknown => "unknown",
        }
    }

    /// Standard deviation of a found position along each axis of the world, metres.
    #[must_use]
    pub fn sigma(self) -> Option<[f64; 3]> {
        match self {
            Self::Found { sigma } => Some(sigma),
            _ => None,
        }
    }
}

/// All points measured from one scanner position.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Scan {
    /// Index of the scan.
    pub id: ScanId,
    /// The input file of its points.
    pub input: InputId,
    /// The mask that labels its points; all scans of one LAS file share a mask.
    pub mask: MaskId,
    /// Display name.
    pub name: String,
    /// The `point_source_id` of its points, where it tells the scans of a LAS file apart.
    pub source_id: Option<u16>,
    /// First and last places of the stretches of its points in its mask, ascending, where these
    /// tell the scans of a file apart; else empty.
    pub places: Vec<[u64; 2]>,
    /// The raster of its points, where only this tells the scans of a LAS file apart.
    pub raster: Option<PointRaster>,
    /// How the position of its scanner is known.
    pub scanner: ScannerPosition,
    /// Pose of the scanner in the world, metres. Where the scanner's position is unknown this is a
    /// translation near the points, so that coordinates in the scan frame stay small.
    pub world_from_scan: Pose,
    /// The angular raster; `None` where the scanner's position is unknown, so that beams cannot
    /// prove free space.
    pub lattice: Option<Lattice>,
    /// Bounds in the world, metres, where the file states them; they may be wrong.
    pub stated_bounds: Option<Aabb>,
    /// Number of valid points, where the file states it; it may be wrong.
    pub stated_points: Option<u64>,
    /// Messages about what the file lacks and which results suffer from it.
    pub notes: Vec<String>,
}

impl Scan {
    /// Whether the beams of this scan are known and can prove free space.
    #[must_use]
    pub fn has_beams(&self) -> bool {
        self.lattice.is_some()
    }
}
