//! Least-squares planes from moments (sums of points and of their products). Moments can be added,
//! so a region can grow, be split over tiles and be joined without reading its points again.

use crate::Vector;
use nalgebra::{Matrix3, SymmetricEigen, UnitQuaternion};
use serde::{Deserialize, Serialize};

/// The plane `normal · p = offset`, with a normal of unit length, metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Plane {
    /// Unit normal.
    pub normal: Vector,
    /// Distance of the plane from the origin along the normal, metres.
    pub offset: f64,
}

impl Plane {
    /// Signed distance of `p`, metres; positive on the side that the normal points to.
    #[inline]
    #[must_use]
    pub fn distance(&self, p: &Vector) -> f64 {
        self.normal.dot(p) - self.offset
    }

    /// A rotation that turns z onto the normal and keeps the x and y axes as near to the world's as
    /// possible; for a level plane it is the identity.
    #[must_use]
    pub fn frame(&self) -> UnitQuaternion<f64> {
        let up = Vector::z();
        if self.normal.z > -0.7 {
            UnitQuaternion::rotation_between(&up, &self.normal).unwrap_or_default()
        } else {
            // For a plane that faces down, turn half a turn about x first: between opposite vectors
            // no shortest rotation is defined.
            let over = UnitQuaternion::from_axis_angle(&Vector::x_axis(), std::f64::consts::PI);
            UnitQuaternion::rotation_between(&-up, &self.normal).unwrap_or_default() * over
        }
    }

    /// The same plane with its normal reversed.
    #[must_use]
    pub fn flipped(&self) -> Self {
        Self { normal: -self.normal, offset: -self.offset }
    }
}

/// Moments of points up to second order about a fixed `origin`, which keeps them precise far from
/// the world's origin.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Moments {
    /// Subtracted from each point before it is summed, metres.
    pub origin: Vector,
    /// Number of points, or sum of their weights.
    pub n: f64,
    /// Sum of the points relative to `origin`, metres.
    pub sum: Vector,
    /// Sum of the outer products of the points relative to `origin`, m².
    pub outer: Matrix3<f64>,
}

impl Moments {
    /// The moments of no points about an origin.
    #[must_use]
    pub fn new(origin: Vector) -> Self {
        Self { origin, n: 0.0, sum: Vector::zeros(), outer: Matrix3::zeros() }
    }

    /// Adds one point.
    #[inline]
    pub fn add(&mut self, p: &Vector) {
        let q = p - self.origin;
        self.n += 1.0;
        self.sum += q;
        self.outer += q * q.transpose();
    }

    /// Adds the moments of `other`, shifted to this origin.
    pub fn join(&mut self, other: &Self) {
        let shift = other.origin - self.origin;
        self.outer += other.outer
            + shift * other.sum.transpose()
            + other.sum * shift.transpose()
            + shift * shift.transpose() * other.n;
        self.sum += other.sum + shift * other.n;
        self.n += other.n;
    }

    /// Centroid of the points, metres; the origin where there are none.
    #[must_use]
    pub fn mean(&self) -> Vector {
        if self.n > 0.0 { self.origin + self.sum / self.n } else { self.origin }
    }

    /// Covariance of the points, m²; zero where there are none.
    #[must_use]
    pub fn covariance(&self) -> Matrix3<f64> {
        if self.n <= 0.0 {
            return Matrix3::zeros();
        }
        let mean = self.sum / self.n;
        self.outer / self.n - mean * mean.transpose()
    }

    /// The least-squares plane with RMS distance and spread. `None` for fewer than three points or
    /// where all lie on a line.
    #[must_use]
    pub fn plane(&self) -> Option<PlaneFit> {
        if self.n < 3.0 {
            return None;
        }
        let eigen = SymmetricEigen::new(self.covariance());
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
        let spread = order.map(|i| eigen.eigenvalues[i].max(0.0).sqrt());
        if spread[1] <= 1e-9 || !spread[2].is_finite() {
            return None;
        }
        let normal: Vector = eigen.eigenvectors.column(order[0]).normalize();
        let along: Vector = eigen.eigenvectors.column(order[2]).normalize();
        let plane = Plane { normal, offset: normal.dot(&self.mean()) };
        Some(PlaneFit { plane, rms: spread[0], spread: [spread[2], spread[1]], along })
    }
}

/// A least-squares plane, see [`Moments::plane`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaneFit {
    /// The plane; the sign of its normal is arbitrary.
    pub plane: Plane,
    /// RMS distance of the points from the plane, metres.
    pub rms: f64,
    /// Standard deviations of the points along the two directions of the plane, larger first,
    /// metres.
    pub spread: [f64; 2],
    /// Unit direction of the larger standard deviation.
    pub along: Vector,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joined_halves_equal_the_whole_far_from_zero() {
        let points: Vec<Vector> = (0..200)
            .map(|i| {
                let (x, y) = (f64::from(i % 20) * 0.01, f64::from(i / 20) * 0.013);
                Vector::new(4.0e5 + x, 5.0e6 + y, 100.0 + 0.1 * x - 0.02 * y)
            })
            .collect();
        let (mut whole, mut a, mut b) =
            (Moments::new(points[0]), Moments::new(points[0]), Moments::new(points[150]));
        for (i, p) in points.iter().enumerate() {
            whole.add(p);
            if i < 90 { a.add(p) } else { b.add(p) }
        }
        a.join(&b);
        let (w, j) = (whole.plane().expect("plane"), a.plane().expect("plane"));
        assert!((w.plane.normal.dot(&j.plane.normal).abs() - 1.0).abs() < 1e-12);
        let truth = Vector::new(-0.1, 0.02, 1.0).normalize();
        assert!((w.plane.normal.dot(&truth).abs() - 1.0).abs() < 1e-9);
        assert!(w.rms < 1e-6, "{}", w.rms);
    }
}
