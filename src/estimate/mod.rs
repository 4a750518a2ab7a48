//! Estimates memory, disk and time of a job, and what an earlier run has left for it. A sample of
//! the points tells how much there is to search.

pub(crate) mod course;
mod expected_regions;
mod nodes;
mod rates;
mod search_time;
pub(crate) mod shard_costs;
pub(crate) mod sizes;

use crate::cache::{Digests, OutputDir};
use crate::detect::library;
use crate::engine::Engine;
use crate::job::{Job, Settings, memory_words, units};
use crate::positions::{self, CloudOrder};
use crate::store::spatial_tiles;
use contract::words::count;
use contract::{Error, Input, Kind, Result};
use ingest::{Before, Sources};
use rates::{COPC, INGEST, LOAD, PAGE, REST, SPREAD};
use serde::Serialize;
use shard_costs::ShardCosts;
use sizes::{
    LABEL_BYTES, MODEL_BYTES, POINT_BYTES, PROGRAM_BYTES, SCAN_BYTES, SCANS, STORE_BYTES, points,
};
use std::path::Path;

pub use expected_regions::{ExpectedRegion, ExpectedRegions};
use nodes::EstimatedJob;
pub use nodes::{NodePhase, NodePlan};

/// Ratio of compressed to plain size of clouds.
const COMPRESSED: f64 = 0.35;
/// Size of a point in a cloud, without and with colour, bytes.
const CLOUD_BYTES: [u64; 2] = [34, 40];
/// Size of a point in the temporary files of a COPC conversion, bytes.
const COPC_BYTES: u64 = 40;
/// Largest size of the page of a result, and its share for each point of a small one, bytes.
const PAGE_BYTES: u64 = 15 << 20;
const PAGE_POINT_BYTES: u64 = 4;
/// Size of pictures, cached models, voxels and lists for each model of the library, bytes: 7 to 11
/// MB were measured in halls with up to two robots, and large plants have more robots.
const EXTRA_BYTES: u64 = 16 << 20;
/// Overhead of a spatial tile: header and the unused part of its last disk block, bytes.
const TILE_BYTES: u64 = 4096;

/// Estimated memory, disk and time of a job.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Estimate {
    /// Number of points of all inputs, as they state or else from their length.
    pub n_points: u64,
    /// Messages that name the units of the inputs.
    pub units: Vec<String>,
    /// Number of models that are searched.
    pub n_models: usize,
    /// Greatest resident memory, bytes: at most `--memory`, unless a single region of all scans
    /// takes more.
    pub memory_bytes: u64,
    /// Disk space for the store, bytes; 0 for tiles that exist already.
    pub store_bytes: u64,
    /// Disk space for the result, bytes. An old result stays until the new one is complete.
    pub output_bytes: u64,
    /// Estimated number of spatial tiles, from samples of the scans, and the limit: a run with
    /// more ends before it writes any.
    pub tiles: [u64; 2],
    /// Free space on the disk of the output folder, bytes; 0 where the system does not state it.
    pub free_bytes: u64,
    /// Least and greatest time, seconds, if no other program uses the processors.
    pub seconds: [f64; 2],
    /// Regions that would probably be searched, if points were sampled.
    pub expected: Option<ExpectedRegions>,
    /// Number of inputs whose tiles exist already, and of all inputs.
    pub kept_inputs: [usize; 2],
    /// Whether nothing has changed, so that the run has nothing to do.
    pub unchanged: bool,
    /// The same job on several machines, if that was asked.
    pub nodes: Option<NodePlan>,
}

/// Estimates a job on one machine.
///
/// # Errors
/// Inputs or a library that cannot be opened.
pub fn estimate(job: &Job, engine: &Engine) -> Result<Estimate> {
    estimate_on(job, None, engine)
}

/// Estimates a job, also on a number of machines with a shared disk, each with as many cores as the
/// job has threads.
///
/// # Errors
/// Inputs or a library that cannot be opened.
pub fn estimate_on(job: &Job, nodes: Option<usize>, engine: &Engine) -> Result<Estimate> {
    job.check_places()?;
    let settings = &job.means.settings;
    // Without an earlier run there are no pieces to use again, and no input need be digested.
    let earlier = job.out.join("store").is_dir().then(|| Earlier::look(job, engine)).transpose()?;
    let unchanged = earlier.as_ref().is_some_and(|e| e.unchanged);
    let has_tiles = |i: &Input, sources: &Sources| {
        earlier.as_ref().is_some_and(|e| e.has_tiles(i, sources, settings))
    };
    let (mut estimate, sources) = opened(job, has_tiles, engine)?;
    if unchanged {
        (estimate.store_bytes, estimate.output_bytes, estimate.seconds) = (0, 0, [0.5; 2]);
    } else {
        estimate.look(job, &sources, engine)?;
        let costs = ShardCosts::new(&sources, &job.means, estimate.n_models);
        let has_tiles = |input: &Input| has_tiles(input, &sources);
        estimate.nodes = nodes.map(|nodes| {
            let places = [nodes.max(1), job.means.n_threads];
            let expected = estimate.expected.as_ref();
            let estimated = EstimatedJob {
                n_points: estimate.n_points,
                n_models: estimate.n_models,
                store_bytes: estimate.store_bytes,
                output_bytes: estimate.output_bytes,
                regions: expected.map_or(&[], |expected| &expected.regions),
            };
            NodePlan::new(&estimated, &sources, &costs, places, has_tiles)
        });
    }
    Ok(Estimate { unchanged, ..estimate })
}

/// Opens all inputs of a job and estimates everything but the search.
fn opened(
    job: &Job,
    has_tiles: impl Fn(&Input, &Sources) -> bool,
    engine: &Engine,
) -> Result<(Estimate, Sources)> {
    let n_models = library::count(&job.robots)?;
    let sources =
        positions::open(job, Before::default(), None, CloudOrder::Measured, engine)?.sources;
    units::check_plan(&job.robots, &sources)?;
    Ok((Estimate::of(job, &sources, n_models, |input| has_tiles(input, &sources)), sources))
}

/// Adds to an error about a full disk how much space is missing.
pub(crate) fn with_missing(error: Error, job: &Job, engine: &Engine) -> Error {
    if !error.is_full_disk() {
        return error;
    }
    // Where the disk is too full to examine cached pieces, none of them is counted.
    let estimate =
        estimate(job, engine).or_else(|_| opened(job, |_, _| false, engine).map(|opened| opened.0));
    match estimate.map(|e| e.need().saturating_sub(e.free_bytes)) {
        Ok(missing) if missing > 0 => error.hint(format!(
            "about {} are missing: make room, or choose another --out; what was done is kept, and the next run goes on from it",
            memory_words(missing)
        )),
        _ => error,
    }
}

/// Pieces that an earlier run has left.
struct Earlier {
    output: OutputDir,
    digests: Digests,
    unchanged: bool,
}

impl Earlier {
    fn look(job: &Job, engine: &Engine) -> Result<Self> {
        let output = job.output()?;
        let digests = Digests::of(job, &output, engine)?;
        let result = digests.unchanged(job, &output)?;
        Ok(Self { output, digests, unchanged: result.is_some() })
    }

    fn has_tiles(&self, input: &Input, sources: &Sources, settings: &Settings) -> bool {
        let key = self.digests.tiles_key(input, &sources.scans, settings);
        key.is_some_and(|key| self.output.has_tiles(&key))
    }
}

impl Estimate {
    /// The estimate for opened inputs; `has_tiles` tells which inputs have tiles already.
    pub(crate) fn of(
        job: &Job,
        sources: &Sources,
        n_models: usize,
        has_tiles: impl Fn(&Input) -> bool,
    ) -> Self {
        let threads = job.means.n_threads as f64;
        let (mut n, mut n_new, mut n_kept, mut seconds) = (0_u64, 0_u64, 0, 0.0);
        // A file may state any number of points, so sums must not overflow.
        for input in &sources.inputs {
            let own = points(sources, input);
            n = n.saturating_add(own);
            if has_tiles(input) {
                n_kept += 1;
                continue;
            }
            n_new = n_new.saturating_add(own);
            let rate =
                INGEST.iter().find(|(format, _)| *format == input.format).map_or(6e6, |r| r.1);
            seconds += own as f64 / rate + own as f64 / REST[0];
        }
        seconds += REST[1..].iter().map(|rate| n as f64 / rate).sum::<f64>();
        let models = n_models as u64;
        let tiles = spatial_tiles::expected(&sources.spread(), n, &job.means.settings.export);
        let cloud = CLOUD_BYTES[usize::from(sources.has_color())];
        let export = &job.means.settings.export;
        let body = if export.bodies { 4 } else { 0 };
        let n_clouds = u64::from(export.tiles) + u64::from(export.fixed_cloud);
        let share = if export.compress { COMPRESSED } else { 1.0 };
        let clouds = ((n_clouds * (cloud + body)) as f64 * share).ceil() as u64;
        let copc = if export.copc { COPC_BYTES + (cloud as f64 * COMPRESSED) as u64 } else { 0 };
        let labelled = n.saturating_mul(LABEL_BYTES + clouds + copc);
        let page = n.saturating_mul(PAGE_POINT_BYTES).saturating_add(1 << 20).min(PAGE_BYTES);
        seconds += if export.page { n as f64 / PAGE } else { 0.0 };
        seconds += if export.copc { n as f64 / COPC } else { 0.0 };
        let base = PROGRAM_BYTES + models * MODEL_BYTES;
        let memory = n.saturating_mul(POINT_BYTES).saturating_add(base);
        let least = base + SCAN_BYTES * SCANS.min(sources.scans.len() as u64);
        Self {
            n_points: n,
            units: units::in_words(sources),
            n_models,
            memory_bytes: memory.min(job.means.memory_bytes.max(least)),
            store_bytes: n_new.saturating_mul(STORE_BYTES),
            output_bytes: labelled
                .saturating_add(models * EXTRA_BYTES)
                .saturating_add(if export.page { page } else { 0 })
                .saturating_add(tiles[0].saturating_mul(TILE_BYTES)),
            tiles,
            free_bytes: free(&job.out),
            seconds: [(seconds + library::bytes(&job.robots) as f64 / 1e6 * LOAD) / threads; 2],
            expected: None,
            kept_inputs: [n_kept, sources.inputs.len()],
            unchanged: false,
            nodes: None,
        }
    }

    /// Samples the points and adds the time of the search.
    fn look(&mut self, job: &Job, sources: &Sources, engine: &Engine) -> Result<()> {
        let expected = expected_regions::sample(sources, &job.means.settings, engine)?;
        let search = search_time::seconds(&expected, self.n_models) / job.means.n_threads as f64;
        self.seconds = [self.seconds[0] + search / SPREAD, self.seconds[1] + search * SPREAD];
        self.expected = Some(expected);
        Ok(())
    }

    /// Disk space that the job takes, bytes.
    fn need(&self) -> u64 {
        self.store_bytes.saturating_add(self.output_bytes)
    }

    /// The same job where so many bytes of the result lie on the disk already.
    #[must_use]
    pub(crate) fn with_written(self, n_bytes: u64) -> Self {
        Self { output_bytes: self.output_bytes.saturating_sub(n_bytes), ..self }
    }

    /// Refuses a job that exceeds the free disk space or the limit of spatial tiles.
    ///
    /// # Errors
    /// More disk space or tiles are needed than are free or allowed.
    pub fn checked(&self, out: &Path) -> Result<()> {
        spatial_tiles::within(self.tiles)?;
        let need = self.need();
        if self.free_bytes == 0 || need <= self.free_bytes {
            return Ok(());
        }
        let (need, free) = (memory_words(need), memory_words(self.free_bytes));
        let what = format!("the disk is too small: \"{need}\" are needed, \"{free}\" are free");
        Err(Error::new(Kind::OverBudget, what)
            .hint("free some, or give an --out on another disk")
            .at(out.display()))
    }
}

impl std::fmt::Display for Estimate {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [kept, all] = self.kept_inputs;
        if self.unchanged {
            return write!(f, "nothing has changed: the result that is there is used again");
        }
        let inputs = count(all as u64, "input");
        writeln!(f, "points    {:.1} M in {inputs}", self.n_points as f64 / 1e6)?;
        for line in &self.units {
            writeln!(f, "unit      {line}")?;
        }
        writeln!(f, "models    {}", self.n_models)?;
        writeln!(f, "memory    {} at most", memory_words(self.memory_bytes))?;
        writeln!(
            f,
            "disk      {} to keep tiles, {} for results; {} free",
            memory_words(self.store_bytes),
            memory_words(self.output_bytes),
            memory_words(self.free_bytes)
        )?;
        writeln!(f, "tiles     about {} spatial tiles, at most {}", self.tiles[0], self.tiles[1])?;
        writeln!(f, "time      {:.0} to {:.0} s", self.seconds[0], self.seconds[1])?;
        if let Some(expected) = &self.expected {
            let regions = count(expected.regions.len() as u64, "region");
            let area: f64 = expected.regions.iter().map(|r| r.size[0] * r.size[1]).sum();
            writeln!(f, "search    {regions} of {area:.0} m² in all, as far as a glance tells")?;
        }
        write!(f, "kept      tiles of {kept} of {inputs}")?;
        self.nodes.iter().try_for_each(|nodes| write!(f, "\n{nodes}"))
    }
}

/// Free space on the disk of a folder that exists or will be created, bytes.
fn free(folder: &Path) -> u64 {
    let there = folder.ancestors().find(|path| path.is_dir()).unwrap_or(Path::new("."));
    fs4::available_space(there).unwrap_or(0)
}
