//! Bodies that hang in the air: what holds them was not seen. A plate below a gripper whose fingers
//! are hidden belongs to the gripper if the gripper is near and everything else is far.

use crate::attached::{Decided, Group, attached_to, mark};
use contract::{Label, LinkAt, PointKind, RESIDUAL_EDGE, ResidualVoxel, Voxel};
use std::collections::BTreeMap;

/// Least distance from everything fixed, metres, and in distances from the hand.
const ALONE: f64 = 0.10;
const ALONE_RATIO: f64 = 1.5;
/// Bodies with fewer voxels are mixed pixels.
const MIN_VOXELS: usize = 8;
/// Edge of the cells in which neighbours are looked up, voxels.
const CELL: i32 = 9;
/// The same as a distance, metres.
const CELL_REACH: f64 = CELL as f64 * RESIDUAL_EDGE;

/// The residual voxels of a plant as bodies.
pub(crate) struct Bodies<'a> {
    /// Largest distance of a body from a hand or from what the hand carries, metres.
    pub(crate) gap: f64,
    pub(crate) voxels: &'a [ResidualVoxel],
    /// Connected components of the voxels.
    pub(crate) components: &'a [Vec<usize>],
    /// Voxels that links fill.
    pub(crate) links: &'a [ResidualVoxel],
    pub(crate) is_fixed: &'a dyn Fn(&ResidualVoxel) -> bool,
    pub(crate) is_hand: &'a dyn Fn(LinkAt) -> bool,
}

/// Attaches bodies that hang in the air to the hand that they are near, the nearest first.
pub(crate) fn attach(bodies: &Bodies<'_>, decided: &mut Decided) {
    let (mut hands, mut fixed) = (Holders::default(), Holders::default());
    for voxel in bodies.links.iter().filter(|v| (bodies.is_hand)(v.nearest)) {
        hands.add(voxel.voxel, mark(voxel.nearest));
    }
    let mut open: Vec<&Vec<usize>> = Vec::new();
    for members in bodies.components {
        let is_free = members
            .iter()
            .all(|&at| decided.labels[at].is_none() && !(bodies.is_fixed)(&bodies.voxels[at]));
        if is_free && members.len() >= MIN_VOXELS {
            open.push(members);
            continue;
        }
        for &at in members {
            match decided.labels[at] {
                None => fixed.add(bodies.voxels[at].voxel, 0),
                Some(label) if label.kind == PointKind::Attachment => {
                    let link = LinkAt { robot: label.robot as u16, link: label.link as u16 };
                    if (bodies.is_hand)(link) {
                        hands.add(bodies.voxels[at].voxel, mark(link));
                    }
                }
                Some(_) => {}
            }
        }
    }
    while let Some((which, mark, label)) = nearest(bodies, &open, &hands, &fixed) {
        let members = open.remove(which);
        let mut group = Group {
            link: LinkAt { robot: (mark >> 16) as u16, link: (mark & 0xffff) as u16 },
            n_attached: 0,
            n_uncertain: 0,
            n_points: 0,
            is_cut: false,
        };
        for &at in members {
            decided.labels[at] = Some(label);
            if label == Label::UNCERTAIN {
                group.n_uncertain += 1;
            } else {
                group.n_attached += 1;
                group.n_points += u64::from(bodies.voxels[at].n_residual);
                hands.add(bodies.voxels[at].voxel, mark);
            }
        }
        decided.groups.push(group);
    }
}

/// The body that is nearest to a hand and farther from everything fixed, by its place in `open`,
/// with the mark of the hand and its label.
fn nearest(
    bodies: &Bodies<'_>,
    open: &[&Vec<usize>],
    hands: &Holders,
    fixed: &Holders,
) -> Option<(usize, u32, Label)> {
    let mut best: Option<(f64, usize, u32, Label)> = None;
    for (which, members) in open.iter().enumerate() {
        let places = || members.iter().map(|&at| bodies.voxels[at].voxel);
        let Some((gap, mark)) = hands.nearest(places(), bodies.gap) else { continue };
        if best.is_some_and(|b| b.0 <= gap) {
            continue;
        }
        let apart =
            fixed.nearest(places(), ALONE_RATIO * bodies.gap).map_or(f64::INFINITY, |f| f.0);
        if apart < gap {
            continue;
        }
        let is_alone = apart >= ALONE.max(ALONE_RATIO * gap);
        let label = if is_alone { attached_to(mark) } else { Label::UNCERTAIN };
        best = Some((gap, which, mark, label));
    }
    best.map(|(_, which, mark, label)| (which, mark, label))
}

/// Voxels by cells, each with the mark of its link.
#[derive(Default)]
struct Holders {
    cells: BTreeMap<[i32; 3], Vec<(Voxel, u32)>>,
}

impl Holders {
    fn add(&mut self, voxel: Voxel, mark: u32) {
        self.cells.entry(voxel.map(|v| v.div_euclid(CELL))).or_default().push((voxel, mark));
    }

    /// Distance of the nearest of these voxels from any place of a body, metres, and its mark;
    /// `None` beyond `reach`, metres.
    fn nearest(&self, places: impl Iterator<Item = Voxel>, reach: f64) -> Option<(f64, u32)> {
        let half = (reach / CELL_REACH).ceil() as i32;
        let side = 2 * half + 1;
        let mut best: Option<(f64, u32)> = None;
        for voxel in places {
            let cell = voxel.map(|v| v.div_euclid(CELL));
            for k in 0..side * side * side {
                let by = [k / (side * side) - half, k / side % side - half, k % side - half];
                let cell = [0, 1, 2].map(|i| cell[i].saturating_add(by[i]));
                for (other, mark) in self.cells.get(&cell).into_iter().flatten() {
                    let square: f64 =
                        (0..3).map(|i| (f64::from(other[i]) - f64::from(voxel[i])).powi(2)).sum();
                    let found = (square.sqrt() * RESIDUAL_EDGE, *mark);
                    if found.0 <= reach && best.is_none_or(|b| found < b) {
                        best = Some(found);
                    }
                }
            }
        }
        best
    }
}
