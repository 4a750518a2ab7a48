//! Finds the scans of a LAS or LAZ file: which source id belongs to which known scanner, and where
//! to put the origin where no scanner is known.

use crate::las_header::LasHeader;
use crate::las_layout::RecordLayout;
use crate::las_runs::LasRecords;
use crate::place_look::PlaceLook;
use crate::rasters_of_scans::{self, RastersOfScans};
use crate::reader::ScanSeed;
use crate::scan_of_point::{PlacesOfScans, ScanOfPoint};
use crate::settings::Settings;
use crate::source_census::SourceCensus;
use contract::{PointRaster, Result, ScannerPosition};
use geometry::{Aabb, Pose};
use std::path::Path;

/// A known scanner of the points of a LAS or LAZ file, or of those with one source id.
#[derive(Debug, Clone)]
pub(crate) struct LasScanner {
    /// Source id of its points; `None` for the whole file.
    pub(crate) source_id: Option<u16>,
    /// Display name.
    pub(crate) name: Option<String>,
    /// Pose `world_from_scan`, metres.
    pub(crate) pose: Pose,
    /// How it is known.
    pub(crate) position: ScannerPosition,
    /// First and last places of the stretches of its points; empty where its source id tells.
    pub(crate) places: Vec<[u64; 2]>,
    /// The raster of its points, where only this tells.
    pub(crate) raster: Option<PointRaster>,
    /// Whether it may belong to another file, so that it is left out if no point of it is seen
    /// here.
    pub(crate) may_be_elsewhere: bool,
}

/// The scans of one file.
pub(crate) struct FoundScans {
    pub(crate) scans: Vec<ScanSeed>,
    /// Which points belong to which scan.
    pub(crate) scan_of: ScanOfPoint,
    /// First and last place at which points of each scan were seen.
    pub(crate) extents: Vec<(u64, u64)>,
    /// Whether all sampled points lie inside the stated bounds.
    pub(crate) bounds_hold: bool,
    /// The source ids of the file, where they were asked for.
    pub(crate) census: Option<SourceCensus>,
}

/// Note on the points of a file that no raster claims alone.
const SEVERAL: &str =
    "points that lie on the rasters of several scanners, or surely on none, prove no free space";
/// Largest number of records of which all source ids are read; of larger files only windows are.
const CENSUS_ALL: u64 = 20_000_000;
/// Number of windows.
const CENSUS_WINDOWS: u64 = 512;
/// Number of records in each window.
const CENSUS_RECORDS: usize = 512;

/// Finds the scans of a file. Its source ids are not read where they are `known`.
pub(crate) fn find(
    path: &Path,
    records: &LasRecords,
    scanners: &[LasScanner],
    known: Option<SourceCensus>,
    settings: &Settings,
) -> Result<FoundScans> {
    let header = &records.header;
    let look = look(records)?;
    let whole = whole_extent(header);
    let stem = path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
    let step = crate::steps::coarse(&look.points);
    let notes = notes(header, &look, step);
    let seed = |name: String, source_id: Option<u16>, pose: Option<Pose>| ScanSeed {
        name,
        mask: 0,
        source_id,
        world_from_scan: pose
            .unwrap_or_else(|| Pose::translation(look.origin[0], look.origin[1], look.origin[2])),
        scanner_known: pose.is_some(),
        position: ScannerPosition::Unknown,
        places: Vec::new(),
        raster: None,
        stated_bounds: header.bounds.filter(|_| !look.bounds_wrong()),
        stated_points: None,
        likely_points: None,
        notes: notes.clone(),
        step,
    };
    let mut found = FoundScans {
        scans: Vec::new(),
        scan_of: ScanOfPoint::One,
        extents: Vec::new(),
        bounds_hold: look.outside == 0 && header.bounds.is_some(),
        census: None,
    };
    if scanners.iter().any(|s| s.raster.is_some()) {
        by_raster(&mut found, scanners, records, &stem, seed)?;
    } else if scanners.iter().any(|s| !s.places.is_empty()) {
        by_place(&mut found, scanners, header, &stem, seed);
    } else if let Some(only) = scanners.iter().find(|s| s.source_id.is_none()) {
        let mut scan = seed(only.name.clone().unwrap_or(stem), None, Some(only.pose));
        scan.position = only.position;
        scan.stated_points = Some(header.n_points);
        found.scans.push(scan);
        found.extents.push(whole);
    } else if scanners.is_empty() {
        let mut scan = seed(stem, None, None);
        scan.stated_points = Some(header.n_points);
        found.scans.push(scan);
        found.extents.push(whole);
    } else {
        let census = known.map_or_else(|| census(records), Ok)?;
        by_source_id(&mut found, scanners, &census, header, &stem, seed);
        found.census = Some(census);
    }
    found.scans.iter_mut().try_for_each(|scan| look.check(scan, settings))?;
    Ok(found)
}

/// What users should know of all scans of a file.
fn notes(header: &LasHeader, look: &PlaceLook, step: Option<f64>) -> Vec<String> {
    let mut notes = header.notes.clone();
    notes.extend(step.map(crate::steps::note));
    if look.bounds_wrong() && header.bounds.is_some() {
        let (outside, n) = (look.outside, look.points.len());
        notes.push(format!(
            "the stated bounds are wrong: {outside} of {n} points looked at lie outside"
        ));
    }
    notes
}

/// The first and last place of a file's records.
fn whole_extent(header: &LasHeader) -> (u64, u64) {
    (0, header.n_points.saturating_sub(1))
}

/// Makes a scan for each scanner that has points, and one for the points of all other sources.
fn by_source_id(
    found: &mut FoundScans,
    scanners: &[LasScanner],
    census: &SourceCensus,
    header: &LasHeader,
    stem: &str,
    seed: impl Fn(String, Option<u16>, Option<Pose>) -> ScanSeed,
) {
    /// Marks ids without scanner until the index of the scan for the rest is known.
    const NONE: u16 = u16::MAX;
    let whole = whole_extent(header);
    let n_records = whole.1 + 1 - whole.0;
    let mut scan_of_source = vec![NONE; 1 << 16];
    for scanner in scanners {
        let Some(id) = scanner.source_id else {
            continue;
        };
        let seen = census.ids.get(&id);
        if seen.is_none() && (census.complete || scanner.may_be_elsewhere) {
            continue;
        }
        scan_of_source[usize::from(id)] = found.scans.len() as u16;
        // The name of the file says of which file the points are, not which scan they are.
        let own_name = scanner.name.clone().filter(|name| name != stem);
        let name = own_name.unwrap_or_else(|| format!("{stem} {id}"));
        let mut scan = seed(name, Some(id), Some(scanner.pose));
        scan.position = scanner.position;
        scan.likely_points = seen.map(|seen| census.likely(seen.2, n_records));
        found.scans.push(scan);
        // Windows may miss the first and last points of a scan; the places between those seen are
        // enough for a sample.
        found.extents.push(seen.map_or(whole, |seen| (seen.0, seen.1)));
    }
    let rest = census.ids.keys().any(|id| scan_of_source[usize::from(*id)] == NONE);
    if rest || !census.complete || found.scans.is_empty() {
        let number = found.scans.len() as u16;
        scan_of_source.iter_mut().filter(|s| **s == NONE).for_each(|s| *s = number);
        found.scans.push(seed(format!("{stem} (rest)"), None, None));
        found.extents.push(whole);
    }
    found.scan_of = ScanOfPoint::BySource(scan_of_source);
}

/// Makes a scan for each scanner with places in this file, and one for all other points.
fn by_place(
    found: &mut FoundScans,
    scanners: &[LasScanner],
    header: &LasHeader,
    stem: &str,
    seed: impl Fn(String, Option<u16>, Option<Pose>) -> ScanSeed,
) {
    let whole = whole_extent(header);
    let mut stretches = Vec::new();
    for scanner in scanners.iter().filter(|s| !s.places.is_empty()) {
        let within = |[first, last]: &[u64; 2]| (*first, (*last).min(whole.1));
        let own: Vec<(u64, u64)> =
            scanner.places.iter().map(within).filter(|(first, last)| first <= last).collect();
        let (Some(first), Some(last)) = (own.first(), own.last()) else { continue };
        let number = found.scans.len() as u16;
        let name = scanner.name.clone().filter(|name| name != stem);
        let name = name.unwrap_or_else(|| format!("{stem} {}", number + 1));
        let mut scan = seed(name, None, Some(scanner.pose));
        scan.position = scanner.position;
        scan.places = own.iter().map(|(first, last)| [*first, *last]).collect();
        scan.likely_points = Some(own.iter().map(|(first, last)| last - first + 1).sum());
        found.scans.push(scan);
        found.extents.push((first.0, last.1));
        stretches.extend(own.into_iter().map(|(first, last)| (first, last, number)));
    }
    let rest = found.scans.len() as u16;
    let by_place = PlacesOfScans::new(stretches, rest);
    if !by_place.are_all(whole) {
        found.scans.push(seed(format!("{stem} (rest)"), None, None));
        found.extents.push(whole);
    }
    found.scan_of = ScanOfPoint::ByPlace(by_place);
}

/// Makes a scan for each scanner whose points lie on a raster of its own, and one for all others.
fn by_raster(
    found: &mut FoundScans,
    scanners: &[LasScanner],
    records: &LasRecords,
    stem: &str,
    seed: impl Fn(String, Option<u16>, Option<Pose>) -> ScanSeed,
) -> Result<()> {
    let header = &records.header;
    let whole = whole_extent(header);
    let mut rasters = RastersOfScans::new(header);
    for (scanner, raster) in scanners.iter().filter_map(|s| s.raster.as_ref().map(|r| (s, r))) {
        let number = found.scans.len() + 1;
        let name = scanner.name.clone().filter(|name| name != stem);
        let mut scan =
            seed(name.unwrap_or_else(|| format!("{stem} {number}")), None, Some(scanner.pose));
        scan.position = scanner.position;
        scan.raster = Some(raster.clone());
        found.scans.push(scan);
        found.extents.push(whole);
        rasters.add(&scanner.pose, raster);
    }
    let shares = rasters_of_scans::shares(&rasters, records)?;
    for (scan, share) in found.scans.iter_mut().zip(shares) {
        scan.likely_points = Some((share * header.n_points as f64).round() as u64);
    }
    let mut rest = seed(format!("{stem} (rest)"), None, None);
    rest.notes.push(SEVERAL.into());
    found.scans.push(rest);
    found.extents.push(whole);
    found.scan_of = ScanOfPoint::ByRaster(rasters);
    Ok(())
}

/// The stated bounds with a margin, since writers round them by up to a tenth of a unit.
pub(crate) fn grown(bounds: &Aabb, header: &LasHeader) -> Aabb {
    let size = bounds.size();
    let scale = header.scale.iter().fold(0.0_f64, |a, s| a.max(s.abs()));
    bounds.grown(0.01 * size[0].max(size[1]).max(size[2]) + 2.0 * scale)
}

fn look(records: &LasRecords) -> Result<PlaceLook> {
    let header = &records.header;
    let mut points = Vec::new();
    let mut starts = Vec::new();
    for first in PlaceLook::windows(header.n_points) {
        if starts.contains(&records.start(first)) {
            continue;
        }
        starts.push(records.start(first));
        let (_, run) = records.run(first, PlaceLook::IN_WINDOW)?;
        let world = run.chunks_exact(header.record_len).map(|r| world(r, header));
        points.extend(world.filter(|p| p.iter().all(|v| v.is_finite())));
    }
    Ok(PlaceLook::new(points, header.bounds.map(|stated| (stated, grown(&stated, header)))))
}

fn world(record: &[u8], header: &LasHeader) -> [f64; 3] {
    [0, 1, 2].map(|a| {
        let at = 4 * a;
        let count =
            i32::from_le_bytes([record[at], record[at + 1], record[at + 2], record[at + 3]]);
        f64::from(count) * header.scale[a] + header.offset[a]
    })
}

/// Reads the source ids of all records of a small file, else those of windows.
fn census(records: &LasRecords) -> Result<SourceCensus> {
    let header = &records.header;
    let layout = RecordLayout::of(header.format).expect("the header was checked");
    let mut census = SourceCensus::default();
    let mut add = |first: u64, run: &[u8]| {
        census.add(first, run.chunks_exact(header.record_len).map(|r| layout.source_id(r)));
    };
    let stream = records.laz.as_ref().is_some_and(|l| l.pieces.is_empty());
    // A compressed record takes forty times as long.
    let all = if header.compressed { CENSUS_ALL / 40 } else { CENSUS_ALL };
    if header.n_points <= all || stream {
        let n = usize::try_from(header.n_points.min(all)).expect("at most twenty million");
        let (first, run) = records.run(0, n)?;
        add(first, &run);
        census.complete = header.n_points <= all;
        return Ok(census);
    }
    for window in 0..CENSUS_WINDOWS {
        let (first, run) =
            records.run(header.n_points * window / CENSUS_WINDOWS, CENSUS_RECORDS)?;
        add(first, &run);
    }
    Ok(census)
}
