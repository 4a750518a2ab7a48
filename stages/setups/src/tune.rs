//! Tunes place on the axis and step of elevation until stretches of columns lie on combs: first
//! short stretches, each with a phase of its own, then longer ones, which tell more from a better
//! start.

use crate::refine::{CombPoint, ScannerFit};
use geometry::Vector;
use std::f64::consts::TAU;

/// Number of points that are looked at, of whole runs.
const LOOKED: usize = 5_000;

/// One round: length of the stretches, points; reach and interval of the places, metres; reach and
/// interval of the steps, shares of the step.
struct TuningRound {
    length: u32,
    places: (f64, f64),
    steps: (f64, f64),
}

/// The rounds. An interval turns the phase across a stretch by about a tenth, at a range of 3 m and
/// steps of 0.1°; the reach is a few intervals of the round before.
const ROUNDS: [TuningRound; 3] = [
    TuningRound { length: 32, places: (0.048, 0.008), steps: (0.02, 0.003) },
    TuningRound { length: 128, places: (0.012, 0.002), steps: (0.004, 0.000_8) },
    TuningRound { length: 512, places: (0.004, 0.000_7), steps: (0.001, 0.000_2) },
];

/// The fit with the place and the step from which stretches are the clearest combs.
pub(crate) fn tuned(points: &[CombPoint], start: ScannerFit) -> ScannerFit {
    let every = points.len().div_ceil(LOOKED).max(1) as u32;
    let looked: Vec<CombPoint> =
        points.iter().filter(|p| p.run.is_multiple_of(every)).copied().collect();
    ROUNDS.iter().fold(start, |fit, round| round.best(&looked, fit))
}

impl TuningRound {
    fn best(&self, points: &[CombPoint], fit: ScannerFit) -> ScannerFit {
        let n = (self.places.0 / self.places.1).round() as i32;
        let axis = fit.pose.rotation * Vector::z();
        let mut best = (f64::NEG_INFINITY, fit);
        for i in -n..=n {
            let mut moved = fit;
            moved.pose.translation.vector += axis * (f64::from(i) * self.places.1);
            let (clearness, step) = self.best_step(points, &moved);
            if clearness > best.0 {
                best = (clearness, ScannerFit { step, ..moved });
            }
        }
        best.1
    }

    /// The step at which the stretches are the clearest, and how clear they are.
    fn best_step(&self, points: &[CombPoint], fit: &ScannerFit) -> (f64, f64) {
        let angles: Vec<f64> = points.iter().map(|p| fit.elevation(&p.at, p.side)).collect();
        let apart = self.steps.1 / fit.step;
        let n = (self.steps.0 / self.steps.1).round() as i32;
        let first = 1.0 / fit.step - f64::from(n) * apart;
        let at = |f: f64| -> Vec<[f64; 2]> {
            angles.iter().map(|e| <[f64; 2]>::from((TAU * e * f).sin_cos())).collect()
        };
        let (mut now, turn) = (at(first), at(apart));
        let mut best = (f64::NEG_INFINITY, fit.step);
        for i in 0..=2 * n {
            let clearness = self.clearness(points, &now);
            if clearness > best.0 {
                best = (clearness, 1.0 / (first + apart * f64::from(i)));
            }
            for ([sin, cos], [s, c]) in now.iter_mut().zip(&turn) {
                (*sin, *cos) = (*sin * c + *cos * s, *cos * c - *sin * s);
            }
        }
        best
    }

    /// Sum over the stretches of the squared sum of their phasors, by their number.
    fn clearness(&self, points: &[CombPoint], phasors: &[[f64; 2]]) -> f64 {
        let stretch = |p: &CombPoint| (p.run, p.order / self.length);
        let mut all = 0.0;
        let mut from = 0;
        for own in points.chunk_by(|a, b| stretch(a) == stretch(b)) {
            let to = from + own.len();
            let sum = phasors[from..to].iter().fold([0.0, 0.0], |s, p| [s[0] + p[0], s[1] + p[1]]);
            all += (sum[0] * sum[0] + sum[1] * sum[1]) / own.len() as f64;
            from = to;
        }
        all
    }
}
