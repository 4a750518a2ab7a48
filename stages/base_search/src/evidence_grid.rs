//! A voxel grid of the evidence in a region. What the beams show about each place is looked up once
//! for all models and base poses of a search, instead of once for each sample.

use contract::{Fan, Region};
use geometry::depth::{LANES, Looks, lanes};
use geometry::probe::NO_RETURN_WEIGHT;
use geometry::{Evidence, Probe};
use std::sync::OnceLock;

use crate::score_grid::{ReorderedScores, SCORE_UNIT, ScoreGrid, UNJUDGED};

/// Edge of a cell, and of the cubes that points are counted in, metres: half of the finest
/// tolerance of a quick score.
pub(crate) const EDGE: f32 = 0.03;
/// Limit of the cells; a larger region has larger ones.
const MAX_CELLS: f64 = 16e6;
/// Least tolerance that the grid has scores for, as a multiple of a cell's edge.
const LEAST: f32 = WIDE / RUNG;
/// Tolerance from which on the rounding to cells hardly matters, as a multiple of a cell's edge.
pub(crate) const WIDE: f32 = 1.4;
/// Ratio of neighbouring tolerances that the grid has scores for. A twentieth more or less than the
/// requested tolerance does not change which place is best.
pub(crate) const RUNG: f32 = 1.1;
const N_RUNGS: usize = 17;
/// Unit of the distances in a cell, metres.
const UNIT: f32 = 0.004;
/// Cells around the region along x, y and z, on either side, that the grid of scores has as well:
/// bodies at its border are looked up as those in its middle are. 0.6 m, half a base and its first
/// link, and 0.3 m.
const MARGIN: [usize; 3] = [20, 20, 10];
/// In `distance`: no beam ended near. In `beyond`: beams went there and none returned.
const NOTHING: u8 = 255;

/// The evidence at one place.
#[derive(Debug, Clone, Copy)]
struct EvidenceCell {
    /// Distance beyond the place at which the farthest beam ended, in units; 0 if none ended
    /// beyond it.
    beyond: u8,
    /// Distance along a beam to the nearest end of one, in units.
    distance: u8,
}

impl EvidenceCell {
    /// Score of a sample at such a place, in [`SCORE_UNIT`]s, whatever the direction of the beam
    /// is.
    fn score(self, tolerance: f32) -> i8 {
        let through = match self.beyond {
            NOTHING => NO_RETURN_WEIGHT,
            beyond => ((f32::from(beyond) * UNIT - tolerance) / tolerance).clamp(0.0, 1.0),
        };
        let on = match self.distance {
            NOTHING => 0.0,
            distance => 1.0 - f32::from(distance) * UNIT / tolerance,
        };
        let mut probe = Probe::default();
        probe.count(through, on);
        match (probe.score / SCORE_UNIT).round() as i8 {
            _ if probe.n_seen == 0 => UNJUDGED,
            // This value is reserved for hidden places.
            UNJUDGED => UNJUDGED - 1,
            score => score,
        }
    }
}

/// A grid of evidence in the region's frame.
#[derive(Debug)]
pub(crate) struct EvidenceGrid {
    min: [f32; 3],
    pub(crate) edge: f32,
    n: [usize; 3],
    cells: Vec<EvidenceCell>,
    /// The score of each cell for each of the tolerances, computed when first requested.
    scores: [OnceLock<Vec<i8>>; N_RUNGS],
    reordered: [ReorderedScores; N_RUNGS],
}

impl EvidenceGrid {
    /// Makes the grid of a region; `None` if the evidence has no beams.
    pub(crate) fn new(region: &Region, evidence: &Evidence<'_>, fan: &dyn Fan) -> Option<Self> {
        if !evidence.has_beams() {
            return None;
        }
        let size = region.bounds.size();
        let content = size.iter().product::<f64>();
        let edge = EDGE.max((content / MAX_CELLS).cbrt() as f32);
        let n = size.map(|s| (s / f64::from(edge)).ceil().max(1.0) as usize);
        let min = region.bounds.min.map(|v| v as f32);
        let middle = |i: usize, of: usize| min[i] + (of as f32 + 0.5) * edge;
        // Neighbouring cells are looked up together.
        let layer = |k: usize| -> Vec<EvidenceCell> {
            let mut layer = Vec::with_capacity(n[0] * n[1]);
            for (j, first) in (0..n[1]).flat_map(|j| (0..n[0]).step_by(LANES).map(move |i| (j, i)))
            {
                let place = |lane: usize| [middle(0, first + lane), middle(1, j), middle(2, k)];
                let local = lanes(&std::array::from_fn::<_, LANES, _>(place));
                let mut gathered = GatheredBeams::default();
                evidence.eyes().iter().for_each(|eye| gathered.add(&eye.look_lanes(&local, edge)));
                let packed = gathered.packed();
                layer.extend_from_slice(&packed[..LANES.min(n[0] - first)]);
            }
            layer
        };
        let cells = fan.fan((0..n[2]).collect(), layer).concat();
        let (scores, reordered) = Default::default();
        Some(Self { min, edge, n, cells, scores, reordered })
    }

    /// The scores at the available tolerance nearest to the requested one (metres); `None` if that
    /// is too fine for the grid.
    pub(crate) fn at_tolerance(&self, tolerance: f32) -> Option<ScoreGrid<'_>> {
        let least = LEAST * self.edge;
        if tolerance * RUNG.sqrt() < least {
            return None;
        }
        let rung = ((tolerance / least).ln() / RUNG.ln()).round().max(0.0) as usize;
        let rung = rung.min(N_RUNGS - 1);
        let tolerance = least * RUNG.powi(rung as i32);
        let scores = self.scores[rung].get_or_init(|| self.score(tolerance));
        let min = std::array::from_fn(|i| self.min[i] - MARGIN[i] as f32 * self.edge);
        let n = self.wide().map(|n| n as i32);
        Some(ScoreGrid { min, edge: self.edge, n, scores, reordered: &self.reordered[rung] })
    }

    /// Number of cells of the grid with its margin.
    fn wide(&self) -> [usize; 3] {
        std::array::from_fn(|i| self.n[i] + 2 * MARGIN[i])
    }

    /// The scores of all cells at a tolerance, with the margin, of which beams say nothing.
    fn score(&self, tolerance: f32) -> Vec<i8> {
        let of = |at: usize| {
            EvidenceCell { beyond: (at >> 8) as u8, distance: at as u8 }.score(tolerance)
        };
        let all: Vec<i8> = (0..1 << 16).map(of).collect();
        let score = |c: &EvidenceCell| all[usize::from(c.beyond) << 8 | usize::from(c.distance)];
        let wide = self.wide();
        let mut scores = vec![UNJUDGED; wide.iter().product()];
        for (row, cells) in self.cells.chunks(self.n[0]).enumerate() {
            let (j, k) = (row % self.n[1] + MARGIN[1], row / self.n[1] + MARGIN[2]);
            let first = (k * wide[1] + j) * wide[0] + MARGIN[0];
            for (to, cell) in scores[first..].iter_mut().zip(cells) {
                *to = score(cell);
            }
        }
        scores
    }
}

/// The evidence of scans about neighbouring places, while it is gathered.
#[derive(Debug, Clone, Copy)]
struct GatheredBeams {
    beyond: [f32; LANES],
    distance: [f32; LANES],
    is_silent: [bool; LANES],
}

impl Default for GatheredBeams {
    fn default() -> Self {
        Self { beyond: [0.0; LANES], distance: [f32::INFINITY; LANES], is_silent: [false; LANES] }
    }
}

impl GatheredBeams {
    #[inline]
    fn add(&mut self, looks: &Looks) {
        for i in 0..LANES {
            let [near, far, range] = [looks.near[i], looks.far[i], looks.range[i]];
            let is_known = !near.is_nan();
            let beyond = looks.around[i] - range;
            let is_silent = beyond == f32::INFINITY;
            let distance = (near - range).abs().min((far - range).abs());
            self.is_silent[i] |= is_known & is_silent;
            // `max` and `min` ignore NaN.
            let beyond = if is_known & !is_silent { beyond } else { f32::NAN };
            self.beyond[i] = self.beyond[i].max(beyond);
            self.distance[i] = self.distance[i].min(if is_known { distance } else { f32::NAN });
        }
    }

    #[inline]
    fn packed(&self) -> [EvidenceCell; LANES] {
        let units = |v: f32| ((v / UNIT) as u32).min(u32::from(NOTHING) - 1) as u8;
        std::array::from_fn(|i| {
            let is_silent = self.is_silent[i] && self.beyond[i] <= 0.0;
            EvidenceCell {
                beyond: if is_silent { NOTHING } else { units(self.beyond[i]) },
                distance: if self.distance[i].is_finite() {
                    units(self.distance[i])
                } else {
                    NOTHING
                },
            }
        })
    }
}
