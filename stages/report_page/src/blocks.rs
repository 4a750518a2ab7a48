//! Points by block, thinned to one a voxel, so that a plant of any size becomes as many points as a
//! page can hold. What is kept does not depend on the order in which points come.

use crate::input::PagePoint;
use crate::morton::{STEPS, join, scatter};
use contract::{PointKind, Space, SpaceKind};
use geometry::Aabb;
use std::collections::BTreeMap;

/// Whose points a block holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Owner {
    /// What stands still; an entry's tag is its kind.
    Still,
    /// Middles of voxels that no beam reached.
    Unknown,
    /// The robot with this index; an entry's tag is its link, and whether it hangs on that.
    Robot(u16),
}

impl Owner {
    /// Edge of its blocks, metres. Robots are looked at from close by.
    pub(crate) fn edge(self) -> f64 {
        match self {
            Self::Robot(_) => 3.2,
            _ => 6.4,
        }
    }

    /// Number that stands for it in the page and in parts.
    pub(crate) fn number(self) -> i32 {
        match self {
            Self::Still => -1,
            Self::Unknown => -2,
            Self::Robot(index) => i32::from(index),
        }
    }

    /// The owner with this number; `None` for a number that none has.
    pub(crate) fn of_number(number: i32) -> Option<Self> {
        match number {
            -1 => Some(Self::Still),
            -2 => Some(Self::Unknown),
            index => u16::try_from(index).ok().map(Self::Robot),
        }
    }
}

/// Tags of what stands still.
pub(crate) const FIXED: u16 = 0;
pub(crate) const FLOOR: u16 = 1;
pub(crate) const UNCERTAIN: u16 = 2;

/// Shift from a place to the cell of 0.8 m that is near a robot or not.
const CELL_SHIFT: u32 = 21;
/// How far from a robot's bounds its surroundings are kept finely, metres.
const NEAR: f64 = 0.6;
/// Bits of an entry below its place.
const TAG_BITS: u32 = 16;
/// Points that may wait in a block until they are thinned.
const WAITING: usize = 1 << 15;
/// The coarsest voxels that levels begin with: 128 steps, 0.8 m of what stands still.
pub(crate) const COARSEST: u32 = 7;

/// Voxels of which one point is kept, as shifts along an axis: how many times a step is doubled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Fineness {
    pub(crate) robot: u32,
    pub(crate) near: u32,
    pub(crate) far: u32,
}

/// From fine to coarse: what is far from robots gives way first.
const LADDER: [Fineness; 9] = [
    Fineness { robot: 1, near: 1, far: 2 },
    Fineness { robot: 1, near: 1, far: 3 },
    Fineness { robot: 1, near: 2, far: 3 },
    Fineness { robot: 2, near: 2, far: 3 },
    Fineness { robot: 2, near: 2, far: 4 },
    Fineness { robot: 2, near: 3, far: 4 },
    Fineness { robot: 3, near: 3, far: 4 },
    Fineness { robot: 3, near: 4, far: 5 },
    Fineness { robot: 4, near: 5, far: 6 },
];
/// Voxels of unknown space of which one is shown: 100 mm.
const UNKNOWN: u32 = 4;

/// Owner and place of a block: how many edges from the origin.
pub(crate) type BlockKey = (Owner, [i32; 3]);

/// Points of one block: place and tag, 46 bits each.
#[derive(Debug, Clone)]
pub(crate) struct Block {
    pub(crate) entries: Vec<u64>,
    n_thinned: usize,
    /// For each cell of 0.8 m whether it is near a robot.
    near: Box<[bool; 512]>,
}

/// Collects points, thinned to what a page can hold.
#[derive(Debug, Clone)]
pub struct PagePoints {
    pub(crate) blocks: BTreeMap<BlockKey, Block>,
    /// Bounds within which points are kept finely, metres.
    near: Vec<Aabb>,
    /// Subtracted from world coordinates, metres.
    pub(crate) origin: [f64; 3],
    rung: usize,
    most: usize,
    /// Number of points of each kind, before any was left out.
    pub(crate) n_of_kind: [u64; 5],
}

impl PagePoints {
    /// Room for `most` points; `robots` are the bounds of the robots, and `middle` is any place of
    /// the plant, world, metres.
    #[must_use]
    pub fn new(robots: &[Aabb], middle: [f64; 3], most: usize) -> Self {
        let all = robots.iter().filter(|b| !b.is_empty());
        let near: Vec<Aabb> = all.map(|bounds| bounds.grown(NEAR)).collect();
        // Whole kilometres: what is near the origin keeps its numbers.
        let origin = middle.map(|v| (v / 1e3).trunc() * 1e3);
        Self { blocks: BTreeMap::new(), near, origin, rung: 0, most, n_of_kind: [0; 5] }
    }

    /// Adds points of the result.
    pub fn add(&mut self, points: &[PagePoint]) {
        for point in points {
            let kind = point.label.kind;
            let at = PointKind::ALL.iter().position(|k| *k == kind).unwrap_or(0);
            self.n_of_kind[at] += 1;
            let (owner, tag) = match kind {
                PointKind::Link | PointKind::Attachment if point.label.robot >= 0 => {
                    let hangs = u16::from(kind == PointKind::Attachment);
                    let link = point.label.link.max(0) as u16;
                    (Owner::Robot(point.label.robot as u16), link << 1 | hangs)
                }
                PointKind::Floor => (Owner::Still, FLOOR),
                PointKind::Uncertain => (Owner::Still, UNCERTAIN),
                _ => (Owner::Still, FIXED),
            };
            self.push(owner, point.world, tag);
        }
    }

    /// Adds the surface of what no beam reached: unknown voxels beside free ones.
    pub fn add_space(&mut self, space: &Space) {
        let (grid, voxels) = (space.grid(), space.voxels());
        let [_, ny, nz] = grid.size;
        let steps = [ny * nz, nz, 1];
        for at in 0..voxels.len() {
            let cell = grid.cell(at);
            let is_free = |axis: usize, step: usize| {
                let below = cell[axis] > 0 && voxels[at - step] == SpaceKind::Free;
                let is_inside = cell[axis] + 1 < grid.size[axis];
                below || is_inside && voxels[at + step] == SpaceKind::Free
            };
            let is_face = || steps.iter().enumerate().any(|(axis, step)| is_free(axis, *step));
            if voxels[at] == SpaceKind::Unknown && is_face() {
                self.push(Owner::Unknown, grid.middle(at), 0);
            }
        }
        self.settle();
    }

    /// Thins what was added so far; to be called between tiles, so that memory stays bounded.
    pub fn settle(&mut self) {
        self.thin_all();
        while self.n_points() > 2 * self.most && self.rung + 1 < LADDER.len() {
            self.rung += 1;
            self.blocks.values_mut().for_each(|block| block.n_thinned = 0);
            self.thin_all();
        }
    }

    /// Number of points that are kept now.
    #[must_use]
    pub fn n_points(&self) -> usize {
        self.blocks.values().map(|block| block.entries.len()).sum()
    }

    pub(crate) fn origin(&self) -> [f64; 3] {
        self.origin
    }

    fn push(&mut self, owner: Owner, world: [f64; 3], tag: u16) {
        let edge = owner.edge();
        let local: [f64; 3] = std::array::from_fn(|i| world[i] - self.origin[i]);
        // A block further away than that is no part of a plant.
        if !local.iter().all(|v| v.abs() < 1e6) {
            return;
        }
        let at = local.map(|v| (v / edge).floor() as i32);
        let steps: [u32; 3] = std::array::from_fn(|i| {
            let within = local[i] / edge - f64::from(at[i]);
            ((within * f64::from(STEPS)) as u32).min(STEPS - 1)
        });
        let entry = u64::from(join(steps)) << TAG_BITS | u64::from(tag);
        self.extend((owner, at), [entry]);
    }

    /// Adds entries to a block.
    pub(crate) fn extend(&mut self, key: BlockKey, entries: impl IntoIterator<Item = u64>) {
        let (owner, at) = key;
        let near = (&self.near, self.origin);
        let block = self.blocks.entry(key).or_insert_with(|| Block::new(owner, at, near.0, near.1));
        block.entries.extend(entries);
        if block.entries.len() > 2 * block.n_thinned + WAITING {
            block.thin(owner, LADDER[self.rung]);
        }
    }

    fn thin_all(&mut self) {
        let fineness = LADDER[self.rung];
        for ((owner, _), block) in &mut self.blocks {
            if block.entries.len() != block.n_thinned {
                block.thin(*owner, fineness);
            }
        }
    }

    /// The blocks with their points by level, and about `most` points: where there are more, the
    /// finest levels of what stands still go, away from robots first, the last of them in part.
    pub(crate) fn finish(&self, most: usize) -> Vec<(BlockKey, LeveledBlock)> {
        let mut all = self.clone_settled(most);
        let fineness = LADDER[all.rung];
        if let Some(mut left) = all.n_points().checked_sub(most).filter(|n| *n > 0) {
            let mut of_rank = [0_usize; 2 * COARSEST as usize];
            for (key, block) in &all.blocks {
                block.ranks(key.0, fineness).flatten().for_each(|rank| of_rank[rank] += 1);
            }
            let goes_of_rank = of_rank.map(|n| {
                let goes = left.min(n);
                left -= goes;
                (goes as f64 / n.max(1) as f64 * u64::MAX as f64) as u64
            });
            for (key, block) in &mut all.blocks {
                let goes: Vec<u64> = block
                    .ranks(key.0, fineness)
                    .map(|rank| rank.map_or(0, |rank| goes_of_rank[rank]))
                    .collect();
                let mut goes = goes.into_iter();
                block
                    .entries
                    .retain(|entry| goes.next().is_none_or(|goes| scatter(!entry) >= goes));
            }
        }
        let full = all.blocks.into_iter().filter(|(_, block)| !block.entries.is_empty());
        full.map(|(key, block)| (key, block.leveled(key.0, fineness))).collect()
    }

    /// A copy that is coarse enough for `most` points, give or take its last level.
    fn clone_settled(&self, most: usize) -> Self {
        let mut all = self.clone();
        all.most = most;
        all.settle();
        all
    }
}

/// The points of a block by level, each level a thinning of the block with those before it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LeveledBlock {
    /// Number of points of each level, from voxels of 128 steps to single steps.
    pub(crate) counts: [u32; COARSEST as usize + 1],
    /// Place and tag, by level, then by place.
    pub(crate) points: Vec<(u32, u16)>,
    /// Shift of the largest voxels of which a tenth of its points or more are the only ones: as
    /// large points are drawn, so that surfaces close.
    pub(crate) shift: u32,
}

impl Block {
    fn new(owner: Owner, at: [i32; 3], near: &[Aabb], origin: [f64; 3]) -> Self {
        let edge = owner.edge();
        let mut cells = Box::new([false; 512]);
        let corner: [f64; 3] = std::array::from_fn(|i| f64::from(at[i]) * edge + origin[i]);
        let cell = edge / 8.0;
        let whole = Aabb { min: corner, max: corner.map(|v| v + edge) };
        for bounds in near.iter().filter(|b| owner == Owner::Still && b.touches(&whole)) {
            for n in 0..512_u32 {
                let [x, y, z] = [n & 7, n >> 3 & 7, n >> 6];
                let min: [f64; 3] = [0, 1, 2].map(|i| corner[i] + f64::from([x, y, z][i]) * cell);
                let own = Aabb { min, max: min.map(|v| v + cell) };
                cells[join([x, y, z]) as usize] |= bounds.touches(&own);
            }
        }
        Self { entries: Vec::new(), n_thinned: 0, near: cells }
    }

    /// Shift of the voxel of which this entry may be the only one.
    fn shift(&self, owner: Owner, fineness: Fineness, entry: u64) -> u32 {
        match owner {
            Owner::Robot(_) => fineness.robot,
            Owner::Unknown => UNKNOWN,
            Owner::Still if self.near[(entry >> (TAG_BITS + CELL_SHIFT)) as usize] => fineness.near,
            Owner::Still => fineness.far,
        }
    }

    /// Keeps one entry a voxel: that with the least [`scatter`], whichever came first.
    fn thin(&mut self, owner: Owner, fineness: Fineness) {
        self.entries.sort_unstable();
        let mut kept = 0;
        let mut last = None;
        for at in 0..self.entries.len() {
            let entry = self.entries[at];
            let shift = self.shift(owner, fineness, entry);
            let voxel = entry >> (TAG_BITS + 3 * shift);
            if last == Some((voxel, shift)) {
                if scatter(entry) < scatter(self.entries[kept - 1]) {
                    self.entries[kept - 1] = entry;
                }
            } else {
                self.entries[kept] = entry;
                kept += 1;
                last = Some((voxel, shift));
            }
        }
        self.entries.truncate(kept);
        self.n_thinned = kept;
    }

    /// The level of each entry: the shift of the largest voxels in which it is the one that is
    /// shown.
    fn levels(&self) -> Vec<u8> {
        const NONE: u8 = u8::MAX;
        let mut level = vec![NONE; self.entries.len()];
        for shift in (0..=COARSEST).rev() {
            let mut from = 0;
            while from < level.len() {
                let voxel = |at: usize| self.entries[at] >> (TAG_BITS + 3 * shift);
                let mut to = from + 1;
                while to < level.len() && voxel(to) == voxel(from) {
                    to += 1;
                }
                if level[from..to].iter().all(|l| *l == NONE) {
                    let chosen = (from..to).min_by_key(|&at| scatter(self.entries[at]));
                    chosen.into_iter().for_each(|at| level[at] = shift as u8);
                }
                from = to;
            }
        }
        level
    }

    /// How early each entry goes where there are too many: its level above the finest, and later
    /// near robots; `None` for those that never go.
    fn ranks(&self, owner: Owner, fineness: Fineness) -> impl Iterator<Item = Option<usize>> {
        self.levels().into_iter().zip(&self.entries).map(move |(level, entry)| {
            let shift = self.shift(owner, fineness, *entry);
            let is_near = shift < fineness.far;
            let rank = u32::from(level).saturating_sub(shift) + if is_near { 2 } else { 0 };
            (owner == Owner::Still).then_some(rank as usize)
        })
    }

    fn leveled(&self, owner: Owner, fineness: Fineness) -> LeveledBlock {
        let level = self.levels();
        let mut order: Vec<usize> = (0..level.len()).collect();
        order.sort_by_key(|&at| (std::cmp::Reverse(level[at]), at));
        let mut counts = [0; COARSEST as usize + 1];
        level.iter().for_each(|l| counts[COARSEST as usize - usize::from(*l)] += 1);
        let point = |at: &usize| {
            let entry = self.entries[*at];
            ((entry >> TAG_BITS) as u32, (entry & 0xffff) as u16)
        };
        let mut by_shift = [0_usize; 8];
        self.entries.iter().for_each(|e| by_shift[self.shift(owner, fineness, *e) as usize] += 1);
        let is_wide = |shift: &u32| by_shift[*shift as usize] * 10 >= level.len();
        let shift = (0..8_u32).rev().find(is_wide).unwrap_or(0);
        LeveledBlock { counts, points: order.iter().map(point).collect(), shift }
    }
}

#[cfg(test)]
mod tests;
