//! Uncertain points that hang in the air beside a robot. A beam that hits an edge of a link partly
//! gives a point off the link, and where the masks cannot tell whose it is, it is uncertain. A mesh
//! around such points would stand in the way of the robot's first move.
//!
//! Space beside robots is cut into cells. Cells with many points, or with points farther from
//! robots, hold those beside them, these hold their neighbours, and so on; what no cell holds is
//! loose. Single points that are labelled as fixed hold nothing, for masks miss some points of a
//! robot, but they are not left out.

use clearance::{BESIDE_REACH, OwnSurface};
use contract::PointKind;
use std::collections::{BTreeMap, BTreeSet};

/// Distance from a moving link within which points may be loose, metres: as in `check`.
const BESIDE: f64 = BESIDE_REACH as f64;
/// Edge of a cell, metres.
const EDGE: f64 = 0.02;
/// Number of points from which on a cell is part of a thing, as in `check`: mixed pixels of the
/// demo's robots, scanned by four scanners, are at most three to a cell.
const DENSE: u32 = 4;

type AirCell = [i64; 3];

/// Points around robots: what may be loose, and what holds it.
#[derive(Default)]
pub(super) struct BesideRobots {
    /// Number of points within [`BESIDE`] of a moving link, by cell.
    near: BTreeMap<AirCell, u32>,
    /// Cells with points farther off.
    held: BTreeSet<AirCell>,
}

/// The cells whose points are loose.
#[derive(Default)]
pub(super) struct LooseCells(BTreeSet<AirCell>);

impl BesideRobots {
    /// Adds a point that does not move; world frame, metres.
    pub(super) fn add(&mut self, world: [f64; 3], kind: PointKind, robots: &[OwnSurface]) {
        let mut near = robots.iter().filter(|r| r.bounds().grown(BESIDE + EDGE).contains(world));
        if near.clone().next().is_none() {
            return;
        }
        if kind == PointKind::Uncertain && near.clone().any(|r| r.contains(world)) {
            // What is left out itself holds nothing.
            return;
        }
        let cell = cell_of(world);
        if near.any(|r| r.is_near(world, BESIDE)) {
            *self.near.entry(cell).or_default() += 1;
        } else {
            self.held.insert(cell);
        }
    }

    /// Adds those of another tile.
    pub(super) fn join(&mut self, other: Self) {
        for (cell, n) in other.near {
            *self.near.entry(cell).or_default() += n;
        }
        self.held.extend(other.held);
    }

    /// The cells that nothing holds.
    pub(super) fn loose(self) -> LooseCells {
        let Self { near, held } = self;
        let is_held = |cell: &AirCell, n: u32| {
            n >= DENSE || held.contains(cell) || beside(cell).any(|c| held.contains(&c))
        };
        let mut loose: BTreeSet<AirCell> = near.keys().copied().collect();
        let mut next: Vec<AirCell> =
            near.iter().filter(|(c, n)| is_held(c, **n)).map(|(c, _)| *c).collect();
        next.iter().for_each(|cell| {
            loose.remove(cell);
        });
        while let Some(cell) = next.pop() {
            next.extend(beside(&cell).filter(|c| loose.remove(c)));
        }
        LooseCells(loose)
    }
}

impl LooseCells {
    /// Whether an uncertain point at a place (world frame, metres) is loose.
    pub(super) fn contains(&self, world: [f64; 3]) -> bool {
        !self.0.is_empty() && self.0.contains(&cell_of(world))
    }
}

fn cell_of(world: [f64; 3]) -> AirCell {
    world.map(|v| (v / EDGE).floor() as i64)
}

/// The 26 cells around a cell.
fn beside(cell: &AirCell) -> impl Iterator<Item = AirCell> {
    let [x, y, z] = *cell;
    (0..27_i64).filter(|i| *i != 13).map(move |i| {
        let [a, b, c] = [i / 9 - 1, i / 3 % 3 - 1, i % 3 - 1];
        [x + a, y + b, z + c]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cells(near: &[(AirCell, u32)], held: &[AirCell]) -> Vec<AirCell> {
        let beside = BesideRobots {
            near: near.iter().copied().collect(),
            held: held.iter().copied().collect(),
        };
        beside.loose().0.into_iter().collect()
    }

    #[test]
    fn what_hangs_in_the_air_is_loose_and_what_something_holds_is_not() {
        let row: Vec<(AirCell, u32)> = (0..5).map(|x| ([x, 0, 0], 1)).collect();
        let all: Vec<AirCell> = row.iter().map(|(c, _)| *c).collect();
        assert_eq!(cells(&row, &[]), all);
        // A row that begins at a wall belongs to it, also over a corner.
        assert_eq!(cells(&row, &[[-1, 1, 1]]), Vec::<AirCell>::new());
        // One cell off, it does not.
        assert_eq!(cells(&row, &[[-2, 0, 0]]), all);
        // A cell with fixed points is held itself, and what has a gap beside it is loose.
        assert_eq!(cells(&[([0, 0, 0], 1), ([2, 0, 0], 1)], &[[0, 0, 0]]), [[2, 0, 0]]);
        // A thing of many points stays, although nothing holds it.
        assert_eq!(cells(&[([0, 0, 0], DENSE), ([1, 0, 0], 1)], &[]), Vec::<AirCell>::new());
    }
}
