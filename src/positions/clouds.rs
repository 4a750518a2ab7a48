//! Finds the setups of each cloud whose scanner is not known.

use super::owned::Ownership;
use super::stretches;
use super::unordered;
use super::words;
use crate::engine::{AllThreads, Engine};
use contract::{Format, MaskId, Result, Scan, ScannerPosition};
use ingest::{KnownScanner, PointWindow, Sources, WindowSample};
use serde::Serialize;
use setups::{FoundRasters, FoundSetups, RasterSetup, ScanWindow, Setup};
use std::path::Path;

/// Number of windows of a cloud that are looked at first, and where these leave much unexplained or
/// hold many setups; and the points of each.
const WINDOWS: [u64; 2] = [800, 6_000];
const WINDOW_POINTS: u64 = 512;
/// Windows of a setup below which more are read.
const PER_SETUP: usize = 60;
/// Share of windows without a setup above which more are read.
const UNEXPLAINED: f64 = 0.1;
/// Fewest windows of a cloud that is looked at without its order.
const FEWEST_WINDOWS: usize = 12;
/// Distance within which setups that are found with and without order are one, metres.
const SAME_PLACE: f64 = 0.2;
/// Largest standard deviation of a position that is used, metres: free space is judged to a few
/// millimetres. Right combs of scanners state less than a millimetre; of 744 drawn setups one was
/// wrong, by 24 mm at a stated 4.6 mm.
const MOST_SIGMA: f64 = 0.002;

/// What was found in a cloud: a scan whose scanner the file does not state.
#[derive(Debug, Clone, Serialize)]
pub struct CloudSetups {
    /// Mask of its points, which keeps its number when scans are told apart.
    #[serde(skip)]
    pub mask: MaskId,
    /// Path of its file.
    pub input: String,
    /// Name of the scan.
    pub name: String,
    /// The setups, those of more columns first.
    pub setups: Vec<SetupOfCloud>,
    /// Why there is no setup, or none for some of the points.
    pub unknown: Option<String>,
    /// Share of the windows looked at that were measured from the setups.
    pub explained: f64,
    /// Whether order leaves so much unexplained that the cloud is looked at without it.
    #[serde(skip)]
    pub is_open: bool,
}

/// A setup of a cloud.
#[derive(Debug, Clone, Serialize)]
pub struct SetupOfCloud {
    /// Position of the scanner, metres.
    pub position: [f64; 3],
    /// Standard deviation of the position along x, y, z, metres.
    pub sigma: [f64; 3],
    /// Angle between the scanner's axis and the vertical, degrees.
    pub tilt_deg: f64,
    /// Elevation between rows, degrees.
    pub row_step_deg: f64,
    /// Azimuth between columns, degrees, where neighbouring columns were seen.
    pub col_step_deg: Option<f64>,
    /// The evidence in words.
    pub evidence: String,
    /// Whether `run` can use it, since it is known which points are its own.
    pub is_usable: bool,
    /// Which points are its own.
    #[serde(skip)]
    pub ownership: Ownership,
    /// The entry of a scanners file.
    #[serde(skip)]
    pub entry: KnownScanner,
}

impl CloudSetups {
    /// Entries of a scanners file for the setups that can be used.
    pub fn entries(&self) -> impl Iterator<Item = KnownScanner> + '_ {
        self.setups.iter().filter(|setup| setup.is_usable).map(|setup| setup.entry.clone())
    }
}

/// In which clouds setups are looked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CloudOrder {
    /// Whose points are in the order of measurement; others cost a second a million points.
    Measured,
    /// In these, and without order where a run can use what is found: where order tells of none.
    Used,
    /// In all.
    Any,
}

/// Finds the setups of all clouds of an order whose scanner is not known. Points without order are
/// looked at in so many bytes.
///
/// # Errors
/// If an input is broken where it is read.
pub fn find(
    sources: &Sources,
    order: CloudOrder,
    bytes: usize,
    engine: &Engine,
) -> Result<Vec<CloudSetups>> {
    let opened = sources.opened();
    let is_open = |scan: &&Scan| opened.iter().any(|input| input.id == scan.input);
    let unknown = sources.scans.iter().filter(is_open);
    let unknown: Vec<&Scan> = unknown
        .filter(|s| s.scanner == ScannerPosition::Unknown && s.stated_points != Some(0))
        .collect();
    let mut clouds = engine.each(unknown.clone(), |scan| of_cloud(sources, scan))?;
    if order == CloudOrder::Measured {
        return Ok(clouds);
    }
    // One after the other: each takes much memory, and all threads.
    let is_wanted = |(cloud, scan): &(&mut CloudSetups, &Scan)| {
        let is_used = cloud.setups.is_empty() && is_alone(sources, scan);
        cloud.is_open && (is_used || order == CloudOrder::Any)
    };
    for (cloud, scan) in clouds.iter_mut().zip(unknown).filter(is_wanted) {
        engine.cancel.check()?;
        let found = unordered::of_scan(sources, scan, bytes, engine)?;
        cloud.add_unordered(sources, scan, &found);
    }
    Ok(clouds)
}

/// The setups of a cloud by the order of its points.
fn of_cloud(sources: &Sources, scan: &Scan) -> Result<CloudSetups> {
    let (windows, found) = looked(sources, scan)?;
    let input = &sources.inputs[scan.input.0 as usize];
    let n_owned = found.owners.iter().filter(|owner| owner.is_some()).count();
    let owned = if is_alone(sources, scan) {
        stretches::of_setups(sources, scan, &windows, &found)?
    } else {
        vec![Ownership::Untold; found.setups.len()]
    };
    let name = name_of_entries(sources, scan);
    let setups = found.setups.iter().zip(owned);
    let setups: Vec<SetupOfCloud> =
        setups.map(|(setup, own)| setup_of_cloud(setup, own, &name)).collect();
    let n_usable = setups.iter().filter(|setup| setup.is_usable).count();
    let explained = n_owned as f64 / windows.len().max(1) as f64;
    Ok(CloudSetups {
        mask: scan.mask,
        input: input.path.display().to_string(),
        name: scan.name.clone(),
        setups,
        unknown: words::unknown(&found, is_alone(sources, scan), n_usable),
        explained,
        is_open: 1.0 - explained > UNEXPLAINED && windows.len() >= FEWEST_WINDOWS,
    })
}

/// The name by which entries of a scanners file mean a scan.
fn name_of_entries(sources: &Sources, scan: &Scan) -> String {
    let input = &sources.inputs[scan.input.0 as usize];
    match input.format {
        Format::Las | Format::Laz => stem(&input.path),
        _ => scan.name.clone(),
    }
}

impl CloudSetups {
    /// Adds the setups that are found without the order of the points, of which there are so many.
    fn add_unordered(&mut self, sources: &Sources, scan: &Scan, of: &(FoundRasters, u64)) {
        let (found, n_points) = of;
        let in_order = self.unknown.take().unwrap_or_default();
        let is_known = |setup: &RasterSetup| {
            let at: [f64; 3] = setup.world_from_scanner.translation.vector.into();
            let off = |other: &SetupOfCloud| {
                (0..3).map(|i| (at[i] - other.position[i]).powi(2)).sum::<f64>().sqrt()
            };
            self.setups.iter().any(|other| off(other) < SAME_PLACE)
        };
        // What order tells stands, and tells whose the points are in another way.
        let is_first = self.setups.is_empty();
        let is_las = {
            let format = sources.inputs[scan.input.0 as usize].format;
            matches!(format, Format::Las | Format::Laz)
        };
        // A raster keeps points from others only if all of them are used.
        let is_sure = |s: &RasterSetup| s.sigma.iter().all(|sigma| *sigma <= MOST_SIGMA);
        let are_sure = found.setups.iter().all(|s| s.raster.is_none() || is_sure(s));
        let own = |i: usize, setup: &RasterSetup| match &setup.raster {
            _ if !is_first || !is_alone(sources, scan) => Ownership::Untold,
            _ if found.is_alone => Ownership::Whole,
            _ if !is_las => Ownership::Untold,
            None => Ownership::Scattered,
            Some(_) if !are_sure => Ownership::Scattered,
            Some(_) => Ownership::Raster((found.told(i) * *n_points as f64).round() as u64),
        };
        let name = name_of_entries(sources, scan);
        let new = found.setups.iter().enumerate().filter(|(_, setup)| !is_known(setup));
        let new: Vec<SetupOfCloud> =
            new.map(|(i, setup)| raster_of_cloud(setup, own(i, setup), &name)).collect();
        if !new.is_empty() {
            self.explained = self.explained.max(found.explained);
        }
        self.unknown = if is_first || !new.is_empty() {
            let is_open = new.iter().any(|setup| !setup.is_usable);
            words::unknown_unordered(&in_order, found, is_open.then_some(is_las))
        } else {
            Some(in_order).filter(|cause| !cause.is_empty())
        };
        self.setups.extend(new);
    }
}

/// A setup that was found without the order of the points.
fn raster_of_cloud(setup: &RasterSetup, ownership: Ownership, name: &str) -> SetupOfCloud {
    let axis = setup.world_from_scanner.rotation * geometry::Vector::z();
    let is_by_raster = matches!(ownership, Ownership::Raster(_));
    let is_told = is_by_raster || ownership == Ownership::Whole;
    SetupOfCloud {
        position: setup.world_from_scanner.translation.vector.into(),
        sigma: setup.sigma,
        tilt_deg: axis.z.abs().min(1.0).acos().to_degrees(),
        row_step_deg: setup.steps[1].to_degrees(),
        col_step_deg: Some(setup.steps[0].to_degrees()),
        evidence: words::raster_evidence(setup),
        is_usable: is_told && setup.sigma.iter().all(|sigma| *sigma <= MOST_SIGMA),
        ownership,
        entry: KnownScanner {
            point_source_id: None,
            name: Some(name.to_owned()),
            world_from_scan: setup.world_from_scanner,
            sigma: Some(setup.sigma),
            places: Vec::new(),
            raster: setup.raster.clone().filter(|_| is_by_raster),
        },
    }
}

/// Windows of a cloud, and the setups in them; more windows where the first leave much open.
fn looked(sources: &Sources, scan: &Scan) -> Result<(Vec<ScanWindow>, FoundSetups)> {
    let mut last = (Vec::new(), FoundSetups::default());
    for n_windows in WINDOWS {
        let sample = WindowSample { n_windows, n_points: WINDOW_POINTS };
        let read = sources.windows(scan.id, sample, &AllThreads)?;
        let windows: Vec<ScanWindow> = read.into_iter().map(window).collect();
        if windows.len() == last.0.len() {
            break;
        }
        let found = setups::find(&windows, &setups::SetupLimits::default());
        let n_open = found.owners.iter().filter(|owner| owner.is_none()).count();
        let is_enough = windows.len() >= PER_SETUP * found.setups.len()
            && n_open as f64 <= UNEXPLAINED * windows.len() as f64;
        let is_hopeless = found.cause == Some(setups::Cause::NoColumns);
        last = (windows, found);
        if is_enough || is_hopeless {
            break;
        }
    }
    Ok(last)
}

fn window(read: PointWindow) -> ScanWindow {
    ScanWindow { place: read.place, source: u32::from(read.source_id), points: read.points }
}

/// Whether the name of a scan names it alone, so that an entry of a scanners file can mean it.
fn is_alone(sources: &Sources, scan: &Scan) -> bool {
    let own = &sources.inputs[scan.input.0 as usize];
    let is_las = |format| matches!(format, Format::Las | Format::Laz);
    if is_las(own.format) {
        let same = sources.opened().iter().filter(|i| stem(&i.path) == stem(&own.path));
        return same.count() == 1;
    }
    sources.scans.iter().filter(|other| other.name == scan.name).count() == 1
}

pub(super) fn stem(path: &Path) -> String {
    path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned())
}

fn setup_of_cloud(setup: &Setup, ownership: Ownership, name: &str) -> SetupOfCloud {
    let is_sure = setup.largest_sigma() <= MOST_SIGMA;
    let (point_source_id, places) = match &ownership {
        Ownership::Source(id) => (Some(*id), Vec::new()),
        Ownership::Places(places) => (None, places.clone()),
        Ownership::Whole | Ownership::Untold | Ownership::Raster(_) | Ownership::Scattered => {
            (None, Vec::new())
        }
    };
    SetupOfCloud {
        position: setup.position(),
        sigma: setup.sigma,
        tilt_deg: setup.tilt().to_degrees(),
        row_step_deg: setup.comb[1].to_degrees(),
        col_step_deg: setup.col_step.map(f64::to_degrees),
        evidence: words::evidence(setup),
        is_usable: is_sure && ownership != Ownership::Untold,
        entry: KnownScanner {
            point_source_id,
            name: Some(name.to_owned()),
            world_from_scan: setup.world_from_scanner,
            sigma: Some(setup.sigma),
            places,
            raster: None,
        },
        ownership,
    }
}
