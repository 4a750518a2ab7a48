//! Points of one session that stand still, with what the other session's beams say of their places,
//! in; out come voxels: in which of them something stands, which of them changed, and how much of
//! them is covered.

use geometry::Aabb;
use rustc_hash::FxHashMap;
use std::collections::BTreeSet;
use std::ops::RangeInclusive;

/// A voxel of a world: `floor(p / edge)`.
pub(crate) type OccupancyCell = [i32; 3];

/// Edge of a voxel, metres.
pub(crate) const EDGE: f64 = 0.05;
/// Voxels in a metre: a product is cheaper than a quotient.
const PER_METRE: f64 = 1.0 / EDGE;
/// Voxels so many steps apart are of one thing.
pub(crate) const REACH: i32 = 2;
/// Fewest points that make a voxel solid.
pub(crate) const MIN_POINTS: u32 = 3;
/// Share of a voxel's points whose places the other session must have seen empty, or not at all.
const MIN_SHARE: f64 = 0.6;

/// Points of one session by voxel: how many, and at how many places of theirs the other session saw
/// nothing. Nothing depends on the order of the voxels.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SessionOccupancy {
    cells: FxHashMap<OccupancyCell, CellCount>,
    /// Voxels with points of robots and what hangs on them.
    robots: BTreeSet<OccupancyCell>,
}

/// What another session says of a point's place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SessionEvidence {
    /// None of its beams got there.
    Not,
    /// Some ended there, or so close that it may be the same.
    Something,
    /// They went on beyond it.
    Nothing {
        /// As did another beam of the point's own session: it is of a wire or an edge.
        is_pierced: bool,
    },
}

/// What is in a voxel.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct CellCount {
    n_points: u32,
    /// At whose places the other session saw nothing …
    n_empty: u32,
    /// … and another beam of their own session went on.
    n_pierced: u32,
    /// To whose places no beam of the other session got.
    n_unseen: u32,
    /// That the points stand for, across their beams, m².
    area: f64,
    /// Points, and the same, of the scan that has most of them there.
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

/// Points of one scan that are still to be counted by voxel: neighbours in a scan mostly are in the
/// same one, and cost no search for it.
#[derive(Debug, Default)]
pub struct OccupancyBuilder {
    cells: FxHashMap<OccupancyCell, CellCount>,
    last: Option<(OccupancyCell, CellCount)>,
    robots: Vec<OccupancyCell>,
}

impl OccupancyBuilder {
    /// Adds a point that stands still, and for so much area across its beam, m²; and what the other
    /// session has at its place.
    #[inline]
    pub fn add(&mut self, world: [f64; 3], area: f64, seen: SessionEvidence) {
        let cell = SessionOccupancy::cell(world);
        let point = CellCount {
            n_points: 1,
            n_empty: u32::from(matches!(seen, SessionEvidence::Nothing { .. })),
            n_pierced: u32::from(seen == SessionEvidence::Nothing { is_pierced: true }),
            n_unseen: u32::from(seen == SessionEvidence::Not),
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

    /// Adds a point of a robot or of what hangs on it.
    #[inline]
    pub fn add_robot(&mut self, world: [f64; 3]) {
        let cell = SessionOccupancy::cell(world);
        if self.robots.last() != Some(&cell) {
            self.robots.push(cell);
        }
    }

    /// All of them by voxel.
    #[must_use]
    pub fn finish(mut self) -> SessionOccupancy {
        let last = self.last.take();
        self.join(last);
        self.cells.values_mut().for_each(|all| all.most = (all.n_points, all.area));
        SessionOccupancy { cells: self.cells, robots: self.robots.into_iter().collect() }
    }
}

impl SessionOccupancy {
    /// Face of a voxel, m².
    pub const FACE: f64 = EDGE * EDGE;

    /// The voxel of a place.
    #[inline]
    #[must_use]
    pub fn cell(world: [f64; 3]) -> OccupancyCell {
        let step = |v: f64| (v * PER_METRE).floor() as i32;
        [step(world[0]), step(world[1]), step(world[2])]
    }

    /// Middles of voxels, world, metres.
    #[must_use]
    pub fn middles(cells: &[OccupancyCell]) -> Vec<[f64; 3]> {
        cells.iter().map(|c| c.map(|i| (f64::from(i) + 0.5) * EDGE)).collect()
    }

    /// All voxels with points.
    #[cfg(test)]
    pub(crate) fn cells(&self) -> impl Iterator<Item = &OccupancyCell> {
        self.cells.keys()
    }

    /// Middles of the voxels in which something stands.
    #[must_use]
    pub fn solid(&self) -> Vec<[f64; 3]> {
        let solid = self.cells.iter().filter(|(_, c)| c.n_points >= MIN_POINTS);
        let mut solid: Vec<OccupancyCell> = solid.map(|(cell, _)| *cell).collect();
        solid.sort_unstable();
        Self::middles(&solid)
    }

    /// Adds all of another.
    pub fn join(&mut self, other: Self) {
        let all = other.cells.into_iter();
        all.for_each(|(cell, count)| self.cells.entry(cell).or_default().join(&count));
        self.robots.extend(other.robots);
    }

    /// Whether a voxel within so many steps holds points of a robot.
    pub(crate) fn has_robot_near(&self, cell: &OccupancyCell, reach: i32) -> bool {
        columns(cell, reach).any(|column| self.robots.range(column).next().is_some())
    }

    /// Whether a voxel or one beside it holds points: what the other session has there, it has here
    /// as well.
    #[must_use]
    pub fn has_some(&self, cell: &OccupancyCell) -> bool {
        self.cells.contains_key(cell) || around(cell, 1).any(|cell| self.cells.contains_key(&cell))
    }

    pub(crate) fn is_solid(&self, cell: &OccupancyCell) -> bool {
        self.cells.get(cell).is_some_and(|c| c.n_points >= MIN_POINTS)
    }

    /// Points in some voxels.
    pub(crate) fn n_points(&self, cells: &[OccupancyCell]) -> u64 {
        cells.iter().map(|c| u64::from(self.cells[c].n_points)).sum()
    }

    /// Voxels that hold points, in and beside which the other session has nothing: of a wire or an
    /// edge it has a point here and there.
    pub(crate) fn changed(&self, other: &Self) -> BTreeSet<OccupancyCell> {
        self.alone(other, |c| c.n_empty)
    }

    /// Solid voxels that no beam of the other session reached.
    pub(crate) fn unseen(&self, other: &Self) -> BTreeSet<OccupancyCell> {
        let mut out = self.alone(other, |c| c.n_unseen);
        out.retain(|cell| self.is_solid(cell));
        out
    }

    /// Voxels of which so many points are enough, in and beside which the other session has none.
    fn alone(&self, other: &Self, n: impl Fn(&CellCount) -> u32) -> BTreeSet<OccupancyCell> {
        let is_enough = |c: &CellCount| f64::from(n(c)) >= MIN_SHARE * f64::from(c.n_points);
        let full = self.cells.iter().filter(|(_, c)| is_enough(c));
        full.map(|(cell, _)| *cell).filter(|cell| !other.has_some(cell)).collect()
    }

    /// Share of the faces of some voxels that their points stand for.
    pub(crate) fn cover(&self, cells: &[OccupancyCell]) -> f64 {
        let area: f64 = cells.iter().map(|c| self.cells[c].area).sum();
        area / (cells.len() as f64 * Self::FACE)
    }

    /// The same of the points of one scan, in each voxel of that which has most of them there.
    pub(crate) fn cover_by_one(&self, cells: &[OccupancyCell]) -> f64 {
        let area: f64 = cells.iter().map(|c| self.cells[c].most.1).sum();
        area / (cells.len() as f64 * Self::FACE)
    }

    /// Share of the points in some voxels at whose places another beam of their own session went
    /// on.
    pub(crate) fn pierced(&self, cells: &[OccupancyCell]) -> f64 {
        let n: u64 = cells.iter().map(|c| u64::from(self.cells[c].n_pierced)).sum();
        n as f64 / self.n_points(cells) as f64
    }
}

/// All voxels within so many steps of one.
pub(crate) fn around(cell: &OccupancyCell, reach: i32) -> impl Iterator<Item = OccupancyCell> {
    let ([x, y, z], r) = (*cell, reach);
    (-r..=r)
        .flat_map(move |i| (-r..=r).flat_map(move |j| (-r..=r).map(move |k| [x + i, y + j, z + k])))
}

/// The same as runs along the last axis, along which voxels are in order.
fn columns(
    cell: &OccupancyCell,
    reach: i32,
) -> impl Iterator<Item = RangeInclusive<OccupancyCell>> {
    let ([x, y, z], r) = (*cell, reach);
    let column = move |i, j| [x + i, y + j, z - r]..=[x + i, y + j, z + r];
    (-r..=r).flat_map(move |i| (-r..=r).map(move |j| column(i, j)))
}

/// All that is connected with a voxel by steps of at most `reach`; `take` says whether a voxel is
/// new and belongs to it.
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

/// What some voxels fill, world, metres.
pub(crate) fn bounds<'a>(cells: impl IntoIterator<Item = &'a OccupancyCell>) -> Aabb {
    let mut out = Aabb::EMPTY;
    for cell in cells {
        out.add(cell.map(|i| f64::from(i) * EDGE));
        out.add(cell.map(|i| f64::from(i + 1) * EDGE));
    }
    out
}
