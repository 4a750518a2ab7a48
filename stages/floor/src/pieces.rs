//! Connects patches to pieces of level surface: ground cells with heights, over all tiles and
//! scans.

use crate::Settings;
use crate::union::Union;
use contract::PlanePatch;
use geometry::{Moments, Plane, Vector};

/// Edge of a ground cell, metres; must be that of `PlanePatch::ground`.
pub(crate) const GROUND: f64 = 0.25;

/// Height of a surface in one ground cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct GroundNode {
    /// Ground cell.
    pub(crate) cell: [i32; 2],
    /// Mean height, metres.
    pub(crate) z: f64,
    /// Number of points.
    pub(crate) n: u32,
}

impl GroundNode {
    /// Centre of the cell at the height of the surface, world, metres.
    pub(crate) fn place(&self) -> Vector {
        let [x, y] = self.cell.map(|i| (f64::from(i) + 0.5) * GROUND);
        Vector::new(x, y, self.z)
    }
}

/// A connected level surface.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LevelPiece {
    /// Its cells, sorted by cell, then height.
    pub(crate) nodes: Vec<GroundNode>,
    /// Indices of the patches that it is made of, ascending.
    pub(crate) patches: Vec<usize>,
}

impl LevelPiece {
    /// Area of its cells, m².
    pub(crate) fn area(&self) -> f64 {
        self.nodes.len() as f64 * GROUND * GROUND
    }
}

/// The part of one patch in one ground cell.
struct Entry {
    cell: [i32; 2],
    z: f64,
    n: u32,
    patch: usize,
}

/// Connects the ground cells of those `patches` for which `wanted` holds; the largest piece first.
pub(crate) fn pieces(
    patches: &[PlanePatch],
    wanted: impl Fn(&PlanePatch) -> bool,
    settings: &Settings,
) -> Vec<LevelPiece> {
    let mut entries: Vec<Entry> = Vec::new();
    for (patch, p) in patches.iter().enumerate().filter(|(_, p)| wanted(p)) {
        entries.extend(
            p.ground
                .iter()
                .filter(|g| g.1 >= settings.min_cell_points)
                .map(|&(cell, n, sum)| Entry { cell, z: sum / f64::from(n), n, patch }),
        );
    }
    entries
        .sort_by(|a, b| a.cell.cmp(&b.cell).then(a.z.total_cmp(&b.z)).then(a.patch.cmp(&b.patch)));
    let (nodes, node_of) = merge_heights(&entries, settings);
    let mut union = Union::new(nodes.len());
    join_cells(&nodes, &mut union, settings);
    join_patches(&entries, &node_of, patches.len(), &mut union);
    collect(&nodes, &entries, &node_of, &mut union)
}

/// Merges the entries of one cell whose heights differ by less than a step to one node.
fn merge_heights(entries: &[Entry], settings: &Settings) -> (Vec<GroundNode>, Vec<usize>) {
    let mut nodes: Vec<GroundNode> = Vec::new();
    let mut node_of = Vec::with_capacity(entries.len());
    let mut sum = 0.0;
    for e in entries {
        let same = nodes.last().is_some_and(|n| n.cell == e.cell && e.z - n.z <= settings.max_step);
        if !same {
            nodes.push(GroundNode { cell: e.cell, z: e.z, n: 0 });
            sum = 0.0;
        }
        if let Some(node) = nodes.last_mut() {
            sum += e.z * f64::from(e.n);
            node.n = node.n.saturating_add(e.n);
            node.z = sum / f64::from(node.n);
        }
        node_of.push(nodes.len() - 1);
    }
    (nodes, node_of)
}

/// Joins nodes of neighbouring cells with little difference in height.
fn join_cells(nodes: &[GroundNode], union: &mut Union, settings: &Settings) {
    for (i, node) in nodes.iter().enumerate() {
        for [dx, dy] in [[0, 1], [1, -1], [1, 0], [1, 1]] {
            let cell = [node.cell[0].saturating_add(dx), node.cell[1].saturating_add(dy)];
            let from = nodes.partition_point(|n| n.cell < cell);
            for (j, other) in
                nodes.iter().enumerate().skip(from).take_while(|(_, n)| n.cell == cell)
            {
                if (other.z - node.z).abs() <= settings.max_step {
                    union.join(i, j);
                }
            }
        }
    }
}

/// Joins nodes that one patch covers: the patch was seen as one surface, even if something stands
/// in front of it.
fn join_patches(entries: &[Entry], node_of: &[usize], n_patches: usize, union: &mut Union) {
    let mut first = vec![usize::MAX; n_patches];
    for (e, &node) in entries.iter().zip(node_of) {
        if first[e.patch] == usize::MAX {
            first[e.patch] = node;
        } else {
            union.join(first[e.patch], node);
        }
    }
}

fn collect(
    nodes: &[GroundNode],
    entries: &[Entry],
    node_of: &[usize],
    union: &mut Union,
) -> Vec<LevelPiece> {
    let mut number = vec![usize::MAX; nodes.len()];
    let mut out: Vec<LevelPiece> = Vec::new();
    for (i, node) in nodes.iter().enumerate() {
        let root = union.find(i);
        if number[root] == usize::MAX {
            number[root] = out.len();
            out.push(LevelPiece { nodes: Vec::new(), patches: Vec::new() });
        }
        out[number[root]].nodes.push(*node);
    }
    for (e, &node) in entries.iter().zip(node_of) {
        out[number[union.find(node)]].patches.push(e.patch);
    }
    for piece in &mut out {
        piece.patches.sort_unstable();
        piece.patches.dedup();
    }
    // A stable sort: pieces of equal size stay in the order of their first cells.
    out.sort_by_key(|piece| std::cmp::Reverse(piece.nodes.len()));
    out
}

/// Mean plane of nodes, each cell with the same weight and the normal up, with the RMS of heights
/// about it. Outliers are left out once. A single row of cells gives a horizontal plane.
pub(crate) fn fit(nodes: &[GroundNode]) -> Option<(Plane, f64)> {
    let first = nodes.first()?.place();
    let mut moments = Moments::new(first);
    nodes.iter().for_each(|n| moments.add(&n.place()));
    let mut plane = upward(&moments);
    let rms = |plane: &Plane| {
        let sum: f64 = nodes.iter().map(|n| plane.distance(&n.place()).powi(2)).sum();
        (sum / nodes.len() as f64).sqrt()
    };
    let limit = 2.5 * rms(&plane).max(0.002);
    let mut kept = Moments::new(first);
    nodes
        .iter()
        .map(GroundNode::place)
        .filter(|p| plane.distance(p).abs() <= limit)
        .for_each(|p| kept.add(&p));
    if 2.0 * kept.n >= moments.n {
        plane = upward(&kept);
    }
    Some((plane, rms(&plane)))
}

/// Least-squares plane with its normal up; horizontal through the mean where the points lie on a
/// line.
pub(crate) fn upward(moments: &Moments) -> Plane {
    let flat = Plane { normal: Vector::z(), offset: moments.mean().z };
    match moments.plane() {
        Some(fit) if fit.spread[1] >= 0.5 * GROUND && fit.plane.normal.z.abs() > 0.5 => {
            if fit.plane.normal.z < 0.0 { fit.plane.flipped() } else { fit.plane }
        }
        _ => flat,
    }
}

/// Height of a plane at (x, y), metres.
pub(crate) fn height(plane: &Plane, x: f64, y: f64) -> f64 {
    (plane.offset - plane.normal.x * x - plane.normal.y * y) / plane.normal.z
}
