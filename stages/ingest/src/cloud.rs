//! Reads clouds that are lists of points: PTS, plain text (XYZ, CSV, TXT), PLY and PCD. All are
//! records of named or numbered columns, in text, in binary or compressed.

mod binary;
mod body;
mod fields;
mod file;
mod header;
mod lzf;
mod packed;
mod pcd;
mod ply;
mod strips;
#[cfg(test)]
mod tests;
mod text_body;
mod text_file;

pub(crate) use text_file::{HEAD, TextKind, kind};

use crate::frame::{self, FileFrame};
use crate::map::{Mapped, map};
use crate::oddities::{Oddities, no_returns_note};
use crate::reader::{
    Extent, FileReading, MaskSeed, PointWindow, RawStrip, RawStrips, Reader, SampledPoint,
    ScanSeed, Want, WindowSample,
};
use crate::sampling;
use crate::settings::Settings;
use crate::units::{Choice, Units};
use body::{CloudSeed, RecordBody};
use contract::{Format, Result};
use file::{CloudFile, CloudPart};
use std::path::Path;

/// Number of runs of records that are looked at, and of records of each.
const RUNS: u64 = 64;
const RUN: usize = 64;
/// Share of the records looked at that lie at the origin of the file from which on these are beams
/// without return. A single one may have been measured.
const NO_RETURNS: f64 = 0.005;

/// Opens a file of one of these formats. All lines of text are counted, since only so places are
/// known.
pub(crate) fn open(path: &Path, format: Format, settings: &Settings) -> Result<Box<dyn Reader>> {
    let map = map(path)?;
    let choice = Choice::read(&settings.units)?;
    let units = Units::of(&[], choice.of(path))?;
    let metres = units.factors();
    let mut seeds = match format {
        Format::Pts => text_file::open(path, TextKind::Pts)?,
        Format::Ply => vec![ply::open(&map)?],
        Format::Pcd => vec![pcd::open(&map, metres)?],
        _ => text_file::open(path, TextKind::Xyz)?,
    };
    for seed in &mut seeds {
        if let (Some(uncounted), RecordBody::Text(body)) = (seed.uncounted, &mut seed.body) {
            text_file::announced(path, uncounted, seed.n_records, body)?;
        }
    }
    let (parts, masks, scans) = (Vec::new(), Vec::new(), Vec::new());
    let (strip_points, max_range) = (settings.strip_points.max(1), settings.max_range);
    let mut file =
        CloudFile { format, map, parts, masks, scans, units, metres, strip_points, max_range };
    let is_one = seeds.len() == 1;
    let stem = path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
    for mut seed in seeds {
        let name = seed.name.take().filter(|_| !is_one).unwrap_or_else(|| stem.clone());
        file.add(name, seed)?;
    }
    Ok(Box::new(file))
}

impl CloudFile {
    /// Adds a scan, of which some records are looked at.
    fn add(&mut self, name: String, seed: CloudSeed) -> Result<()> {
        let mut looked = Vec::new();
        let n_runs = RUNS.min(seed.n_records.div_ceil(RUN as u64));
        for run in 0..n_runs {
            let first = (seed.n_records as f64 * run as f64 / n_runs as f64) as u64;
            looked.extend(seed.body.records(&self.map, first, RUN, seed.n_records)?);
        }
        let (fields, note) = seed.fields.suited(&looked);
        let mut notes = seed.notes;
        notes.extend(note);
        let xyz = looked.iter().map(|r| self.in_metres([r[0], r[1], r[2]]));
        let points: Vec<[f64; 3]> = xyz.filter(|p| p.iter().all(|v| v.is_finite())).collect();
        let frame = match seed.pose {
            Some(pose) => FileFrame::of_world(pose),
            None => about(&points, &mut notes),
        };
        if seed.n_records == 0 {
            notes.push("scan has no points".into());
        }
        let step = crate::steps::coarse(&points);
        notes.extend(step.map(crate::steps::note));
        let n_points = Some(seed.n_records);
        self.masks.push(MaskSeed { name: name.clone(), n_points, n_stated: n_points });
        self.scans.push(ScanSeed {
            name,
            mask: self.parts.len(),
            source_id: None,
            world_from_scan: frame.world_from_scan,
            scanner_known: frame.scanner_known,
            places: Vec::new(),
            raster: None,
            position: frame.position(),
            stated_bounds: None,
            stated_points: n_points,
            likely_points: None,
            notes,
            step,
        });
        let oddities = Oddities::default();
        let (body, n_records) = (seed.body, seed.n_records);
        self.parts.push(CloudPart { body, fields, n_records, frame, oddities });
        Ok(())
    }

    /// The valid points among `n` records of a scan from a place on, with their places.
    fn points_of(&self, scan: usize, from: u64, n: usize) -> Result<Vec<(u64, [f32; 3])>> {
        let part = &self.parts[scan];
        let records = part.body.records(&self.map, from, n, part.n_records)?;
        let valid = records.iter().zip(from..).filter_map(|(record, place)| {
            let p = self.valid(part, [record[0], record[1], record[2]])?;
            Some((place, p.1.map(|v| v as f32)))
        });
        Ok(valid.collect())
    }

    /// First and last place of a scan.
    fn places(&self, scan: usize) -> (u64, u64) {
        (0, self.parts[scan].n_records.saturating_sub(1))
    }
}

/// The frame of points whose scanner is not known.
fn about(points: &[[f64; 3]], notes: &mut Vec<String>) -> FileFrame {
    let is_origin = |p: &&[f64; 3]| **p == [0.0; 3];
    let n_at_origin = points.iter().filter(is_origin).count();
    let own: Vec<[f64; 3]> = points.iter().filter(|p| !is_origin(p)).copied().collect();
    let frame = FileFrame::about(geometry::Pose::identity(), frame::near(None, &own));
    if n_at_origin < 2 || (n_at_origin as f64) < NO_RETURNS * points.len() as f64 {
        return frame;
    }
    notes.push(no_returns_note(n_at_origin, points.len()));
    frame.without_origin()
}

impl Reader for CloudFile {
    fn format(&self) -> Format {
        self.format
    }

    fn masks(&self) -> &[MaskSeed] {
        &self.masks
    }

    fn scans(&self) -> &[ScanSeed] {
        &self.scans
    }

    fn sample(&self, scan: usize, n: usize) -> Result<Vec<SampledPoint>> {
        sampling::sample(self.places(scan), n, |from, length| {
            Ok(self.points_of(scan, from, length)?.into_iter().map(|(_, xyz)| xyz).collect())
        })
    }

    fn spread(&self, scan: usize, n: usize, most: u64) -> Result<Vec<[f32; 3]>> {
        sampling::spread(self.places(scan), n, most, |from, length| {
            self.points_of(scan, from, length)
        })
    }

    fn window_starts(&self, scan: usize, sample: WindowSample) -> Option<Vec<u64>> {
        // A window is asked for by its place alone, which tells no scans apart.
        let part = self.parts.get(scan).filter(|_| self.parts.len() == 1)?;
        if let RecordBody::Packed(_) = part.body {
            return None;
        }
        let n = part.n_records;
        let n_windows = sample.n_windows.min(n / sample.n_points.max(1)).max(u64::from(n > 0));
        let start = |i: u64| (n as f64 * i as f64 / n_windows as f64) as u64;
        Some((0..n_windows).map(start).collect())
    }

    fn window(&self, first: u64, n: usize) -> Result<PointWindow> {
        let part = &self.parts[0];
        let records = part.body.records(&self.map, first, n, part.n_records)?;
        let world = records.iter().filter_map(|r| self.valid(part, [r[0], r[1], r[2]]));
        let points = world.map(|(world, _)| world).collect();
        Ok(PointWindow { place: first, source_id: 0, points })
    }

    fn read(&self, want: Want) -> Result<FileReading<'_>> {
        if want == Want::Everything {
            self.parts.iter().for_each(|part| part.oddities.clear());
        }
        if let [part] = &self.parts[..]
            && let RecordBody::Packed(body) = &part.body
        {
            return Ok(FileReading::Straight(Box::new(strips::PackedStrips::new(
                self, body, want,
            ))));
        }
        let extents = self.parts.iter().flat_map(|part| {
            part.body.extents(part.n_records, self.strip_points).into_iter().flatten()
        });
        Ok(FileReading::ByExtent(Box::new(Extent::cover(extents, self.map.len() as u64))))
    }

    fn decode(&self, extent: &Extent, bytes: &[u8], want: Want) -> Result<Vec<RawStrip>> {
        if extent.n_points == 0 {
            return Ok(Vec::new());
        }
        let end = |part: &CloudPart| part.body.end(part.n_records);
        let scan = self.parts.partition_point(|part| end(part) <= extent.bytes.start);
        let Some(part) = self.parts.get(scan) else { return Ok(Vec::new()) };
        self.strips(scan, extent.first, part.body.decode(extent, bytes), want)
    }

    fn mapped(&self) -> Option<&Mapped> {
        Some(&self.map)
    }

    fn units(&self) -> &Units {
        &self.units
    }

    fn read_scan(&self, scan: usize) -> Option<RawStrips<'_>> {
        let part = &self.parts[scan];
        let extents = part.body.extents(part.n_records, self.strip_points)?;
        let decode = move |extent: Extent| {
            let strips = self.decode(&extent, extent.of(&self.map), Want::Coordinates);
            match strips {
                Ok(strips) => strips.into_iter().map(Ok).collect(),
                Err(error) => vec![Err(error)],
            }
        };
        Some(Box::new(extents.flat_map(decode)))
    }

    fn has_color(&self) -> bool {
        self.parts.iter().any(|part| part.fields.has_color())
    }

    fn oddities(&self, scan: usize) -> Option<&Oddities> {
        self.parts.get(scan).map(|part| &part.oddities)
    }

    fn facts(&self) -> Vec<(String, String)> {
        let n_records: u64 = self.parts.iter().map(|part| part.n_records).sum();
        let mut facts = vec![("records".to_owned(), n_records.to_string())];
        if let Some(part) = self.parts.first() {
            let stored = match &part.body {
                RecordBody::Text(body) => format!("text of {} columns", body.n_columns),
                RecordBody::Binary(body) => format!("{} bytes each", body.stride),
                RecordBody::Packed(_) => "compressed".into(),
            };
            facts.push(("stored".into(), stored));
            let mut attributes = vec!["coordinates"];
            attributes.extend(part.fields.intensity.map(|_| "intensity"));
            attributes.extend(part.fields.has_color().then_some("colour"));
            facts.push(("attributes".into(), attributes.join(", ")));
        }
        facts
    }
}
