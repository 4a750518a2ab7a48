//! The evidence of a region in; out comes a grid of it: what the beams say about each place, looked
//! up once for all models and all base poses of a search instead of once for each sample.

use contract::{Fan, Region, View};
use geometry::depth::{LANES, Looks, lanes};
use geometry::probe::{HIDDEN_PRICE, NO_RETURN_WEIGHT};
use geometry::{Aabb, Evidence, Eye, Pose, Probe, Vector};
use std::sync::OnceLock;

use crate::score_grid::{Graded, HIDDEN, SCORE_UNIT, Stencil, UNJUDGED};
use crate::trial::Said;

/// Edge of a cell, and of the cubes of points, metres: half of the finest tolerance that is asked
/// of it.
const EDGE: f32 = 0.03;
/// Most cells; a larger region gets larger ones.
const MAX_CELLS: f64 = 16e6;
/// Least tolerance, in cells, for which the grid is asked.
const COARSE: f32 = 1.4;
/// Tolerances that the grid is asked for, from the least on, each so many times the one before: a
/// twentieth more or less than was asked for tells no place from another.
const RUNG: f32 = 1.1;
const N_RUNGS: usize = 16;
/// Unit of the distances in a cell, metres.
const UNIT: f32 = 0.004;
/// In `off`: no beam got near. In `ahead`: beams went there and none came back.
const NOTHING: u8 = 255;

/// What is known of one place.
#[derive(Debug, Clone, Copy)]
struct Cell {
    /// By how much the beam that went farthest went on beyond it, in units; 0 for none.
    ahead: u8,
    /// Distance from the nearest end of a beam along it, in units.
    off: u8,
}

impl Cell {
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

/// The points of a small cube.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Spot {
    /// Their mean, local, metres.
    pub(crate) at: [f32; 3],
    pub(crate) n_points: u32,
}

/// What was seen of a region, ready for searches of all models.
#[derive(Debug)]
pub struct Sight<'a> {
    pub(crate) region: &'a Region,
    pub(crate) views: &'a [View],
    pub(crate) evidence: &'a Evidence<'a>,
    /// Nothing where there are no beams.
    volume: Option<Volume>,
    /// What each scan sees by itself, where they are to be asked one by one; else empty.
    pub(crate) each: Vec<Evidence<'a>>,
    /// Where there are points.
    all_spots: Vec<Spot>,
    /// Those of them that a base may stand among.
    spots: Vec<Spot>,
}

impl<'a> Sight<'a> {
    /// Prepares it, from what all views say, and those by which single poses are judged.
    #[must_use]
    pub fn new(
        region: &'a Region,
        views: &'a [View],
        (all, scouts): (&Evidence<'_>, &'a Evidence<'a>),
        fan: &dyn Fan,
    ) -> Self {
        let volume = Volume::new(region, all, fan);
        let all_spots = spots(views, fan);
        let (each, spots) = (Vec::new(), all_spots.clone());
        Self { region, views, evidence: scouts, volume, each, all_spots, spots }
    }

    /// The same for robots that moved between scans: what moves is looked for in each scan by
    /// itself.
    #[must_use]
    pub fn apart(mut self) -> Self {
        let with_beams = self.views.iter().filter(|v| !v.images.is_empty());
        let alone = |v: &'a View| Evidence::new([Eye::new(&v.images)], None);
        self.each = with_beams.map(alone).collect();
        self.spots.clone_from(&self.all_spots);
        self
    }

    /// Lets only points count that are in none of the boxes (world, metres), and says how many
    /// there are higher than `height` above the region's lowest, metres.
    pub fn pass_over(&mut self, boxes: &[Aabb], height: f64) -> usize {
        let origin = self.region.origin;
        let is_free = |spot: &&Spot| {
            let world = origin + Vector::from(spot.at.map(f64::from));
            !boxes.iter().any(|b| b.contains(world.into()))
        };
        self.spots = self.all_spots.iter().filter(is_free).copied().collect();
        let least = self.region.bounds.min[2] + height;
        let high = self.spots.iter().filter(|spot| f64::from(spot.at[2]) > least);
        high.map(|spot| spot.n_points as usize).sum()
    }

    /// Where there are points that a base may stand among.
    pub(crate) fn spots(&self) -> &[Spot] {
        &self.spots
    }

    /// A quick judgement of surface samples and their normals (frame of the body), to tell the
    /// hopeless: from the grid where the tolerance allows.
    pub(crate) fn glance(
        &self,
        (points, normals): (&[[f32; 3]], &[[f32; 3]]),
        local_from_body: &Pose,
        tolerance: f32,
    ) -> Said {
        match self.graded(tolerance) {
            Some(graded) => graded.ask(points, local_from_body),
            None => self.said(&self.evidence.probe(points, normals, local_from_body, tolerance)),
        }
    }

    /// Samples of a body at a pose from which it will be moved about, for glances by the thousand;
    /// `None` where there is no grid for the tolerance.
    pub(crate) fn stencil(
        &self,
        points: &[[f32; 3]],
        local_from_body: &Pose,
        tolerance: f32,
    ) -> Option<Stencil<'_>> {
        self.graded(tolerance).map(|graded| graded.stencil(points, local_from_body))
    }

    fn graded(&self, tolerance: f32) -> Option<Graded<'_>> {
        self.volume.as_ref().and_then(|volume| volume.graded(tolerance))
    }

    /// A tolerance that the grid can be asked for, where one a little wider than this is.
    pub(crate) fn of_grid(&self, tolerance: f32) -> f32 {
        let least = self.volume.as_ref().map_or(0.0, |volume| COARSE * volume.edge);
        if tolerance * RUNG >= least { tolerance.max(least) } else { tolerance }
    }

    /// The length of as many whole cells of the grid as it holds, metres; itself where it holds
    /// none.
    pub(crate) fn in_cells(&self, length: f64) -> f64 {
        let edge = self.volume.as_ref().map_or(f64::INFINITY, |volume| f64::from(volume.edge));
        if edge <= length { (length / edge).floor() * edge } else { length }
    }

    /// What a probe of them says.
    pub(crate) fn said(&self, probe: &Probe) -> Said {
        Said::of(probe, self.mean(probe))
    }

    /// Mean score of the samples, hidden ones at their price for a base.
    pub(crate) fn mean(&self, probe: &Probe) -> f64 {
        let back = if self.evidence.has_beams() { HIDDEN_PRICE - HIDDEN } else { 0.0 };
        let score = probe.score + back * (probe.n - probe.n_seen) as f32;
        f64::from(score / probe.n.max(1) as f32)
    }
}

/// Points of a cube: their sum, metres, and how many they are.
type Sum = (u64, [f64; 3], u32);

/// The points of all views, cube by cube.
fn spots(views: &[View], fan: &dyn Fan) -> Vec<Spot> {
    // Beams beside each other mostly end in one cube: there are far fewer runs of points than
    // points.
    let of_view = |view: &View| {
        let mut runs: Vec<Sum> = Vec::new();
        for p in &view.points {
            let (cube, at) = (cube(p), p.map(f64::from));
            match runs.last_mut() {
                Some(run) if run.0 == cube => add(run, &(cube, at, 1)),
                _ => runs.push((cube, at, 1)),
            }
        }
        // Numbers are moved about sooner than sums.
        runs.sort_by_cached_key(|own| own.0);
        joined(runs)
    };
    let mut all = fan.fan(views.iter().collect(), of_view).concat();
    // View by view they are in order: the stable sort merges them.
    all.sort_by_key(|own| own.0);
    let mean = |(_, sum, n): &Sum| sum.map(|v| (v / f64::from(*n)) as f32);
    joined(all).iter().map(|own| Spot { at: mean(own), n_points: own.2 }).collect()
}

/// One sum for each cube, of sums in the order of the cubes.
fn joined(mut sums: Vec<Sum>) -> Vec<Sum> {
    sums.dedup_by(|later, first| {
        let is_same = later.0 == first.0;
        if is_same {
            add(first, later);
        }
        is_same
    });
    sums
}

fn add((_, sum, n): &mut Sum, (_, more, n_more): &Sum) {
    sum.iter_mut().zip(more).for_each(|(sum, v)| *sum += v);
    *n += n_more;
}

/// The cube of a place in a region's frame, in the order of x, y, z: 21 bits each, 60 km either
/// way.
fn cube(p: &[f32; 3]) -> u64 {
    const MIDDLE: i32 = 1 << 20;
    let along =
        |v: f32| ((v / EDGE).floor() as i32).saturating_add(MIDDLE).clamp(0, 2 * MIDDLE - 1);
    p.iter().fold(0, |cube, v| cube << 21 | along(*v) as u64)
}

/// A grid of evidence in the local frame.
#[derive(Debug)]
struct Volume {
    min: [f32; 3],
    edge: f32,
    n: [usize; 3],
    cells: Vec<Cell>,
    /// What each cell scores, for each rung of tolerance that was asked for.
    scores: [OnceLock<Vec<i8>>; N_RUNGS],
}

impl Volume {
    /// The region's grid; `None` where there are no beams.
    fn new(region: &Region, evidence: &Evidence<'_>, fan: &dyn Fan) -> Option<Self> {
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
        let layer = |k: usize| -> Vec<Cell> {
            let mut layer = Vec::with_capacity(n[0] * n[1]);
            for (j, first) in (0..n[1]).flat_map(|j| (0..n[0]).step_by(LANES).map(move |i| (j, i)))
            {
                let place = |lane: usize| [middle(0, first + lane), middle(1, j), middle(2, k)];
                let local = lanes(&std::array::from_fn::<_, LANES, _>(place));
                let mut known = Known::default();
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
    fn graded(&self, tolerance: f32) -> Option<Graded<'_>> {
        let least = COARSE * self.edge;
        if tolerance < least {
            return None;
        }
        let rung = ((tolerance / least).ln() / RUNG.ln()).round() as usize;
        let rung = rung.min(N_RUNGS - 1);
        let tolerance = least * RUNG.powi(rung as i32);
        let scores = self.scores[rung].get_or_init(|| self.score(tolerance));
        Some(Graded { min: self.min, edge: self.edge, n: self.n.map(|n| n as i32), scores })
    }

    /// The scores of all cells at a tolerance.
    fn score(&self, tolerance: f32) -> Vec<i8> {
        let of = |at: usize| Cell { ahead: (at >> 8) as u8, off: at as u8 }.score(tolerance);
        let all: Vec<i8> = (0..1 << 16).map(of).collect();
        let score = |c: &Cell| all[usize::from(c.ahead) << 8 | usize::from(c.off)];
        self.cells.iter().map(score).collect()
    }
}

/// What the scans say about places beside each other, being gathered.
#[derive(Debug, Clone, Copy)]
struct Known {
    ahead: [f32; LANES],
    off: [f32; LANES],
    is_silent: [bool; LANES],
}

impl Default for Known {
    fn default() -> Self {
        Self { ahead: [0.0; LANES], off: [f32::INFINITY; LANES], is_silent: [false; LANES] }
    }
}

impl Known {
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
    fn packed(&self) -> [Cell; LANES] {
        let units = |v: f32| ((v / UNIT) as u32).min(u32::from(NOTHING) - 1) as u8;
        std::array::from_fn(|i| {
            let is_silent = self.is_silent[i] && self.ahead[i] <= 0.0;
            Cell {
                ahead: if is_silent { NOTHING } else { units(self.ahead[i]) },
                off: if self.off[i].is_finite() { units(self.off[i]) } else { NOTHING },
            }
        })
    }
}
