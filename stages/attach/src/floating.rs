//! Bodies that hang in the air: what holds them was not seen. A plate below a gripper whose fingers
//! are hidden belongs to the gripper if the gripper is near and everything else is far.

use crate::attached::{Decided, Group, attached_to, mark};
use crate::near_voxels::NearVoxels;
use crate::thin::{is_line, spreads_of};
use contract::{Label, LinkAt, PointKind, ResidualVoxel, Voxel};

/// Least distance from everything fixed, metres, and in distances from the hand.
const ALONE: f64 = 0.10;
const ALONE_RATIO: f64 = 1.5;
/// Largest gap between bits of the same body, metres: wires of a fence are so far apart, and bits
/// of a sparsely seen tool.
const BIT_GAP: f64 = 0.08;
/// Components with fewer voxels are mixed pixels: they hang between a body and what is behind it,
/// and tell nothing.
const MIN_BIT: usize = 3;
/// Bodies with fewer voxels are mixed pixels as well.
const MIN_VOXELS: usize = 8;
/// Standard deviation along a wire, voxels (at least 20 cm of it are seen), and how many times that
/// across it is smaller.
const WIRE: f64 = 2.9;
const WIRE_RATIO: f64 = 5.0;

/// How far a column of beams may reach beyond the rest of its body, voxels (8 cm, as far as columns
/// are apart), and how many times more voxels the body has at least.
const IN_BOUNDS: i32 = 4;
const LARGER: usize = 20;

/// The residual voxels of a plant as bodies.
pub(crate) struct Bodies<'a> {
    /// Largest distance of a body from a hand or from what the hand carries, metres.
    pub(crate) gap: f64,
    /// Largest circumference of a thin part, metres.
    pub(crate) thin: f64,
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
    let [mut hands, mut fixed, mut doubtful] = [(); 3].map(|()| NearVoxels::default());
    for voxel in bodies.links.iter().filter(|v| (bodies.is_hand)(v.nearest)) {
        hands.add(voxel.voxel, mark(voxel.nearest));
    }
    let (mut bits, mut lines): (Vec<&[usize]>, Vec<&[usize]>) = (Vec::new(), Vec::new());
    for members in bodies.components {
        let is_free = members
            .iter()
            .all(|&at| decided.labels[at].is_none() && !(bodies.is_fixed)(&bodies.voxels[at]));
        if is_free {
            if is_wire(bodies, members) {
                lines.push(members);
            } else if members.len() >= MIN_BIT {
                bits.push(members);
            }
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
                Some(_) => doubtful.add(bodies.voxels[at].voxel, 0),
            }
        }
    }
    let mut open = joined(bodies, &bits);
    open.retain(|members| members.len() >= MIN_VOXELS);
    for &at in join_columns(bodies, &mut open, lines).iter().copied().flatten() {
        fixed.add(bodies.voxels[at].voxel, 0);
    }
    while let Some((which, mark)) = nearest(bodies, &open, &hands, &fixed) {
        let members = open.remove(which);
        let mut group = Group {
            link: LinkAt { robot: (mark >> 16) as u16, link: (mark & 0xffff) as u16 },
            n_attached: 0,
            n_uncertain: 0,
            n_points: 0,
            is_cut: false,
        };
        for at in members {
            decided.labels[at] = Some(attached_to(mark));
            group.n_attached += 1;
            group.n_points += u64::from(bodies.voxels[at].n_residual);
            hands.add(bodies.voxels[at].voxel, mark);
        }
        decided.groups.push(group);
    }
    for members in open.iter().filter(|members| is_bit_of(bodies, members, &doubtful, &fixed)) {
        members.iter().for_each(|at| decided.labels[*at] = Some(Label::UNCERTAIN));
    }
}

/// Whether a body in the air may be a bit of something near it that is in doubt: of a wide tool, of
/// which some is hidden. What is fixed is farther away.
fn is_bit_of(
    bodies: &Bodies<'_>,
    members: &[usize],
    doubtful: &NearVoxels,
    fixed: &NearVoxels,
) -> bool {
    let places = || members.iter().map(|&at| bodies.voxels[at].voxel);
    let gap = doubtful.nearest(places(), BIT_GAP).map(|found| found.0);
    gap.is_some_and(|gap| fixed.nearest(places(), gap).is_none())
}

/// Whether connected voxels lie along a line that is longer than bits of tools: a wire or a cable,
/// whose ends no scan saw, is nothing that a hand carries.
fn is_wire(bodies: &Bodies<'_>, members: &[usize]) -> bool {
    let Some(first) = members.first() else { return false };
    let voxels: Vec<Voxel> = members.iter().map(|at| bodies.voxels[*at].voxel).collect();
    let spread = spreads_of(&voxels, bodies.voxels[*first].voxel);
    spread[2] >= WIRE && is_line(&spread, bodies.thin, WIRE_RATIO)
}

/// Gives the columns of beams among some lines to their bodies, one beside the other, and returns
/// the other lines.
fn join_columns<'a>(
    bodies: &Bodies<'_>,
    open: &mut [Vec<usize>],
    mut lines: Vec<&'a [usize]>,
) -> Vec<&'a [usize]> {
    loop {
        let n_before = lines.len();
        lines.retain(|line| {
            let body = open.iter_mut().find(|body| is_column_of(bodies, line, body));
            let is_wire = body.is_none();
            body.into_iter().for_each(|body| body.extend_from_slice(line));
            is_wire
        });
        if lines.len() == n_before {
            return lines;
        }
    }
}

/// Whether a line is a column of beams on a face of a body that they graze: it lies within the
/// bounds of the body, which is much larger. A wire that passes a body sticks out of it.
fn is_column_of(bodies: &Bodies<'_>, line: &[usize], body: &[usize]) -> bool {
    let places = |of: &[usize]| of.iter().map(|at| bodies.voxels[*at].voxel).collect::<Vec<_>>();
    let (line, body) = (places(line), places(body));
    let is_within = |i: usize| {
        let (least, most) = (body.iter().map(|v| v[i]).min(), body.iter().map(|v| v[i]).max());
        let (Some(least), Some(most)) = (least, most) else { return false };
        line.iter().all(|v| (least - IN_BOUNDS..=most + IN_BOUNDS).contains(&v[i]))
    };
    body.len() >= LARGER * line.len() && (0..3).all(is_within)
}

/// Joins bits with small gaps between them to bodies.
fn joined(bodies: &Bodies<'_>, bits: &[&[usize]]) -> Vec<Vec<usize>> {
    let mut bit_at = NearVoxels::default();
    for (bit, members) in bits.iter().enumerate() {
        members.iter().for_each(|&at| bit_at.add(bodies.voxels[at].voxel, bit as u32));
    }
    let mut is_taken = vec![false; bits.len()];
    let mut out = Vec::new();
    for first in 0..bits.len() {
        if std::mem::replace(&mut is_taken[first], true) {
            continue;
        }
        let (mut body, mut queue) = (Vec::new(), vec![first]);
        while let Some(bit) = queue.pop() {
            body.extend_from_slice(bits[bit]);
            for &at in bits[bit] {
                bit_at.around(bodies.voxels[at].voxel, BIT_GAP, |_, other| {
                    if !std::mem::replace(&mut is_taken[other as usize], true) {
                        queue.push(other as usize);
                    }
                });
            }
        }
        body.sort_unstable();
        out.push(body);
    }
    out
}

/// The body that is nearest to a hand and far from everything fixed, by its place in `open`, with
/// the mark of the hand.
fn nearest(
    bodies: &Bodies<'_>,
    open: &[Vec<usize>],
    hands: &NearVoxels,
    fixed: &NearVoxels,
) -> Option<(usize, u32)> {
    let mut best: Option<(f64, usize, u32)> = None;
    for (which, members) in open.iter().enumerate() {
        let places = || members.iter().map(|&at| bodies.voxels[at].voxel);
        let Some((gap, mark)) = hands.nearest(places(), bodies.gap) else { continue };
        if best.is_some_and(|b| b.0 <= gap) {
            continue;
        }
        let apart =
            fixed.nearest(places(), ALONE_RATIO * bodies.gap).map_or(f64::INFINITY, |f| f.0);
        if apart >= ALONE.max(ALONE_RATIO * gap) {
            best = Some((gap, which, mark));
        }
    }
    best.map(|(_, which, mark)| (which, mark))
}
