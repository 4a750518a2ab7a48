//! What a run tells its bar: how long each of its stages will probably take, by the rates of
//! `plan`. The more of a run is known, the better: first the size of the files, then the points and
//! a glance at them, then the regions.

use super::expected_regions::{self, ExpectedRegions};
use super::rates::{INGEST, LOAD, PAGE, REST};
use super::search_time;
use super::sizes::points;
use crate::detect::library;
use crate::engine::Engine;
use crate::job::Job;
use contract::{Cluster, Region};
use ingest::Sources;

/// Size of a point in a file, bytes, before its header is read.
const FILE_POINT_BYTES: f64 = 20.0;
/// Time of the search against that of loading the library, before any point is read: both grow with
/// the number of models.
const SEARCHES: f64 = 2.0;
/// Points per second of one thread that reads, before the format is known.
const READS: f64 = 10e6;

/// A run begins.
pub(crate) fn begin(job: &Job, engine: &Engine) {
    if !engine.progress.has_bar() {
        return;
    }
    let threads = job.means.n_threads as f64;
    let robots = library::bytes(&job.robots) as f64 / 1e6 * LOAD / threads;
    let bytes = |path: &std::path::PathBuf| path.metadata().map_or(0, |file| file.len());
    let n = job.inputs.iter().map(bytes).sum::<u64>() as f64 / FILE_POINT_BYTES;
    engine.progress.expect(&[("robots", robots)], false);
    engine.progress.expect(&of_points(n, n / READS, job), false);
    engine.progress.expect(&[("fit", SEARCHES * robots)], false);
}

/// Library and inputs are open; the points are glanced at.
pub(crate) fn opened(job: &Job, sources: &Sources, n_models: usize, engine: &Engine) {
    if !engine.progress.has_bar() {
        return;
    }
    let rate = |format| INGEST.iter().find(|rate| rate.0 == format).map_or(READS, |rate| rate.1);
    let own = sources.inputs.iter().map(|input| (points(sources, input) as f64, input.format));
    let (n, reading) =
        own.fold((0.0, 0.0), |(n, seconds), (own, format)| (n + own, seconds + own / rate(format)));
    engine.progress.expect(&of_points(n, reading, job), true);
    // What is wrong with an input is said when it is read.
    if let Ok(seen) = expected_regions::sample(sources, &job.means.settings, engine) {
        search(&seen, n_models, job, engine);
    }
}

/// The regions are known.
pub(crate) fn regions(
    job: &Job,
    clusters: &[Cluster],
    regions: &[Region],
    n_models: usize,
    engine: &Engine,
) {
    if engine.progress.has_bar() {
        let regions = regions.iter().map(|at| expected_regions::searched(clusters, at)).collect();
        search(&ExpectedRegions { regions, has_floor: true }, n_models, job, engine);
    }
}

fn search(seen: &ExpectedRegions, n_models: usize, job: &Job, engine: &Engine) {
    let seconds = search_time::seconds(seen, n_models) / job.means.n_threads as f64;
    engine.progress.expect(&[("fit", seconds)], true);
}

/// Stages through which all points go, in their order, with the search among them.
fn of_points(n: f64, reading: f64, job: &Job) -> Vec<(&'static str, f64)> {
    let threads = job.means.n_threads as f64;
    let [storing, planes, near, writing] = REST.map(|rate| n / rate / threads);
    let page = if job.means.settings.export.page { n / PAGE / threads } else { 0.0 };
    vec![
        ("ingest", reading / threads),
        ("store", storing),
        ("surfaces", planes),
        ("fit", 0.0),
        ("segment", near),
        ("write", writing),
        ("page", page),
    ]
}
