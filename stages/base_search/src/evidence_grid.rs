//! The evidence of a region in; out comes a grid of it: what the beams say about each place, looked
//! up once for all models and all base poses of a search instead of once for each sample.

use contract::{Fan, Region};
use geometry::depth::{LANES, Looks, lanes};
use geometry::probe::NO_RETURN_WEIGHT;
use geometry::{Evidence, Probe};
use std::sync::OnceLock;

use crate::score_grid::{SCORE_UNIT, ScoreGrid, UNJUDGED};

/// Edge of a cell, and of the cubes of points, metres: half of the finest tolerance that is asked
/// of it.
pub(crate) const EDGE: f32 = 0.03;
/// Most cells; a larger region gets larger ones.
const MAX_CELLS: f64 = 16e6;
/// Least tolerance, in cells, for which the grid is asked.
pub(crate) const COARSE: f32 = 1.4;
/// Tolerances that the grid is asked for, from the least on, each so many times the one before: a
/// twentieth more or less than was asked for tells no place from another.
pub(crate) const RUNG: f32 = 1.1;
const N_RUNGS: usize = 16;
/// Unit of the distances in a cell, metres.
const UNIT: f32 = 0.004;
/// In `off`: no beam got near. In `ahead`: beams went there and none came back.
const NOTHING: u8 = 255;

/// What is known of one place.
#[derive(Debug, Clone, Copy)]
struct EvidenceCell {
    /// By how much the beam that went farthest went on beyond it, in units; 0 for none.
    ahead: u8,
    /// Distance from the nearest end of a beam along it, in units.
    off: u8,
}

impl EvidenceCell {
    /// What a sample at such a place scores, without regard to the side from which a beam comes, in
    /// [`SCORE_UNIT`]s.
    fn score(self, tolerance: f32) -> i8 {
        let through = match self.ahead {
            NOTHING => NO_RETURN_WEIGHT,
            ahead => ((f32::from(ahead) * UNIT - tolerance) / tolerance).clamp(0.0, 1.0),
        };
        let on = match self.off {
            NOTHING => 0.0,
            off => 1.0 - f32::from(off) * UNIT / tolerance,
        };
        let mut probe = Probe::default();
        probe.count(through, on);
        match (probe.score / SCORE_UNIT).round() as i8 {
            _ if probe.n_seen == 0 => UNJUDGED,
            // Only what is hidden scores this.
            UNJUDGED => UNJUDGED - 1,
            score => score,
        }
    }
}

/// A grid of evidence in the local frame.
#[derive(Debug)]
pub(crate) struct EvidenceGrid {
    min: [f32; 3],
    pub(crate) edge: f32,
    n: [usize; 3],
    cells: Vec<EvidenceCell>,
    /// What each cell scores, for each rung of tolerance that was asked for.
    scores: [OnceLock<Vec<i8>>; N_RUNGS],
}

impl EvidenceGrid {
    /// The region's grid; `None` where there are no beams.
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
        // Cells beside each other are asked together.
        let layer = |k: usize| -> Vec<EvidenceCell> {
            let mut layer = Vec::with_capacity(n[0] * n[1]);
            for (j, first) in (0..n[1]).flat_map(|j| (0..n[0]).step_by(LANES).map(move |i| (j, i)))
            {
                let place = |lane: usize| [middle(0, first + lane), middle(1, j), middle(2, k)];
                let local = lanes(&std::array::from_fn::<_, LANES, _>(place));
                let mut known = GatheredBeams::default();
                evidence.eyes().iter().for_each(|eye| known.add(&eye.look_lanes(&local, edge)));
                let packed = known.packed();
                layer.extend_from_slice(&packed[..LANES.min(n[0] - first)]);
            }
            layer
        };
        let cells = fan.fan((0..n[2]).collect(), layer).concat();
        Some(Self { min, edge, n, cells, scores: Default::default() })
    }

    /// The grid at the rung nearest to a tolerance; `None` where it is too fine to be asked.
    pub(crate) fn at_tolerance(&self, tolerance: f32) -> Option<ScoreGrid<'_>> {
        let least = COARSE * self.edge;
        if tolerance < least {
            return None;
        }
        let rung = ((tolerance / least).ln() / RUNG.ln()).round() as usize;
        let rung = rung.min(N_RUNGS - 1);
        let tolerance = least * RUNG.powi(rung as i32);
        let scores = self.scores[rung].get_or_init(|| self.score(tolerance));
        Some(ScoreGrid { min: self.min, edge: self.edge, n: self.n.map(|n| n as i32), scores })
    }

    /// The scores of all cells at a tolerance.
    fn score(&self, tolerance: f32) -> Vec<i8> {
        let of =
            |at: usize| EvidenceCell { ahead: (at >> 8) as u8, off: at as u8 }.score(tolerance);
        let all: Vec<i8> = (0..1 << 16).map(of).collect();
        let score = |c: &EvidenceCell| all[usize::from(c.ahead) << 8 | usize::from(c.off)];
        self.cells.iter().map(score).collect()
    }
}

/// What the scans say about places beside each other, being gathered.
#[derive(Debug, Clone, Copy)]
struct GatheredBeams {
    ahead: [f32; LANES],
    off: [f32; LANES],
    is_silent: [bool; LANES],
}

impl Default for GatheredBeams {
    fn default() -> Self {
        Self { ahead: [0.0; LANES], off: [f32::INFINITY; LANES], is_silent: [false; LANES] }
    }
}

impl GatheredBeams {
    #[inline]
    fn add(&mut self, looks: &Looks) {
        for i in 0..LANES {
            let [near, far, range] = [looks.near[i], looks.far[i], looks.range[i]];
            let is_known = !near.is_nan();
            let ahead = looks.around[i] - range;
            let is_silent = ahead == f32::INFINITY;
            let off = (near - range).abs().min((far - range).abs());
            self.is_silent[i] |= is_known & is_silent;
            // `max` and `min` pass NaN over.
            let ahead = if is_known & !is_silent { ahead } else { f32::NAN };
            self.ahead[i] = self.ahead[i].max(ahead);
            self.off[i] = self.off[i].min(if is_known { off } else { f32::NAN });
        }
    }

    #[inline]
    fn packed(&self) -> [EvidenceCell; LANES] {
        let units = |v: f32| ((v / UNIT) as u32).min(u32::from(NOTHING) - 1) as u8;
        std::array::from_fn(|i| {
            let is_silent = self.is_silent[i] && self.ahead[i] <= 0.0;
            EvidenceCell {
                ahead: if is_silent { NOTHING } else { units(self.ahead[i]) },
                off: if self.off[i].is_finite() { units(self.off[i]) } else { NOTHING },
            }
        })
    }
}
