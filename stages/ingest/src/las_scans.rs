//! Finds the scans of a LAS or LAZ file: which source id belongs to which known scanner, and where
//! to put the origin where no scanner is known.

use crate::frame::NO_RETURN;
use crate::las_header::LasHeader;
use crate::las_layout::RecordLayout;
use crate::las_runs::LasRecords;
use crate::oddities::no_returns_note;
use crate::reader::ScanSeed;
use crate::scan_of_point::{PlacesOfScans, ScanOfPoint};
use crate::settings::Settings;
use contract::{Error, Kind, Result, ScannerPosition};
use geometry::{Aabb, Pose};
use std::collections::BTreeMap;
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
}

impl Census {
    /// Estimated number of records of the whole file, of which `n` were seen in the sample.
    fn likely(&self, n: u64, n_records: u64) -> u64 {
        let all = n_records as f64;
        (n as f64 / self.n_looked.max(1) as f64 * all) as u64
    }
}

/// Message for scans without scanner position.
pub(crate) const NO_SCANNER: &str = "the scanner's position is not known: no free-space evidence, so postures are less \
     certain and wrong ones harder to refuse; give it with --scanners";

/// Largest number of records of which all source ids are read; of larger files only windows are.
const CENSUS_ALL: u64 = 20_000_000;
/// Number of windows.
const CENSUS_WINDOWS: u64 = 512;
/// Number of records in each window.
const CENSUS_RECORDS: usize = 512;
/// A scanner farther than this from the middle of its points was probably given in another frame,
/// metres.
const FAR_SCANNER: f64 = 2_000.0;

/// The source ids of a file, from all records or a sample of them.
#[derive(Default)]
struct Census {
    /// First place, last place and number of records of each source id.
    ids: BTreeMap<u16, (u64, u64, u64)>,
    /// Number of records that were read.
    n_looked: u64,
    /// Whether every record was read.
    complete: bool,
}

/// Finds the scans of a file.
pub(crate) fn find(
    path: &Path,
    records: &LasRecords,
    scanners: &[LasScanner],
    settings: &Settings,
) -> Result<FoundScans> {
    let header = &records.header;
    let look = look(records)?;
    let whole = whole_extent(header);
    let stem = path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
    let mut notes = header.notes.clone();
    let step = crate::steps::coarse(&look.points);
    notes.extend(step.map(crate::steps::note));
    if look.bounds_wrong() && header.bounds.is_some() {
        let (outside, n) = (look.outside, look.points.len());
        notes.push(format!(
            "the stated bounds are wrong: {outside} of {n} points looked at lie outside"
        ));
    }
    let seed = |name: String, source_id: Option<u16>, pose: Option<Pose>| ScanSeed {
        name,
        mask: 0,
        source_id,
        world_from_scan: pose
            .unwrap_or_else(|| Pose::translation(look.origin[0], look.origin[1], look.origin[2])),
        scanner_known: pose.is_some(),
        position: ScannerPosition::Unknown,
        places: Vec::new(),
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
    };
    if scanners.iter().any(|s| !s.places.is_empty()) {
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
        let census = census(records)?;
        by_source_id(&mut found, scanners, &census, header, &stem, seed);
    }
    found.scans.iter_mut().try_for_each(|scan| check_place(scan, &look, settings))?;
    Ok(found)
}

/// The first and last place of a file's records.
fn whole_extent(header: &LasHeader) -> (u64, u64) {
    (0, header.n_points.saturating_sub(1))
}

/// Makes a scan for each scanner that has points, and one for the points of all other sources.
fn by_source_id(
    found: &mut FoundScans,
    scanners: &[LasScanner],
    census: &Census,
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

/// Message for scans whose scanner's position was found from their points.
pub(crate) fn found_note(sigma: [f64; 3]) -> String {
    let most = sigma.iter().fold(0.0_f64, |most, s| s.max(most)) * 1e3;
    format!("the scanner's position was found from the points, to about {most:.2} mm")
}

/// Checks the place of a scan, by its scanner where that is known, else by the spread of its
/// points, and notes what users should know.
fn check_place(scan: &mut ScanSeed, look: &LasLook, settings: &Settings) -> Result<()> {
    if scan.scanner_known {
        if let ScannerPosition::Found { sigma } = scan.position {
            scan.notes.push(found_note(sigma));
        }
        let n = look.n_at(scan.world_from_scan.translation.vector);
        if n > 0 {
            scan.notes.push(no_returns_note(n, look.points.len()));
        }
        return check_distance(scan, look.middle, settings);
    }
    let far = look.far_from(scan.world_from_scan.translation.vector, settings.max_range);
    if far > 0 && far == look.points.len() {
        let what = format!(
            "none of {far} points looked at lies within {} km of their middle, \"{:?}\"",
            settings.max_range / 1000.0,
            look.origin
        );
        return Err(Error::bad_input(what)
            .hint("the file is damaged, or its unit is another: give it with --units"));
    }
    if far > 0 {
        scan.notes.push(format!(
            "{far} of {} points looked at lie more than {} km from the middle: such points are dropped",
            look.points.len(),
            settings.max_range / 1000.0
        ));
    }
    scan.notes.push(NO_SCANNER.into());
    Ok(())
}

fn check_distance(
    scan: &mut ScanSeed,
    middle: Option<[f64; 3]>,
    settings: &Settings,
) -> Result<()> {
    let Some(middle) = middle else { return Ok(()) };
    let distance =
        (nalgebra::Vector3::from(middle) - scan.world_from_scan.translation.vector).norm();
    if distance > settings.max_range {
        return Err(Error::new(
            Kind::Usage,
            format!("the scanner \"{}\" lies {distance:.0} m from its points", scan.name),
        )
        .hint("give its position in the same frame as the points"));
    }
    if distance > FAR_SCANNER {
        scan.notes.push(format!(
            "the scanner lies {distance:.0} m from the middle of the points: check that its position is in their frame"
        ));
    }
    Ok(())
}

/// The stated bounds with a margin, since writers round them by up to a tenth of a unit.
pub(crate) fn grown(bounds: &Aabb, header: &LasHeader) -> Aabb {
    let size = bounds.size();
    let scale = header.scale.iter().fold(0.0_f64, |a, s| a.max(s.abs()));
    bounds.grown(0.01 * size[0].max(size[1]).max(size[2]) + 2.0 * scale)
}

/// The place of a scan's points, from a sample of records.
struct LasLook {
    /// World coordinates, metres.
    points: Vec<[f64; 3]>,
    /// Number of these points outside the stated bounds.
    outside: usize,
    /// Median of these points, metres.
    middle: Option<[f64; 3]>,
    /// Origin to use where no scanner is known: whole metres near the median.
    origin: [f64; 3],
}

impl LasLook {
    fn bounds_wrong(&self) -> bool {
        self.outside * 2 > self.points.len()
    }

    /// Number of these points that lie at a scanner itself.
    fn n_at(&self, scanner: nalgebra::Vector3<f64>) -> usize {
        let is_at = |p: &&[f64; 3]| (0..3).all(|a| (p[a] - scanner[a]).abs() < NO_RETURN);
        self.points.iter().filter(is_at).count()
    }

    fn far_from(&self, origin: nalgebra::Vector3<f64>, max_range: f64) -> usize {
        let far = |p: &[f64; 3]| (0..3).any(|a| (p[a] - origin[a]).abs() > max_range);
        self.points.iter().filter(|p| far(p)).count()
    }
}

fn look(records: &LasRecords) -> Result<LasLook> {
    const WINDOWS: u64 = 8;
    const IN_WINDOW: usize = 256;
    let header = &records.header;
    let mut points = Vec::new();
    let mut starts = Vec::new();
    for window in 0..WINDOWS {
        let first = header.n_points * window / WINDOWS;
        if header.n_points == 0 || starts.contains(&records.start(first)) {
            continue;
        }
        starts.push(records.start(first));
        let (_, run) = records.run(first, IN_WINDOW)?;
        let world = run.chunks_exact(header.record_len).map(|r| world(r, header));
        points.extend(world.filter(|p| p.iter().all(|v| v.is_finite())));
    }
    let bounds = header.bounds.as_ref().map(|b| grown(b, header));
    let outside =
        points.iter().filter(|p| !bounds.as_ref().is_some_and(|b| b.contains(**p))).count();
    let middle = (!points.is_empty()).then(|| {
        [0, 1, 2].map(|a| {
            let mut values: Vec<f64> = points.iter().map(|p| p[a]).collect();
            values.sort_by(f64::total_cmp);
            values[values.len() / 2]
        })
    });
    let mut look = LasLook { points, outside, middle, origin: [0.0; 3] };
    let stated = header.bounds.filter(|_| !look.bounds_wrong()).map(|b| {
        let center = b.center();
        [center.x, center.y, center.z]
    });
    look.origin = stated.or(middle).unwrap_or_default().map(f64::round);
    Ok(look)
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
fn census(records: &LasRecords) -> Result<Census> {
    let header = &records.header;
    let layout = RecordLayout::of(header.format).expect("the header was checked");
    let mut census = Census::default();
    let mut add = |first: u64, run: &[u8]| {
        let ids: Vec<u16> =
            run.chunks_exact(header.record_len).map(|r| layout.source_id(r)).collect();
        let mut place = first;
        // Points of one scan usually follow one another.
        for same in ids.chunk_by(|a, b| a == b) {
            let n = same.len() as u64;
            let id = census.ids.entry(same[0]).or_insert((place, place, 0));
            *id = (id.0.min(place), id.1.max(place + n - 1), id.2 + n);
            place += n;
        }
        census.n_looked += place - first;
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
