//! Strips of a PTX file in file order, from the lines of all its blocks.

use super::file::{PtxFile, PtxScan};
use crate::oddities::Oddities;
use crate::reader::{RawStrip, SampledPoint, Want};
use crate::text::{TextLines, numbers};
use contract::{Attributes, Result, is_ptx_no_return};
use geometry::Point;

/// Number of lines over which a sample is spread: half a second of parsing.
const N_SAMPLED_FROM: u64 = 2_000_000;
/// Number of runs of neighbouring points in a sample.
const N_RUNS: u64 = 4;
/// Largest number of places that a strip spans, so that they fit 32 bits.
const MAX_SPAN: u64 = 1 << 31;

/// Reads the points of one block, a line at a time.
struct PtxPoints<'a> {
    block: &'a PtxScan,
    lines: TextLines,
    /// Number of lines read.
    n_read: u64,
    /// Values of the current line.
    values: [f64; 7],
}

impl<'a> PtxPoints<'a> {
    /// Starts before the first point of a block.
    fn open(file: &PtxFile, block: &'a PtxScan) -> Result<Self> {
        let (byte, line) = block.points_at;
        Ok(Self {
            block,
            lines: TextLines::open(&file.path, byte, line)?,
            n_read: 0,
            values: [0.0; 7],
        })
    }

    /// Moves to the next line that is not marked as a beam without return; returns false after the
    /// last line of the block. Only the first `n_wanted` values are parsed.
    fn advance(&mut self, n_wanted: usize) -> Result<bool> {
        while self.n_read < self.block.n_lines {
            if !self.lines.advance()? {
                return Err(self.lines.error("file became shorter while it was read"));
            }
            self.n_read += 1;
            if is_ptx_no_return(self.lines.line()) {
                continue;
            }
            let n = numbers(self.lines.line(), &mut self.values[..n_wanted]).map_err(|word| {
                self.lines
                    .error(format!("not a number, \"{word}\""))
                    .hint("numbers need a decimal point, not a comma")
            })?;
            if n != self.block.n_columns {
                return Err(self.lines.error(format!(
                    "line holds not {} numbers as the scan's first, but \"{n}\"",
                    self.block.n_columns
                )));
            }
            return Ok(true);
        }
        Ok(false)
    }

    /// The current point in the scan frame, metres; `None` where it is out of range or lies at the
    /// scanner itself.
    fn xyz(&self, max_range: f64) -> Option<[f64; 3]> {
        let p = self.in_scan();
        let is_good = p.iter().all(|v| v.abs() <= max_range) && !self.block.frame.is_no_return(p);
        is_good.then_some(p)
    }

    /// The current point in the scan frame, metres, without checks.
    fn in_scan(&self) -> [f64; 3] {
        let metres = |i: usize| self.values[i] * self.block.metres;
        self.block.frame.scan_from_file([metres(0), metres(1), metres(2)])
    }

    /// Whether the intensity of the current point lies outside its limits.
    fn is_cut(&self) -> bool {
        matches!(self.block.n_columns, 4 | 7) && self.block.intensity.cuts(self.values[3])
    }

    /// Row and column of the current point; lines run column by column.
    fn native(&self) -> Option<[u32; 2]> {
        let at = self.n_read - 1;
        let rows = self.block.n_rows;
        Some([u32::try_from(at % rows).ok()?, u32::try_from(at / rows).ok()?])
    }
}

/// Iterator over the strips of one file.
pub(super) struct PtxStrips<'a> {
    file: &'a PtxFile,
    want: Want,
    /// Index of the current scan, and its points once they are open.
    scan: usize,
    points: Option<PtxPoints<'a>>,
    /// Place in the mask of the next valid point.
    place: u64,
    done: bool,
}

impl<'a> PtxStrips<'a> {
    /// Starts at the first point of the file.
    pub(super) fn new(file: &'a PtxFile, want: Want) -> Self {
        if want == Want::Everything {
            file.oddities.iter().for_each(Oddities::clear);
        }
        Self { file, want, scan: 0, points: None, place: 0, done: false }
    }

    /// The next strip that holds a point; `None` after the last scan.
    fn read(&mut self) -> Result<Option<RawStrip>> {
        while let Some(block) = self.file.blocks.get(self.scan) {
            let strip = self.read_block(block)?;
            if strip.is_some() {
                return Ok(strip);
            }
            (self.scan, self.points, self.place) = (self.scan + 1, None, 0);
        }
        Ok(None)
    }

    /// The next strip of this block; `None` at its end.
    fn read_block(&mut self, block: &'a PtxScan) -> Result<Option<RawStrip>> {
        let points = match &mut self.points {
            Some(points) => points,
            none => none.insert(PtxPoints::open(self.file, block)?),
        };
        let settings = &self.file.settings;
        let mut strip = RawStrip {
            scan: self.scan,
            first_place: self.place,
            place: Vec::new(),
            xyz: Vec::new(),
            attributes: (self.want == Want::Everything).then(Attributes::default),
        };
        let (mut n_no_returns, mut n_cut) = (0, 0);
        let n_wanted = if self.want == Want::Everything { 7 } else { 3 };
        while strip.xyz.len() < settings.strip_points
            && (strip.xyz.is_empty() || self.place - strip.first_place < MAX_SPAN)
            && points.advance(n_wanted)?
        {
            if let Some(p) = points.xyz(settings.max_range) {
                if strip.place.is_empty() {
                    strip.first_place = self.place;
                }
                strip.place.push((self.place - strip.first_place) as u32);
                strip.xyz.push(p.map(|v| v as f32));
                if let Some(attributes) = &mut strip.attributes {
                    push(attributes, points, p);
                    n_cut += u64::from(points.is_cut());
                }
            } else {
                n_no_returns += u64::from(block.frame.is_no_return(points.in_scan()));
            }
            self.place += 1;
        }
        if self.want == Want::Everything {
            self.file.oddities[self.scan].add_no_returns(n_no_returns);
            self.file.oddities[self.scan].add_cut(n_cut);
        }
        Ok((!strip.xyz.is_empty()).then_some(strip))
    }
}

impl Iterator for PtxStrips<'_> {
    type Item = Result<RawStrip>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.done {
            return None;
        }
        let strip = self.read().transpose();
        self.done = !matches!(strip, Some(Ok(_)));
        strip
    }
}

/// Appends the attributes of the point on the current line.
fn push(attributes: &mut Attributes, points: &PtxPoints<'_>, p: [f64; 3]) {
    attributes.world.push((points.block.frame.world_from_scan * Point::from(p)).coords.into());
    // `as` saturates at both ends and turns NaN into 0. Colour is 0..255.
    if let 4 | 7 = points.block.n_columns {
        let span = points.block.intensity;
        attributes.intensity.push(((points.values[3] - span.min) * span.scale()).round() as u16);
    }
    if let n @ (6 | 7) = points.block.n_columns {
        attributes
            .color
            .push([n - 3, n - 2, n - 1].map(|i| (points.values[i] * 257.0).round() as u16));
    }
}

/// Up to `n` valid points of a scan in a few runs.
pub(super) fn sample(file: &PtxFile, scan: usize, n: usize) -> Result<Vec<SampledPoint>> {
    let mut out = Vec::new();
    let block = &file.blocks[scan];
    let spread = block.n_lines.clamp(1, N_SAMPLED_FROM);
    let mut points = PtxPoints::open(file, block)?;
    while out.len() < n && points.advance(3)? {
        // Number of points that the runs begun so far may hold: run k begins at k/N_RUNS of the
        // lines.
        let run = ((points.n_read - 1) * N_RUNS / spread + 1).min(N_RUNS) as usize;
        if out.len() < n * run / N_RUNS as usize
            && let Some(p) = points.xyz(file.settings.max_range)
        {
            out.push(SampledPoint { xyz: p.map(|v| v as f32), native: points.native() });
        }
    }
    Ok(out)
}

/// Up to `n` valid points of a scan (scan frame, metres), evenly spread over its first `most`
/// lines.
pub(super) fn spread(file: &PtxFile, scan: usize, n: usize, most: u64) -> Result<Vec<[f32; 3]>> {
    let mut out = Vec::new();
    let block = &file.blocks[scan];
    let every = block.n_valid.min(most).div_ceil(n.max(1) as u64).max(1);
    let mut points = PtxPoints::open(file, block)?;
    let mut at = 0_u64;
    while points.n_read < most && points.advance(3)? {
        if at.is_multiple_of(every)
            && let Some(p) = points.xyz(file.settings.max_range)
        {
            out.push(p.map(|v| v as f32));
        }
        at += 1;
    }
    Ok(out)
}
