//! Opens the inputs of a job, and finds the scanners of those that state none from their points.

mod clouds;
mod owned;
mod stretches;
mod unordered;
mod words;

pub use clouds::{CloudOrder, CloudSetups, SetupOfCloud, find};
pub use owned::Ownership;

use crate::cache::kept_looks::KeptLooks;
use crate::engine::{AllThreads, Engine};
use crate::job::Job;
use contract::{MaskId, Result, ScannerPosition};
use ingest::{Before, KnownScanners, Sources};
use serde::{Deserialize, Serialize};

/// Opened inputs, and what was found of scanners that they do not state.
pub(crate) struct OpenedInputs {
    pub(crate) sources: Sources,
    /// What was found in each cloud without a scanner; empty where nothing was looked for.
    pub(crate) clouds: Vec<CloudSetups>,
}

/// Opens the inputs of a job after those of an earlier result, with the positions that the job
/// gives; where it gives none, with those that are found in the points of clouds of this order.
/// Where `looks` is given, what it knows of the inputs is not looked for again.
///
/// # Errors
/// As [`ingest::open`].
pub(crate) fn open(
    job: &Job,
    before: Before,
    looks: Option<&KeptLooks<'_>>,
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
    let mut clouds = Vec::new();
    let kept = looks.filter(|_| is_wanted).and_then(KeptLooks::scanners);
    let found: ScannersFound = match kept {
        Some(found) => found,
        None if is_wanted => {
            clouds = find(&sources, order, job.means.sample_bytes(), engine)?;
            let found = ScannersFound::of(&clouds);
            looks.into_iter().for_each(|looks| looks.keep_scanners(&found));
            found
        }
        None => ScannersFound::default(),
    };
    if found.entries.is_empty() {
        return Ok(OpenedInputs { sources: found.with_causes(sources), clouds });
    }
    drop(sources);
    // As from a file, so that found and given entries are the same to the last digit.
    let sources = open(before, Some(&KnownScanners::parse(&found.entries)?))?;
    Ok(OpenedInputs { sources: found.with_causes(sources), clouds })
}

/// What was found of the scanners of a job, as processes that do it together keep it.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
struct ScannersFound {
    /// Entries of a scanners file; empty where there is none.
    entries: String,
    /// Why the scanner of a mask's points stays unknown.
    causes: Vec<(MaskId, String)>,
}

impl ScannersFound {
    fn of(clouds: &[CloudSetups]) -> Self {
        let entries = clouds.iter().flat_map(CloudSetups::entries).map(|e| e.to_toml(&[]) + "\n");
        let causes = clouds.iter().filter_map(|cloud| Some((cloud.mask, cloud.unknown.clone()?)));
        Self { entries: entries.collect(), causes: causes.collect() }
    }

    /// The sources with the cause in the notes of each scan whose scanner stays unknown.
    fn with_causes(&self, mut sources: Sources) -> Sources {
        for scan in &mut sources.scans {
            let cause = self.causes.iter().find(|(mask, _)| *mask == scan.mask);
            let is_unknown = scan.scanner == ScannerPosition::Unknown;
            if let Some((_, cause)) = cause.filter(|_| is_unknown) {
                scan.notes.push(format!("the scanner's position was not found: {cause}"));
            }
        }
        sources
    }
}
