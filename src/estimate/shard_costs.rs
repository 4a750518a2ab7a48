//! What single shards of a job will take, from the same rates as the estimate of the whole job.

use super::rates::{AREA, INGEST, PAGE, REGION, REST, SURFACE};
use super::sizes::{
    LABEL_BYTES, MODEL_BYTES, POINT_BYTES, PROGRAM_BYTES, SCAN_BYTES, SCANS, all_points, points,
};
use crate::job::Means;
use crate::label::joined_files::FileGroup;
use contract::{Cluster, Input, Region};
use ingest::Sources;

/// Processor seconds of a shard before its own work: the program starts, and opens the models of
/// the library.
const START: f64 = 0.3;
/// Processor seconds of each input that a shard opens; each opens all of them.
const OPEN: f64 = 0.0075;
/// Points per second that one thread copies from the pieces of inputs to files of the result.
const JOIN: f64 = 20e6;
/// Number of points that the page of a result is written from, at most.
const PAGE_POINTS: u64 = report_page::MOST_POINTS as u64;
/// Points per second of one thread that labels an input and writes its piece.
const LABELS: f64 = 4e6;
/// Processor seconds for the space around one robot.
const SPACE: f64 = 0.2;
/// Processor seconds for the choice among the fits of one region.
const CHOICE: f64 = 0.1;

/// Estimated processor time (seconds) and memory (bytes) of one shard.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ShardCost {
    pub(crate) seconds: f64,
    pub(crate) memory_bytes: u64,
}

/// Costs of the shards of one job.
pub(crate) struct ShardCosts<'a> {
    sources: &'a Sources,
    means: &'a Means,
    n_models: usize,
}

impl<'a> ShardCosts<'a> {
    pub(crate) fn new(sources: &'a Sources, means: &'a Means, n_models: usize) -> Self {
        Self { sources, means, n_models }
    }

    fn cost(&self, seconds: f64, n_points: u64) -> ShardCost {
        let n_scans = SCANS.min(self.sources.scans.len() as u64);
        let base = PROGRAM_BYTES + self.n_models as u64 * MODEL_BYTES;
        let least = base + SCAN_BYTES * n_scans;
        let memory = base.saturating_add(n_points.saturating_mul(POINT_BYTES));
        let memory_bytes = memory.min(self.means.memory_bytes.max(least));
        ShardCost { seconds: self.start() + seconds, memory_bytes }
    }

    /// Processor seconds of a shard before its own work.
    pub(super) fn start(&self) -> f64 {
        START + OPEN * self.sources.inputs.len() as f64
    }

    fn all_points(&self) -> u64 {
        all_points(self.sources)
    }

    /// Reading an input into tiles.
    pub(crate) fn tiles(&self, input: &Input) -> ShardCost {
        let n = points(self.sources, input);
        let rate = INGEST.iter().find(|(format, _)| *format == input.format).map_or(6e6, |r| r.1);
        self.cost(n as f64 / rate + n as f64 / REST[0], n)
    }

    /// Planes and occupied space of an input.
    pub(crate) fn ground_part(&self, input: &Input) -> ShardCost {
        let n = points(self.sources, input);
        self.cost(n as f64 / REST[1], n)
    }

    /// Joining the ground of all inputs, and its floor. What is joined is a small part of the
    /// points: a hundredth of them is voxels and patches.
    pub(crate) fn ground(&self) -> ShardCost {
        let n = self.all_points();
        self.cost(n as f64 / (100.0 * REST[1]), n / 100)
    }

    /// The search of a region with these clusters of the plant.
    pub(crate) fn region(&self, region: &Region, clusters: &[Cluster]) -> ShardCost {
        let bounds = region.world_bounds();
        let inside = clusters.iter().filter(|c| bounds.contains(c.bounds.center().into()));
        let n_voxels: usize = inside.clone().map(|c| c.voxels.len()).sum();
        let n_points: u64 = inside.map(|c| c.n_points).sum();
        let size = bounds.size();
        let area = size[0] * size[1] * self.n_models as f64;
        let seconds = REGION + AREA * area + SURFACE * n_voxels as f64 / 1000.0;
        self.cost(seconds, n_points)
    }

    /// The choice among the fits of so many regions, and labels near the robots.
    pub(crate) fn robots(&self, n_regions: usize) -> ShardCost {
        let n = self.all_points();
        self.cost(CHOICE * n_regions as f64 + n as f64 / REST[2], n / 10)
    }

    /// Known space around a robot.
    pub(crate) fn space(&self) -> ShardCost {
        self.cost(SPACE, 0)
    }

    /// Labels, masks and records of an input.
    pub(crate) fn labels(&self, input: &Input) -> ShardCost {
        let n = points(self.sources, input);
        self.cost(n as f64 / LABELS, n / LABEL_BYTES)
    }

    /// Joining a group of files from the labels of all inputs.
    pub(crate) fn files(&self, group: FileGroup) -> ShardCost {
        let n = self.all_points() as f64;
        let page = if self.means.settings.export.page { group.page_share() } else { 0.0 };
        self.cost(n * group.share() / (2.0 * JOIN) + n * page / PAGE, PAGE_POINTS)
    }

    /// Giving the result its files, and writing its page of at most so many points.
    pub(crate) fn gather(&self) -> ShardCost {
        let page = if self.means.settings.export.page { PAGE_POINTS as f64 / PAGE } else { 0.0 };
        self.cost(page, self.all_points())
    }
}
