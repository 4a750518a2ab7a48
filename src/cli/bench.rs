//! `bench`: suites and numbers in; tables of what the program is worth out.

use super::flags::{AccuracyFlags, Against, Common, PlantFlags};
use super::say::Say;
use crate::bench::plant::{PlantBench, plants};
use crate::bench::{Bench, accuracy};
use crate::exit;
use contract::Result;

pub(super) fn bench_accuracy(flags: &AccuracyFlags, common: &Common, say: &Say) -> Result<u8> {
    let means = common.means()?;
    let engine = common.engine(&means)?;
    let bench = Bench {
        suites: flags.suite.clone(),
        n_cases: flags.cases,
        first: flags.first,
        seed: flags.seed,
        robots: flags.robots.clone(),
        models: flags.model.clone(),
        whole_library: flags.against == Against::Library,
        out: flags.out.clone(),
    };
    say.result(&accuracy(&bench, &means, &engine)?);
    Ok(exit::OK)
}

pub(super) fn bench_plant(flags: &PlantFlags, common: &Common, say: &Say) -> Result<u8> {
    let means = common.means()?;
    let engine = common.engine(&means)?;
    let bench = PlantBench {
        suites: flags.suite.clone(),
        n_cases: flags.cases,
        first: flags.first,
        seed: flags.seed,
        robots: flags.robots.clone(),
        out: flags.out.clone(),
        keep: flags.keep,
    };
    say.result(&plants(&bench, &means, &engine)?);
    Ok(exit::OK)
}
