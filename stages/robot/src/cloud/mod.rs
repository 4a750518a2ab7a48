//! Samples the outer surface of a link's mesh, with outward normals, in an order in which each
//! prefix is spread evenly.

mod exterior;
mod place;
mod spread;

use crate::model::{CadCloud, Mesh};
use exterior::{Blockers, Shell, Side};
use place::{SurfaceSample, corners};
use rand::{RngExt as _, SeedableRng as _};
use rand_xoshiro::SplitMix64;

/// Number of candidates for each sample that is kept: with fewer the samples leave holes, with more
/// only the time grows.
const N_CANDIDATES: f64 = 2.5;
/// Edge of the cells whose candidates are judged together, metres; smaller parts hide nothing that
/// a scanner resolves.
const JUDGED_CELL: f32 = 0.015;
/// Depth of such a cell along the normal, metres, so that the two sides of sheet metal are judged
/// separately.
const JUDGED_DEPTH: f32 = 0.004;

/// Smallest number of samples of a link, as far as [`MIN_SPACING`] allows. The pose of a small
/// wrist is determined by its bolts and edges, and a sample beside an edge has the wrong normal.
const MIN_SAMPLES: f64 = 12_000.0;
/// Smallest distance between samples, metres: finer than the noise of any scanner.
const MIN_SPACING: f64 = 0.002;

/// Samples a mesh at about `spacing` metres, a small mesh more finely, with at most `max_samples`
/// samples.
pub(crate) fn sample(mesh: &Mesh, spacing: f64, max_samples: usize) -> CadCloud {
    let areas: Vec<f64> = mesh.triangles.iter().map(|t| area(mesh, t)).collect();
    let whole: f64 = areas.iter().sum();
    if whole <= 0.0 || !whole.is_finite() || spacing <= 0.0 || max_samples == 0 {
        return CadCloud::default();
    }
    let spacing = spacing.min((whole / MIN_SAMPLES).sqrt().max(MIN_SPACING));
    let n_wanted = (whole / (spacing * spacing)).min(max_samples as f64 * 1.5).max(400.0);
    // The sequence of SplitMix64 is fixed by its definition: the same samples on every machine.
    let mut random = SplitMix64::seed_from_u64(mesh.triangles.len() as u64);
    let candidates =
        candidates(mesh, &areas, whole, (n_wanted * N_CANDIDATES) as usize, &mut random);
    let n_candidates = candidates.len();
    let outer = outer(mesh, candidates);
    let area = whole * outer.len() as f64 / n_candidates.max(1) as f64;
    let fine = spacing.max((area / max_samples as f64).sqrt());
    let mut samples = spread::spread(outer, area, fine, &mut random);
    samples.truncate(max_samples);
    CadCloud {
        spacing: (area / samples.len().max(1) as f64).sqrt() as f32,
        points: samples.iter().map(|s| s.at.into()).collect(),
        normals: samples.iter().map(|s| s.normal.into()).collect(),
        area: area as f32,
    }
}

fn area(mesh: &Mesh, triangle: &[u32; 3]) -> f64 {
    let [a, b, c] = corners(mesh, triangle).map(|p| p.cast::<f64>());
    0.5 * (b - a).cross(&(c - a)).norm()
}

/// About `n` places that stand for equal areas: one in each step of the cumulative area, with a
/// low-discrepancy sequence within large triangles.
fn candidates(
    mesh: &Mesh,
    areas: &[f64],
    whole: f64,
    n: usize,
    random: &mut SplitMix64,
) -> Vec<SurfaceSample> {
    let step = whole / n as f64;
    let mut out = Vec::with_capacity(n + 1);
    let mut next = step * random.random::<f64>();
    let mut sum = 0.0;
    for (triangle, area) in mesh.triangles.iter().zip(areas) {
        sum += area;
        if next >= sum {
            continue;
        }
        let [a, b, c] = corners(mesh, triangle);
        let Some(normal) = (b - a).cast::<f64>().cross(&(c - a).cast()).try_normalize(0.0) else {
            continue;
        };
        // The R2 sequence (powers of the plastic number) from a random start.
        let (mut u, mut v) = (random.random::<f64>(), random.random::<f64>());
        while next < sum {
            let (s, t) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            out.push(SurfaceSample {
                at: a + (b - a) * s as f32 + (c - a) * t as f32,
                normal: normal.cast(),
            });
            u = (u + 0.754_877_666_246_693).fract();
            v = (v + 0.569_840_290_998_053).fract();
            next += step;
        }
    }
    out
}

/// The group of candidates that are judged together: orientation, cell, and depth along the normal.
fn key(sample: &SurfaceSample) -> (u8, [i32; 4]) {
    let n = sample.normal;
    let axis = n.iamax();
    let facing = (2 * axis + usize::from(n[axis] < 0.0)) as u8;
    let cell = sample.at.map(|v| (v / JUDGED_CELL).floor());
    // Measured from the centre of the cell, where a small rotation of the normal matters little.
    let depth = n.dot(&(sample.at - cell.map(|v| (v + 0.5) * JUDGED_CELL)));
    let [x, y, z] = [0, 1, 2].map(|k| cell[k] as i32);
    (facing, [x, y, z, (depth / JUDGED_DEPTH).round() as i32])
}

/// The candidates on the outer surface, with their normals turned outward.
fn outer(mesh: &Mesh, candidates: Vec<SurfaceSample>) -> Vec<SurfaceSample> {
    let shell = Shell::new(mesh);
    let mut order: Vec<(_, u32)> = candidates.iter().map(key).zip(0..).collect();
    order.sort_unstable();
    let mut sides = vec![None; candidates.len()];
    let mut blockers = Blockers::none();
    for group in order.chunk_by(|a, b| a.0 == b.0) {
        let mut judge = |at: u32| shell.side(&candidates[at as usize], &mut blockers);
        let (first, last) = (group[0].1, group[group.len() - 1].1);
        let side = judge(first);
        if first == last || side == judge(last) {
            for (_, at) in group {
                sides[*at as usize] = side;
            }
        } else {
            for (_, at) in group {
                sides[*at as usize] = judge(*at);
            }
        }
    }
    (candidates.into_iter().zip(sides))
        .filter_map(|(sample, side)| match side? {
            Side::Front => Some(sample),
            Side::Back => Some(SurfaceSample { at: sample.at, normal: -sample.normal }),
        })
        .collect()
}
