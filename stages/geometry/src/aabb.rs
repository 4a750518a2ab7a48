//! Axis-aligned boxes: points in, bounds out.

use crate::Point;
use serde::{Deserialize, Serialize};

/// An axis-aligned box; empty when `min > max` on any axis.
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
    /// Holds nothing; growing it by a point gives that point.
    pub const EMPTY: Self = Self { min: [f64::INFINITY; 3], max: [f64::NEG_INFINITY; 3] };

    /// The box of these points; empty for none.
    pub fn of(points: impl IntoIterator<Item = [f64; 3]>) -> Self {
        let mut aabb = Self::EMPTY;
        for p in points {
            aabb.add(p);
        }
        aabb
    }

    /// Grows to hold `p`.
    #[inline]
    pub fn add(&mut self, p: [f64; 3]) {
        // Plain comparisons: `f64::min` spends most of its time on NaN, which these pass over as
        // well.
        for i in 0..3 {
            self.min[i] = if p[i] < self.min[i] { p[i] } else { self.min[i] };
            self.max[i] = if p[i] > self.max[i] { p[i] } else { self.max[i] };
        }
    }

    /// The smallest box that holds both.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        let mut out = *self;
        if !other.is_empty() {
            out.add(other.min);
            out.add(other.max);
        }
        out
    }

    /// What both share; empty where they are apart.
    #[must_use]
    pub fn shared(&self, other: &Self) -> Self {
        Self {
            min: std::array::from_fn(|i| self.min[i].max(other.min[i])),
            max: std::array::from_fn(|i| self.max[i].min(other.max[i])),
        }
    }

    /// Grown by `margin` metres on each side.
    #[must_use]
    pub fn grown(&self, margin: f64) -> Self {
        Self { min: self.min.map(|v| v - margin), max: self.max.map(|v| v + margin) }
    }

    /// Holds no point.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        (0..3).any(|i| self.min[i] > self.max[i])
    }

    /// Holds `p`, borders included.
    #[inline]
    #[must_use]
    pub fn contains(&self, p: [f64; 3]) -> bool {
        (0..3).all(|i| p[i] >= self.min[i] && p[i] <= self.max[i])
    }

    /// Shares at least a border point with `other`.
    #[must_use]
    pub fn touches(&self, other: &Self) -> bool {
        (0..3).all(|i| self.min[i] <= other.max[i] && other.min[i] <= self.max[i])
    }

    /// Middle of the box.
    #[must_use]
    pub fn center(&self) -> Point {
        Point::from([0, 1, 2].map(|i| 0.5 * (self.min[i] + self.max[i])))
    }

    /// Edge lengths, metres; zero where empty.
    #[must_use]
    pub fn size(&self) -> [f64; 3] {
        [0, 1, 2].map(|i| (self.max[i] - self.min[i]).max(0.0))
    }

    /// The eight corners, z fastest.
    #[must_use]
    pub fn corners(&self) -> [[f64; 3]; 8] {
        let pick = |i: usize, k: usize| if k == 0 { self.min[i] } else { self.max[i] };
        std::array::from_fn(|n| [pick(0, n >> 2 & 1), pick(1, n >> 1 & 1), pick(2, n & 1)])
    }
}
