//! The evidence of a region, prepared for the searches of all models: depth images, a grid for
//! quick scores, and the cubes that hold points.

use contract::{Fan, Region, View};
use geometry::probe::HIDDEN_PRICE;
use geometry::{Aabb, Evidence, Eye, Pose, Probe, Vector};

use crate::evidence_grid::{EDGE, EvidenceGrid, RUNG, WIDE};
use crate::score_grid::{RowAxis, ScoreGrid, Stencil};
use crate::trial::{HIDDEN, SampleScore, Samples};

/// The points of a small cube.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PointCube {
    /// Mean of its points; region frame, metres.
    pub(crate) at: [f32; 3],
    pub(crate) n_points: u32,
}

/// The evidence of a region, prepared for the searches of all models.
#[derive(Debug)]
pub struct RegionEvidence<'a> {
    pub(crate) region: &'a Region,
    pub(crate) views: &'a [View],
    pub(crate) evidence: &'a Evidence<'a>,
    /// `None` if the evidence has no beams.
    grid: Option<EvidenceGrid>,
    /// The evidence of each scan, if scans are scored one by one; otherwise empty.
    pub(crate) by_scan: Vec<Evidence<'a>>,
    /// The cubes that hold points.
    all_cubes: Vec<PointCube>,
    /// The cubes that count as points near a base.
    point_cubes: Vec<PointCube>,
}

impl<'a> RegionEvidence<'a> {
    /// Prepares the evidence of a region. `all` is the evidence of all views, for quick scores;
    /// `scouts` is the evidence that single poses are scored by.
    #[must_use]
    pub fn new(
        region: &'a Region,
        views: &'a [View],
        all: &Evidence<'_>,
        scouts: &'a Evidence<'a>,
        fan: &dyn Fan,
    ) -> Self {
        let grid = EvidenceGrid::new(region, all, fan);
        let all_cubes = point_cubes(views, fan);
        let (by_scan, point_cubes) = (Vec::new(), all_cubes.clone());
        Self { region, views, evidence: scouts, grid, by_scan, all_cubes, point_cubes }
    }

    /// The same evidence with each scan by itself, for robots that moved between scans.
    #[must_use]
    pub fn scan_by_scan(mut self) -> Self {
        let with_beams = self.views.iter().filter(|v| !v.images.is_empty());
        let alone = |v: &'a View| Evidence::new([Eye::new(&v.images)], None);
        self.by_scan = with_beams.map(alone).collect();
        self.point_cubes.clone_from(&self.all_cubes);
        self
    }

    /// Ignores the points inside the boxes (world frame, metres). Returns the number of the other
    /// points that are more than `height` (metres) above the lowest of the region.
    pub fn exclude_boxes(&mut self, boxes: &[Aabb], height: f64) -> usize {
        let origin = self.region.origin;
        let is_free = |spot: &&PointCube| {
            let world = origin + Vector::from(spot.at.map(f64::from));
            !boxes.iter().any(|b| b.contains(world.into()))
        };
        self.point_cubes = self.all_cubes.iter().filter(is_free).copied().collect();
        let least = self.region.bounds.min[2] + height;
        let high = self.point_cubes.iter().filter(|spot| f64::from(spot.at[2]) > least);
        high.map(|spot| spot.n_points as usize).sum()
    }

    /// The cubes that count as points near a base.
    pub(crate) fn point_cubes(&self) -> &[PointCube] {
        &self.point_cubes
    }

    /// Quick score of surface samples, to exclude most poses: from the grid if the tolerance
    /// (metres) allows, otherwise from the depth images.
    pub(crate) fn quick_score(
        &self,
        samples: Samples<'_>,
        local_from_body: &Pose,
        tolerance: f32,
    ) -> SampleScore {
        match self.at_tolerance(tolerance) {
            Some(scores) => scores.look_up(samples.points, local_from_body),
            None => self.rating(&samples.probe(self.evidence, local_from_body, tolerance)),
        }
    }

    /// Whether a tolerance (metres) is so much wider than a cell of the grid that its rounding does
    /// not matter.
    pub(crate) fn is_coarse(&self, tolerance: f32) -> bool {
        self.grid.as_ref().is_none_or(|grid| tolerance >= WIDE * grid.edge)
    }

    /// Samples of a body at a pose that it is then shifted from, mostly along an axis, for many
    /// quick scores; `None` if the grid does not serve the tolerance (metres).
    pub(crate) fn stencil(
        &self,
        axis: RowAxis,
        points: &[[f32; 3]],
        local_from_body: &Pose,
        tolerance: f32,
    ) -> Option<Stencil<'_>> {
        self.at_tolerance(tolerance).map(|scores| scores.stencil(axis, points, local_from_body))
    }

    fn at_tolerance(&self, tolerance: f32) -> Option<ScoreGrid<'_>> {
        self.grid.as_ref().and_then(|grid| grid.at_tolerance(tolerance))
    }

    /// The tolerance itself, or the least one of the grid if that is slightly larger; metres.
    pub(crate) fn grid_tolerance(&self, tolerance: f32) -> f32 {
        let least = self.grid.as_ref().map_or(0.0, |grid| WIDE * grid.edge);
        if tolerance * RUNG >= least { tolerance.max(least) } else { tolerance }
    }

    /// The length, rounded down to whole cells of the grid, metres; unchanged if it is shorter than
    /// a cell or there is no grid.
    pub(crate) fn whole_cells(&self, length: f64) -> f64 {
        let edge = self.grid.as_ref().map_or(f64::INFINITY, |grid| f64::from(grid.edge));
        if edge <= length { (length / edge).floor() * edge } else { length }
    }

    /// The score of a probe.
    pub(crate) fn rating(&self, probe: &Probe) -> SampleScore {
        SampleScore::of(probe, self.mean(probe))
    }

    /// Mean score of the samples of a probe, with the price of a hidden sample of a base.
    pub(crate) fn mean(&self, probe: &Probe) -> f64 {
        let back = if self.evidence.has_beams() { HIDDEN_PRICE - HIDDEN } else { 0.0 };
        let score = probe.score + back * (probe.n - probe.n_seen) as f32;
        f64::from(score / probe.n.max(1) as f32)
    }
}

/// The sum of the points of one cube.
#[derive(Debug, Clone, Copy)]
struct CubeSum {
    /// Key of the cube, see [`cube`].
    cube: u64,
    /// Sum of their coordinates; region frame, metres.
    sum: [f64; 3],
    n_points: u32,
}

/// The points of all views by cube, in the order of the cubes' keys.
fn point_cubes(views: &[View], fan: &dyn Fan) -> Vec<PointCube> {
    // Neighbouring beams mostly end in the same cube, so that there are far fewer runs of points
    // than points.
    let of_view = |view: &View| {
        let mut runs: Vec<CubeSum> = Vec::new();
        for p in &view.points {
            let cube_sum = CubeSum { cube: cube(p), sum: p.map(f64::from), n_points: 1 };
            match runs.last_mut() {
                Some(run) if run.cube == cube_sum.cube => add(run, &cube_sum),
                _ => runs.push(cube_sum),
            }
        }
        // Moving keys is cheaper than moving sums.
        runs.sort_by_cached_key(|cube_sum| cube_sum.cube);
        merged(runs)
    };
    let mut all = fan.fan(views.iter().collect(), of_view).concat();
    // The sums of each view are sorted, and the stable sort merges them.
    all.sort_by_key(|cube_sum| cube_sum.cube);
    let mean = |cube_sum: &CubeSum| cube_sum.sum.map(|v| (v / f64::from(cube_sum.n_points)) as f32);
    merged(all)
        .iter()
        .map(|cube_sum| PointCube { at: mean(cube_sum), n_points: cube_sum.n_points })
        .collect()
}

/// One sum for each cube, from sums in the order of the cubes' keys.
fn merged(mut sums: Vec<CubeSum>) -> Vec<CubeSum> {
    sums.dedup_by(|later, first| {
        let is_same = later.cube == first.cube;
        if is_same {
            add(first, later);
        }
        is_same
    });
    sums
}

fn add(to: &mut CubeSum, more: &CubeSum) {
    to.sum.iter_mut().zip(&more.sum).for_each(|(sum, v)| *sum += v);
    to.n_points += more.n_points;
}

/// Key of the cube at a place in the region's frame, ordered by x, y, z: 21 bits each, which is 30
/// km in either direction.
fn cube(p: &[f32; 3]) -> u64 {
    const MIDDLE: i32 = 1 << 20;
    let along =
        |v: f32| ((v / EDGE).floor() as i32).saturating_add(MIDDLE).clamp(0, 2 * MIDDLE - 1);
    p.iter().fold(0, |cube, v| cube << 21 | along(*v) as u64)
}
