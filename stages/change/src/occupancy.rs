//! Counts the points of one session by voxel, with what the other session's beams show about their
//! places: which voxels are solid, which changed, and how much of their faces the points cover.

use geometry::Aabb;
use rustc_hash::FxHashMap;
use std::collections::BTreeSet;
use std::ops::RangeInclusive;

/// Index of a voxel in the world frame: `floor(p / edge)`.
pub(crate) type OccupancyCell = [i32; 3];

/// Edge of a voxel, metres.
pub(crate) const EDGE: f64 = 0.05;
/// Voxels per metre: a multiplication is cheaper than a division.
const PER_METRE: f64 = 1.0 / EDGE;
/// Voxels at most this many steps apart belong to one thing.
pub(crate) const REACH: i32 = 2;
/// Fewest points that make a voxel solid.
pub(crate) const MIN_POINTS: u32 = 3;
/// Least share of a voxel's points whose places the other session must have seen empty (or not at
/// all) for the voxel to count as changed (or as unobserved).
const MIN_SHARE: f64 = 0.6;

/// The points of one session by voxel, with what the other session shows about their places. No
/// result depends on the order of the voxels.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SessionOccupancy {
    cells: FxHashMap<OccupancyCell, CellCount>,
    /// Voxels with points of robots or of what is attached to them.
    robots: BTreeSet<OccupancyCell>,
}

/// What the beams of another session show about the place of a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SessionEvidence {
    /// No beam reached the place.
    Unobserved,
    /// A beam ended at the place, or so close that it may have hit the same surface.
    Occupied,
    /// The beams ended beyond the place: it is empty.
    Empty {
        /// Whether another beam of the point's own session passed the place as well, as at a wire
        /// or an edge.
        is_pierced: bool,
    },
}

/// The counts of one voxel.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct CellCount {
    n_points: u32,
    /// Points whose places the other session saw empty.
    n_empty: u32,
    /// Points among these that another beam of their own session passed.
    n_pierced: u32,
    /// Points whose places no beam of the other session reached.
    n_unseen: u32,
    /// Area across the beams that the points represent, m².
    area: f64,
    /// Number of points and their area (m²) of the scan that has most points in the voxel.
    most: (u32, f64),
}

impl CellCount {
    fn join(&mut self, other: &Self) {
        self.n_points += other.n_points;
        self.n_empty += other.n_empty;
        self.n_pierced += other.n_pierced;
        self.n_unseen += other.n_unseen;
        self.area += other.area;
        if self.most < other.most {
            self.most = other.most;
        }
    }
}

/// Counts the points of one scan by voxel. Consecutive points of a scan mostly lie in the same
/// voxel, so that one run of them needs one look-up.
#[derive(Debug, Default)]
pub struct OccupancyBuilder {
    cells: FxHashMap<OccupancyCell, CellCount>,
    last: Option<(OccupancyCell, CellCount)>,
    robots: Vec<OccupancyCell>,
}

impl OccupancyBuilder {
    /// Adds a point that does not belong to a robot (world frame, metres), with the area across its
    /// beam that it represents (m²) and what the other session shows about its place.
    #[inline]
    pub fn add(&mut self, world: [f64; 3], area: f64, seen: SessionEvidence) {
        let cell = SessionOccupancy::cell(world);
        let point = CellCount {
            n_points: 1,
            n_empty: u32::from(matches!(seen, SessionEvidence::Empty { .. })),
            n_pierced: u32::from(seen == SessionEvidence::Empty { is_pierced: true }),
            n_unseen: u32::from(seen == SessionEvidence::Unobserved),
            area,
            most: (0, 0.0),
        };
        match &mut self.last {
            Some((last, count)) if *last == cell => count.join(&point),
            last => {
                let whole = last.replace((cell, point));
                self.join(whole);
            }
        }
    }

    fn join(&mut self, run: Option<(OccupancyCell, CellCount)>) {
        if let Some((cell, count)) = run {
            self.cells.entry(cell).or_default().join(&count);
        }
    }

    /// Adds a point of a robot or of what is attached to it; world frame, metres.
    #[inline]
    pub fn add_robot(&mut self, world: [f64; 3]) {
        let cell = SessionOccupancy::cell(world);
        if self.robots.last() != Some(&cell) {
            self.robots.push(cell);
        }
    }

    /// Returns the counts of all added points.
    #[must_use]
    pub fn finish(mut self) -> SessionOccupancy {
        let last = self.last.take();
        self.join(last);
        self.cells.values_mut().for_each(|all| all.most = (all.n_points, all.area));
        SessionOccupancy { cells: self.cells, robots: self.robots.into_iter().collect() }
    }
}

impl SessionOccupancy {
    /// Area of one face of a voxel, m².
    pub const FACE: f64 = EDGE * EDGE;

    /// The voxel that contains a place; world frame, metres.
    #[inline]
    #[must_use]
    pub fn cell(world: [f64; 3]) -> OccupancyCell {
        let step = |v: f64| (v * PER_METRE).floor() as i32;
        [step(world[0]), step(world[1]), step(world[2])]
    }

    /// Centres of voxels; world frame, metres.
    #[must_use]
    pub fn centres(cells: &[OccupancyCell]) -> Vec<[f64; 3]> {
        cells.iter().map(|c| c.map(|i| (f64::from(i) + 0.5) * EDGE)).collect()
    }

    /// All voxels with points.
    #[cfg(test)]
    pub(crate) fn cells(&self) -> impl Iterator<Item = &OccupancyCell> {
        self.cells.keys()
    }

    /// Centres of the solid voxels, sorted by voxel; world frame, metres.
    #[must_use]
    pub fn solid(&self) -> Vec<[f64; 3]> {
        let solid = self.cells.iter().filter(|(_, c)| c.n_points >= MIN_POINTS);
        let mut solid: Vec<OccupancyCell> = solid.map(|(cell, _)| *cell).collect();
        solid.sort_unstable();
        Self::centres(&solid)
    }

    /// Adds the counts of another scan or session.
    pub fn join(&mut self, other: Self) {
        let all = other.cells.into_iter();
        all.for_each(|(cell, count)| self.cells.entry(cell).or_default().join(&count));
        self.robots.extend(other.robots);
    }

    /// Whether a voxel at most `reach` steps away holds points of a robot.
    pub(crate) fn has_robot_near(&self, cell: &OccupancyCell, reach: i32) -> bool {
        columns(cell, reach).any(|column| self.robots.range(column).next().is_some())
    }

    /// Whether a voxel or one of its 26 neighbours holds points. What the other session has in the
    /// voxel is then not missing here.
    #[must_use]
    pub fn has_points_near(&self, cell: &OccupancyCell) -> bool {
        self.cells.contains_key(cell) || around(cell, 1).any(|cell| self.cells.contains_key(&cell))
    }

    /// Whether a voxel holds points.
    pub(crate) fn has_points(&self, cell: &OccupancyCell) -> bool {
        self.cells.contains_key(cell)
    }

    pub(crate) fn is_solid(&self, cell: &OccupancyCell) -> bool {
        self.cells.get(cell).is_some_and(|c| c.n_points >= MIN_POINTS)
    }

    /// Number of points in some voxels.
    pub(crate) fn n_points(&self, cells: &[OccupancyCell]) -> u64 {
        cells.iter().map(|c| u64::from(self.cells[c].n_points)).sum()
    }

    /// Voxels whose points lie where the other session saw empty space, and which have no points of
    /// the other session in or beside them. (Another session may have only single points of a wire
    /// or an edge.)
    pub(crate) fn changed(&self, other: &Self) -> BTreeSet<OccupancyCell> {
        self.without_counterpart(other, |c| c.n_empty)
    }

    /// Solid voxels that no beam of the other session reached.
    pub(crate) fn unseen(&self, other: &Self) -> BTreeSet<OccupancyCell> {
        let mut out = self.without_counterpart(other, |c| c.n_unseen);
        out.retain(|cell| self.is_solid(cell));
        out
    }

    /// Voxels in which `n` of the points are at least the share [`MIN_SHARE`], and in and beside
    /// which the other session has no points.
    fn without_counterpart(
        &self,
        other: &Self,
        n: impl Fn(&CellCount) -> u32,
    ) -> BTreeSet<OccupancyCell> {
        let is_enough = |c: &CellCount| f64::from(n(c)) >= MIN_SHARE * f64::from(c.n_points);
        let full = self.cells.iter().filter(|(_, c)| is_enough(c));
        full.map(|(cell, _)| *cell).filter(|cell| !other.has_points_near(cell)).collect()
    }

    /// Share of the faces of some voxels that their points cover.
    pub(crate) fn cover(&self, cells: &[OccupancyCell]) -> f64 {
        let area: f64 = cells.iter().map(|c| self.cells[c].area).sum();
        area / (cells.len() as f64 * Self::FACE)
    }

    /// Like [`Self::cover`], but of each voxel only the points of the scan with most points in it.
    pub(crate) fn cover_by_one(&self, cells: &[OccupancyCell]) -> f64 {
        let area: f64 = cells.iter().map(|c| self.cells[c].most.1).sum();
        area / (cells.len() as f64 * Self::FACE)
    }

    /// Share of the points in some voxels that another beam of their own session passed.
    pub(crate) fn pierced(&self, cells: &[OccupancyCell]) -> f64 {
        let n: u64 = cells.iter().map(|c| u64::from(self.cells[c].n_pierced)).sum();
        n as f64 / self.n_points(cells) as f64
    }
}

/// All voxels at most `reach` steps away from one, itself included.
pub(crate) fn around(cell: &OccupancyCell, reach: i32) -> impl Iterator<Item = OccupancyCell> {
    let ([x, y, z], r) = (*cell, reach);
    (-r..=r)
        .flat_map(move |i| (-r..=r).flat_map(move |j| (-r..=r).map(move |k| [x + i, y + j, z + k])))
}

/// The voxels of [`around`] as ranges along the last axis, in which voxels are sorted.
fn columns(
    cell: &OccupancyCell,
    reach: i32,
) -> impl Iterator<Item = RangeInclusive<OccupancyCell>> {
    let ([x, y, z], r) = (*cell, reach);
    let column = move |i, j| [x + i, y + j, z - r]..=[x + i, y + j, z + r];
    (-r..=r).flat_map(move |i| (-r..=r).map(move |j| column(i, j)))
}

/// The voxels that are connected with `first` by steps of at most `reach`, sorted. `take` returns
/// whether a voxel belongs to the set and was not taken before. The search stops at `at_most`
/// voxels or a few more.
pub(crate) fn connected(
    first: OccupancyCell,
    reach: i32,
    mut take: impl FnMut(&OccupancyCell) -> bool,
    at_most: usize,
) -> Vec<OccupancyCell> {
    let mut out = vec![first];
    let mut next = 0;
    while next < out.len() && out.len() < at_most {
        let cell = out[next];
        next += 1;
        out.extend(around(&cell, reach).filter(|c| take(c)));
    }
    out.sort_unstable();
    out
}

/// Bounds of some voxels; world frame, metres.
pub(crate) fn bounds<'a>(cells: impl IntoIterator<Item = &'a OccupancyCell>) -> Aabb {
    let mut out = Aabb::EMPTY;
    for cell in cells {
        out.add(cell.map(|i| f64::from(i) * EDGE));
        out.add(cell.map(|i| f64::from(i + 1) * EDGE));
    }
    out
}
