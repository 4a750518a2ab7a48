//! Commands and flags of `bench`, as `clap` parses them.

use crate::eval::bench::request::RescanSuite;
use crate::eval::bench::throughput::Scanned;
use clap::{Args, Subcommand};
use std::path::PathBuf;

#[derive(Debug, Subcommand)]
pub(super) enum BenchCommand {
    /// Draw cells from seeds, scan them, find the robots, compare with the truth
    Accuracy(AccuracyFlags),
    /// Draw cells and lines as files, do the main job on them, compare robots and labels with the
    /// truth
    Plant(PlantFlags),
    /// Draw halls with libraries of their own, ask what they will take, do the main job: predicted
    /// beside measured
    Plan(PlanBenchFlags),
    /// Draw plants of which one cell is scanned again: what a rescan finds, what it invents, its
    /// time beside a whole run
    Rescan(RescanBenchFlags),
    /// Draw cells and paths of their robots, do the main job and check the paths: false alarms and
    /// misses
    Check(CheckBenchFlags),
    /// Draw plants of given sizes as files, do the main job on them: points a second, memory, share
    /// of the machine's limits
    Throughput(ThroughputFlags),
}

/// Which cases are drawn from seeds.
#[derive(Debug, Args)]
pub(super) struct SeedFlags {
    /// Number of the first of them, to look at single ones again
    #[arg(long, value_name = "K", default_value_t = 0)]
    pub(super) first: usize,
    /// Seed of all that is drawn
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(super) seed: u64,
}

/// With which robots, and what is kept.
#[derive(Debug, Clone, Args)]
pub(super) struct KeptFlags {
    /// Robot library (else the demo's robots)
    #[arg(long, value_name = "DIR")]
    pub(super) robots: Option<PathBuf>,
    /// Where rows and tables go; scenes, scans and results are kept there, too, with --keep
    #[arg(long, value_name = "DIR")]
    pub(super) out: Option<PathBuf>,
    /// Keep scenes, scans and results
    #[arg(long, requires = "out")]
    pub(super) keep: bool,
}

/// Cases of suites.
#[derive(Debug, Args)]
pub(super) struct SuiteFlags {
    /// Suites, by name (else all)
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    pub(super) suite: Vec<String>,
    /// Cases of each suite, and of each model where there is one a case (else the suite's own
    /// number)
    #[arg(long, value_name = "N")]
    pub(super) cases: Option<usize>,
    #[command(flatten)]
    pub(super) seeds: SeedFlags,
}

#[derive(Debug, Args)]
pub(super) struct AccuracyFlags {
    #[command(flatten)]
    pub(super) drawn: SuiteFlags,
    /// Robot library (else the demo's robots)
    #[arg(long, value_name = "DIR")]
    pub(super) robots: Option<PathBuf>,
    /// Only robots whose name holds one of these
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    pub(super) model: Vec<String>,
    /// Which models each cell is searched for
    #[arg(long, value_enum, value_name = "WHICH", default_value = "library")]
    pub(super) against: Against,
    /// Where rows and tables go
    #[arg(long, value_name = "DIR")]
    pub(super) out: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(super) struct PlantFlags {
    #[command(flatten)]
    pub(super) drawn: SuiteFlags,
    #[command(flatten)]
    pub(super) kept: KeptFlags,
}

#[derive(Debug, Args)]
pub(super) struct PlanBenchFlags {
    /// Halls
    #[arg(long, value_name = "N", default_value_t = 10)]
    pub(super) halls: usize,
    #[command(flatten)]
    pub(super) seeds: SeedFlags,
    /// Robot library that the halls' libraries are chosen from
    #[arg(long, value_name = "DIR")]
    pub(super) robots: PathBuf,
    /// Where rows and table go; scans are kept there, too, with --keep
    #[arg(long, value_name = "DIR")]
    pub(super) out: PathBuf,
    /// Keep scans: the next bench of the same halls finds them
    #[arg(long)]
    pub(super) keep: bool,
}

#[derive(Debug, Args)]
pub(super) struct RescanBenchFlags {
    /// Plants
    #[arg(long, value_name = "N", default_value_t = 5)]
    pub(super) cases: usize,
    #[command(flatten)]
    pub(super) seeds: SeedFlags,
    /// Robots of each plant
    #[arg(long, value_name = "N", default_value_t = 4)]
    pub(super) n_robots: usize,
    /// Scanners of its first session
    #[arg(long, value_name = "N", default_value_t = 5)]
    pub(super) scans: usize,
    /// Angle between beams, degrees
    #[arg(long, value_name = "DEG", default_value_t = 0.13)]
    pub(super) step: f64,
    #[command(flatten)]
    pub(super) kept: KeptFlags,
    /// Plants in one frame, new scans in frames that are drawn, or lines of equal cells in such
    /// frames
    #[arg(long, value_enum, value_name = "WHICH", default_value = "same")]
    pub(super) suite: RescanSuite,
    /// Do the main job on the new scans alone, too, to compare with
    #[arg(long)]
    pub(super) alone: bool,
}

#[derive(Debug, Args)]
pub(super) struct CheckBenchFlags {
    /// Cells
    #[arg(long, value_name = "N", default_value_t = 20)]
    pub(super) cases: usize,
    #[command(flatten)]
    pub(super) seeds: SeedFlags,
    /// Robots of each cell
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(super) n_robots: usize,
    /// Scanners of each cell
    #[arg(long, value_name = "N", default_value_t = 4)]
    pub(super) scans: usize,
    /// Angle between beams, degrees
    #[arg(long, value_name = "DEG", default_value_t = 0.17)]
    pub(super) step: f64,
    /// What comes nearer to a robot is in its way, metres
    #[arg(long, value_name = "METRES", default_value_t = 0.02)]
    pub(super) margin: f64,
    #[command(flatten)]
    pub(super) kept: KeptFlags,
}

#[derive(Debug, Args)]
pub(super) struct ThroughputFlags {
    /// Beams of each plant, for example 1M,10M,100M
    #[arg(long, value_name = "N", value_delimiter = ',', default_value = "10M")]
    pub(super) points: Vec<String>,
    /// Scanners (else one for 50 million beams, two at least)
    #[arg(long, value_name = "N")]
    pub(super) scans: Option<usize>,
    /// Robots that stand in it
    #[arg(long, value_name = "N", default_value_t = 4)]
    pub(super) n_robots: usize,
    /// Times that each is run; medians count
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(super) runs: usize,
    /// Format of the scans
    #[arg(long, value_enum, value_name = "FORMAT", default_value = "las")]
    pub(super) format: Scanned,
    /// Seed of the plants
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(super) seed: u64,
    /// Robot library (else the demo's robots)
    #[arg(long, value_name = "DIR")]
    pub(super) robots: Option<PathBuf>,
    /// Where scans, results and figures go
    #[arg(long, value_name = "DIR")]
    pub(super) out: PathBuf,
    /// Keep the scans: the next bench of the same plant finds them
    #[arg(long)]
    pub(super) keep: bool,
    /// Write what is true of each point beside the scans
    #[arg(long)]
    pub(super) truth: bool,
}

/// Which models a cell is searched for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Against {
    /// The true one only
    Same,
    /// All of the library
    Library,
}
