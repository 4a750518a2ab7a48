//! What a scanner measured first in each direction: which beams passed a place, and which may have
//! hit an edge in front of it.

use crate::shadow::ScannerAt;
use geometry::Point;
use rustc_hash::{FxHashMap, FxHashSet};

/// The nearest measurement of a scanner in each direction.
#[derive(Debug, Clone)]
pub(crate) struct Front {
    eye: Point,
    width: f64,
    near: FxHashMap<[i32; 3], f32>,
}

/// Smallest width of a beam, radians: 3 mm at 3 m.
const BEAM: f64 = 1e-3;
/// A point that is nearer by less belongs to the same object, metres: noise, and surfaces seen at
/// an angle.
const MIN_DEPTH: f32 = 0.02;
/// Beams that end by less beyond a place may have hit what is there, metres: noise, and surfaces
/// seen at an angle.
const BEYOND: f32 = 0.05;

impl Front {
    pub(crate) fn new(eye: &ScannerAt) -> Self {
        Self { eye: eye.at, width: eye.step.max(BEAM), near: FxHashMap::default() }
    }

    pub(crate) fn add(&mut self, p: &Point) {
        let (cell, far) = self.cell(p);
        let near = self.near.entry(cell).or_insert(far);
        *near = near.min(far);
    }

    /// What lies in the directions of some asked places, or beside them: of this front, and of
    /// points of all scanners.
    pub(crate) fn beside_of(
        &self,
        asked: impl Iterator<Item = Point>,
        points: impl Iterator<Item = Point>,
    ) -> Self {
        let asked: FxHashSet<[i32; 3]> = asked.flat_map(|p| beside(self.cell(&p).0)).collect();
        let own = asked.iter().filter_map(|cell| Some((*cell, *self.near.get(cell)?)));
        let mut out = Self { near: own.collect(), ..*self };
        for p in points {
            if asked.contains(&self.cell(&p).0) {
                out.add(&p);
            }
        }
        out
    }

    /// Adds the measurements of another front of the same scanner.
    #[expect(clippy::iter_over_hash_type, reason = "the least does not depend on the order")]
    pub(crate) fn join(&mut self, other: Self) {
        for (cell, far) in other.near {
            let near = self.near.entry(cell).or_insert(far);
            *near = near.min(far);
        }
    }

    fn cell(&self, p: &Point) -> ([i32; 3], f32) {
        let off = p - self.eye;
        let far = off.norm().max(1e-9);
        ((off / far / self.width).map(|v| v.floor() as i32).into(), far as f32)
    }

    /// Whether beams passed a place: neighbouring ones ended beyond it, and none ended at it or in
    /// front of it.
    pub(crate) fn passed(&self, p: &Point) -> bool {
        let (cell, far) = self.cell(p);
        let mut is_passed = false;
        // The direction of the place first, since something mostly is there.
        for cell in (13..40).map(|i| beside_at(cell, i % 27)) {
            if !self.is_of_directions(&cell) {
                continue;
            }
            if let Some(near) = self.near.get(&cell) {
                if *near < far + BEYOND {
                    return false;
                }
                is_passed = true;
            }
        }
        is_passed
    }

    /// Whether a cell holds directions, which are as long as 1: about half of the 27 about one do
    /// not, and are not worth a look.
    fn is_of_directions(&self, cell: &[i32; 3]) -> bool {
        let (mut low, mut high) = (0.0, 0.0);
        for v in cell {
            let (a, b) = (f64::from(*v) * self.width, f64::from(*v + 1) * self.width);
            let least = if *v >= 0 { a } else { b.min(0.0) };
            low += least * least;
            high += (a * a).max(b * b);
        }
        (low..=high).contains(&1.0) || (low - 1.0).abs() < 1e-9 || (high - 1.0).abs() < 1e-9
    }

    /// Whether the beam to a point, or a neighbouring one, hit something in front of it.
    pub(crate) fn is_behind(&self, p: &Point) -> bool {
        let (cell, far) = self.cell(p);
        beside(cell).any(|cell| self.near.get(&cell).is_some_and(|near| near + MIN_DEPTH < far))
    }
}

/// A cell and its 26 neighbours.
fn beside(cell: [i32; 3]) -> impl Iterator<Item = [i32; 3]> {
    (0..27).map(move |i: i32| beside_at(cell, i))
}

/// One of a cell and its 26 neighbours.
fn beside_at([x, y, z]: [i32; 3], i: i32) -> [i32; 3] {
    [x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_just_beside_a_nearer_surface_are_behind_it() {
        let mut front = Front::new(&ScannerAt { at: Point::new(0.0, 0.0, 1.0), step: 0.003 });
        // A wire 2 m away.
        (0..100).for_each(|i| front.add(&Point::new(2.0, 0.0, 0.5 + 0.006 * f64::from(i))));
        for (p, is_behind) in [
            ([2.06, 0.002, 0.8], true),
            ([3.0, -0.004, 0.8], true),
            ([2.01, 0.002, 0.8], false),
            ([1.9, 0.0, 0.8], false),
            ([2.06, 0.03, 0.8], false),
        ] {
            assert_eq!(front.is_behind(&Point::from(p)), is_behind, "{p:?}");
        }
    }

    #[test]
    fn a_wire_that_only_another_scanner_measured_has_points_behind_it() {
        let mut front = Front::new(&ScannerAt { at: Point::new(0.0, 0.0, 1.0), step: 0.003 });
        let wire = || (0..100).map(|i| Point::new(2.0, 0.0, 0.5 + 0.006 * f64::from(i)));
        let (stray, beside) = (Point::new(2.1, 0.003, 0.8), Point::new(2.1, 0.05, 0.8));
        front.add(&stray);
        assert!(!front.is_behind(&stray));
        let front = front.beside_of([stray, beside].into_iter(), wire());
        assert_eq!([stray, beside].map(|p| front.is_behind(&p)), [true, false]);
    }
}
