//! The trait of a format's reader: masks and scans, a sample of each scan, and all points as strips
//! in file order.

use crate::map::Mapped;
use crate::oddities::Oddities;
use crate::source_census::SourceCensus;
use crate::units::{ReferenceSystem, Units};
use contract::{Attributes, Error, Format, Kind, PointRaster, Result, ScannerPosition};
use geometry::{Aabb, Pose};
use std::ops::Range;

/// Which attributes of the points are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Want {
    /// Coordinates and places only.
    Coordinates,
    /// All attributes.
    Everything,
}

/// A mask of one file, before it gets its index over all inputs.
#[derive(Debug, Clone)]
pub(crate) struct MaskSeed {
    /// Display name.
    pub(crate) name: String,
    /// Number of valid points, where known without reading them.
    pub(crate) n_points: Option<u64>,
    /// Number of points that the file states, including invalid ones; only for estimates.
    pub(crate) n_stated: Option<u64>,
}

/// A scan of one file, before it gets its index over all inputs and its lattice.
#[derive(Debug, Clone)]
pub(crate) struct ScanSeed {
    /// Display name.
    pub(crate) name: String,
    /// Index of the mask of this file that labels it.
    pub(crate) mask: usize,
    /// Point source id of LAS, where scans are told apart by it.
    pub(crate) source_id: Option<u16>,
    /// First and last places of the stretches of its points, where these tell scans apart.
    pub(crate) places: Vec<[u64; 2]>,
    /// The raster of its points, where this tells scans apart.
    pub(crate) raster: Option<PointRaster>,
    /// How the scanner's position is known: `Stated` or `Unknown`, or what a scanners file says of
    /// a LAS file.
    pub(crate) position: ScannerPosition,
    /// Pose of the scan frame, metres; a translation near the points where the scanner is unknown.
    pub(crate) world_from_scan: Pose,
    /// Whether the origin of the scan frame is the scanner.
    pub(crate) scanner_known: bool,
    /// Stated bounds in the world, metres.
    pub(crate) stated_bounds: Option<Aabb>,
    /// Stated number of valid points.
    pub(crate) stated_points: Option<u64>,
    /// Estimated number of points, where a sample of the file gives one.
    pub(crate) likely_points: Option<u64>,
    /// Messages about what is missing and which results suffer from it.
    pub(crate) notes: Vec<String>,
    /// The step of the coordinates, metres; `None` where it is fine enough.
    pub(crate) step: Option<f64>,
}

/// A valid point of a sample, with its native row and column where the file has them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SampledPoint {
    /// Scan frame, metres.
    pub(crate) xyz: [f32; 3],
    /// Native row and column, where the file has them.
    pub(crate) native: Option<[u32; 2]>,
}

/// A strip with indices of scan and mask within its file. It is empty only at the end of a mask
/// whose length is not known beforehand and whose last points were dropped; `first_place` is then
/// the length of the mask.
#[derive(Debug, Clone)]
pub(crate) struct RawStrip {
    /// Index of the scan in this file.
    pub(crate) scan: usize,
    /// Place in the mask of the first point.
    pub(crate) first_place: u64,
    /// Places of the points less `first_place`, ascending.
    pub(crate) place: Vec<u32>,
    /// Scan frame, metres.
    pub(crate) xyz: Vec<[f32; 3]>,
    /// Attributes, if they were requested.
    pub(crate) attributes: Option<Attributes>,
}

impl RawStrip {
    /// The points with their places.
    pub(crate) fn into_points(self) -> impl Iterator<Item = (u64, [f32; 3])> {
        let first = self.first_place;
        self.place.into_iter().map(move |place| first + u64::from(place)).zip(self.xyz)
    }
}

/// Iterator over the strips of one file, in file order.
pub(crate) type RawStrips<'a> = Box<dyn Iterator<Item = Result<RawStrip>> + Send + 'a>;

/// A range of bytes of a file whose points can be decoded independently, or that holds no points.
/// The extents of a file cover it from its first byte to its last.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Extent {
    /// Byte offsets in the file.
    pub bytes: Range<u64>,
    /// Place of its first point.
    pub(crate) first: u64,
    /// Number of its points.
    pub n_points: u64,
}

/// Largest length of an extent without points, bytes.
const GAP: usize = 1 << 20;

impl Extent {
    /// The bytes of the extent within those of the file.
    pub(crate) fn of<'a>(&self, file: &'a [u8]) -> &'a [u8] {
        &file[self.bytes.start as usize..self.bytes.end as usize]
    }

    /// Extends extents with points to cover a whole file of `n_bytes` bytes, by extents without
    /// points before, between and after them.
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

/// Points that follow one another in a file.
#[derive(Debug, Clone, PartialEq)]
pub struct PointWindow {
    /// Place of the first point in its mask.
    pub place: u64,
    /// Its `point_source_id`, in LAS and LAZ files; else 0.
    pub source_id: u16,
    /// The points, world, metres.
    pub points: Vec<[f64; 3]>,
}

/// How many windows are read, and how long.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WindowSample {
    /// Largest number of windows.
    pub n_windows: u64,
    /// Number of points of each.
    pub n_points: u64,
}

/// How a file is read, in file order.
pub(crate) enum FileReading<'a> {
    /// From its beginning to its end.
    Straight(RawStrips<'a>),
    /// By extents that are decoded independently.
    ByExtent(Box<dyn Iterator<Item = Extent> + Send + 'a>),
}

/// An open file whose headers are read and checked.
pub(crate) trait Reader: Send + Sync {
    /// The format of the file.
    fn format(&self) -> Format;
    /// The masks of the file.
    fn masks(&self) -> &[MaskSeed];
    /// The scans of the file.
    fn scans(&self) -> &[ScanSeed];
    /// The source ids of the file, where its scans were told apart by them.
    fn census(&self) -> Option<&SourceCensus> {
        None
    }
    /// Up to `n` valid points of a scan, as runs of neighbours in file order, spread over the scan.
    fn sample(&self, scan: usize, n: usize) -> Result<Vec<SampledPoint>>;
    /// Up to `n` valid points of a scan (scan frame, metres), evenly spread over it, or over its
    /// first `most` points if it has more.
    fn spread(&self, scan: usize, n: usize, most: u64) -> Result<Vec<[f32; 3]>>;
    /// First places of windows of a scan, spread over it; `None` for a format that is read from
    /// beginning to end.
    fn window_starts(&self, _scan: usize, _sample: WindowSample) -> Option<Vec<u64>> {
        None
    }
    /// Points that follow one another, from a place on or from the piece that holds it.
    fn window(&self, first: u64, _n: usize) -> Result<PointWindow> {
        let what = format!("the window at \"{first}\" was asked of a format without windows");
        Err(Error::new(Kind::Bug, what))
    }
    /// All valid points in file order. A broken file gives an error and never a silent end.
    fn read(&self, want: Want) -> Result<FileReading<'_>>;
    /// The points of an extent, from its bytes.
    fn decode(&self, extent: &Extent, _bytes: &[u8], _want: Want) -> Result<Vec<RawStrip>> {
        let what = format!("bytes {:?} were given to a format without extents", extent.bytes);
        Err(Error::new(Kind::Bug, what))
    }
    /// The memory map of the file, where it is mapped.
    fn mapped(&self) -> Option<&Mapped> {
        None
    }
    /// Units of the coordinates in the file; the reader itself returns metres.
    fn units(&self) -> &Units;
    /// The coordinates of one scan, for formats in which a scan can be read alone.
    fn read_scan(&self, _scan: usize) -> Option<RawStrips<'_>> {
        None
    }
    /// Whether the points have colour.
    fn has_color(&self) -> bool;
    /// Scale and offset of the coordinates, metres, where they are multiples of a step (LAS).
    fn quantum(&self) -> Option<([f64; 3], [f64; 3])> {
        None
    }
    /// The coordinate reference system that the file states (LAS).
    fn system(&self) -> Option<&ReferenceSystem> {
        None
    }
    /// Counts of odd points of a scan from the last full read, where they are counted.
    fn oddities(&self, _scan: usize) -> Option<&Oddities> {
        None
    }
    /// Checks that all data read so far was there: a mapped file may have been truncated.
    fn check(&self) -> Result<()> {
        self.mapped().map_or(Ok(()), Mapped::check)
    }
    /// Facts that the file states, as (name, value), for `inspect`.
    fn facts(&self) -> Vec<(String, String)>;
}

/// The strips of a file, decoded on this thread whichever way the file is read.
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
    // The iterator ends after the first error.
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
