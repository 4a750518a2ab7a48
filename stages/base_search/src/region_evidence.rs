//! The views of a region in; what searches of all models ask of it out: its evidence, a grid of
//! that for coarse looks, and where there are points that a base may stand among.

use contract::{Fan, Region, View};
use geometry::probe::HIDDEN_PRICE;
use geometry::{Aabb, Evidence, Eye, Pose, Probe, Vector};

use crate::evidence_grid::{COARSE, EDGE, EvidenceGrid, RUNG};
use crate::score_grid::{HIDDEN, ScoreGrid, Stencil};
use crate::trial::{SampleScore, Samples};

/// The points of a small cube.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PointCube {
    /// Their mean, local, metres.
    pub(crate) at: [f32; 3],
    pub(crate) n_points: u32,
}

/// What was seen of a region, ready for searches of all models.
#[derive(Debug)]
pub struct RegionEvidence<'a> {
    pub(crate) region: &'a Region,
    pub(crate) views: &'a [View],
    pub(crate) evidence: &'a Evidence<'a>,
    /// Nothing where there are no beams.
    grid: Option<EvidenceGrid>,
    /// What each scan sees by itself, where they are to be asked one by one; else empty.
    pub(crate) each: Vec<Evidence<'a>>,
    /// Where there are points.
    all_spots: Vec<PointCube>,
    /// Those of them that a base may stand among.
    spots: Vec<PointCube>,
}

impl<'a> RegionEvidence<'a> {
    /// Prepares it, from what all views say, and those by which single poses are judged.
    #[must_use]
    pub fn new(
        region: &'a Region,
        views: &'a [View],
        all: &Evidence<'_>,
        scouts: &'a Evidence<'a>,
        fan: &dyn Fan,
    ) -> Self {
        let grid = EvidenceGrid::new(region, all, fan);
        let all_spots = spots(views, fan);
        let (each, spots) = (Vec::new(), all_spots.clone());
        Self { region, views, evidence: scouts, grid, each, all_spots, spots }
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
        let is_free = |spot: &&PointCube| {
            let world = origin + Vector::from(spot.at.map(f64::from));
            !boxes.iter().any(|b| b.contains(world.into()))
        };
        self.spots = self.all_spots.iter().filter(is_free).copied().collect();
        let least = self.region.bounds.min[2] + height;
        let high = self.spots.iter().filter(|spot| f64::from(spot.at[2]) > least);
        high.map(|spot| spot.n_points as usize).sum()
    }

    /// Where there are points that a base may stand among.
    pub(crate) fn spots(&self) -> &[PointCube] {
        &self.spots
    }

    /// A quick judgement of surface samples, to tell the
    /// hopeless: from the grid where the tolerance allows.
    pub(crate) fn glance(
        &self,
        samples: Samples<'_>,
        local_from_body: &Pose,
        tolerance: f32,
    ) -> SampleScore {
        match self.at_tolerance(tolerance) {
            Some(scores) => scores.ask(samples.points, local_from_body),
            None => self.said(&samples.probe(self.evidence, local_from_body, tolerance)),
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
        self.at_tolerance(tolerance).map(|scores| scores.stencil(points, local_from_body))
    }

    fn at_tolerance(&self, tolerance: f32) -> Option<ScoreGrid<'_>> {
        self.grid.as_ref().and_then(|grid| grid.at_tolerance(tolerance))
    }

    /// A tolerance that the grid can be asked for, where one a little wider than this is.
    pub(crate) fn of_grid(&self, tolerance: f32) -> f32 {
        let least = self.grid.as_ref().map_or(0.0, |grid| COARSE * grid.edge);
        if tolerance * RUNG >= least { tolerance.max(least) } else { tolerance }
    }

    /// The length of as many whole cells of the grid as it holds, metres; itself where it holds
    /// none.
    pub(crate) fn in_cells(&self, length: f64) -> f64 {
        let edge = self.grid.as_ref().map_or(f64::INFINITY, |grid| f64::from(grid.edge));
        if edge <= length { (length / edge).floor() * edge } else { length }
    }

    /// What a probe of them says.
    pub(crate) fn said(&self, probe: &Probe) -> SampleScore {
        SampleScore::of(probe, self.mean(probe))
    }

    /// Mean score of the samples, hidden ones at their price for a base.
    pub(crate) fn mean(&self, probe: &Probe) -> f64 {
        let back = if self.evidence.has_beams() { HIDDEN_PRICE - HIDDEN } else { 0.0 };
        let score = probe.score + back * (probe.n - probe.n_seen) as f32;
        f64::from(score / probe.n.max(1) as f32)
    }
}

/// The points of one cube.
#[derive(Debug, Clone, Copy)]
struct CubeSum {
    /// Number of the cube, see [`cube`].
    cube: u64,
    /// Sum of their coordinates, local, metres.
    sum: [f64; 3],
    n_points: u32,
}

/// The points of all views, cube by cube.
fn spots(views: &[View], fan: &dyn Fan) -> Vec<PointCube> {
    // Beams beside each other mostly end in one cube: there are far fewer runs of points than
    // points.
    let of_view = |view: &View| {
        let mut runs: Vec<CubeSum> = Vec::new();
        for p in &view.points {
            let own = CubeSum { cube: cube(p), sum: p.map(f64::from), n_points: 1 };
            match runs.last_mut() {
                Some(run) if run.cube == own.cube => add(run, &own),
                _ => runs.push(own),
            }
        }
        // Numbers are moved about sooner than sums.
        runs.sort_by_cached_key(|own| own.cube);
        joined(runs)
    };
    let mut all = fan.fan(views.iter().collect(), of_view).concat();
    // View by view they are in order: the stable sort merges them.
    all.sort_by_key(|own| own.cube);
    let mean = |own: &CubeSum| own.sum.map(|v| (v / f64::from(own.n_points)) as f32);
    joined(all).iter().map(|own| PointCube { at: mean(own), n_points: own.n_points }).collect()
}

/// One sum for each cube, of sums in the order of the cubes.
fn joined(mut sums: Vec<CubeSum>) -> Vec<CubeSum> {
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

/// The cube of a place in a region's frame, in the order of x, y, z: 21 bits each, 60 km either
/// way.
fn cube(p: &[f32; 3]) -> u64 {
    const MIDDLE: i32 = 1 << 20;
    let along =
        |v: f32| ((v / EDGE).floor() as i32).saturating_add(MIDDLE).clamp(0, 2 * MIDDLE - 1);
    p.iter().fold(0, |cube, v| cube << 21 | along(*v) as u64)
}
