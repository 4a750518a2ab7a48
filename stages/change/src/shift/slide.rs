//! Directions in which overlapping faces do not determine a motion, as along the only face that
//! both sessions saw: the ends of the thing do. Beyond the true place points of one session lie
//! where beams of the other one passed, on either side.

use super::align::step_motion;
use super::search::ThingPair;
use geometry::{Point, Pose, Vector};
use nalgebra::{Matrix6, Vector6};

/// Standard deviation by the faces from which on ends are asked, metres at the radius of the thing.
const WEAK: f64 = 0.004;
/// Farthest slide, metres: about the width of a thing.
const FARTHEST: f64 = 0.5;
/// Step of a slide, metres.
const STEP: f64 = 0.01;
/// Slides among which the least contradicted one is chosen first, metres.
const FIRST: [f64; 9] = [0.0, -0.02, 0.02, -0.04, 0.04, -0.07, 0.07, -0.1, 0.1];
/// Growth of the passed points that ends a slide: a share of all, and at least so many.
const PASSED: (f64, f64) = (0.004, 4.0);
/// Standard deviation of the middle between two ends, metres: beams lie about 12 mm apart and are
/// a few wide; and the share of the distance of the ends.
const END: f64 = 0.004;
const OF_WIDTH: f64 = 0.15;
/// Standard deviation of a direction of which nothing is known, metres.
const OPEN: f64 = 1.0;
/// Rounds of slides and of alignment across them.
const ROUNDS: usize = 3;
/// Alignments across the weak directions after each round.
const ACROSS: usize = 3;

/// A motion whose weak directions were determined by the ends of the thing as far as they can be.
pub(super) struct SettledMotion {
    pub(super) motion: Pose,
    /// Middle of the thing in the later session, about which the covariance is stated.
    pub(super) about: Vector,
    /// Covariance of shift (metres) and rotation vector (radians).
    pub(super) covariance: Matrix6<f64>,
}

/// A slide between both ends: its middle and standard deviation, metres; `None` where one of them
/// is not there.
fn slide(pair: &ThingPair<'_>, motion: &Pose, along: &dyn Fn(f64) -> Pose) -> Option<[f64; 2]> {
    let n = |t: f64| {
        let [a, b] = pair.n_through(&(along(t) * motion));
        (a + b) as f64
    };
    let counts = FIRST.map(|t| (n(t), t));
    let (least, start) = counts.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
    let most = least + (PASSED.0 * pair.n_asked() as f64).max(PASSED.1);
    let end = |sign: f64| {
        let (mut last, mut k) = (least, 1.0);
        while k * STEP <= FARTHEST {
            let now = n(start + sign * k * STEP);
            if now > most {
                let share = ((most - last) / (now - last)).clamp(0.0, 1.0);
                return Some(start + sign * (k - 1.0 + share) * STEP);
            }
            (last, k) = (now, k + 1.0);
        }
        None
    };
    let (low, high) = (end(-1.0)?, end(1.0)?);
    Some([0.5 * (low + high), END.hypot(OF_WIDTH * (high - low))])
}

/// Determines the weak directions of an aligned motion by the ends of the thing.
pub(super) fn settled(pair: &ThingPair<'_>, aligned: Pose) -> SettledMotion {
    let radius = pair.radius();
    let scale = Vector6::from_fn(|i, _| if i < 3 { 1.0 } else { 1.0 / radius });
    let scaled = Matrix6::from_diagonal(&scale);
    let mut motion = aligned;
    let mut about = pair.middle;
    let mut covariance = Matrix6::zeros();
    for _ in 0..ROUNDS {
        about = (motion * Point::from(pair.middle)).coords;
        let equations = pair.equations(&motion, &about);
        let certain = equations.information - equations.noise;
        let eigen = (scaled * certain * scaled).symmetric_eigen();
        let sigma = eigen.eigenvalues.map(|v| v.max(1e-9).powf(-0.5));
        let mut order: Vec<usize> = (0..6).collect();
        order.sort_by(|&a, &b| sigma[a].total_cmp(&sigma[b]));
        covariance = Matrix6::zeros();
        let mut strong = Matrix6::zeros();
        for i in order {
            let u: Vector6<f64> = scaled * eigen.eigenvectors.column(i);
            let mut own = sigma[i];
            if own > WEAK {
                let along = |t: f64| step_motion(&(u * t), &about);
                if let Some([middle, by_ends]) = slide(pair, &motion, &along) {
                    let share = own.powi(2) / (own.powi(2) + by_ends.powi(2));
                    motion = along(share * middle) * motion;
                    own = own * by_ends / own.hypot(by_ends);
                } else {
                    own = own.min(OPEN * radius.max(1.0));
                }
            } else {
                strong += u * u.transpose() / eigen.eigenvalues[i].max(1e-9);
            }
            covariance += own.powi(2) * u * u.transpose();
        }
        for _ in 0..ACROSS {
            let about = (motion * Point::from(pair.middle)).coords;
            let right = pair.equations(&motion, &about).right;
            motion = step_motion(&(strong * right), &about) * motion;
        }
    }
    SettledMotion { motion, about, covariance }
}
