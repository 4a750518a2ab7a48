//! Reads scans and points of LAS and LAZ files (versions 1.0 to 1.4, point formats 0 to 10). Points
//! are read as runs of records, from the file or from the decompressor, without an object for each
//! point.

use crate::las_record::Decoder;
use crate::las_runs::{LasRecords, at_once};
use crate::las_scans::{self, LasScanner};
use crate::laz::LazStream;
use crate::map::Mapped;
use crate::oddities::Oddities;
use crate::reader::{
    Extent, FileReading, MaskSeed, PointWindow, RawStrip, Reader, SampledPoint, ScanSeed, Want,
    WindowSample,
};
use crate::sampling;
use crate::settings::Settings;
use crate::source_census::SourceCensus;
use crate::units::{ReferenceSystem, Units};
use contract::{Error, Format, Result};
use std::path::Path;

/// An open LAS or LAZ file.
pub(crate) struct Las {
    records: LasRecords,
    decoder: Decoder,
    masks: Vec<MaskSeed>,
    scans: Vec<ScanSeed>,
    /// First and last place at which points of each scan were seen.
    extents: Vec<(u64, u64)>,
    /// Whether all points of a sample lie inside the stated bounds; then a piece with points
    /// outside is damaged.
    bounds_hold: bool,
    /// The source ids of the file, where its scans are told apart by them.
    census: Option<SourceCensus>,
    strip_points: usize,
}

impl Las {
    /// Opens a LAS or LAZ file with the scanners that are known for it, and its source ids where
    /// they are known.
    pub(crate) fn open(
        path: &Path,
        scanners: &[LasScanner],
        census: Option<SourceCensus>,
        settings: &Settings,
    ) -> Result<Self> {
        let records = LasRecords::open(path, settings)?;
        let found = las_scans::find(path, &records, scanners, census, settings)?;
        let pose = |s: &ScanSeed| (s.world_from_scan, s.scanner_known);
        let poses: Vec<_> = found.scans.iter().map(pose).collect();
        let decoder = Decoder::new(&records.header, &poses, found.scan_of, settings.max_range);
        let name = path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
        let n_points = Some(records.header.n_points);
        Ok(Self {
            masks: vec![MaskSeed { name, n_points, n_stated: n_points }],
            scans: found.scans,
            extents: found.extents,
            bounds_hold: found.bounds_hold,
            census: found.census,
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

    fn units(&self) -> &Units {
        &self.records.units
    }

    fn has_color(&self) -> bool {
        self.decoder.has_color()
    }

    fn census(&self) -> Option<&SourceCensus> {
        self.census.as_ref()
    }

    fn quantum(&self) -> Option<([f64; 3], [f64; 3])> {
        let header = &self.records.header;
        Some((header.scale, header.offset))
    }

    fn system(&self) -> Option<&ReferenceSystem> {
        self.records.header.system.as_ref()
    }

    fn masks(&self) -> &[MaskSeed] {
        &self.masks
    }

    fn scans(&self) -> &[ScanSeed] {
        &self.scans
    }

    fn sample(&self, scan: usize, n: usize) -> Result<Vec<SampledPoint>> {
        sampling::sample(self.extents[scan], n, |from, length| {
            let points = self.points_of(scan, from, length)?;
            Ok(points.into_iter().map(|(_, xyz)| xyz).collect())
        })
    }

    fn spread(&self, scan: usize, n: usize, most: u64) -> Result<Vec<[f32; 3]>> {
        sampling::spread(self.extents[scan], n, most, |from, length| {
            self.points_of(scan, from, length)
        })
    }

    fn window_starts(&self, scan: usize, sample: WindowSample) -> Option<Vec<u64>> {
        let is_stream = self.records.laz.as_ref().is_some_and(|laz| laz.pieces.is_empty());
        if is_stream {
            return None;
        }
        let (first, last) = self.extents[scan];
        let n = (last + 1).saturating_sub(first);
        let n_windows = sample.n_windows.min(n / sample.n_points.max(1)).max(u64::from(n > 0));
        let start = |i: u64| first + (n as f64 * i as f64 / n_windows as f64) as u64;
        let mut starts: Vec<u64> = (0..n_windows).map(start).collect();
        starts.dedup_by_key(|start| self.records.start(*start));
        Some(starts)
    }

    fn window(&self, first: u64, n: usize) -> Result<PointWindow> {
        let (place, records) = self.records.run(first, n)?;
        let layout = self.decoder.layout();
        let len = self.records.header.record_len;
        let own = |record: &&[u8]| !layout.withheld(record);
        let world = |record: &[u8]| self.decoder.world(record);
        let points = records.chunks_exact(len).filter(own).map(world);
        Ok(PointWindow {
            place,
            source_id: records.chunks_exact(len).next().map_or(0, |r| layout.source_id(r)),
            points: points.filter(|p| p.iter().all(|v| v.is_finite())).collect(),
        })
    }

    fn oddities(&self, scan: usize) -> Option<&Oddities> {
        self.decoder.oddities(scan)
    }

    fn read(&self, want: Want) -> Result<FileReading<'_>> {
        if want == Want::Everything {
            (0..self.scans.len()).filter_map(|i| self.oddities(i)).for_each(Oddities::clear);
        }
        let streamed = || {
            let records =
                StreamedStrips { las: self, want, place: 0, stream: None, has_failed: false };
            FileReading::Straight(Box::new(records.flatten()))
        };
        Ok(self.records.extents(self.strip_points).map_or_else(streamed, FileReading::ByExtent))
    }

    fn decode(&self, extent: &Extent, bytes: &[u8], want: Want) -> Result<Vec<RawStrip>> {
        if extent.n_points == 0 {
            return Ok(Vec::new());
        }
        let Some(laz) = &self.records.laz else {
            return Ok(self.strips_of(bytes, extent.first, want));
        };
        let records = laz.decompress(bytes, extent, want)?;
        self.check_bounds(&records, extent.first)?;
        Ok(self.strips_of(&records, extent.first, want))
    }

    fn mapped(&self) -> Option<&Mapped> {
        Some(&self.records.map)
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

impl Las {
    /// The points of a scan among `n` records from a place on, with their places.
    fn points_of(&self, scan: usize, from: u64, n: usize) -> Result<Vec<(u64, [f32; 3])>> {
        let (place, records) = self.records.run(from, n)?;
        let strips = self.decoder.decode(&records, place, Want::Coordinates).into_iter();
        let own = strips.filter(|strip| strip.scan == scan);
        Ok(own.flat_map(RawStrip::into_points).collect())
    }

    /// The strips of a run of records; `first` is the place of the first record.
    fn strips_of(&self, records: &[u8], first: u64, want: Want) -> Vec<RawStrip> {
        let runs = records.chunks(self.strip_points * self.records.header.record_len);
        let places = (first..).step_by(self.strip_points);
        runs.zip(places).flat_map(|(run, first)| self.decoder.decode(run, first, want)).collect()
    }

    /// Refuses a run with points outside the stated bounds, if these hold elsewhere: damaged
    /// compressed data decodes to nonsense without an error.
    fn check_bounds(&self, records: &[u8], first: u64) -> Result<()> {
        let header = &self.records.header;
        let (Some(bounds), true) = (&header.bounds, self.bounds_hold) else {
            return Ok(());
        };
        let bounds = las_scans::grown(bounds, header);
        let n = records.len() / header.record_len;
        let outside = records
            .chunks_exact(header.record_len)
            .filter(|r| !bounds.contains(self.decoder.world(r)))
            .count();
        if outside * 2 > n {
            return Err(Error::bad_input(format!(
                "points decompress to places outside the bounds that the file states, \"{outside}\" of {n}"
            ))
            .at(format!("points {first} to {}", first + n as u64))
            .hint("the file is damaged; copy or compress it again"));
        }
        Ok(())
    }
}

/// The strips of a file whose compressed records are one stream, run by run.
struct StreamedStrips<'a> {
    las: &'a Las,
    want: Want,
    /// Place of the next record to decompress.
    place: u64,
    stream: Option<LazStream<'a>>,
    has_failed: bool,
}

impl StreamedStrips<'_> {
    /// The strips of the next run; `None` at the end.
    fn run(&mut self) -> Result<Option<Vec<RawStrip>>> {
        let (las, first) = (self.las, self.place);
        let left = las.records.header.n_points - first;
        let most = las.strip_points.min(at_once(las.records.header.record_len));
        let n = usize::try_from(left).unwrap_or(usize::MAX).min(most);
        let (Some(laz), true) = (&las.records.laz, n > 0) else { return Ok(None) };
        let stream = match &mut self.stream {
            Some(stream) => stream,
            None => self.stream.insert(laz.stream(&las.records.map)?),
        };
        let records = stream.next(n).map_err(|e| e.at(format!("point {first}")))?;
        las.check_bounds(&records, first)?;
        self.place += n as u64;
        Ok(Some(las.strips_of(&records, first, self.want)))
    }
}

impl Iterator for StreamedStrips<'_> {
    type Item = Vec<Result<RawStrip>>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.has_failed {
            return None;
        }
        match self.run() {
            Ok(strips) => Some(strips?.into_iter().map(Ok).collect()),
            Err(error) => {
                self.has_failed = true;
                Some(vec![Err(error)])
            }
        }
    }
}
