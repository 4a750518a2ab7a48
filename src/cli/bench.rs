//! The commands `bench ...`: each runs a bench and prints its table.

use super::bench_flags::{
    AccuracyFlags, Against, CheckBenchFlags, KeptFlags, PlanBenchFlags, PlantFlags,
    RescanBenchFlags, ScannersBenchFlags, SeedFlags, ThroughputFlags,
};
use super::common::Common;
use super::exit;
use super::say::Say;
use crate::eval::bench::accuracy::{AccuracyBench, accuracy};
use crate::eval::bench::check::{CheckBench, checks};
use crate::eval::bench::frames::frames;
use crate::eval::bench::plan::{PlanBench, plans};
use crate::eval::bench::plant::{PlantBench, plants};
use crate::eval::bench::request::{DrawnCases, PlantSize, RescanBench, RescanSuite};
use crate::eval::bench::rescan::rescans;
use crate::eval::bench::scanners::{ScannersBench, scanners};
use crate::eval::bench::shifts::shifts;
use crate::eval::bench::throughput::{ThroughputBench, throughput};
use contract::{Error, Kind, Result};

pub(super) fn bench_accuracy(flags: &AccuracyFlags, common: &Common, say: &Say) -> Result<u8> {
    let means = common.means()?;
    let engine = common.engine(&means)?;
    let bench = AccuracyBench {
        drawn: DrawnCases {
            first: flags.drawn.seeds.first,
            seed: flags.drawn.seeds.seed,
            robots: flags.robots.clone(),
            out: flags.out.clone(),
            keep: false,
        },
        suites: flags.drawn.suite.clone(),
        n_cases: flags.drawn.cases,
        models: flags.model.clone(),
        whole_library: flags.against == Against::Library,
    };
    say.result(&accuracy(&bench, &means, &engine)?);
    Ok(exit::OK)
}

pub(super) fn bench_plant(flags: &PlantFlags, common: &Common, say: &Say) -> Result<u8> {
    let means = common.means()?;
    let engine = common.engine(&means)?;
    let bench = PlantBench {
        drawn: drawn(&flags.drawn.seeds, &flags.kept),
        suites: flags.drawn.suite.clone(),
        n_cases: flags.drawn.cases,
    };
    say.result(&plants(&bench, &means, &engine)?);
    Ok(exit::OK)
}

pub(super) fn bench_plan(flags: &PlanBenchFlags, common: &Common, say: &Say) -> Result<u8> {
    let means = common.means()?;
    let engine = common.engine(&means)?;
    let bench = PlanBench {
        n_halls: flags.halls,
        first: flags.seeds.first,
        seed: flags.seeds.seed,
        robots: flags.robots.clone(),
        out: flags.out.clone(),
        keep: flags.keep,
    };
    say.result(&plans(&bench, &means, &engine)?);
    Ok(exit::OK)
}

pub(super) fn bench_rescan(flags: &RescanBenchFlags, common: &Common, say: &Say) -> Result<u8> {
    let means = common.means()?;
    // A failed case is reported and the bench goes on, but without a library all cases would fail.
    if let Some(robots) = &flags.kept.robots {
        robot::Library::open(robots)?;
    }
    let engine = common.engine(&means)?;
    let bench = RescanBench {
        drawn: drawn(&flags.seeds, &flags.kept),
        n_cases: flags.cases,
        size: PlantSize { n_robots: flags.n_robots, n_scanners: flags.scans, step_deg: flags.step },
        alone: flags.alone,
        suite: flags.suite,
    };
    let table = match bench.suite {
        RescanSuite::Same => rescans(&bench, &means, &engine)?,
        RescanSuite::Frames | RescanSuite::Lines => frames(&bench, &means, &engine)?,
        RescanSuite::Things => shifts(&bench, &means, &engine)?,
    };
    say.result(&table);
    Ok(exit::OK)
}

pub(super) fn bench_check(flags: &CheckBenchFlags, common: &Common, say: &Say) -> Result<u8> {
    let means = common.means()?;
    let engine = common.engine(&means)?;
    let bench = CheckBench {
        drawn: drawn(&flags.seeds, &flags.kept),
        n_cases: flags.cases,
        size: PlantSize { n_robots: flags.n_robots, n_scanners: flags.scans, step_deg: flags.step },
        margin: flags.margin,
    };
    say.result(&checks(&bench, &means, &engine)?);
    Ok(exit::OK)
}

pub(super) fn bench_scanners(flags: &ScannersBenchFlags, common: &Common, say: &Say) -> Result<u8> {
    let means = common.means()?;
    let engine = common.engine(&means)?;
    let (seeds, out, keep) = (&flags.seeds, flags.out.clone(), false);
    let bench = ScannersBench {
        drawn: DrawnCases { first: seeds.first, seed: seeds.seed, robots: None, out, keep },
        n_cases: flags.cases,
        n_setups: [1, usize::from(flags.scans)],
        n_beams: flags.beams as f64,
        orders: flags.order.clone(),
    };
    say.result(&scanners(&bench, &means, &engine)?);
    Ok(exit::OK)
}

pub(super) fn bench_throughput(flags: &ThroughputFlags, common: &Common, say: &Say) -> Result<u8> {
    let means = common.means()?;
    let engine = common.engine(&means)?;
    let size = |text: &String| -> Result<u64> {
        let number = text.to_ascii_uppercase();
        let split = number.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(number.len());
        let factor = match &number[split..] {
            "" => Some(1.0),
            "K" => Some(1e3),
            "M" => Some(1e6),
            "G" => Some(1e9),
            _ => None,
        };
        let size = number[..split].parse().ok().zip(factor).map(|(n, f): (f64, f64)| n * f);
        size.filter(|n| (1e4..=1e12).contains(n)).map(|n| n as u64).ok_or_else(|| {
            Error::new(Kind::Usage, format!("this is not a number of points: \"{text}\""))
                .hint("write for example 100M")
        })
    };
    let bench = ThroughputBench {
        sizes: flags.points.iter().map(size).collect::<Result<_>>()?,
        n_scans: flags.scans,
        n_robots: flags.n_robots,
        n_runs: flags.runs,
        format: flags.format,
        seed: flags.seed,
        robots: flags.robots.clone(),
        out: flags.out.clone(),
        keep: flags.keep,
        truth: flags.truth,
    };
    say.result(&throughput(&bench, &means, &engine)?);
    Ok(exit::OK)
}

/// The random cases of these flags.
fn drawn(seeds: &SeedFlags, kept: &KeptFlags) -> DrawnCases {
    let KeptFlags { robots, out, keep } = kept.clone();
    DrawnCases { first: seeds.first, seed: seeds.seed, robots, out, keep }
}
