//! Combines what several postures of one robot say of the places of its joints (METHOD.md §17).

use contract::Calibration;
use geometry::robust;

use super::places::prior;

/// Rounds of the robust mean.
const N_ROUNDS: usize = 10;
/// Standard deviations off the mean up to which a value counts fully; beyond less (Huber).
const FULLY_SIGMAS: f64 = 1.5;
/// A value counts only if the points add this share of what the prior knows of it.
const LEAST_TOLD: f64 = 0.05;

/// What several postures of one robot, or several robots of one model, say together of the places
/// of its joints; `None` where they are of different models.
///
/// Value by value, not by their covariance: one wrist that stands wrong must not pull at joints
/// that are right, and counts less the farther it is off.
#[must_use]
pub fn combine(all: &[&Calibration]) -> Option<Calibration> {
    let first = *all.first()?;
    let names = |c: &Calibration| c.frames.iter().map(|f| f.name.clone()).collect::<Vec<_>>();
    if !all.iter().all(|c| names(c) == names(first)) {
        return None;
    }
    let mut out = Calibration { link_rms: Vec::new(), ..first.clone() };
    for (f, frame) in out.frames.iter_mut().enumerate() {
        let before = prior(frame, first.prior);
        for i in 0..6 {
            let value = |c: &&Calibration| {
                let f = &c.frames[f];
                let v = if i < 3 { f.shift[i] } else { f.turn[i - 3] };
                told_by_points(v, f.sigma[i], before[i])
            };
            let values: Vec<[f64; 2]> = all.iter().filter_map(value).collect();
            let [v, sigma] = mean(&values, before[i]);
            frame.sigma[i] = sigma;
            if i < 3 { frame.shift[i] = v } else { frame.turn[i - 3] = v }
        }
    }
    Some(out)
}

/// What the points alone say of a value that was found with a prior: value and weight; `None` where
/// they say nothing.
fn told_by_points(value: f64, sigma: f64, prior: f64) -> Option<[f64; 2]> {
    let (whole, own) = (sigma.powi(-2), prior.powi(-2));
    let weight = whole - own;
    (weight > LEAST_TOLD * own).then(|| [value * whole / weight, weight])
}

/// Robust weighted mean with the prior, and its standard deviation.
fn mean(values: &[[f64; 2]], prior: f64) -> [f64; 2] {
    let mut at: Vec<f64> = values.iter().map(|v| v[0]).collect();
    let mut middle = robust::median(&mut at).unwrap_or(0.0);
    let mut total = prior.powi(-2);
    for _ in 0..N_ROUNDS {
        let mut sum = 0.0;
        total = prior.powi(-2);
        for [value, weight] in values {
            let off = (value - middle).abs() * weight.sqrt();
            let weight = weight * (FULLY_SIGMAS / off.max(FULLY_SIGMAS)).powi(2);
            sum += weight * value;
            total += weight;
        }
        middle = sum / total;
    }
    [middle, total.sqrt().recip()]
}
