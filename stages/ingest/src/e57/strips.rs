//! Strips of an E57 file in file order, from the blocks of points of all its scans.

use super::file::E57File;
use super::pages::Pages;
use super::points::{E57Points, WantedFields};
use super::scan::E57Scan;
use crate::oddities::Oddities;
use crate::reader::{RawStrip, SampledPoint, Want};
use crate::settings::Settings;
use contract::{Attributes, Result};
use geometry::Point;

/// Number of records decoded at once: their columns (3 × 8 bytes each) stay in the second-level
/// cache.
const BLOCK: usize = 8192;
/// Number of records over which a sample is spread: a tenth of a second of decoding.
const N_SAMPLED_FROM: u64 = 4_000_000;
/// Number of runs of neighbouring points in a sample.
const N_RUNS: u64 = 4;

/// Largest number of places that a strip spans, so that they fit 32 bits. It is only reached where
/// billions of consecutive points are dropped.
const MAX_SPAN: u64 = 1 << 31;

/// Iterator over the strips of one file.
pub(super) struct E57Strips<'a> {
    file: &'a E57File,
    want: Want,
    /// Index of the current scan, index at which to stop, and the open points of the current scan.
    scan: usize,
    until: usize,
    points: Option<E57Points>,
    /// Place in the mask of the next valid point.
    place: u64,
    /// Place in the mask after the last point that was not dropped.
    named: u64,
    done: bool,
}

impl<'a> E57Strips<'a> {
    /// Starts at the first point of the file.
    pub(super) fn new(file: &'a E57File, want: Want) -> Self {
        if want == Want::Everything {
            file.oddities.iter().for_each(Oddities::clear);
        }
        let until = file.files.len();
        Self { file, want, scan: 0, until, points: None, place: 0, named: 0, done: false }
    }

    /// Reads the coordinates of one scan only.
    pub(super) fn of_scan(file: &'a E57File, scan: usize) -> Self {
        Self { scan, until: scan + 1, ..Self::new(file, Want::Coordinates) }
    }

    /// The next strip; `None` after the last scan.
    fn read(&mut self) -> Result<Option<RawStrip>> {
        while let Some(scan) = self.file.files[..self.until].get(self.scan) {
            let at = self.scan;
            let strip = self
                .read_scan(scan)
                .map_err(|e| e.at(format!("scan \"{}\"", self.file.scans[at].name)))?;
            if strip.is_some() {
                return Ok(strip);
            }
            (self.scan, self.points, self.place, self.named) = (at + 1, None, 0, 0);
        }
        Ok(None)
    }

    /// The next strip of this scan; `None` at its checked end.
    fn read_scan(&mut self, scan: &E57Scan) -> Result<Option<RawStrip>> {
        let points = match &mut self.points {
            Some(points) => points,
            none => {
                let wanted = match self.want {
                    Want::Coordinates => WantedFields::Coordinates,
                    Want::Everything => WantedFields::Attributes,
                };
                none.insert(E57Points::open(scan, Pages::open(&self.file.path)?, wanted)?)
            }
        };
        let settings = &self.file.settings;
        let mut strip = FillingStrip {
            settings,
            scan,
            strip: RawStrip {
                scan: self.scan,
                first_place: self.place,
                place: Vec::new(),
                xyz: Vec::new(),
                attributes: (self.want == Want::Everything).then(Attributes::default),
            },
            place: self.place,
            n_no_returns: 0,
            n_cut: 0,
        };
        while strip.strip.xyz.len() < settings.strip_points && strip.span() < MAX_SPAN {
            let most = BLOCK.min(settings.strip_points - strip.strip.xyz.len());
            let n = points.next_block(most)?;
            if n == 0 {
                break;
            }
            strip.add(points, n);
        }
        let FillingStrip { strip, place, n_no_returns, n_cut, .. } = strip;
        self.place = place;
        if self.want == Want::Everything {
            let oddities = &self.file.oddities[self.scan];
            oddities.add_no_returns(n_no_returns);
            oddities.add_cut(n_cut);
        }
        if let Some(last) = strip.place.last() {
            self.named = strip.first_place + u64::from(*last) + 1;
            return Ok(Some(strip));
        }
        // At the end: where the length of the mask is not known beforehand and its last points were
        // dropped, a strip without points states the length.
        let told = self.file.masks[self.scan].n_points.is_some() || self.named == place;
        self.named = place;
        Ok((!told).then_some(RawStrip { first_place: place, ..strip }))
    }
}

impl Iterator for E57Strips<'_> {
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

/// A strip that is being filled.
struct FillingStrip<'a> {
    settings: &'a Settings,
    scan: &'a E57Scan,
    strip: RawStrip,
    /// Place in the mask of the next valid point.
    place: u64,
    /// Numbers of points at the scanner itself, and of intensities outside their limits.
    n_no_returns: u64,
    n_cut: u64,
}

impl FillingStrip<'_> {
    /// Adds a block of `n` records.
    fn add(&mut self, points: &E57Points, n: usize) {
        let far = self.settings.max_range;
        if points.all_valid()
            && self.strip.attributes.is_none()
            && let Some(shift) = self.scan.frame.shift_only()
        {
            let [x, y, z] = points.axes();
            let near = |axis: &[f64], shift: f64| axis.iter().all(|v| (v - shift).abs() <= far);
            let is_near = near(x, shift[0]) && near(y, shift[1]) && near(z, shift[2]);
            let mut all = x.iter().zip(y).zip(z).map(|((x, y), z)| [*x, *y, *z]);
            let frame = &self.scan.frame;
            if is_near && !all.any(|p| frame.is_no_return(frame.scan_from_file(p))) {
                return self.add_plain(points, shift);
            }
        }
        self.strip.place.reserve(n);
        self.strip.xyz.reserve(n);
        for i in 0..n {
            if !points.is_valid(i) {
                continue;
            }
            let p = self.scan.frame.scan_from_file(points.xyz(i));
            if self.scan.frame.is_no_return(p) {
                self.n_no_returns += 1;
            } else if p.iter().all(|v| v.abs() <= far) {
                self.push_place();
                self.strip.xyz.push(p.map(|v| v as f32));
                self.push_attributes(points, i, p);
            }
            self.place += 1;
        }
    }

    /// Adds a block in which every point is valid.
    fn add_plain(&mut self, points: &E57Points, shift: [f64; 3]) {
        let [x, y, z] = points.axes();
        let xyz = x.iter().zip(y).zip(z);
        self.strip.xyz.extend(xyz.map(|((x, y), z)| {
            [(x - shift[0]) as f32, (y - shift[1]) as f32, (z - shift[2]) as f32]
        }));
        if self.strip.place.is_empty() {
            self.strip.first_place = self.place;
        }
        let first = (self.place - self.strip.first_place) as u32;
        self.strip.place.extend(first..first + x.len() as u32);
        self.place += x.len() as u64;
    }

    /// Number of places from the first point to the next one.
    fn span(&self) -> u64 {
        if self.strip.place.is_empty() { 0 } else { self.place - self.strip.first_place }
    }

    /// Appends the next place.
    fn push_place(&mut self) {
        if self.strip.place.is_empty() {
            self.strip.first_place = self.place;
        }
        self.strip.place.push((self.place - self.strip.first_place) as u32);
    }

    /// Appends intensity, colour and world coordinates of point `i` of the block.
    fn push_attributes(&mut self, points: &E57Points, i: usize, p: [f64; 3]) {
        let Some(attributes) = &mut self.strip.attributes else { return };
        attributes.world.push((self.scan.frame.world_from_scan * Point::from(p)).coords.into());
        attributes.intensity.extend(points.intensity().get(i));
        self.n_cut += u64::from(points.is_cut(i));
        attributes.color.extend(points.color(i));
    }
}

/// Up to `n` valid points of a scan in a few runs.
pub(super) fn sample(file: &E57File, scan: &E57Scan, n: usize) -> Result<Vec<SampledPoint>> {
    let mut out = Vec::new();
    if scan.n_records == 0 || n == 0 {
        return Ok(out);
    }
    let mut points = E57Points::open(scan, Pages::open(&file.path)?, WantedFields::Native)?;
    let spread = scan.n_records.min(N_SAMPLED_FROM);
    let mut seen = 0;
    while out.len() < n {
        let n_block = points.next_block(BLOCK)?;
        if n_block == 0 {
            break;
        }
        // Number of points that the runs begun so far may hold: run k begins at k/N_RUNS of the
        // records.
        let run = (seen * N_RUNS / spread + 1).min(N_RUNS) as usize;
        let most = n * run / N_RUNS as usize;
        for i in 0..n_block {
            let p = scan.frame.scan_from_file(points.xyz(i));
            if out.len() < most
                && points.is_valid(i)
                && !scan.frame.is_no_return(p)
                && p.iter().all(|v| v.abs() <= file.settings.max_range)
            {
                out.push(SampledPoint { xyz: p.map(|v| v as f32), native: points.native(i) });
            }
        }
        seen += n_block as u64;
    }
    Ok(out)
}

/// Up to `n` valid points of a scan (scan frame, metres), evenly spread over its first `most`
/// records.
pub(super) fn spread(file: &E57File, scan: &E57Scan, n: usize, most: u64) -> Result<Vec<[f32; 3]>> {
    let mut out = Vec::new();
    if scan.n_records == 0 || n == 0 {
        return Ok(out);
    }
    let mut points = E57Points::open(scan, Pages::open(&file.path)?, WantedFields::Coordinates)?;
    let every = scan.n_records.min(most).div_ceil(n as u64);
    let mut seen = 0;
    while seen < most {
        let n_block = points.next_block(BLOCK)?;
        if n_block == 0 {
            break;
        }
        for i in (0..n_block).filter(|i| (seen + *i as u64).is_multiple_of(every)) {
            let p = scan.frame.scan_from_file(points.xyz(i));
            let is_near = p.iter().all(|v| v.abs() <= file.settings.max_range);
            if points.is_valid(i) && !scan.frame.is_no_return(p) && is_near {
                out.push(p.map(|v| v as f32));
            }
        }
        seen += n_block as u64;
    }
    Ok(out)
}
