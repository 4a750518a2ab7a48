//! A grid of scores, in which the mean score of a body's samples at a pose takes one look-up and
//! one integer addition a sample.

use crate::trial::{HIDDEN, SampleScore};
use geometry::Pose;
use geometry::depth::{LANES, Lanes, Rows, lanes, rows, transform, transform_lanes};

/// Unit of the scores in a grid. The price of a hidden sample is two units, that of a sample that a
/// beam passed through is a hundred.
pub(crate) const SCORE_UNIT: f32 = HIDDEN / -(UNJUDGED as f32);
/// Score of a cell that no beam could judge. No other cell has this score.
pub(crate) const UNJUDGED: i8 = -2;
/// The scores of the cells of a region at one tolerance.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ScoreGrid<'a> {
    /// Lowest corner of the first cell; region frame, metres.
    pub(crate) min: [f32; 3],
    /// Edge of a cell, metres.
    pub(crate) edge: f32,
    /// Number of cells along x, y, z; x varies fastest.
    pub(crate) n: [i32; 3],
    /// Score of each cell, in [`SCORE_UNIT`]s.
    pub(crate) scores: &'a [i8],
}

/// Samples of a body at one orientation, as cells of the grid, so that the body can be shifted by
/// whole cells.
#[derive(Debug, Clone)]
pub(crate) struct Stencil<'a> {
    grid: ScoreGrid<'a>,
    places: Vec<i32>,
    /// Lowest and highest cells of the samples along x, y, z.
    low: [i32; 3],
    high: [i32; 3],
}

impl<'a> ScoreGrid<'a> {
    /// The rows of the transformation from the body's frame to cells.
    fn cells_from(&self, local_from_body: &Pose) -> Rows {
        let mut m = rows(local_from_body);
        for (row, min) in m.iter_mut().zip(self.min) {
            row[3] -= min;
            row.iter_mut().for_each(|v| *v /= self.edge);
        }
        m
    }

    /// Score of samples (frame of the body, metres) with the body at a pose. Samples outside of the
    /// grid are hidden.
    pub(crate) fn look_up(&self, points: &[[f32; 3]], local_from_body: &Pose) -> SampleScore {
        let m = self.cells_from(local_from_body);
        let some = points.chunks(LANES).flat_map(|some| {
            let places = self.places_of(&transform_lanes(&m, &lanes(some)));
            let score = |place: i32| self.scores.get(place as usize).copied().unwrap_or(UNJUDGED);
            places.map(score).into_iter().take(some.len())
        });
        rating(some, points.len())
    }

    /// Indices of cells; -1 outside of the grid. The loop has no branches, so that it is
    /// vectorised.
    #[inline]
    fn places_of(&self, cells: &Lanes) -> [i32; LANES] {
        let mut out = [-1; LANES];
        let [x, y, z] = cells;
        let n = self.n.map(|n| n as f32);
        for i in 0..LANES {
            let is_inside = (x[i] >= 0.0) & (y[i] >= 0.0) & (z[i] >= 0.0);
            let is_inside = is_inside & (x[i] < n[0]) & (y[i] < n[1]) & (z[i] < n[2]);
            // Far outside the index would overflow.
            let cell = |v: f32, n: f32| v.clamp(0.0, n) as i32;
            let place = self.place([cell(x[i], n[0]), cell(y[i], n[1]), cell(z[i], n[2])]);
            out[i] = if is_inside { place } else { -1 };
        }
        out
    }

    /// The samples of a body at the pose that it is then shifted from.
    pub(crate) fn stencil(self, points: &[[f32; 3]], local_from_body: &Pose) -> Stencil<'a> {
        let m = self.cells_from(local_from_body);
        let cells: Vec<[i32; 3]> =
            points.iter().map(|p| transform(&m, *p).map(|v| v.floor() as i32)).collect();
        let end = |i: usize, of: fn(i32, i32) -> i32| cells.iter().map(|c| c[i]).reduce(of);
        Stencil {
            grid: self,
            places: cells.iter().map(|c| self.place(*c)).collect(),
            low: std::array::from_fn(|i| end(i, i32::min).unwrap_or(0)),
            high: std::array::from_fn(|i| end(i, i32::max).unwrap_or(0)),
        }
    }

    /// Index of a cell, or the difference of index to a cell this many cells away.
    fn place(&self, at: [i32; 3]) -> i32 {
        (at[2] * self.n[1] + at[1]) * self.n[0] + at[0]
    }
}

impl Stencil<'_> {
    /// Score of the first `n` samples with the body shifted by `shift` (region frame, metres),
    /// rounded to whole cells; `None` if a sample would lie outside of the grid.
    pub(crate) fn look_up(&self, shift: [f32; 3], n: usize) -> Option<SampleScore> {
        let grid = &self.grid;
        let by = shift.map(|v| (v / grid.edge).round() as i32);
        let is_inside =
            (0..3).all(|i| by[i] + self.low[i] >= 0 && by[i] + self.high[i] < grid.n[i]);
        is_inside.then(|| {
            let step = grid.place(by);
            let places = &self.places[..n.min(self.places.len())];
            rating(places.iter().map(|p| grid.scores[(p + step) as usize]), places.len())
        })
    }
}

fn rating(scores: impl Iterator<Item = i8>, n: usize) -> SampleScore {
    let add = |(sum, n_seen): (i32, i32), score: i8| {
        (sum + i32::from(score), n_seen + i32::from(score != UNJUDGED))
    };
    let (sum, n_seen) = scores.fold((0, 0), add);
    let n = n.max(1) as f64;
    SampleScore { score: f64::from(sum) * f64::from(SCORE_UNIT) / n, seen: f64::from(n_seen) / n }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_moved_body_scores_as_where_it_was_moved_to_and_nothing_outside() {
        let n = [20, 17, 13];
        let scores: Vec<i8> = (0..20 * 17 * 13).map(|i| (i * 37 % 150 - 100) as i8).collect();
        let grid = ScoreGrid { min: [-0.3, 0.1, -0.2], edge: 0.03, n, scores: &scores };
        let points = [[0.0, 0.02, 0.05], [0.07, -0.01, 0.1], [-0.05, 0.03, 0.0]];
        let at = |x: f64, y: f64, z: f64| Pose::translation(-0.1 + x, 0.2 + y, -0.1 + z);
        let stencil = grid.stencil(&points, &at(0.0, 0.0, 0.0));
        for (i, j, k) in [(0, 0, 0), (3, -1, 2), (7, 9, -1)] {
            let by = [i, j, k].map(|n| f64::from(n) * 0.03);
            let moved = grid.look_up(&points, &at(by[0], by[1], by[2]));
            assert_eq!(stencil.look_up(by.map(|v| v as f32), 3), Some(moved), "{by:?}");
        }
        assert_eq!(stencil.look_up([1.0, 0.0, 0.0], 3), None);
        let outside = grid.look_up(&points, &at(9.0, 0.0, 0.0)).score;
        assert!((outside + f64::from(HIDDEN)).abs() < 1e-6, "{outside}");
    }
}
