//! Aligns the surfaces of a thing in two sessions, point to plane in both directions, where both
//! sessions saw them.

use super::scan_set::{ScanSet, ScanShares};
use super::surfels::{SurfelIndex, ThingSurfel};
use geometry::robust::{median, tukey};
use geometry::{Point, Pose, Vector};
use nalgebra::{Matrix3, Matrix6, Translation3, UnitQuaternion, Vector6};
use rustc_hash::FxHashMap;

/// Least cosine of the normals of two surfels that are the same piece of surface: 37°.
const SAME_WAY: f64 = 0.8;
/// Standard deviation of the tilt between two places where a thing stands, radians: 0.3°, of the
/// floor and of the scans' levels.
const TILT: f64 = 0.005;
/// Least standard deviation of a distance between two surfels, metres: noise of the means.
const LEAST_SCALE: f64 = 0.0015;
/// Edge of the cells whose surfels together count as one measurement, metres: errors of
/// neighbouring beams are alike.
const TOGETHER: f64 = 0.1;
/// Standard deviation of a normal, radians (1.5°): along a flat face the pairs seem to determine
/// the shift only because their normals are noisy.
const NORMAL: f64 = 0.026;
/// Tukey's constant, and the standard deviation by the median absolute value.
const TUKEY: f64 = 4.685;
const FROM_MEDIAN: f64 = 1.4826;

/// Two surfels that are the same piece of the thing, at a motion of the earlier one.
struct SurfelPair {
    /// Distance of the earlier one, moved, from the later one along `normal`, metres.
    distance: f64,
    normal: Vector,
    /// Place of the moved surfel.
    at: Vector,
    /// Share of a measurement that it counts as.
    share: f64,
    /// The scans that saw the earlier and the later one.
    scans: [ScanSet; 2],
}

/// The surfels of a thing in both sessions.
pub(super) struct ThingSides {
    /// Earlier and later surfels, world frame.
    pub(super) sides: [SurfelIndex; 2],
    /// For each surfel, the share of a measurement that it is.
    shares: [Vec<f64>; 2],
}

/// Normal equations of a step: shift of a centre in metres and rotation vector about it in radians.
pub(super) struct MotionEquations {
    pub(super) information: Matrix6<f64>,
    /// The part of the information that is due to the noise of normals.
    pub(super) noise: Matrix6<f64>,
    pub(super) right: Vector6<f64>,
}

impl ThingSides {
    /// `reach` is the largest distance of partners that is asked for, metres.
    pub(super) fn new(sides: [Vec<ThingSurfel>; 2], reach: f64) -> Self {
        let shares = sides.each_ref().map(|side| {
            let cell = |s: &ThingSurfel| [0, 1, 2].map(|i| (s.at[i] / TOGETHER).floor() as i32);
            let mut n: FxHashMap<[i32; 3], u32> = FxHashMap::default();
            side.iter().for_each(|s| *n.entry(cell(s)).or_default() += 1);
            side.iter().map(|s| 1.0 / f64::from(n[&cell(s)])).collect()
        });
        Self { sides: sides.map(|side| SurfelIndex::new(side, reach)), shares }
    }

    /// Surfels of one side that have a partner on the other one within `reach` metres at a motion
    /// of the earlier side.
    pub(super) fn n_on(&self, motion: &Pose, reach: f64) -> [usize; 2] {
        let back = motion.inverse();
        let n = |k: usize, pose: &Pose| {
            let own = self.sides[k].all.iter().map(|s| moved(s, pose));
            own.filter(|s| self.sides[1 - k].nearest(s, reach, SAME_WAY).is_some()).count()
        };
        [n(0, motion), n(1, &back)]
    }

    /// Covariance of the shift due to the errors of the places of scans, m².
    pub(super) fn scan_errors(&self, motion: &Pose, reach: f64) -> Matrix3<f64> {
        let mut shares = [ScanShares::default(), ScanShares::default()];
        for pair in self.pairs(motion, reach) {
            for (shares, scans) in shares.iter_mut().zip(pair.scans) {
                shares.add(scans, &pair.normal, pair.share);
            }
        }
        shares.iter().map(ScanShares::covariance).sum()
    }

    fn pairs(&self, motion: &Pose, reach: f64) -> Vec<SurfelPair> {
        let back = motion.inverse();
        let mut out = Vec::new();
        for (surfel, share) in self.sides[0].all.iter().zip(&self.shares[0]) {
            let own = moved(surfel, motion);
            if let Some(other) = self.sides[1].nearest(&own, reach, SAME_WAY) {
                out.push(SurfelPair::of(&own, other, *share));
            }
        }
        for (surfel, share) in self.sides[1].all.iter().zip(&self.shares[1]) {
            if let Some(own) = self.sides[0].nearest(&moved(surfel, &back), reach, SAME_WAY) {
                out.push(SurfelPair::of(&moved(own, motion), surfel, *share));
            }
        }
        out
    }

    /// The equations of the next step of a motion, about a centre at its later place.
    pub(super) fn equations(&self, motion: &Pose, about: &Vector, reach: f64) -> MotionEquations {
        let pairs = self.pairs(motion, reach);
        let mut off: Vec<f64> = pairs.iter().map(|p| p.distance.abs()).collect();
        let scale = (FROM_MEDIAN * median(&mut off).unwrap_or_default()).max(LEAST_SCALE);
        let (mut information, mut right) = (Matrix6::zeros(), Vector6::zeros());
        let mut noise = Matrix6::zeros();
        for pair in &pairs {
            // A pair of both directions is counted twice.
            let weight = 0.5 * pair.share * tukey(pair.distance, TUKEY * scale) / (scale * scale);
            let row_of = |n: Vector| {
                let turn = (pair.at - about).cross(&n);
                Vector6::new(n.x, n.y, n.z, turn.x, turn.y, turn.z)
            };
            let row = row_of(pair.normal);
            let one = pair.normal.cross(&Vector::ith(pair.normal.iamin(), 1.0)).normalize();
            for across in [one, pair.normal.cross(&one)].map(row_of) {
                noise += weight * NORMAL * NORMAL * across * across.transpose();
            }
            information += weight * row * row.transpose();
            right -= weight * pair.distance * row;
        }
        let up = motion.rotation * Vector::z();
        for (i, tilt) in [(3, -up.y), (4, up.x)] {
            information[(i, i)] += TILT.powi(-2);
            right[i] -= tilt * TILT.powi(-2);
        }
        MotionEquations { information, noise, right }
    }
}

impl SurfelPair {
    fn of(own: &ThingSurfel, other: &ThingSurfel, share: f64) -> Self {
        let normal = (own.normal + other.normal).normalize();
        let distance = normal.dot(&(own.at - other.at));
        Self { distance, normal, at: own.at, share, scans: [own.scans, other.scans] }
    }
}

pub(super) fn moved(surfel: &ThingSurfel, motion: &Pose) -> ThingSurfel {
    ThingSurfel {
        at: (motion * Point::from(surfel.at)).coords,
        normal: motion.rotation * surfel.normal,
        ..*surfel
    }
}

/// The motion of a step: shift of a centre, metres, and rotation vector about it, radians.
pub(super) fn step_motion(step: &Vector6<f64>, about: &Vector) -> Pose {
    let turn = UnitQuaternion::from_scaled_axis(Vector::new(step[3], step[4], step[5]));
    let shift = Vector::new(step[0], step[1], step[2]);
    Pose::from_parts(Translation3::from(about + shift - turn * about), turn)
}
