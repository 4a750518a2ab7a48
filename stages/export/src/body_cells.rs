//! Cells of a plan that a body fills, with the cells beside them.

/// Which cells a body fills, over a plan and a little beyond its border.
pub(crate) struct BodyCells {
    /// The lowest cell that is kept.
    low: [i64; 2],
    size: [i64; 2],
    is_full: Vec<bool>,
}

impl BodyCells {
    /// The cells of points, and the eight cells beside each, for a plan of this size.
    pub(crate) fn new(points: impl Iterator<Item = [i64; 2]> + Clone, plan: [i64; 2]) -> Self {
        // Cells beside the border say whether the border is an edge of the body; what is farther
        // away says nothing.
        let within = |cell: [i64; 2]| [0, 1].map(|i| cell[i].clamp(-3, plan[i] + 2));
        let points = points.map(within);
        let min = |all: [i64; 2], cell: [i64; 2]| [0, 1].map(|i| all[i].min(cell[i]));
        let max = |all: [i64; 2], cell: [i64; 2]| [0, 1].map(|i| all[i].max(cell[i]));
        let low = points.clone().fold(plan, min).map(|v| v - 1);
        let high = points.clone().fold([-3; 2], max).map(|v| v + 1);
        let size = [0, 1].map(|i| (high[i] + 1 - low[i]).max(0));
        let is_full = vec![false; (size[0] * size[1]) as usize];
        let mut all = Self { low, size, is_full };
        for [u, v] in points {
            for k in 0..9 {
                if let Some(at) = all.at([u + k % 3 - 1, v + k / 3 - 1]) {
                    all.is_full[at] = true;
                }
            }
        }
        all
    }

    fn at(&self, [u, v]: [i64; 2]) -> Option<usize> {
        let [u, v] = [u - self.low[0], v - self.low[1]];
        let is_inside = (0..self.size[0]).contains(&u) && (0..self.size[1]).contains(&v);
        is_inside.then(|| (v * self.size[0] + u) as usize)
    }

    /// Whether the body fills this cell, which lies in the plan or right beside it.
    pub(crate) fn has(&self, cell: [i64; 2]) -> bool {
        self.at(cell).is_some_and(|at| self.is_full[at])
    }

    /// The cells that the body fills, row by row.
    pub(crate) fn cells(&self) -> impl Iterator<Item = [i64; 2]> {
        let full = self.is_full.iter().enumerate().filter(|(_, is_full)| **is_full);
        full.map(|(at, _)| {
            let (u, v) = (at as i64 % self.size[0], at as i64 / self.size[0]);
            [self.low[0] + u, self.low[1] + v]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn cells_in_and_beside_a_plan_are_those_of_the_points_and_their_neighbours() {
        let plan = [12, 9];
        let bodies: [&[[i64; 2]]; 5] = [
            &[],
            &[[3, 3], [4, 3], [11, 8], [11, 8]],
            &[[-1, 4], [-2, 5], [-3, 6], [-900_000_000_000, 2]],
            &[[12, 1], [13, 2], [14, 3], [5, 900_000_000_000]],
            &[[0, 0], [0, 8], [11, 0], [6, -2], [6, 10]],
        ];
        for body in bodies {
            let beside = |[u, v]: [i64; 2]| (0..9).map(move |k| [u + k % 3 - 1, v + k / 3 - 1]);
            let expected: BTreeSet<[i64; 2]> = body.iter().copied().flat_map(beside).collect();
            let found = BodyCells::new(body.iter().copied(), plan);
            for cell in (-1..13).flat_map(|u| (-1..10).map(move |v| [u, v])) {
                assert_eq!(found.has(cell), expected.contains(&cell), "{cell:?} of {body:?}");
            }
            let is_shown = |[u, v]: &[i64; 2]| (0..12).contains(u) && (0..9).contains(v);
            let shown: BTreeSet<[i64; 2]> = found.cells().filter(is_shown).collect();
            assert_eq!(shown, expected.into_iter().filter(is_shown).collect());
        }
    }
}
