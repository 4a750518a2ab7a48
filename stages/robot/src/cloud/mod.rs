//! A link's mesh in; samples of its outer surface with outward normals out, in an order whose
//! prefixes are even.

mod exterior;
mod spread;

use crate::model::{CadCloud, Mesh};
use exterior::{Blockers, Shell, Side};
use nalgebra::Vector3;
use rand::{Rng as _, RngExt as _, SeedableRng as _};
use rand_xoshiro::SplitMix64;

/// Candidates for each sample that is kept: with fewer the spread gets holes, with more it only
/// costs time.
const N_CANDIDATES: f64 = 2.5;
/// Edge of the cells whose candidates are judged together, metres: parts smaller than this hide
/// nothing that a scanner resolves.
const JUDGED_CELL: f32 = 0.015;
/// Depth of such a cell along the normal, metres: the two sides of a sheet of metal are judged
/// apart.
const JUDGED_DEPTH: f32 = 0.004;

/// A place on the surface.
#[derive(Debug, Clone, Copy)]
struct Sample {
    at: Vector3<f32>,
    normal: Vector3<f32>,
}

/// A number below `n`, by the upper half of a product.
fn below(random: &mut SplitMix64, n: usize) -> usize {
    ((u128::from(random.next_u64()) * n as u128) >> 64) as usize
}

/// A link gets so many samples at least, as far as the least spacing allows: bolts and edges of a
/// small wrist are what tells its pose, and a sample beside an edge has the wrong normal.
const MIN_SAMPLES: f64 = 12_000.0;
/// Least spacing, metres: finer than the noise of any scanner.
const MIN_SPACING: f64 = 0.002;

/// Samples a mesh at about `spacing` metres, a small one more finely, with at most `max_samples`.
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

fn corners(mesh: &Mesh, triangle: &[u32; 3]) -> [Vector3<f32>; 3] {
    triangle.map(|i| mesh.vertices[i as usize].into())
}

fn area(mesh: &Mesh, triangle: &[u32; 3]) -> f64 {
    let [a, b, c] = corners(mesh, triangle).map(|p| p.cast::<f64>());
    0.5 * (b - a).cross(&(c - a)).norm()
}

/// About `n` places, each standing for the same area: one in each step of the summed area,
/// low-discrepancy within large triangles.
fn candidates(
    mesh: &Mesh,
    areas: &[f64],
    whole: f64,
    n: usize,
    random: &mut SplitMix64,
) -> Vec<Sample> {
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
        // The R2 sequence (plastic number) from a random start.
        let (mut u, mut v) = (random.random::<f64>(), random.random::<f64>());
        while next < sum {
            let (s, t) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            out.push(Sample {
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

/// Which candidates are judged together: their cell, the way they face, and their depth along it.
fn key(sample: &Sample) -> (u8, [i32; 4]) {
    let n = sample.normal;
    let axis = n.iamax();
    let facing = (2 * axis + usize::from(n[axis] < 0.0)) as u8;
    let cell = sample.at.map(|v| (v / JUDGED_CELL).floor());
    // From the middle of the cell, where a small turn of the normal matters little.
    let depth = n.dot(&(sample.at - cell.map(|v| (v + 0.5) * JUDGED_CELL)));
    let [x, y, z] = [0, 1, 2].map(|k| cell[k] as i32);
    (facing, [x, y, z, (depth / JUDGED_DEPTH).round() as i32])
}

/// The candidates on the outer surface, their normals turned outward.
fn outer(mesh: &Mesh, candidates: Vec<Sample>) -> Vec<Sample> {
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
            Side::Back => Some(Sample { at: sample.at, normal: -sample.normal }),
        })
        .collect()
}
