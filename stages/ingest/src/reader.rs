//! What every format gives: its masks and scans, a sample of each scan, and its points as strips in file order.

use contract::{Attributes, Format, Result};
use geometry::{Aabb, Pose};

/// How much of each point is wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Want {
    /// Coordinates and places only.
    Coordinates,
    /// Every attribute as well.
    Everything,
}

/// A mask of one file, before it has a number over all inputs.
#[derive(Debug, Clone)]
pub(crate) struct MaskSeed {
    /// Name for people.
    pub(crate) name: String,
    /// Valid points, where known without reading them.
    pub(crate) n_points: Option<u64>,
}

/// A scan of one file, before it has a number over all inputs and a lattice.
#[derive(Debug, Clone)]
pub(crate) struct ScanSeed {
    /// Name for people.
    pub(crate) name: String,
    /// Which mask of this file labels it.
    pub(crate) mask: usize,
    /// LAS point source id, where scans are told apart by it.
    pub(crate) source_id: Option<u16>,
    /// Pose; a translation near the points where the scanner is not known.
    pub(crate) world_from_scan: Pose,
    /// Whether the scan frame's origin is the scanner.
    pub(crate) scanner_known: bool,
    /// Stated bounds in the world.
    pub(crate) stated_bounds: Option<Aabb>,
    /// Stated number of valid points.
    pub(crate) stated_points: Option<u64>,
    /// About how many it has, where a look at the file told.
    pub(crate) likely_points: Option<u64>,
    /// What is missing and what is worse for it.
    pub(crate) notes: Vec<String>,
}

/// A valid point of a sample, with its native row and column where the file has them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Sampled {
    /// Scan frame, metres.
    pub(crate) xyz: [f32; 3],
    /// Native row and column.
    pub(crate) native: Option<[u32; 2]>,
}

/// A strip with this file's own numbers for scan and mask. It holds no point only at the end of a mask whose length is
/// not known beforehand and whose last points were dropped: `first_place` is then the length of the mask.
#[derive(Debug, Clone)]
pub(crate) struct RawStrip {
    /// Index of the scan in this file.
    pub(crate) scan: usize,
    /// Place in the mask of the first point.
    pub(crate) first_place: u64,
    /// Places less `first_place`, ascending.
    pub(crate) place: Vec<u32>,
    /// Scan frame, metres.
    pub(crate) xyz: Vec<[f32; 3]>,
    /// Where asked for.
    pub(crate) attributes: Option<Attributes>,
}

/// Strips of one file, in its order.
pub(crate) type RawStrips<'a> = Box<dyn Iterator<Item = Result<RawStrip>> + Send + 'a>;

/// An open file: headers read and checked, points not yet.
pub(crate) trait Reader: Send + Sync {
    /// What it is.
    fn format(&self) -> Format;
    /// Its masks.
    fn masks(&self) -> &[MaskSeed];
    /// Its scans.
    fn scans(&self) -> &[ScanSeed];
    /// Up to `n` valid points of a scan, as runs of neighbours in file order spread over the scan.
    fn sample(&self, scan: usize, n: usize) -> Result<Vec<Sampled>>;
    /// All valid points in file order. Ends with an error, never with a silent end, where the file is broken.
    fn strips(&self, want: Want) -> Result<RawStrips<'_>>;
    /// Whether points have colour.
    fn has_color(&self) -> bool;
    /// Scale and offset of its coordinates, metres, where they are whole multiples of a step (LAS).
    fn quantum(&self) -> Option<([f64; 3], [f64; 3])> {
        None
    }
    /// Whether all that was read so far was really there: a mapped file may have been cut short.
    fn check(&self) -> Result<()> {
        Ok(())
    }
    /// What the file says of itself, as `(name, value)` pairs for `inspect`.
    fn facts(&self) -> Vec<(String, String)>;
}
