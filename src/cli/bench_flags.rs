//! Commands and flags of `bench`, as `clap` parses them.

use crate::eval::bench::request::RescanSuite;
use crate::eval::bench::throughput::Scanned;
use clap::{Args, Subcommand};
use std::path::PathBuf;

#[derive(Debug, Subcommand)]
pub(super) enum BenchCommand {
    /// Find robots in random cells and compare them with the truth
    Accuracy(AccuracyFlags),
    /// Run on random cells and lines from files, and compare robots and labels with the truth
    Plant(PlantFlags),
    /// Estimate and run random halls with their own libraries, and compare prediction and
    /// measurement
    Plan(PlanBenchFlags),
    /// Rescan one cell of random plants: changes found and invented, and the time beside a whole
    /// run
    Rescan(RescanBenchFlags),
    /// Check random paths of robots in random cells: false alarms and misses
    Check(CheckBenchFlags),
    /// Find the scanners of random halls from clouds that do not state them, in several orders
    Scanners(ScannersBenchFlags),
    /// Run on random plants of given sizes: points per second, memory, share of the machine's
    /// limits
    Throughput(ThroughputFlags),
}

/// Selection of random cases.
#[derive(Debug, Args)]
pub(super) struct SeedFlags {
    /// Number of the first case, to repeat single ones
    #[arg(long, value_name = "K", default_value_t = 0)]
    pub(super) first: usize,
    /// Seed of all random values
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(super) seed: u64,
}

/// Robot library, and files that are kept.
#[derive(Debug, Clone, Args)]
pub(super) struct KeptFlags {
    /// Robot library (default: the demo's robots)
    #[arg(long, value_name = "DIR")]
    pub(super) robots: Option<PathBuf>,
    /// Output folder of rows and tables, and with --keep of scenes, scans and results
    #[arg(long, value_name = "DIR")]
    pub(super) out: Option<PathBuf>,
    /// Keep scenes, scans and results
    #[arg(long, requires = "out")]
    pub(super) keep: bool,
}

/// Cases of suites.
#[derive(Debug, Args)]
pub(super) struct SuiteFlags {
    /// Names of suites (default: all)
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    pub(super) suite: Vec<String>,
    /// Number of cases of each suite, and of each model in suites with one case per model
    /// (default: the suite's own number)
    #[arg(long, value_name = "N")]
    pub(super) cases: Option<usize>,
    #[command(flatten)]
    pub(super) seeds: SeedFlags,
}

#[derive(Debug, Args)]
pub(super) struct AccuracyFlags {
    #[command(flatten)]
    pub(super) drawn: SuiteFlags,
    /// Robot library (default: the demo's robots)
    #[arg(long, value_name = "DIR")]
    pub(super) robots: Option<PathBuf>,
    /// Only robots whose name contains one of these
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    pub(super) model: Vec<String>,
    /// Models that each cell is searched for
    #[arg(long, value_enum, value_name = "WHICH", default_value = "library")]
    pub(super) against: Against,
    /// Output folder of rows and tables
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
    /// Number of halls
    #[arg(long, value_name = "N", default_value_t = 10)]
    pub(super) halls: usize,
    #[command(flatten)]
    pub(super) seeds: SeedFlags,
    /// Robot library from which the halls' libraries are chosen
    #[arg(long, value_name = "DIR")]
    pub(super) robots: PathBuf,
    /// Output folder of rows and table, and with --keep of scans
    #[arg(long, value_name = "DIR")]
    pub(super) out: PathBuf,
    /// Keep the scans for the next bench of the same halls
    #[arg(long)]
    pub(super) keep: bool,
}

#[derive(Debug, Args)]
pub(super) struct RescanBenchFlags {
    /// Number of plants
    #[arg(long, value_name = "N", default_value_t = 5)]
    pub(super) cases: usize,
    #[command(flatten)]
    pub(super) seeds: SeedFlags,
    /// Number of robots of each plant
    #[arg(long, value_name = "N", default_value_t = 4)]
    pub(super) n_robots: usize,
    /// Number of scanners of the first session
    #[arg(long, value_name = "N", default_value_t = 5)]
    pub(super) scans: usize,
    /// Angle between beams, degrees
    #[arg(long, value_name = "DEG", default_value_t = 0.13)]
    pub(super) step: f64,
    #[command(flatten)]
    pub(super) kept: KeptFlags,
    /// Suite: plants in one frame, new scans in random frames, lines of equal cells in such frames,
    /// or halls with pushed things
    #[arg(long, value_enum, value_name = "WHICH", default_value = "same")]
    pub(super) suite: RescanSuite,
    /// Also run on the new scans alone, for comparison
    #[arg(long)]
    pub(super) alone: bool,
}

#[derive(Debug, Args)]
pub(super) struct CheckBenchFlags {
    /// Number of cells
    #[arg(long, value_name = "N", default_value_t = 20)]
    pub(super) cases: usize,
    #[command(flatten)]
    pub(super) seeds: SeedFlags,
    /// Number of robots of each cell
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(super) n_robots: usize,
    /// Number of scanners of each cell
    #[arg(long, value_name = "N", default_value_t = 4)]
    pub(super) scans: usize,
    /// Angle between beams, degrees
    #[arg(long, value_name = "DEG", default_value_t = 0.17)]
    pub(super) step: f64,
    /// Distance below which something is in a robot's way, metres
    #[arg(long, value_name = "METRES", default_value_t = 0.02)]
    pub(super) margin: f64,
    #[command(flatten)]
    pub(super) kept: KeptFlags,
}

#[derive(Debug, Args)]
pub(super) struct ScannersBenchFlags {
    /// Number of halls
    #[arg(long, value_name = "N", default_value_t = 20)]
    pub(super) cases: usize,
    #[command(flatten)]
    pub(super) seeds: SeedFlags,
    /// Greatest number of scanners of a hall
    #[arg(long, value_name = "N", default_value_t = 12, value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub(super) scans: u16,
    /// Greatest number of beams of a hall
    #[arg(long, value_name = "N", default_value_t = 8_000_000, value_parser = clap::value_parser!(u64).range(100_000..=200_000_000))]
    pub(super) beams: u64,
    /// Only orders of points whose name has one of these parts, such as shuffled
    #[arg(long, value_name = "PART", value_delimiter = ',')]
    pub(super) order: Vec<String>,
    /// Output folder of rows and table
    #[arg(long, value_name = "DIR")]
    pub(super) out: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(super) struct ThroughputFlags {
    /// Number of beams of each plant, for example 1M,10M,100M
    #[arg(long, value_name = "N", value_delimiter = ',', default_value = "10M")]
    pub(super) points: Vec<String>,
    /// Number of scanners (default: one per 50 million beams, at least two)
    #[arg(long, value_name = "N")]
    pub(super) scans: Option<usize>,
    /// Number of robots of each plant
    #[arg(long, value_name = "N", default_value_t = 4)]
    pub(super) n_robots: usize,
    /// Number of runs of each plant; the median counts
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(super) runs: usize,
    /// Format of the scans
    #[arg(long, value_enum, value_name = "FORMAT", default_value = "las")]
    pub(super) format: Scanned,
    /// Seed of the plants
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(super) seed: u64,
    /// Robot library (default: the demo's robots)
    #[arg(long, value_name = "DIR")]
    pub(super) robots: Option<PathBuf>,
    /// Output folder of scans, results and figures
    #[arg(long, value_name = "DIR")]
    pub(super) out: PathBuf,
    /// Keep the scans for the next bench of the same plant
    #[arg(long)]
    pub(super) keep: bool,
    /// Also write the truth of each point beside the scans
    #[arg(long)]
    pub(super) truth: bool,
}

/// Models that a cell is searched for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Against {
    /// Only the true model
    Same,
    /// All models of the library
    Library,
}
