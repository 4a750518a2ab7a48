//! Opens the inputs of a job, and finds the scanners of those that state none from their points.

mod clouds;
mod owned;
mod stretches;
mod unordered;
mod words;

pub use clouds::{CloudOrder, CloudSetups, SetupOfCloud, find};
pub use owned::Ownership;

use crate::engine::{AllThreads, Engine};
use crate::job::Job;
use contract::{Result, ScannerPosition};
use ingest::{Before, KeepLooks, KnownScanners, Sources};

/// Opened inputs, and what was found of scanners that they do not state.
pub(crate) struct OpenedInputs {
    pub(crate) sources: Sources,
    /// What was found in each cloud without a scanner; empty where nothing was looked for.
    pub(crate) clouds: Vec<CloudSetups>,
}

/// Opens the inputs of a job after those of an earlier result, with the positions that the job
/// gives; where it gives none, with those that are found in the points of clouds of this order.
/// Where `looks` is given, inputs that it knows are not sampled again as the job states them.
///
/// # Errors
/// As [`ingest::open`].
pub(crate) fn open(
    job: &Job,
    before: Before,
    looks: Option<&dyn KeepLooks>,
    order: CloudOrder,
    engine: &Engine,
) -> Result<OpenedInputs> {
    let settings = &job.means.settings.ingest;
    let read = |path| KnownScanners::read(path, settings);
    let given = job.scanners.as_deref().map(read).transpose()?;
    let (inputs, pool) = (&job.inputs, engine.pool()?);
    let open = |before, scanners: Option<&KnownScanners>| {
        pool.install(|| ingest::open_after(before, inputs, scanners, settings, &AllThreads))
    };
    let known = given.as_ref();
    let sources = match looks {
        None => open(before.clone(), known)?,
        Some(looks) => pool.install(|| {
            ingest::open_known(before.clone(), inputs, known, settings, looks, &AllThreads)
        })?,
    };
    let is_wanted = given.is_none() && job.find_scanners;
    let clouds = if is_wanted { find(&sources, order, engine)? } else { Vec::new() };
    let entries: Vec<_> = clouds.iter().flat_map(CloudSetups::entries).collect();
    if entries.is_empty() {
        let sources = with_causes(sources, &clouds);
        return Ok(OpenedInputs { sources, clouds });
    }
    drop(sources);
    let sources = open(before, Some(&KnownScanners { entries }))?;
    Ok(OpenedInputs { sources: with_causes(sources, &clouds), clouds })
}

/// The sources with the cause in the notes of each scan whose scanner stays unknown.
fn with_causes(mut sources: Sources, clouds: &[CloudSetups]) -> Sources {
    for scan in &mut sources.scans {
        let mut own = clouds.iter().filter(|cloud| cloud.mask == scan.mask);
        let cause = own.find_map(|cloud| cloud.unknown.as_ref());
        if let Some(cause) = cause.filter(|_| scan.scanner == ScannerPosition::Unknown) {
            scan.notes.push(format!("the scanner's position was not found: {cause}"));
        }
    }
    sources
}
