//! The patches of a model's surface, and how the surface's errors vary over a link: how offset and
//! tilts of each patch follow from a field over the link, given by its values at a few nodes
//! (METHOD.md §11.4).

use geometry::Vector;
use nalgebra::{DMatrix, Matrix5, RowVector3, Vector5};
use std::ops::Range;

/// Edge of a patch, metres: within it a model's error of shape is about the same (METHOD.md §4).
pub(crate) const PATCH_EDGE: f32 = 0.13;
/// Half of that.
pub(crate) const HALF_PATCH: f64 = 0.5 * PATCH_EDGE as f64;
/// Sides of a link that its patches look to: two for each axis.
pub(crate) const N_SIDES: u32 = 6;

/// A number for each way in which a patch may be off: an offset, two tilts, two shifts.
pub(crate) type Shape = Vector5<f64>;
/// One for each two of them.
pub(crate) type ShapeSquare = Matrix5<f64>;

/// The patches of a model's surface, link by link.
#[derive(Debug, Clone, Default)]
pub(crate) struct Patches {
    /// For each patch: its group, one for each link and side ([`N_SIDES`] a link).
    pub(crate) groups: Vec<u32>,
    /// Where each lies.
    pub(crate) places: Vec<PatchPlace>,
}

impl Patches {
    pub(crate) fn len(&self) -> usize {
        self.groups.len()
    }

    /// The patches of each link.
    pub(crate) fn links(&self) -> impl Iterator<Item = Range<usize>> {
        let mut end = 0;
        self.groups.chunk_by(|a, b| a / N_SIDES == b / N_SIDES).map(move |link| {
            end += link.len();
            end - link.len()..end
        })
    }
}

/// How the offsets of a link's patches vary from one patch to the next.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Smoothness {
    /// Each patch is off by itself.
    Apart,
    /// A link's patches follow a field over it.
    Field(Kernel),
}

/// Number of the ways in which a patch may be off that follow a field: its offset and tilts.
pub(crate) const N_SMOOTH: usize = 3;

/// Nodes of the field over a link.
struct FieldNodes {
    /// They are this near to each patch, in lengths, …
    gap: f64,
    /// … but no more than so many.
    most: usize,
}

const NODES: FieldNodes = FieldNodes { gap: 0.8, most: 64 };
/// Added to the nodes' correlation with themselves, for rounding.
const JITTER: f64 = 1e-6;

/// Where a patch lies, link frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PatchPlace {
    /// Middle of the patch, metres.
    pub(crate) x: Vector,
    /// Mean of its normals: shorter than one where it is bent.
    pub(crate) n: Vector,
    /// Across the normal and each other, unit length.
    pub(crate) axes: [Vector; 2],
}

impl PatchPlace {
    pub(crate) fn new(x: Vector, n: Vector) -> Self {
        let across = Vector::ith(n.iamin(), 1.0);
        let first = n.cross(&across).try_normalize(0.0).unwrap_or_else(Vector::x);
        let second = n.cross(&first).try_normalize(0.0).unwrap_or_else(Vector::y);
        Self { x, n, axes: [first, second] }
    }

    /// What a residual at a place with a normal changes by if the patch is off by one along its
    /// normal, is tilted so that it is off by one at half its edge, or lies beside where it
    /// should: that shows where it is bent, and in small things on it.
    #[inline]
    pub(crate) fn shape(&self, at: &Vector, n: &Vector) -> Shape {
        let ([s, t], [first, second]) = (self.along(at), &self.axes);
        Shape::new(1.0, s, t, first.dot(n), second.dot(n))
    }

    /// Where a place is on the patch: along its two axes, in halves of a patch's edge from its
    /// middle.
    fn along(&self, at: &Vector) -> [f64; 2] {
        let off = (at - self.x) / HALF_PATCH;
        self.axes.map(|axis| axis.dot(&off))
    }
}

/// Likeness of the surface's errors at two places, as it falls with their distance and that of
/// their normals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Kernel {
    /// Metres.
    pub(crate) length: f64,
    /// Weight of the normals: 0 where a link is too thick or too thin all around, 1 where opposite
    /// sides are off apart.
    pub(crate) sides: f64,
}

impl Kernel {
    /// Variance of the ways in which a patch may be off, over that of the field: tilts are its
    /// slopes, and what does not grow thicker lies elsewhere.
    pub(crate) fn variance(self) -> ShapeSquare {
        let tilt = (HALF_PATCH / self.length).powi(2);
        let shift = if self.sides > 0.0 { 1.0 } else { 0.0 };
        ShapeSquare::from_diagonal(&Shape::new(1.0, tilt, tilt, shift, shift))
    }

    fn apart2(self, a: &PatchPlace, b: &PatchPlace) -> f64 {
        (a.x - b.x).norm_squared() / (self.length * self.length)
            + self.sides * (a.n - b.n).norm_squared()
    }

    fn like(self, a: &PatchPlace, b: &PatchPlace) -> f64 {
        (-0.5 * self.apart2(a, b)).exp()
    }

    /// Offset and tilts of the patches for independent unit values of a field given by its nodes:
    /// three columns for each patch.
    pub(crate) fn basis(self, places: &[PatchPlace]) -> DMatrix<f64> {
        let nodes = self.nodes(places);
        let n = nodes.len();
        let own = DMatrix::from_fn(n, n, |i, j| {
            self.like(nodes[i], nodes[j]) + if i == j { JITTER } else { 0.0 }
        });
        let slope = HALF_PATCH * HALF_PATCH / (self.length * self.length);
        let mut basis = DMatrix::zeros(n, N_SMOOTH * places.len());
        for (c, place) in places.iter().enumerate() {
            for (i, node) in nodes.iter().enumerate() {
                let like = self.like(node, place);
                let [s, t] = place.along(&node.x).map(|along| like * slope * along);
                let mut row = basis.fixed_view_mut::<1, N_SMOOTH>(i, N_SMOOTH * c);
                row.copy_from(&RowVector3::new(like, s, t));
            }
        }
        // The inverse first: it is small, and a product of matrices is sooner done than solving for
        // many columns.
        let inverse =
            own.cholesky().and_then(|own| own.l().solve_lower_triangular(&DMatrix::identity(n, n)));
        inverse.map_or_else(|| DMatrix::zeros(0, basis.ncols()), |inverse| inverse * &basis)
    }

    /// Places as far from each other as can be, until all are near to one.
    fn nodes(self, places: &[PatchPlace]) -> Vec<&PatchPlace> {
        let mut away = vec![f64::INFINITY; places.len()];
        let mut nodes: Vec<&PatchPlace> = Vec::new();
        let mut next = 0;
        while nodes.len() < NODES.most {
            nodes.push(&places[next]);
            let mut farthest = NODES.gap * NODES.gap;
            let before = nodes.len();
            for (i, (away, place)) in away.iter_mut().zip(places).enumerate() {
                *away = away.min(self.apart2(place, nodes[before - 1]));
                if *away > farthest {
                    (farthest, next) = (*away, i);
                }
            }
            if farthest <= NODES.gap * NODES.gap {
                break;
            }
        }
        nodes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tilts_are_the_slopes_of_the_offsets() {
        let place = |x: f64, y: f64| PatchPlace::new(Vector::new(x, y, 0.0), Vector::z());
        let kernel = Kernel { length: 0.2, sides: 1.0 };
        // Two nodes, and a patch with its neighbours a step to each side along one of its axes.
        let step = 1e-5;
        let patch = place(0.1, 0.07);
        for (at, axis) in patch.axes.iter().enumerate() {
            let moved = |by: f64| PatchPlace { x: patch.x + axis * by, ..patch };
            let all = [place(0.0, 0.0), place(0.3, 0.1), patch, moved(step), moved(-step)];
            let basis = kernel.basis(&all);
            let offset = |c: usize| basis.column(N_SMOOTH * c).into_owned();
            let slope = (offset(3) - offset(4)) * (HALF_PATCH / (2.0 * step));
            let tilt = basis.column(N_SMOOTH * 2 + 1 + at);
            assert!((&slope - tilt).norm() < 1e-4 * tilt.norm(), "{slope} {tilt}");
        }
    }
}
