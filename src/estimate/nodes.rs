//! What a job takes on several machines with a shared disk: its shards are laid on the cores of
//! all nodes, phase by phase, the longest first, as a driver does. `scripts/plant_model.py` has the
//! same model for plants that are not scanned yet, and is compared with measured runs.

use super::expected_regions::ExpectedRegion;
use super::rates::SPREAD;
use super::search_time;
use super::shard_costs::ShardCosts;
use super::sizes::STORE_BYTES;
use crate::label::joined_files::FileGroup;
use contract::Input;
use ingest::Sources;
use serde::Serialize;

/// Size of a point's labels and records in the piece of an input, bytes.
const PIECE_BYTES: u64 = 73;

/// What is estimated of a job on one machine.
pub(super) struct EstimatedJob<'a> {
    pub(super) n_points: u64,
    pub(super) n_models: usize,
    /// Space for tiles and for the result, bytes.
    pub(super) store_bytes: u64,
    pub(super) output_bytes: u64,
    /// Regions that are expected.
    pub(super) regions: &'a [ExpectedRegion],
}

/// Time, storage and transfers of a job on several nodes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NodePlan {
    /// Number of nodes.
    pub nodes: usize,
    /// Cores of each node, as `--threads` states.
    pub cores: usize,
    /// Least and greatest time, seconds, if the shared disk is fast enough.
    pub seconds: [f64; 2],
    /// Least and greatest time times the number of nodes, hours.
    pub machine_hours: [f64; 2],
    /// Share of the cores' time in which they work, 0 to 1, at the greatest time.
    pub busy: f64,
    /// Space on the shared disk for inputs' tiles, pieces and the result, bytes.
    pub shared_bytes: u64,
    /// Bytes that nodes read from the shared disk and write to it.
    pub moved_bytes: u64,
    /// The phases one after the other.
    pub phases: Vec<NodePhase>,
}

/// One phase, whose shards do not wait for one another.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NodePhase {
    /// What its shards make.
    pub name: &'static str,
    /// Number of its shards.
    pub shards: usize,
    /// Least and greatest time, seconds.
    pub seconds: [f64; 2],
    /// Greatest processor time of all of its shards, seconds.
    pub processor_seconds: f64,
}

impl NodePlan {
    /// The plan of an estimated job. Robots are not known before the search: one a region is
    /// counted.
    pub(super) fn new(
        estimate: &EstimatedJob<'_>,
        sources: &Sources,
        costs: &ShardCosts<'_>,
        [nodes, cores]: [usize; 2],
        has_tiles: impl Fn(&Input) -> bool,
    ) -> Self {
        let places = [nodes, cores];
        let of_inputs = |cost: &dyn Fn(&Input) -> f64| -> Vec<f64> {
            sources.inputs.iter().filter(|input| !has_tiles(input)).map(cost).collect()
        };
        let regions = estimate.regions;
        let search = |region| costs.start() + search_time::of_region(region, estimate.n_models);
        let search: Vec<f64> = regions.iter().map(search).collect();
        let labels = sources.inputs.iter().map(|input| costs.labels(input).seconds);
        let labels: Vec<f64> =
            labels.chain(regions.iter().map(|_| costs.space().seconds)).collect();
        let tiles = of_inputs(&|input| costs.tiles(input).seconds);
        let planes = of_inputs(&|input| costs.ground_part(input).seconds);
        let files = FileGroup::all(estimate.n_points).into_iter();
        let files = files.map(|group| costs.files(group).seconds).collect();
        let joined = |seconds: f64| vec![seconds];
        let phases = vec![
            NodePhase::of("tiles", tiles, 1.0, places),
            NodePhase::of("planes", planes, 1.0, places),
            NodePhase::of("ground", joined(costs.ground().seconds), 1.0, places),
            NodePhase::of("regions", search, SPREAD, places),
            NodePhase::of("robots", joined(costs.robots(regions.len()).seconds), 1.0, places),
            NodePhase::of("labels", labels, 1.0, places),
            NodePhase::of("files", files, 1.0, places),
            NodePhase::of("gather", joined(costs.gather().seconds), 1.0, places),
        ];
        let sum = |i: usize| phases.iter().map(|phase| phase.seconds[i]).sum::<f64>();
        let seconds = [sum(0), sum(1)];
        let work: f64 = phases.iter().map(|phase| phase.processor_seconds).sum();
        let inputs = sources.inputs.iter().fold(0, |sum: u64, i| sum.saturating_add(i.n_bytes));
        let n = estimate.n_points;
        let of_points = |bytes: u64| n.saturating_mul(bytes);
        let pieces = of_points(PIECE_BYTES);
        // Inputs are read twice; tiles are written, and read for planes and regions; pieces are
        // written and read once.
        let moved = [inputs, inputs, of_points(3 * STORE_BYTES), pieces, pieces];
        let moved = moved.iter().fold(estimate.output_bytes, |sum, v| sum.saturating_add(*v));
        Self {
            nodes,
            cores,
            seconds,
            machine_hours: seconds.map(|s| s * nodes as f64 / 3600.0),
            busy: work / (seconds[1] * (nodes * cores) as f64).max(f64::MIN_POSITIVE),
            shared_bytes: estimate
                .store_bytes
                .saturating_add(estimate.output_bytes)
                .saturating_add(pieces),
            moved_bytes: moved,
            phases,
        }
    }
}

impl NodePhase {
    /// A phase of shards with these processor seconds, which may be `spread` times as much or as
    /// little, on so many nodes and cores.
    fn of(name: &'static str, shards: Vec<f64>, spread: f64, places: [usize; 2]) -> Self {
        let seconds = longest_first(&shards, places[0] * places[1]);
        let processor_seconds = shards.iter().sum::<f64>() * spread;
        let seconds = [seconds / spread, seconds * spread];
        Self { name, shards: shards.len(), seconds, processor_seconds }
    }
}

/// When the last of these shards ends, each of which starts on the core that is free first, the
/// longest before the others; seconds.
fn longest_first(shards: &[f64], n_cores: usize) -> f64 {
    let mut sorted = shards.to_vec();
    sorted.sort_by(|a, b| b.total_cmp(a));
    let mut free = vec![0.0_f64; n_cores.clamp(1, sorted.len().max(1))];
    for seconds in sorted {
        let next = free.iter_mut().min_by(|a, b| a.total_cmp(b));
        next.into_iter().for_each(|core| *core += seconds);
    }
    free.into_iter().fold(0.0, f64::max)
}

impl std::fmt::Display for NodePlan {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let ([low, high], hours) = (self.seconds, self.machine_hours);
        writeln!(
            f,
            "nodes     {} of {} cores: {low:.0} to {high:.0} s, {:.2} to {:.2} machine hours, cores busy {:.0} %",
            self.nodes,
            self.cores,
            hours[0],
            hours[1],
            100.0 * self.busy
        )?;
        let gigabytes = |bytes: u64| bytes as f64 / 1e9;
        writeln!(
            f,
            "shared    {:.1} GB on the shared disk, {:.1} GB to and from it: {:.2} GB/s",
            gigabytes(self.shared_bytes),
            gigabytes(self.moved_bytes),
            gigabytes(self.moved_bytes) / low.max(1.0)
        )?;
        let phases = self.phases.iter().map(|p| format!("{} {:.0}", p.name, p.seconds[1]));
        write!(f, "phases    {} s", phases.collect::<Vec<_>>().join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_fill_the_cores_longest_first() {
        assert_eq!(longest_first(&[], 4), 0.0);
        assert_eq!(longest_first(&[3.0], 4), 3.0);
        // 5 | 4 | 3 + 2: one core waits for nothing.
        assert_eq!(longest_first(&[2.0, 3.0, 4.0, 5.0], 3), 5.0);
        assert_eq!(longest_first(&[1.0; 10], 3), 4.0);
    }

    #[test]
    fn what_is_uncertain_spreads_the_time_of_its_phase_only() {
        let phase = NodePhase::of("regions", vec![2.0, 2.0, 2.0], 2.0, [1, 2]);
        assert_eq!((phase.seconds, phase.processor_seconds), ([2.0, 8.0], 12.0));
    }
}
