//! Which points of a scan are sampled where every point can be read by its place.

use crate::reader::SampledPoint;
use contract::Result;

/// Positions of the runs of a sample, relative to the length of the scan: each run spans several
/// lines of most scanners.
const RUNS: [f64; 3] = [0.45, 0.1, 0.8];
/// Number of further positions that are tried where points of other scans lie between.
const MORE: usize = 16;
/// Number of points of a spread that follow one another in the file: a sector of a few degrees or
/// more. Many narrower sectors leave most cells of directions filled in part, and at true positions
/// of ten scans of 10 million points up to 0.2 % of the full ones looked like two surfaces.
const RUN: u64 = 500_000;

/// Up to `n` points between the first and the last place of a scan, as runs of neighbours.
/// `run` reads points of the scan, scan frame, among so many from a place on.
pub(crate) fn sample(
    (first, last): (u64, u64),
    n: usize,
    mut run: impl FnMut(u64, usize) -> Result<Vec<[f32; 3]>>,
) -> Result<Vec<SampledPoint>> {
    let span = last + 1 - first.min(last + 1);
    let starts: Vec<f64> = if span <= n as u64 {
        vec![0.0]
    } else {
        let more = (0..MORE).map(|i| (i as f64 + 0.5) / MORE as f64);
        RUNS.into_iter().chain(more).collect()
    };
    let length = if starts.len() == 1 { n } else { n / RUNS.len() };
    let mut out: Vec<SampledPoint> = Vec::new();
    for (i, share) in starts.into_iter().enumerate() {
        if out.len() >= n || (i >= RUNS.len() && out.len() > n / 2) {
            break;
        }
        let from = first + (span as f64 * share) as u64;
        let points = run(from, length)?.into_iter();
        out.extend(points.map(|xyz| SampledPoint { xyz, native: None }));
    }
    out.truncate(n);
    Ok(out)
}

/// Up to `n` points evenly spread over the places of a scan, or over as many of them as `most`.
/// `run` reads points of the scan with their places, among so many from a place on.
pub(crate) fn spread(
    (first, last): (u64, u64),
    n: usize,
    most: u64,
    mut run: impl FnMut(u64, usize) -> Result<Vec<(u64, [f32; 3])>>,
) -> Result<Vec<[f32; 3]>> {
    let span = (last + 1).saturating_sub(first);
    let n_runs = span.min(most).div_ceil(RUN);
    let every = span.min(most).div_ceil(n.max(1) as u64).max(1);
    let mut out = Vec::new();
    for at in 0..n_runs {
        let from = first + (span as f64 * at as f64 / n_runs as f64) as u64;
        let own = run(from, RUN.min(last + 1 - from) as usize)?.into_iter();
        out.extend(own.filter(|(place, _)| place.is_multiple_of(every)).map(|(_, xyz)| xyz));
    }
    Ok(out)
}
