//! The scans that saw a point, and the errors that their points share.

use geometry::Vector;
use nalgebra::Matrix3;
use std::collections::BTreeMap;

/// Scans that are told apart.
const N_SCANS: u64 = 64;
/// Positions of scanners are compared in this unit, metres.
const UNIT: f64 = 0.01;
/// Standard deviation of the place of a scan in any direction, metres: what is left of its
/// registration. All its points share it.
const REGISTRATION: f64 = 0.003;
/// Information of all scans together about a direction below which its shift is taken to follow
/// from other evidence, as a share of that of all pairs.
const UNSEEN: f64 = 0.05;

/// A set of scans.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct ScanSet(u64);

impl ScanSet {
    /// The set of the scan from a place; world frame, metres. Few scans of a thing have the same
    /// number; these count as one.
    pub(super) fn of(scanner: [f64; 3]) -> Self {
        let step = |v: f64| (v / UNIT).round() as i64 as u64;
        // A hash by the golden ratio: its upper bits depend on all coordinates.
        let mix = |all: u64, v: f64| (all ^ step(v)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let number = scanner.iter().fold(0, |all, v| mix(all, *v).rotate_left(29));
        Self(1 << (number % N_SCANS))
    }

    pub(super) fn with(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    fn each(self) -> impl Iterator<Item = u64> {
        (0..N_SCANS).filter(move |i| self.0 >> i & 1 == 1)
    }
}

/// Information about a shift, by scan of one session: a scan that is off moves the thing as far as
/// the thing's place was found by that scan's points.
#[derive(Debug, Default)]
pub(super) struct ScanShares {
    by_scan: BTreeMap<u64, Matrix3<f64>>,
}

impl ScanShares {
    /// Adds a pair of surfels along a normal.
    pub(super) fn add(&mut self, scans: ScanSet, normal: &Vector, weight: f64) {
        let n = scans.each().count().max(1) as f64;
        let one = weight / n * normal * normal.transpose();
        scans.each().for_each(|scan| *self.by_scan.entry(scan).or_default() += one);
    }

    /// Covariance of the shift due to errors of the places of scans, m².
    pub(super) fn covariance(&self) -> Matrix3<f64> {
        let all: Matrix3<f64> = self.by_scan.values().sum();
        let hold = Matrix3::identity() * (UNSEEN * all.trace()).max(1e-12);
        let Some(inverse) = (all + hold).try_inverse() else { return Matrix3::zeros() };
        let one = |own: &Matrix3<f64>| {
            let share = inverse * own;
            share * share.transpose()
        };
        REGISTRATION.powi(2) * self.by_scan.values().map(one).sum::<Matrix3<f64>>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scans_that_saw_the_same_faces_average_their_errors() {
        let scans = [[0.0, 1.0, 1.7], [5.0, -2.0, 1.7]].map(ScanSet::of);
        assert_ne!(scans[0], scans[1]);
        let sigma = |faces: &[(usize, Vector)]| {
            let mut shares = ScanShares::default();
            faces.iter().for_each(|(k, normal)| shares.add(scans[*k], normal, 9.0));
            shares.covariance().diagonal().map(f64::sqrt)
        };
        let one = sigma(&[(0, Vector::x()), (0, Vector::y())]);
        assert!((one.x / REGISTRATION - 1.0).abs() < 0.15 && one.z < 1e-6, "{one}");
        let both = sigma(&[(0, Vector::x()), (1, Vector::x()), (1, Vector::y())]);
        assert!((both.x / REGISTRATION - 0.7).abs() < 0.1, "{both}");
        assert!((both.y / REGISTRATION - 1.0).abs() < 0.2, "{both}");
    }
}
