//! Axis-aligned bounding boxes of points.

use crate::Point;
use serde::{Deserialize, Serialize};

/// An axis-aligned bounding box; it is empty when `min > max` on any axis.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Aabb {
    /// Smallest corner, metres.
    pub min: [f64; 3],
    /// Largest corner, metres.
    pub max: [f64; 3],
}

impl Default for Aabb {
    fn default() -> Self {
        Self::EMPTY
    }
}

impl Aabb {
    /// The empty box; adding a point to it gives the box of that point.
    pub const EMPTY: Self = Self { min: [f64::INFINITY; 3], max: [f64::NEG_INFINITY; 3] };

    /// The bounding box of these points; empty where there are none.
    pub fn of(points: impl IntoIterator<Item = [f64; 3]>) -> Self {
        let mut aabb = Self::EMPTY;
        for p in points {
            aabb.add(p);
        }
        aabb
    }

    /// Extends the box so that it holds `p`.
    #[inline]
    pub fn add(&mut self, p: [f64; 3]) {
        // Plain comparisons ignore NaN just as `f64::min` does, and are faster: `f64::min` spends
        // most of its time on NaN.
        for i in 0..3 {
            self.min[i] = if p[i] < self.min[i] { p[i] } else { self.min[i] };
            self.max[i] = if p[i] > self.max[i] { p[i] } else { self.max[i] };
        }
    }

    /// The smallest box that holds both boxes.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        let mut out = *self;
        if !other.is_empty() {
            out.add(other.min);
            out.add(other.max);
        }
        out
    }

    /// The intersection of both boxes; empty where they do not overlap.
    #[must_use]
    pub fn shared(&self, other: &Self) -> Self {
        Self {
            min: std::array::from_fn(|i| self.min[i].max(other.min[i])),
            max: std::array::from_fn(|i| self.max[i].min(other.max[i])),
        }
    }

    /// The box extended by `margin` metres on each side.
    #[must_use]
    pub fn grown(&self, margin: f64) -> Self {
        Self { min: self.min.map(|v| v - margin), max: self.max.map(|v| v + margin) }
    }

    /// Whether the box holds no point.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        (0..3).any(|i| self.min[i] > self.max[i])
    }

    /// Whether the box holds `p`, its borders included.
    #[inline]
    #[must_use]
    pub fn contains(&self, p: [f64; 3]) -> bool {
        (0..3).all(|i| p[i] >= self.min[i] && p[i] <= self.max[i])
    }

    /// Whether the boxes share at least a point of their borders.
    #[must_use]
    pub fn touches(&self, other: &Self) -> bool {
        (0..3).all(|i| self.min[i] <= other.max[i] && other.min[i] <= self.max[i])
    }

    /// Centre of the box.
    #[must_use]
    pub fn center(&self) -> Point {
        Point::from([0, 1, 2].map(|i| 0.5 * (self.min[i] + self.max[i])))
    }

    /// Lengths of the edges, metres; zero where the box is empty.
    #[must_use]
    pub fn size(&self) -> [f64; 3] {
        [0, 1, 2].map(|i| (self.max[i] - self.min[i]).max(0.0))
    }

    /// The eight corners; z varies fastest.
    #[must_use]
    pub fn corners(&self) -> [[f64; 3]; 8] {
        let pick = |i: usize, k: usize| if k == 0 { self.min[i] } else { self.max[i] };
        std::array::from_fn(|n| [pick(0, n >> 2 & 1), pick(1, n >> 1 & 1), pick(2, n & 1)])
    }
}
