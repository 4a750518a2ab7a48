//! Inputs, scans and masks: what was found in the files, before any point is read.

use crate::Lattice;
use geometry::{Aabb, Pose};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Index of an input file, in the order of the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct InputId(pub u32);
/// Index of a scan over all inputs, in their order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct ScanId(pub u32);
/// Index of a mask over all inputs, in their order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct MaskId(pub u32);

/// A point format that is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Format {
    /// ASTM E2807.
    E57,
    /// Leica's gridded text.
    Ptx,
    /// ASPRS LAS 1.0–1.4.
    Las,
    /// LAS, compressed.
    Laz,
}

/// One input file.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Input {
    /// Its place on the command line.
    pub id: InputId,
    /// As given.
    pub path: PathBuf,
    /// What it is.
    pub format: Format,
    /// Length of the file, bytes.
    pub n_bytes: u64,
}

/// The points of one output triple (`labels/N.*.npy`): one scan of an E57 or PTX file, one LAS or
/// LAZ file whole.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Mask {
    /// Its number.
    pub id: MaskId,
    /// Where its points come from.
    pub input: InputId,
    /// Name for people: scan name, or file name.
    pub name: String,
    /// Points that the file does not itself flag as invalid: the length of the mask. For text
    /// formats it is known only once read, and then `None` here.
    pub n_points: Option<u64>,
}

/// All points measured from one scanner position.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Scan {
    /// Its number.
    pub id: ScanId,
    /// Where its points come from.
    pub input: InputId,
    /// The mask that labels its points (several scans of one LAS file share one).
    pub mask: MaskId,
    /// Name for people.
    pub name: String,
    /// LAS `point_source_id` of its points, where scans of one file are told apart by it.
    pub source_id: Option<u16>,
    /// Pose of the scanner. Where the scanner's position is not known: a translation near the
    /// points, so that coordinates about it stay small.
    pub world_from_scan: Pose,
    /// The angular raster; `None` where the scanner's position is not known: then there is no
    /// free-space evidence.
    pub lattice: Option<Lattice>,
    /// Bounds in the world, metres, where the file states them; may be wrong, so only a hint.
    pub stated_bounds: Option<Aabb>,
    /// Number of valid points as stated by the file, where stated.
    pub stated_points: Option<u64>,
    /// What is missing and what will be worse for it, in words.
    pub notes: Vec<String>,
}

impl Scan {
    /// Whether beams of this scan can prove free space.
    #[must_use]
    pub fn has_beams(&self) -> bool {
        self.lattice.is_some()
    }
}
