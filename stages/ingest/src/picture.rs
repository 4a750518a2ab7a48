//! Recognises depth cameras from a sample of neighbouring points: a camera's pixels are evenly
//! spaced on a plane in front of it, a scanner's beams are evenly spaced in angle.

use crate::angular_grid::{Axis, wrap};
use crate::reader::SampledPoint;
use nalgebra::Vector3;

/// Largest number of pairs of neighbours that are examined; it gives shares to one percent.
const PAIRS: usize = 4_000;
/// Number of pairs below which nothing is concluded.
const MIN_PAIRS: usize = 500;
/// Length of the mean unit direction below which the points lie all around, so that no single
/// picture can hold them.
const MIN_MEAN: f64 = 0.6;
/// Largest difference of a step from the most frequent one at which both are equal, as logarithm of
/// the ratio: coordinates in tenths of a millimetre vary by 4 %.
const SAME: f64 = 0.06;
/// Largest difference at which a step is counted at all, logarithm: longer steps skip pixels.
const NEAR: f64 = 0.5;
/// Width of the histogram bins for the most frequent step, logarithm.
const BIN: f64 = 0.03;
/// Share of equal steps that makes a raster. Cameras have 0.99 on their plane and at most 0.42 in
/// angle.
const EVEN: f64 = 0.85;
/// Share of equal angles from which on the points are a scanner's.
const SCANNER: f64 = 0.7;
/// Search for the axis of a picture about the mean direction: number of steps to either side, and
/// length of the first step, tangent.
const AXIS: (i32, f64) = (5, 0.12);
/// Length of the last step, tangent: an axis wrong by a degree leaves steps equal to 2 %.
const LAST_STEP: f64 = 0.01;

/// Whether the points have the directions of a camera's pixels.
pub(crate) fn is_picture(sample: &[SampledPoint]) -> bool {
    let unit = |s: &SampledPoint| Vector3::from(s.xyz.map(f64::from)).normalize();
    let all: Vec<Vector3<f64>> = sample.iter().map(unit).collect();
    let mean = all.iter().sum::<Vector3<f64>>() / all.len().max(1) as f64;
    let every = all.len().div_ceil(PAIRS).max(1);
    let pairs: Vec<[usize; 2]> = (1..all.len()).step_by(every).map(|i| [i - 1, i]).collect();
    if pairs.len() < MIN_PAIRS || mean.norm() < MIN_MEAN {
        return false;
    }
    let angle = |&[a, b]: &[usize; 2]| Some((all[b] - all[a]).norm());
    let round = |axis: Axis| {
        let azimuth = |i: usize| axis.angles(sample[i].xyz)[0];
        even(pairs.iter().map(|&[a, b]| wrap(azimuth(b) - azimuth(a)).abs()))
    };
    let is_scanner = even(pairs.iter().filter_map(angle)) > SCANNER
        || Axis::ALL.into_iter().any(|axis| round(axis) > SCANNER);
    !is_scanner && on_plane(&all, &pairs, &mean.normalize()) > EVEN
}

/// Largest share of equal steps on a plane in front of the camera, over the planes whose axes lie
/// near a direction.
fn on_plane(all: &[Vector3<f64>], pairs: &[[usize; 2]], middle: &Vector3<f64>) -> f64 {
    let across = |of: &Vector3<f64>| {
        let x = of.cross(&Vector3::ith(of.iamin(), 1.0)).normalize();
        (x, of.cross(&x))
    };
    let (x, y) = across(middle);
    let share = |at: [f64; 2]| {
        let axis = (middle + x * at[0] + y * at[1]).normalize();
        let (x, y) = across(&axis);
        let tangents = |i: usize| {
            let z = axis.dot(&all[i]);
            (z > 0.2).then(|| [x.dot(&all[i]) / z, y.dot(&all[i]) / z])
        };
        even(pairs.iter().filter_map(|&[a, b]| {
            let (a, b) = tangents(a).zip(tangents(b))?;
            Some((b[0] - a[0]).hypot(b[1] - a[1]))
        }))
    };
    let (n, mut step) = AXIS;
    let grid = |i: i32| f64::from(i) * step;
    let places = (-n..=n).flat_map(|i| (-n..=n).map(move |j| [grid(i), grid(j)]));
    let best = places.map(|at| (share(at), at)).max_by(|a, b| a.0.total_cmp(&b.0));
    let Some((mut most, mut at)) = best else { return 0.0 };
    while step > LAST_STEP && most <= EVEN {
        let beside = [[-1.0, 0.0], [1.0, 0.0], [0.0, -1.0], [0.0, 1.0]];
        let beside = beside.map(|d| [at[0] + d[0] * step, at[1] + d[1] * step]);
        match beside.into_iter().map(|at| (share(at), at)).max_by(|a, b| a.0.total_cmp(&b.0)) {
            Some(next) if next.0 > most => (most, at) = next,
            _ => step /= 2.0,
        }
    }
    most
}

/// Share of the steps that equal the most frequent one, among those of similar length.
fn even(steps: impl Iterator<Item = f64>) -> f64 {
    let logs: Vec<f64> = steps.filter(|s| *s > 1e-7).map(f64::ln).collect();
    let mut bins = std::collections::BTreeMap::<i64, u32>::new();
    for log in &logs {
        *bins.entry((log / BIN).floor() as i64).or_default() += 1;
    }
    let count = |bin: i64| bins.get(&bin).copied().unwrap_or(0);
    let fullest = bins.keys().max_by_key(|&&b| (count(b - 1) + 2 * count(b) + count(b + 1), b));
    let Some(&fullest) = fullest else { return 0.0 };
    let mode = (fullest as f64 + 0.5) * BIN;
    let within = |reach: f64| logs.iter().filter(|log| (*log - mode).abs() < reach).count();
    within(SAME) as f64 / within(NEAR).max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points on a bumpy wall, row by row, in the directions that `at` gives.
    fn sample(at: impl Fn(i32, i32) -> [f64; 3]) -> Vec<SampledPoint> {
        let rows = (-120..120).flat_map(|i| (-160..160).map(move |j| (i, j)));
        let point = |(i, j): (i32, i32)| {
            let range = 1.5 + 0.3 * f64::from(i * 7 + j * 3).sin();
            let d = Vector3::from(at(i, j)).normalize() * range;
            // As a file with tenths of a millimetre has them.
            SampledPoint {
                // Rounded as in a file with tenths of a millimetre.
                xyz: [d.x, d.y, d.z].map(|v| (v * 1e4).round() as f32 / 1e4),
                native: None,
            }
        };
        // Pixels without depth are missing.
        rows.filter(|(i, j)| (i * 31 + j * 17) % 7 != 0).map(point).collect()
    }

    #[test]
    fn pixels_of_a_camera_are_distinguished_from_beams_of_a_scanner() {
        let tan = |k: i32| f64::from(k) * 0.004;
        let ahead = |i: i32, j: i32| [1.0, tan(j), tan(i)];
        assert!(is_picture(&sample(ahead)));
        // Rolled and pitched, as tripods are.
        let turn = nalgebra::Rotation3::from_euler_angles(0.5, 0.6, 2.0);
        let leaning = |i: i32, j: i32| (turn * Vector3::from(ahead(i, j))).into();
        assert!(is_picture(&sample(leaning)));
        let beam = |azimuth: f64, elevation: f64| {
            let flat = elevation.cos();
            [flat * azimuth.cos(), flat * azimuth.sin(), elevation.sin()]
        };
        assert!(!is_picture(&sample(|i, j| beam(tan(j), tan(i)))));
        assert!(!is_picture(&sample(|i, j| beam(tan(i), tan(j)))));
        // A window of a scanner that looks up steeply, along its rows and along its columns.
        assert!(!is_picture(&sample(|i, j| beam(tan(j), 0.7 + tan(i)))));
        assert!(!is_picture(&sample(|i, j| beam(tan(i), 0.7 + tan(j)))));
    }

    #[test]
    fn points_without_order_tell_nothing() {
        let mut shuffled = sample(|i, j| [1.0, f64::from(j) * 0.004, f64::from(i) * 0.004]);
        let n = shuffled.len();
        (0..n).for_each(|k| shuffled.swap(k, k * 7919 % n));
        assert!(!is_picture(&shuffled));
    }
}
