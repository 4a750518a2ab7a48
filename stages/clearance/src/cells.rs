//! Cells that hold points around a robot, with which scanners measured them. All coordinates are in
//! the frame of the robot's base, metres.

use crate::evidence::Sight;
use crate::front::Front;
use crate::obstacle::{CELL, HALF_CELL, Obstacle, ObstacleKind};
use crate::shadow::ScannerAt;
use geometry::Point;
use std::collections::BTreeMap;
use std::ops::Range;

/// Number of bits of a cell's position along each axis.
const BITS: u32 = 20;
/// Largest distance from a base at which the cells of points are distinct, metres: 2 km.
pub const FARTHEST: f64 = 0.5 * CELL * (1_u32 << BITS) as f64;

/// Cells that hold points, once for each kind of obstacle.
#[derive(Debug, Clone, Default)]
pub struct Cells {
    /// Largest distance from the base along each axis, metres.
    pub(crate) far: f64,
    /// Position, kind, whether the beam grazed the edge of a robot, and `point_source_id` of the
    /// scanner.
    cells: Vec<(u64, ObstacleKind, bool, u16)>,
    /// Nearest measurements of each scanner, whatever they belong to, by `point_source_id`.
    fronts: BTreeMap<u16, Front>,
    /// These scanners.
    pub(crate) eyes: Vec<ScannerAt>,
}

/// Key of the cell of a place in the base's frame, at most `far` metres away along each axis.
pub(crate) fn key(p: [f64; 3], far: f64) -> u64 {
    let most = f64::from((1_u32 << BITS) - 1);
    let place = |i: usize| ((p[i] + far) / CELL).clamp(0.0, most) as u64;
    place(0) << (2 * BITS) | place(1) << BITS | place(2)
}

/// Centre of the cell with this key, base frame, metres.
pub(crate) fn middle(key: u64, far: f64) -> [f32; 3] {
    let mask = (1_u64 << BITS) - 1;
    let cell = [key >> (2 * BITS), key >> BITS & mask, key & mask];
    cell.map(|k| ((k as f64 + 0.5) * CELL - far) as f32)
}

/// A cell of points around a robot, see [`crate::Obstacles::point_cells`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointCell {
    /// Its centre, base frame, metres.
    pub at: [f32; 3],
    /// Its kind.
    pub what: ObstacleKind,
    /// Whether its points are no evidence of an object.
    pub is_dropped: bool,
}

impl Cells {
    /// Empty cells for points up to `far` metres from the base along each axis. `eyes` are the
    /// scanners with known position, by the `point_source_id` of their points.
    #[must_use]
    pub fn within(far: f64, eyes: &BTreeMap<u16, ScannerAt>) -> Self {
        let fronts = eyes.iter().map(|(source, eye)| (*source, Front::new(eye))).collect();
        Self { far, cells: Vec::new(), fronts, eyes: eyes.values().copied().collect() }
    }

    /// Records that a scanner measured a point (base frame, at most `far` away), whatever it is.
    pub fn add_measurement(&mut self, p: &Point, source: u16) {
        if let Some(front) = self.fronts.get_mut(&source) {
            front.add(p);
        }
    }

    /// Adds a point (base frame, at most `far` away) with whether its beam grazed the edge of a
    /// robot, and the `point_source_id` of its scanner.
    pub fn add(&mut self, p: [f64; 3], what: ObstacleKind, is_grazed: bool, source: u16) {
        self.cells.push((key(p, self.far), what, is_grazed, source));
    }

    /// Removes duplicate cells. Call it after each tile, so that only distinct cells take memory.
    pub fn remove_duplicates(&mut self) {
        self.cells.sort_unstable();
        self.cells.dedup();
    }

    /// Adds the cells of another part of the same surroundings. Call [`Cells::remove_duplicates`]
    /// at the end.
    pub fn join(&mut self, other: Self) {
        self.cells.extend(other.cells);
        for (source, front) in other.fronts {
            if let Some(own) = self.fronts.get_mut(&source) {
                own.join(front);
            }
        }
    }

    /// For each of the obstacles, where its cells are.
    fn sources(&self) -> Vec<Range<usize>> {
        let alike = self.cells.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1));
        let mut from = 0;
        let next = |alike: &[_]| {
            let own = from..from + alike.len();
            from = own.end;
            own
        };
        alike.map(next).collect()
    }

    /// One obstacle for each cell and kind.
    pub(crate) fn obstacles(&self) -> Vec<Obstacle> {
        let alike = self.cells.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1));
        let obstacle = |alike: &[(u64, ObstacleKind, bool, u16)]| {
            let (key, what, ..) = alike[0];
            let is_grazed = alike.iter().all(|cell| cell.2);
            Obstacle { at: middle(key, self.far), radius: HALF_CELL, what, is_grazed }
        };
        alike.map(obstacle).collect()
    }
}

/// What the scanners of some cells tell about the obstacles that are made of them.
pub(crate) struct CellSight<'a> {
    cells: &'a Cells,
    /// For each obstacle, where its cells are.
    sources: Vec<Range<usize>>,
}

impl<'a> CellSight<'a> {
    pub(crate) fn new(cells: &'a Cells) -> Self {
        Self { cells, sources: cells.sources() }
    }

    /// The cells of an obstacle.
    fn of(&self, at: usize) -> &[(u64, ObstacleKind, bool, u16)] {
        &self.cells.cells[self.sources[at].clone()]
    }
}

impl Sight for CellSight<'_> {
    /// Of all scanners, if one is not known.
    fn eyes(&self, at: usize) -> Vec<Point> {
        let Cells { fronts, eyes, .. } = self.cells;
        let eye = |source: u16| {
            let known = fronts.keys().zip(eyes).find(|(own, _)| **own == source);
            known.map(|(_, eye)| eye.at)
        };
        let all = || eyes.iter().map(|eye| eye.at).collect();
        let own = self.of(at).iter();
        own.map(|cell| eye(cell.3)).collect::<Option<Vec<Point>>>().unwrap_or_else(all)
    }

    fn are_of_several(&self, at: usize, other: usize) -> bool {
        let mut sources = self.of(at).iter().chain(self.of(other)).map(|cell| cell.3);
        let first = sources.next();
        sources.any(|source| Some(source) != first)
    }

    fn is_passed(&self, at: usize, o: &Obstacle) -> bool {
        let p = Point::from(o.at.map(f64::from));
        let is_own = |source: u16| self.of(at).iter().any(|cell| cell.3 == source);
        let mut others = self.cells.fronts.iter().filter(|(source, _)| !is_own(**source));
        others.any(|(_, front)| front.passed(&p))
    }

    /// For each asked obstacle, whether its beam passed the edge of something in front of it,
    /// according to all scanners that measured it: neighbouring beams hit something, or another
    /// scanner measured something there. Of a wire in front of a surface a scanner may have
    /// nothing but points in between. `false` for all others.
    fn behind(&self, all: &[Obstacle], asked: &[bool]) -> Vec<bool> {
        let place = |o: &Obstacle| Point::from(o.at.map(f64::from));
        let asked_places = || all.iter().zip(asked).filter(|(_, is)| **is).map(|(o, _)| place(o));
        let front = |(source, front): (&u16, &Front)| {
            let points = all.iter().filter(|o| o.is_point()).map(place);
            (*source, front.beside_of(asked_places(), points))
        };
        let fronts: BTreeMap<u16, Front> = match asked.contains(&true) {
            true => self.cells.fronts.iter().map(front).collect(),
            false => BTreeMap::new(),
        };
        let is_behind = |(at, o): (usize, &Obstacle)| {
            let by = |source: u16| fronts.get(&source).is_some_and(|f| f.is_behind(&place(o)));
            // Beams that grazed a robot are no evidence.
            asked[at] && self.of(at).iter().filter(|cell| !cell.2).all(|cell| by(cell.3))
        };
        all.iter().enumerate().map(is_behind).collect()
    }
}
