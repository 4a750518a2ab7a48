//! What every format gives: its masks and scans, a sample of each scan, and its points as strips in
//! file order.

use crate::map::Mapped;
use crate::oddities::Oddities;
use crate::units::Units;
use contract::{Attributes, Error, Format, Kind, Result};
use geometry::{Aabb, Pose};
use std::ops::Range;

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
    /// Points that the file states, those that are not valid with them; of no use but to guess how
    /// much there is.
    pub(crate) n_stated: Option<u64>,
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
    /// The step that its coordinates come in, metres, where it is coarse.
    pub(crate) step: Option<f64>,
}

/// A valid point of a sample, with its native row and column where the file has them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SampledPoint {
    /// Scan frame, metres.
    pub(crate) xyz: [f32; 3],
    /// Native row and column.
    pub(crate) native: Option<[u32; 2]>,
}

/// A strip with this file's own numbers for scan and mask. It holds no point only at the end of a
/// mask whose length is not known beforehand and whose last points were dropped: `first_place` is
/// then the length of the mask.
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

/// Consecutive bytes of a file that are points by themselves, so that any thread may read them; or
/// that hold none. Extents cover a file from its first byte to its last.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Extent {
    /// Where its bytes lie in the file.
    pub bytes: Range<u64>,
    /// Place of its first point.
    pub(crate) first: u64,
    /// Number of its points.
    pub n_points: u64,
}

/// Bytes without points that are read at once, at most.
const GAP: usize = 1 << 20;

impl Extent {
    /// Its bytes in those of the file.
    pub(crate) fn of<'a>(&self, file: &'a [u8]) -> &'a [u8] {
        &file[self.bytes.start as usize..self.bytes.end as usize]
    }

    /// Extents with points, and what lies before, between and behind them in a file of so many
    /// bytes.
    pub(crate) fn cover(
        points: impl Iterator<Item = Self>,
        n_bytes: u64,
    ) -> impl Iterator<Item = Self> {
        let none = |bytes| Self { bytes, first: 0, n_points: 0 };
        let mut at = 0;
        let all = points.chain([none(n_bytes..n_bytes)]).flat_map(move |next| {
            let end = next.bytes.start;
            let starts = (at..end).step_by(GAP);
            at = next.bytes.end;
            starts.map(move |start| none(start..end.min(start + GAP as u64))).chain([next])
        });
        all.filter(|extent| !extent.bytes.is_empty())
    }
}

/// How a file is read, in its order.
pub(crate) enum FileReading<'a> {
    /// From its beginning on.
    Straight(RawStrips<'a>),
    /// By extents, each of which is decoded by itself.
    ByExtent(Box<dyn Iterator<Item = Extent> + Send + 'a>),
}

/// An open file: headers read and checked, points not yet.
pub(crate) trait Reader: Send + Sync {
    /// What it is.
    fn format(&self) -> Format;
    /// Its masks.
    fn masks(&self) -> &[MaskSeed];
    /// Its scans.
    fn scans(&self) -> &[ScanSeed];
    /// Up to `n` valid points of a scan, as runs of neighbours in file order spread over the scan.
    fn sample(&self, scan: usize, n: usize) -> Result<Vec<SampledPoint>>;
    /// Up to `n` valid points of a scan, scan frame, metres, evenly spread over it; of a scan of
    /// more than `most` points over so many.
    fn spread(&self, scan: usize, n: usize, most: u64) -> Result<Vec<[f32; 3]>>;
    /// All valid points in file order. Ends with an error, never with a silent end, where the file
    /// is broken.
    fn read(&self, want: Want) -> Result<FileReading<'_>>;
    /// The points of an extent, from its bytes.
    fn decode(&self, extent: &Extent, _bytes: &[u8], _want: Want) -> Result<Vec<RawStrip>> {
        let what = format!("bytes {:?} were given to a format without extents", extent.bytes);
        Err(Error::new(Kind::Bug, what))
    }
    /// Its bytes, where it is mapped.
    fn mapped(&self) -> Option<&Mapped> {
        None
    }
    /// Units of its coordinates as they stand in the file; what it gives is in metres.
    fn units(&self) -> &Units;
    /// The coordinates of one scan from its first point on, where a scan can be read by itself.
    fn read_scan(&self, _scan: usize) -> Option<RawStrips<'_>> {
        None
    }
    /// Whether points have colour.
    fn has_color(&self) -> bool;
    /// Scale and offset of its coordinates, metres, where they are whole multiples of a step (LAS).
    fn quantum(&self) -> Option<([f64; 3], [f64; 3])> {
        None
    }
    /// What was odd about the points of a scan when all was last read, where that is counted.
    fn oddities(&self, _scan: usize) -> Option<&Oddities> {
        None
    }
    /// Whether all that was read so far was really there: a mapped file may have been cut short.
    fn check(&self) -> Result<()> {
        self.mapped().map_or(Ok(()), Mapped::check)
    }
    /// What the file says of itself, as `(name, value)` pairs for `inspect`.
    fn facts(&self) -> Vec<(String, String)>;
}

/// The strips of a file on this thread, whichever way it is read.
pub(crate) fn strips(reader: &dyn Reader, want: Want) -> Result<RawStrips<'_>> {
    let extents = match reader.read(want)? {
        FileReading::Straight(strips) => return Ok(strips),
        FileReading::ByExtent(extents) => extents,
    };
    let decode = move |extent: Extent| {
        let bytes = reader.mapped().map_or(&[][..], |map| extent.of(map));
        match reader.decode(&extent, bytes, want) {
            Ok(strips) => strips.into_iter().map(Ok).collect(),
            Err(error) => vec![Err(error)],
        }
    };
    // An error is the end.
    let mut has_failed = false;
    let until = move |strip: &Result<RawStrip>| {
        let goes_on = !has_failed;
        has_failed |= strip.is_err();
        goes_on
    };
    Ok(Box::new(extents.flat_map(decode).take_while(until)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extents_cover_a_file() {
        let points = |bytes: Range<u64>| Extent { bytes, first: 3, n_points: 5 };
        let gap = GAP as u64;
        let all = [points(2 * gap + 7..2 * gap + 9), points(2 * gap + 9..3 * gap)];
        let of =
            |n_bytes: u64| -> Vec<Extent> { Extent::cover(all.iter().cloned(), n_bytes).collect() };
        let covered = of(3 * gap + 1);
        assert!(covered.iter().zip(&covered[1..]).all(|(a, b)| a.bytes.end == b.bytes.start));
        assert_eq!((covered[0].bytes.start, covered.len()), (0, 6));
        assert_eq!(covered[5].bytes, 3 * gap..3 * gap + 1);
        assert!(covered.iter().all(|e| e.bytes.end - e.bytes.start <= gap));
        assert_eq!(of(3 * gap).len(), 5);
        assert_eq!(covered.iter().map(|e| e.n_points).sum::<u64>(), 10);
    }
}
