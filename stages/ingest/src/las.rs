//! LAS and LAZ files in (versions 1.0 to 1.4, point formats 0 to 10); scans and strips out. Points come from a
//! memory map, or from the decompressor, as runs of records; no object is made for a point.

use crate::las_header::LasHeader;
use crate::las_record::Decoder;
use crate::las_scans::{self, LasScanner};
use crate::laz::{Laz, Stream};
use crate::map::{Mapped, map};
use crate::reader::{MaskSeed, RawStrip, RawStrips, Reader, Sampled, ScanSeed, Want};
use crate::settings::Settings;
use contract::{Error, Format, Result};
use std::borrow::Cow;
use std::collections::VecDeque;
use std::path::Path;

/// Compressed pieces that are decompressed at once: enough for eight cores, 16 MB of records.
const PIECES_AT_ONCE: usize = 8;
/// Memory of the records that are decompressed at once, bytes.
const RECORDS_AT_ONCE: usize = 32 << 20;

/// The records of a file, whichever way they are stored.
pub(crate) struct Records {
    map: Mapped,
    /// Header, checked.
    pub(crate) header: LasHeader,
    /// How to decompress, where they are compressed.
    pub(crate) laz: Option<Laz>,
}

impl Records {
    /// Opens a file and checks what it says of itself.
    pub(crate) fn open(path: &Path, settings: &Settings) -> Result<Self> {
        let map = map(path)?;
        let header = LasHeader::read(&map)?;
        let laz = if header.compressed { Some(Laz::read(&map, &header, settings)?) } else { None };
        Ok(Self { map, header, laz })
    }

    /// At most `n` records from `first` on; `(place of the first one, records)`. Where records are compressed, the
    /// run starts at the piece that holds `first`; where they are one stream, at the start of the file.
    pub(crate) fn run(&self, first: u64, n: usize) -> Result<(u64, Cow<'_, [u8]>)> {
        let n = n.min(usize::try_from(self.header.n_points.saturating_sub(first)).unwrap_or(n));
        let Some(laz) = &self.laz else {
            return Ok((first, Cow::Borrowed(self.mapped(first, n))));
        };
        if laz.pieces.is_empty() {
            return Ok((0, Cow::Owned(laz.stream(&self.map)?.next(n)?)));
        }
        let mut at = laz.pieces.partition_point(|p| p.first + p.n_points <= first);
        let start = laz.pieces.get(at).map_or(first, |p| p.first);
        let mut records = Vec::new();
        let mut left = n;
        while let Some(piece) = laz.pieces.get(at).filter(|_| left > 0) {
            records.extend(laz.head(&self.map, piece, left)?);
            left = left.saturating_sub(piece.n_points as usize);
            at += 1;
        }
        Ok((start, Cow::Owned(records)))
    }

    /// Where [`Records::run`] would start.
    pub(crate) fn start(&self, first: u64) -> u64 {
        let Some(laz) = &self.laz else { return first };
        let at = laz.pieces.partition_point(|p| p.first + p.n_points <= first);
        laz.pieces.get(at).map_or(0, |p| p.first)
    }

    /// Records of an uncompressed file. In range, since the count was checked against the file's length.
    fn mapped(&self, first: u64, n: usize) -> &[u8] {
        let from = self.header.points_at + first as usize * self.header.record_len;
        &self.map[from..from + n * self.header.record_len]
    }
}

/// An open LAS or LAZ file.
pub(crate) struct Las {
    records: Records,
    decoder: Decoder,
    masks: Vec<MaskSeed>,
    scans: Vec<ScanSeed>,
    /// First and last place at which each scan was seen.
    extents: Vec<(u64, u64)>,
    /// Whether a look at the file found all points inside the stated bounds: then a piece that is not is damaged.
    bounds_hold: bool,
    strip_points: usize,
}

impl Las {
    /// Opens a LAS or LAZ file, with the scanners that are known for it.
    pub(crate) fn open(path: &Path, scanners: &[LasScanner], settings: &Settings) -> Result<Self> {
        let records = Records::open(path, settings)?;
        let found = las_scans::find(path, &records, scanners, settings)?;
        let poses: Vec<_> = found.scans.iter().map(|s| s.world_from_scan).collect();
        let decoder =
            Decoder::new(&records.header, &poses, found.scan_of_source, settings.max_range);
        let name = path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
        Ok(Self {
            masks: vec![MaskSeed { name, n_points: Some(records.header.n_points) }],
            scans: found.scans,
            extents: found.extents,
            bounds_hold: found.bounds_hold,
            records,
            decoder,
            strip_points: settings.strip_points.max(1),
        })
    }
}

impl Reader for Las {
    fn format(&self) -> Format {
        if self.records.header.compressed { Format::Laz } else { Format::Las }
    }

    fn has_color(&self) -> bool {
        self.decoder.has_color()
    }

    fn quantum(&self) -> Option<([f64; 3], [f64; 3])> {
        let header = &self.records.header;
        Some((header.scale, header.offset))
    }

    fn check(&self) -> Result<()> {
        self.records.map.check()
    }

    fn masks(&self) -> &[MaskSeed] {
        &self.masks
    }

    fn scans(&self) -> &[ScanSeed] {
        &self.scans
    }

    fn sample(&self, scan: usize, n: usize) -> Result<Vec<Sampled>> {
        /// Long enough to span several lines of most scanners, and spread over the scan.
        const RUNS: [f64; 3] = [0.45, 0.1, 0.8];
        /// More places to look at where other scans' points lie between.
        const MORE: usize = 16;
        let (first, last) = self.extents[scan];
        let span = last + 1 - first.min(last + 1);
        let starts: Vec<f64> = if span <= n as u64 {
            vec![0.0]
        } else {
            let more = (0..MORE).map(|i| (i as f64 + 0.5) / MORE as f64);
            RUNS.into_iter().chain(more).collect()
        };
        let length = if starts.len() == 1 { n } else { n / RUNS.len() };
        let mut sample: Vec<Sampled> = Vec::new();
        for (i, share) in starts.into_iter().enumerate() {
            if sample.len() >= n || (i >= RUNS.len() && sample.len() > n / 2) {
                break;
            }
            let from = first + (span as f64 * share) as u64;
            let (place, records) = self.records.run(from, length)?;
            for strip in self.decoder.decode(&records, place, Want::Coordinates) {
                if strip.scan == scan {
                    sample.extend(strip.xyz.into_iter().map(|xyz| Sampled { xyz, native: None }));
                }
            }
        }
        sample.truncate(n);
        Ok(sample)
    }

    fn strips(&self, want: Want) -> Result<RawStrips<'_>> {
        Ok(Box::new(Strips {
            las: self,
            want,
            place: 0,
            piece: 0,
            stream: None,
            records: Cow::Borrowed(&[]),
            used: 0,
            ready: VecDeque::new(),
            given: 0,
            failed: false,
        }))
    }

    fn facts(&self) -> Vec<(String, String)> {
        let header = &self.records.header;
        let layout = self.decoder.layout();
        let mut attributes = vec!["intensity", "classification", "point source id"];
        attributes.extend(layout.gps_time.map(|_| "GPS time"));
        attributes.extend(layout.color.map(|_| "colour"));
        let mut facts = vec![
            ("version", format!("1.{}", header.minor)),
            ("point format", header.format.to_string()),
            (
                "record",
                format!(
                    "{} bytes, {} of them extra",
                    header.record_len,
                    header.record_len - layout.len
                ),
            ),
            ("resolution", format!("{:?}", header.scale)),
            ("attributes", attributes.join(", ")),
            ("software", header.software.clone()),
        ];
        if header.copc {
            facts.push(("order", "octree (COPC), not the order of measurement".into()));
        }
        facts.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
    }
}

/// The strips of one file, in its order.
struct Strips<'a> {
    las: &'a Las,
    want: Want,
    /// Place of the first record that is not loaded yet.
    place: u64,
    piece: usize,
    stream: Option<Stream<'a>>,
    /// Records that are loaded, and how many of their bytes went out.
    records: Cow<'a, [u8]>,
    used: usize,
    ready: VecDeque<RawStrip>,
    /// Bytes of the map that were given back.
    given: usize,
    failed: bool,
}

impl<'a> Strips<'a> {
    /// Loads the next run of records; false at the end.
    fn load(&mut self) -> Result<bool> {
        let las = self.las;
        let n_points = las.records.header.n_points;
        if self.place >= n_points {
            return Ok(false);
        }
        let header = &las.records.header;
        let read = match &las.records.laz {
            None => header.points_at + self.place as usize * header.record_len,
            Some(laz) => laz.pieces.get(self.piece).map_or(0, |piece| piece.at),
        };
        las.records.map.passed(read, &mut self.given);
        let n = usize::try_from(n_points - self.place).unwrap_or(usize::MAX).min(las.strip_points);
        self.records = match &las.records.laz {
            None => Cow::Borrowed(las.records.mapped(self.place, n)),
            Some(laz) if laz.pieces.is_empty() => {
                if self.stream.is_none() {
                    self.stream = Some(laz.stream(&las.records.map)?);
                }
                let stream = self.stream.as_mut().expect("made above");
                Cow::Owned(stream.next(n).map_err(|e| e.at(format!("point {}", self.place)))?)
            }
            Some(laz) => {
                let group = self.group(laz);
                Cow::Owned(laz.pieces(&las.records.map, group, self.want)?)
            }
        };
        self.used = 0;
        self.place += (self.records.len() / las.records.header.record_len) as u64;
        if las.records.header.compressed {
            self.check_bounds()?;
        }
        Ok(true)
    }

    /// The next pieces that are decompressed together.
    fn group(&mut self, laz: &'a Laz) -> &'a [crate::laz::Piece] {
        let first = self.piece;
        let mut n_bytes = 0;
        while let Some(piece) = laz.pieces.get(self.piece) {
            n_bytes += piece.n_points as usize * self.las.records.header.record_len;
            let joins = self.piece == first
                || (self.piece - first < PIECES_AT_ONCE
                    && n_bytes <= RECORDS_AT_ONCE
                    && piece.follows(&laz.pieces[self.piece - 1]));
            if !joins {
                break;
            }
            self.piece += 1;
        }
        &laz.pieces[first..self.piece]
    }

    /// A damaged compressed run decodes without complaint, into nonsense: tell by the stated bounds, where these
    /// were found to be right.
    fn check_bounds(&self) -> Result<()> {
        let header = &self.las.records.header;
        let (Some(bounds), true) = (&header.bounds, self.las.bounds_hold) else {
            return Ok(());
        };
        let bounds = las_scans::grown(bounds, header);
        let n = self.records.len() / header.record_len;
        let outside = self
            .records
            .chunks_exact(header.record_len)
            .filter(|r| !bounds.contains(self.las.decoder.world(r)))
            .count();
        if outside * 2 > n {
            return Err(Error::bad_input(format!(
                "points decompress to places outside the bounds that the file states, \"{outside}\" of {n}"
            ))
            .at(format!("points {} to {}", self.place - n as u64, self.place))
            .hint("the file is damaged; copy or compress it again"));
        }
        Ok(())
    }
}

impl Iterator for Strips<'_> {
    type Item = Result<RawStrip>;

    fn next(&mut self) -> Option<Self::Item> {
        let record_len = self.las.records.header.record_len;
        while !self.failed {
            if let Some(strip) = self.ready.pop_front() {
                return Some(Ok(strip));
            }
            if self.used < self.records.len() {
                let end = (self.used + self.las.strip_points * record_len).min(self.records.len());
                let first = self.place - ((self.records.len() - self.used) / record_len) as u64;
                self.ready.extend(self.las.decoder.decode(
                    &self.records[self.used..end],
                    first,
                    self.want,
                ));
                self.used = end;
                continue;
            }
            match self.load() {
                Ok(true) => {}
                Ok(false) => return None,
                Err(error) => {
                    self.failed = true;
                    return Some(Err(error));
                }
            }
        }
        None
    }
}
