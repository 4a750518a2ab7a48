//! A grid of scores, in which the mean score of a body's samples at a pose takes one look-up and
//! one integer addition a sample.

use crate::trial::{HIDDEN, SampleScore};
use geometry::Pose;
use geometry::depth::{LANES, Lanes, Rows, lanes, rows, transform, transform_lanes};
use std::sync::OnceLock;

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
    /// The same scores in other orders.
    pub(crate) reordered: &'a ReorderedScores,
}

/// The way of a row of places, along which the scores of neighbouring cells lie side by side.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum RowAxis {
    /// Along x, on floors and ceilings.
    X,
    /// Along z, on walls, whichever way they face.
    Z,
}

impl RowAxis {
    /// Its number among x, y and z.
    pub(crate) fn index(self) -> usize {
        match self {
            Self::X => 0,
            Self::Z => 2,
        }
    }
}

/// The scores in the orders that rows of places need, each made when first requested.
///
/// For a stride of two cells, the scores of every second cell from the first on, then from the
/// second on; likewise for three.
#[derive(Debug, Default)]
pub(crate) struct ReorderedScores {
    /// Rows along x with strides of two and three cells.
    along_x: [OnceLock<Vec<i8>>; 2],
    /// Rows along z with strides of one, two and three cells.
    along_z: [OnceLock<Vec<i8>>; 3],
}

/// Places along an axis that a body is shifted to, at equal distances.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PlaceRow {
    pub(crate) axis: RowAxis,
    /// Shift to the first of them, cells.
    pub(crate) first: [i32; 3],
    /// Distance of neighbours, cells: 1 to [`MAX_STRIDE`].
    pub(crate) stride: i32,
    pub(crate) n: usize,
}

impl PlaceRow {
    /// Some of its places.
    pub(crate) fn part(&self, at: usize, n: usize) -> Self {
        Self { first: self.place(at), n, ..*self }
    }

    /// The shift to place `at`, cells.
    pub(crate) fn place(&self, at: usize) -> [i32; 3] {
        let mut out = self.first;
        out[self.axis.index()] += self.stride * at as i32;
        out
    }
}

/// Largest distance of the places of a row, cells.
pub(crate) const MAX_STRIDE: i32 = 3;

/// Samples of a body at one orientation, as cells of the grid, so that the body can be shifted by
/// whole cells.
#[derive(Debug, Clone)]
pub(crate) struct Stencil<'a> {
    grid: ScoreGrid<'a>,
    /// The order of the scores that `places` are indices of.
    axis: RowAxis,
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
        let (mut sum, mut n_seen) = (0, 0);
        for some in points.chunks(LANES) {
            let places = self.places_of(&transform_lanes(&m, &lanes(some)));
            for place in &places[..some.len()] {
                let score = self.scores.get(*place as usize).copied().unwrap_or(UNJUDGED);
                sum += i32::from(score);
                n_seen += i32::from(score != UNJUDGED);
            }
        }
        rated(sum, n_seen, points.len())
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
            let at = [cell(x[i], n[0]), cell(y[i], n[1]), cell(z[i], n[2])];
            let place = self.place(RowAxis::X, at);
            out[i] = if is_inside { place } else { -1 };
        }
        out
    }

    /// The samples of a body at the pose that it is then shifted from, mostly along an axis.
    pub(crate) fn stencil(
        self,
        axis: RowAxis,
        points: &[[f32; 3]],
        local_from_body: &Pose,
    ) -> Stencil<'a> {
        let m = self.cells_from(local_from_body);
        let cells: Vec<[i32; 3]> =
            points.iter().map(|p| transform(&m, *p).map(|v| v.floor() as i32)).collect();
        let end = |i: usize, of: fn(i32, i32) -> i32| cells.iter().map(|c| c[i]).reduce(of);
        Stencil {
            grid: self,
            axis,
            places: cells.iter().map(|c| self.place(axis, *c)).collect(),
            low: std::array::from_fn(|i| end(i, i32::min).unwrap_or(0)),
            high: std::array::from_fn(|i| end(i, i32::max).unwrap_or(0)),
        }
    }

    /// The scores in which cells at such a distance along an axis lie side by side, part after
    /// part.
    fn ordered(&self, axis: RowAxis, stride: i32) -> &'a [i8] {
        let ReorderedScores { along_x, along_z } = self.reordered;
        match (axis, stride) {
            (RowAxis::X, ..=1) => self.scores,
            (RowAxis::Z, ..=1) => along_z[0].get_or_init(|| self.upright()),
            (RowAxis::X, _) => {
                along_x[stride as usize - 2].get_or_init(|| parted(self.scores, stride as usize))
            }
            (RowAxis::Z, _) => along_z[stride as usize - 1]
                .get_or_init(|| parted(self.ordered(axis, 1), stride as usize)),
        }
    }

    /// The scores with z varying fastest.
    fn upright(&self) -> Vec<i8> {
        let [nx, ny, nz] = self.n.map(|n| n as usize);
        let mut out = Vec::with_capacity(self.scores.len());
        let mut columns = vec![UNJUDGED; nx * nz];
        for j in 0..ny {
            for k in 0..nz {
                let row = &self.scores[(k * ny + j) * nx..][..nx];
                row.iter().enumerate().for_each(|(i, score)| columns[i * nz + k] = *score);
            }
            out.extend_from_slice(&columns);
        }
        out
    }

    /// Index of a cell in the order of an axis, or the difference of index to a cell this many
    /// cells away.
    fn place(&self, axis: RowAxis, at: [i32; 3]) -> i32 {
        match axis {
            RowAxis::X => (at[2] * self.n[1] + at[1]) * self.n[0] + at[0],
            RowAxis::Z => (at[1] * self.n[0] + at[0]) * self.n[2] + at[2],
        }
    }
}

/// Scores of which every one at a distance of `stride` lies side by side, part after part.
fn parted(scores: &[i8], stride: usize) -> Vec<i8> {
    let part = scores.len().div_ceil(stride);
    let mut out = vec![UNJUDGED; part * stride];
    for (first, part) in out.chunks_mut(part).enumerate() {
        let every = scores[first..].iter().step_by(stride);
        part.iter_mut().zip(every).for_each(|(to, score)| *to = *score);
    }
    out
}

impl Stencil<'_> {
    /// The shift (region frame, metres), rounded to whole cells.
    pub(crate) fn cells(&self, shift: [f32; 3]) -> [i32; 3] {
        shift.map(|v| (v / self.grid.edge).round() as i32)
    }

    /// Whether all samples stay in the grid, shifted by so many cells.
    fn is_inside(&self, by: [i32; 3]) -> bool {
        (0..3).all(|i| by[i] + self.low[i] >= 0 && by[i] + self.high[i] < self.grid.n[i])
    }

    /// Scores of the first `n` samples at each place of a row; `None` if a sample would lie outside
    /// of the grid. Sample by sample, since the cells of neighbouring places lie side by side.
    pub(crate) fn look_up_row(&self, row: &PlaceRow, n: usize) -> Option<Vec<SampleScore>> {
        let ends = [row.first, row.place(row.n.saturating_sub(1))];
        if row.axis != self.axis || !ends.into_iter().all(|by| self.is_inside(by)) {
            return None;
        }
        let (scores, stride) = (self.grid.ordered(row.axis, row.stride), row.stride as usize);
        let part = self.grid.scores.len().div_ceil(stride);
        let places = &self.places[..n.min(self.places.len())];
        let step = self.grid.place(row.axis, row.first);
        let (mut sums, mut n_seen) = (vec![0_i16; row.n], vec![0_i16; row.n]);
        for place in places {
            let at = (place + step) as usize;
            let along = &scores[at % stride * part + at / stride..][..row.n];
            for ((sum, n_seen), score) in sums.iter_mut().zip(&mut n_seen).zip(along) {
                *sum += i16::from(*score);
                *n_seen += i16::from(*score != UNJUDGED);
            }
        }
        let each = sums.into_iter().zip(n_seen);
        Some(each.map(|(sum, seen)| rated(sum.into(), seen.into(), places.len())).collect())
    }

    /// Score of the first `n` samples with the body shifted by `shift` (region frame, metres),
    /// rounded to whole cells; `None` if a sample would lie outside of the grid.
    pub(crate) fn look_up(&self, shift: [f32; 3], n: usize) -> Option<SampleScore> {
        let grid = &self.grid;
        let by = self.cells(shift);
        self.is_inside(by).then(|| {
            let (step, scores) = (grid.place(self.axis, by), grid.ordered(self.axis, 1));
            let places = &self.places[..n.min(self.places.len())];
            let add = |(sum, n_seen): (i32, i32), place: &i32| {
                let score = scores[(place + step) as usize];
                (sum + i32::from(score), n_seen + i32::from(score != UNJUDGED))
            };
            let (sum, n_seen) = places.iter().fold((0, 0), add);
            rated(sum, n_seen, places.len())
        })
    }
}

/// The score of `n` samples by their sum, in [`SCORE_UNIT`]s, and by how many of them were judged.
fn rated(sum: i32, n_seen: i32, n: usize) -> SampleScore {
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
        let reordered = &ReorderedScores::default();
        let grid = ScoreGrid { min: [-0.3, 0.1, -0.2], edge: 0.03, n, scores: &scores, reordered };
        let points = [[0.0, 0.02, 0.05], [0.07, -0.01, 0.1], [-0.05, 0.03, 0.0]];
        let at = |x: f64, y: f64, z: f64| Pose::translation(-0.1 + x, 0.2 + y, -0.1 + z);
        let rows_of_x = [(1, [-2, 3, 1], 9), (2, [-3, -1, 0], 6), (3, [0, 2, -1], 3)];
        let rows_of_z = [(1, [1, 3, -1], 6), (2, [0, -1, -1], 3), (3, [2, 0, -1], 2)];
        for (axis, rows) in [(RowAxis::X, rows_of_x), (RowAxis::Z, rows_of_z)] {
            let stencil = grid.stencil(axis, &points, &at(0.0, 0.0, 0.0));
            for (i, j, k) in [(0, 0, 0), (3, -1, 2), (7, 9, -1)] {
                let by = [i, j, k].map(|n| f64::from(n) * 0.03);
                let moved = grid.look_up(&points, &at(by[0], by[1], by[2]));
                assert_eq!(stencil.look_up(by.map(|v| v as f32), 3), Some(moved), "{by:?}");
            }
            assert_eq!(stencil.look_up([1.0, 0.0, 0.0], 3), None);
            for (stride, first, n) in rows {
                let row = PlaceRow { axis, first, stride, n };
                let metres = |at: usize| row.place(at).map(|v| v as f32 * 0.03);
                let each = (0..n).map(|at| stencil.look_up(metres(at), 3));
                let each = each.collect::<Option<Vec<_>>>();
                assert!(each.is_some(), "{row:?}");
                assert_eq!(stencil.look_up_row(&row, 3), each, "{row:?}");
                assert_eq!(stencil.look_up_row(&PlaceRow { n: 20, ..row }, 3), None);
            }
        }
        let outside = grid.look_up(&points, &at(9.0, 0.0, 0.0)).score;
        assert!((outside + f64::from(HIDDEN)).abs() < 1e-6, "{outside}");
    }
}
