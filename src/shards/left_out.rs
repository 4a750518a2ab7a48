//! Records of inputs and regions that a job leaves out because they failed, for jobs that keep
//! going. Each is a small file in the store, so that all processes of the job know of it.

use super::list::Shard;
use super::listing::{Listing, ShardTask};
use super::work::{DoneShard, HowDone};
use crate::detect::region_failures::RegionFailures;
use crate::job::Job;
use crate::plan::Run;
use contract::{Error, Kind, Result};
use export::atomic;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// What is left out: an input, or a region as it is named in the store.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct LeftOutPart {
    /// Id of its shard, where that is known.
    shard: Option<Shard>,
    /// Path of the input and its length and time of modification, which tell whether it was
    /// mended since.
    input: Option<(String, u64, u128)>,
    /// The region, and the key of the fits of its plant.
    region: Option<(String, String)>,
    /// Message for the result.
    says: String,
}

/// All that a job leaves out.
pub(super) struct LeftOut {
    parts: Vec<LeftOutPart>,
    regions: BTreeMap<String, String>,
}

impl LeftOut {
    /// Reads the records of a job; none where the job does not keep going.
    pub(super) fn read(job: &Job) -> Result<Self> {
        let mut out = Self { parts: Vec::new(), regions: BTreeMap::new() };
        if !job.keep_going {
            return Ok(out);
        }
        let folder = job.out.join("store").join("left_out");
        for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            let bytes = std::fs::read(entry.path()).unwrap_or_default();
            let part = serde_json::from_slice::<LeftOutPart>(&bytes).ok();
            out.parts.extend(part.filter(LeftOutPart::is_current));
        }
        // The order of the inputs, then of the regions.
        let place = |part: &LeftOutPart| {
            let is_of = |path: &std::path::PathBuf| part.input_path() == Some(&*text(path));
            (job.inputs.iter().position(is_of).unwrap_or(usize::MAX), part.says.clone())
        };
        out.parts.sort_by_key(place);
        let regions = out.parts.iter().filter_map(|part| {
            part.region.as_ref().map(|(name, _)| (name.clone(), part.says.clone()))
        });
        out.regions = regions.collect();
        Ok(out)
    }

    /// The job without the inputs that are left out.
    pub(super) fn without(&self, job: &Job) -> Job {
        let mut job = job.clone();
        let is_out =
            |path: &Path| self.parts.iter().find(|part| part.input_path() == Some(&*text(path)));
        let left: Vec<String> =
            job.inputs.iter().filter_map(|p| is_out(p)).map(|part| part.says.clone()).collect();
        if left.len() < job.inputs.len() {
            job.inputs.retain(|path| is_out(path).is_none());
            job.left_out.extend(left);
        }
        job
    }

    /// Messages about regions, by region.
    pub(super) fn regions(&self) -> &BTreeMap<String, String> {
        &self.regions
    }

    /// Messages about all that is left out.
    pub(super) fn messages(&self) -> Vec<String> {
        self.parts.iter().map(|part| part.says.clone()).collect()
    }

    /// The shard with this id, if it was left out.
    pub(super) fn shard(&self, id: &str) -> Option<DoneShard> {
        let shards = self.parts.iter().filter_map(|part| part.shard.as_ref());
        let shard = shards.into_iter().find(|shard| shard.id == id)?;
        Some(DoneShard::of(shard.clone(), HowDone::LeftOut))
    }

    /// Records that an input has failed.
    pub(super) fn add_input(
        &self,
        job: &Job,
        run: &Run<'_>,
        at: usize,
        error: &Error,
    ) -> Result<()> {
        let path = &run.job.inputs[at];
        let says = format!("left out: {error}");
        let id = super::listing::tiles_id(run, path);
        let part = LeftOutPart {
            shard: Some(Shard::of_input(id.clone(), path)),
            input: Some(stamped(path)),
            region: None,
            says,
        };
        part.write(&job.out, &id)
    }

    /// Records that a shard cannot be made, for the reason that a person or an engine states.
    pub(super) fn add(&self, run: &Run<'_>, listing: &Listing, at: usize, why: &str) -> Result<()> {
        let (shard, task) = &listing.shards[at];
        let (input, region, says) = match task {
            ShardTask::Tiles(at) if run.job.inputs.len() > 1 => {
                let path = &run.job.inputs[*at];
                let says = format!("left out: {}: {why}", path.display());
                (Some(stamped(path)), None, says)
            }
            ShardTask::Region(at) => {
                let region = &listing.regions()[*at];
                let fits = listing.fits_name(run);
                let says = RegionFailures::message(region, &why);
                (None, Some((format!("{region:?}"), fits)), says)
            }
            _ => {
                let what = format!("the result cannot do without shard {}", shard.id);
                let hint = "only the tiles of one of several inputs and the search of a region can be left out";
                return Err(Error::new(Kind::Usage, what).hint(hint));
            }
        };
        let part = LeftOutPart { shard: Some(shard.clone()), input, region, says };
        part.write(&run.job.out, &shard.id)
    }
}

impl LeftOutPart {
    fn input_path(&self) -> Option<&str> {
        self.input.as_ref().map(|(path, ..)| path.as_str())
    }

    /// Whether the input that failed is still the same file.
    fn is_current(&self) -> bool {
        self.input.as_ref().is_none_or(|known| *known == stamped(Path::new(&known.0)))
    }

    fn write(&self, out: &Path, id: &str) -> Result<()> {
        let bytes = serde_json::to_vec_pretty(self).map_err(|e| {
            Error::new(Kind::Bug, "a record of what is left out cannot be encoded").because(e)
        })?;
        let folder = out.join("store").join("left_out");
        atomic::write_shared(&folder.join(format!("{id}.json")), &bytes)
    }
}

fn text(path: &Path) -> String {
    path.display().to_string()
}

/// Path, length and time of modification of a file, zero where it cannot be seen.
fn stamped(path: &Path) -> (String, u64, u128) {
    let meta = std::fs::metadata(path).ok();
    let changed = meta.as_ref().and_then(|m| m.modified().ok());
    let changed = changed.and_then(|at| at.duration_since(std::time::UNIX_EPOCH).ok());
    (text(path), meta.map_or(0, |m| m.len()), changed.map_or(0, |since| since.as_nanos()))
}
