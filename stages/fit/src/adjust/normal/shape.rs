//! The ways in which patches of the model's surface may be off, taken out of the sums of residuals:
//! smooth over each link as far as the residuals say so (METHOD.md §11.4).
//!
//! A patch is off by `u_c = B_c·z + e_c`: a smooth field over its link, a Gaussian process given by
//! its values at a few nodes (sparse approximation "FITC" of Snelson and Ghahramani, 2006), and a
//! rest of its own. Both are integrated out.

use contract::Fan;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, SMatrix};
use std::ops::Range;

use super::patch_sums::PatchSums;
use crate::model::{Kernel, N_SMOOTH, PatchPlace, Patches, Shape, ShapeSquare, Smoothness};

/// Lengths over which surfaces of castings, hulls and sheets are off alike, metres; the middle one
/// is tried first.
const LENGTHS: [f64; 3] = [0.2, 0.1, 0.4];
/// Weights of the normals: both sides of a link off alike, or each side by itself.
const SIDES: [f64; 2] = [0.0, 1.0];
/// What is off each patch by itself is so over this length, metres: its tilts are as large as such
/// a field's.
const ROUGH: Kernel = Kernel { length: 0.1, sides: 1.0 };
/// Share of the variance of a smooth offset that is a patch's own: a field is not the same all over
/// it.
const OWN: f64 = 0.02;
/// Smaller offsets are not worth a choice, metres.
const NO_OFFSET: f64 = 1e-4;

/// What the offsets of a link's patches take from the normal equations.
struct TakenOut {
    hessian: DMatrix<f64>,
    gradient: DVector<f64>,
    /// How much likelier the residuals are with the offsets than without, as a logarithm.
    evidence: f64,
}

/// The patches of a link that have residuals.
struct LinkPatches {
    /// Where they are among all.
    at: Vec<usize>,
    places: Vec<PatchPlace>,
    /// Σ w J φᵀ, five columns for each.
    a: DMatrix<f64>,
    /// Σ w φ φᵀ and Σ w r φ of each.
    sums: Vec<(ShapeSquare, Shape)>,
}

/// How a patch is off by itself, under one smoothness.
struct PatchRest {
    /// Covariance of that with the residuals known: D(1 + WD)⁻¹.
    known: ShapeSquare,
    /// What is left of its sums with that taken out: (1 + WD)⁻¹.
    left: ShapeSquare,
}

impl PatchRest {
    fn new(variance: &ShapeSquare, weight: &ShapeSquare) -> Self {
        let left = (ShapeSquare::identity() + weight * variance).try_inverse();
        let left = left.unwrap_or_else(ShapeSquare::zeros);
        Self { known: variance * left, left }
    }
}

/// A link's offsets under one smoothness.
struct Offsets<'a> {
    link: &'a LinkPatches,
    own: Vec<PatchRest>,
    /// The smooth part, where there is one.
    field: Option<SmoothPart>,
}

struct SmoothPart {
    /// Shapes of the patches for unit values at the nodes: nodes × three for each patch.
    basis: DMatrix<f64>,
    /// Of the values at the nodes, with the residuals.
    precision: Cholesky<f64, Dyn>,
    /// The likeliest values at the nodes.
    values: DVector<f64>,
    /// Nodes × unknowns.
    gain: DMatrix<f64>,
    /// Σ w J at the nodes: unknowns × nodes.
    cross: DMatrix<f64>,
    /// What is known of each value before, m⁻².
    prior: f64,
    /// Σ w r at the nodes.
    pull: DVector<f64>,
}

/// Normal equations with the sums of each patch.
pub(super) struct PatchedSums<'n> {
    /// With all priors.
    pub(super) hessian: &'n mut DMatrix<f64>,
    /// Of the priors alone: that of the residuals stands in the sums of the patches.
    pub(super) gradient: &'n mut DVector<f64>,
    pub(super) patches: &'n mut [Option<PatchSums>],
    /// Where those patches lie.
    pub(super) of: &'n Patches,
}

/// Normal equations of which nothing is taken out.
#[derive(Clone, Copy)]
struct WholeEquations<'n> {
    hessian: &'n DMatrix<f64>,
    gradient: &'n DVector<f64>,
    /// Variance of the patches' offsets, m².
    sigma2: f64,
}

/// Takes the patches' offsets of variance `sigma2`, m², out of the normal equations and of the
/// patches' own sums. How smooth they were taken for: as told, or as is likeliest.
pub(super) fn take_out(
    PatchedSums { hessian, gradient, patches, of }: PatchedSums<'_>,
    sigma2: f64,
    told: Option<Smoothness>,
    fan: &dyn Fan,
) -> Smoothness {
    patches.iter().flatten().for_each(|patch| *gradient += &patch.g);
    if sigma2 <= 0.0 {
        return told.unwrap_or(Smoothness::Apart);
    }
    let links: Vec<LinkPatches> =
        of.links().filter_map(|at| LinkPatches::new(patches, of, at)).collect();
    let smoothness = match told {
        Some(told) => told,
        None if sigma2.sqrt() < NO_OFFSET => Smoothness::Apart,
        None => likeliest(WholeEquations { hessian, gradient, sigma2 }, &links, fan),
    };
    let found = fan.fan(links.iter().collect(), |link| {
        let offsets = link.offsets(smoothness, sigma2);
        (offsets.taken(), offsets)
    });
    for (taken, offsets) in found {
        *hessian -= taken.hessian;
        *gradient -= taken.gradient;
        offsets.write(patches);
    }
    smoothness
}

/// The smoothness under which the residuals are likeliest, whatever base, posture and scans are:
/// first whether sides are off alike, at a middle length, then at which.
fn likeliest(equations: WholeEquations<'_>, links: &[LinkPatches], fan: &dyn Fan) -> Smoothness {
    let judged = |among: Vec<Smoothness>| {
        fan.fan(among, |of| (evidence(equations, links, of), of)).into_iter()
    };
    let likelier = |a: (f64, Smoothness), b: (f64, Smoothness)| if b.0 > a.0 { b } else { a };
    let field = |length, sides| Smoothness::Field(Kernel { length, sides });
    let [middle, others @ ..] = LENGTHS;
    let [alike, apart] = SIDES.map(|sides| field(middle, sides));
    let none = (f64::NEG_INFINITY, Smoothness::Apart);
    let kind = judged(vec![Smoothness::Apart, alike, apart]).fold(none, likelier);
    let Smoothness::Field(kernel) = kind.1 else { return Smoothness::Apart };
    let lengths = others.map(|length| field(length, kernel.sides));
    judged(lengths.to_vec()).fold(kind, likelier).1
}

/// How likely the residuals are, as a logarithm, but for what is the same for all.
fn evidence(
    WholeEquations { hessian, gradient, sigma2 }: WholeEquations<'_>,
    links: &[LinkPatches],
    smoothness: Smoothness,
) -> f64 {
    let (mut h, mut g, mut evidence) = (hessian.clone(), gradient.clone(), 0.0);
    for link in links {
        let taken = link.offsets(smoothness, sigma2).taken();
        h -= taken.hessian;
        g -= taken.gradient;
        evidence += taken.evidence;
    }
    let Some(h) = h.cholesky() else { return f64::NEG_INFINITY };
    evidence + 0.5 * g.dot(&h.solve(&g)) - 0.5 * log_det(&h)
}

fn log_det(matrix: &Cholesky<f64, Dyn>) -> f64 {
    2.0 * matrix.l_dirty().diagonal().iter().map(|v| v.ln()).sum::<f64>()
}

/// A matrix of some columns for each patch, with those of each multiplied by a matrix of its own.
fn each_times<const N: usize, const M: usize>(
    columns: &DMatrix<f64>,
    by: impl ExactSizeIterator<Item = SMatrix<f64, N, M>>,
) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(columns.nrows(), M * by.len());
    for (c, by) in by.enumerate() {
        let of = columns.fixed_columns::<N>(N * c);
        out.fixed_columns_mut::<M>(M * c).gemm(1.0, &of, &by, 0.0);
    }
    out
}

impl LinkPatches {
    fn new(patches: &[Option<PatchSums>], of: &Patches, range: Range<usize>) -> Option<Self> {
        let at: Vec<usize> =
            range.filter(|&c| patches[c].as_ref().is_some_and(|p| p.total() > 0.0)).collect();
        let own: Vec<&PatchSums> = at.iter().filter_map(|&c| patches[c].as_ref()).collect();
        if own.is_empty() {
            return None;
        }
        let columns: Vec<_> = own.iter().flat_map(|p| p.a.column_iter()).collect();
        Some(Self {
            places: at.iter().map(|&c| of.places[c]).collect(),
            at,
            a: DMatrix::from_columns(&columns),
            sums: own.iter().map(|p| (p.weight, p.r)).collect(),
        })
    }

    fn offsets(&self, smoothness: Smoothness, sigma2: f64) -> Offsets<'_> {
        let rough = sigma2 * ROUGH.variance();
        let Smoothness::Field(kernel) = smoothness else {
            let own = self.sums.iter().map(|(weight, _)| PatchRest::new(&rough, weight)).collect();
            return Offsets { link: self, own, field: None };
        };
        let basis = kernel.basis(&self.places);
        let smooth = sigma2 * (1.0 - OWN);
        let own = self.sums.iter().enumerate().map(|(c, (weight, _))| {
            let of = basis.fixed_columns::<N_SMOOTH>(N_SMOOTH * c);
            // What lies between the nodes is a patch's own, too.
            let mut between = kernel.variance();
            let mut smooth_part = between.fixed_view_mut::<N_SMOOTH, N_SMOOTH>(0, 0);
            smooth_part -= of.tr_mul(&of);
            PatchRest::new(&(smooth * between + OWN * rough), weight)
        });
        let own: Vec<PatchRest> = own.collect();
        let field = self.field(basis, &own, 1.0 / smooth);
        Offsets { link: self, own, field }
    }

    fn field(&self, basis: DMatrix<f64>, own: &[PatchRest], prior: f64) -> Option<SmoothPart> {
        let all = || own.iter().zip(&self.sums);
        let left = |own: &PatchRest| own.left.fixed_rows::<N_SMOOTH>(0).into_owned();
        let weights = all().map(|(own, (weight, _))| {
            let weight = left(own) * weight;
            weight.fixed_columns::<N_SMOOTH>(0).into_owned()
        });
        let across = basis.transpose();
        let mut precision = each_times(&basis, weights) * &across;
        (0..basis.nrows()).for_each(|i| precision[(i, i)] += prior);
        let precision = precision.cholesky()?;
        let cross = each_times(&self.a, own.iter().map(|own| left(own).transpose())) * across;
        let sums = all().flat_map(|(own, (_, r))| (left(own) * r).data.0[0]);
        let pull = &basis * DVector::from_iterator(basis.ncols(), sums);
        let (gain, values) = (precision.solve(&cross.transpose()), precision.solve(&pull));
        Some(SmoothPart { basis, precision, values, gain, cross, prior, pull })
    }
}

impl Offsets<'_> {
    /// How a patch is likeliest off, as far as that enters the gradient.
    fn shape(&self, c: usize) -> Shape {
        let (own, r) = (&self.own[c], &self.link.sums[c].1);
        let mut shape = own.known * r;
        if let Some(field) = &self.field {
            let smooth = field.basis.fixed_columns::<N_SMOOTH>(N_SMOOTH * c);
            let left = own.left.fixed_rows::<N_SMOOTH>(0);
            shape += left.tr_mul(&smooth.tr_mul(&field.values));
        }
        shape
    }

    fn taken(&self) -> TakenOut {
        let link = self.link;
        let by: Vec<f64> = (0..self.own.len()).flat_map(|c| self.shape(c).data.0[0]).collect();
        let of_own = |(own, (_, r)): (&PatchRest, &(_, Shape))| {
            0.5 * (own.left.determinant().ln() + r.dot(&(own.known * r)))
        };
        let mut evidence: f64 = self.own.iter().zip(&link.sums).map(of_own).sum();
        let weighted = each_times(&link.a, self.own.iter().map(|own| own.known));
        let mut hessian = weighted * link.a.transpose();
        if let Some(field) = &self.field {
            hessian.gemm(1.0, &field.cross, &field.gain, 1.0);
            evidence += 0.5 * field.pull.dot(&field.values) - 0.5 * log_det(&field.precision);
            evidence += 0.5 * field.prior.ln() * field.values.len() as f64;
        }
        TakenOut { hessian, gradient: &link.a * DVector::from_vec(by), evidence }
    }

    /// Each patch gets its part of the gradient that is left.
    fn write(&self, patches: &mut [Option<PatchSums>]) {
        for (c, &at) in self.link.at.iter().enumerate() {
            let Some(patch) = &mut patches[at] else { continue };
            patch.g.gemv(-1.0, &patch.a, &self.shape(c), 1.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::patch_sums::PatchColumns;
    use super::*;
    use crate::model::HALF_PATCH;
    use contract::OneByOne;
    use nalgebra::Vector3;

    /// The patches of a link, and the sums of their residuals.
    struct LinkPatches {
        sums: Vec<Option<PatchSums>>,
        of: Patches,
    }

    /// A link of two sides, ten patches each along a line, on which an offset of `wave` lies; one
    /// unknown shifts all.
    fn link(wave: impl Fn(usize, f64) -> f64) -> LinkPatches {
        let (weight, mut patches, mut of) = (1e9, Vec::new(), Patches::default());
        for i in 0..20_usize {
            let (side, x) = (i / 10, (i % 10) as f64 * 0.13);
            let normal = if side == 0 { 1.0 } else { -1.0 };
            let r = weight * wave(side, x);
            let a = PatchColumns::from_row_slice(&[weight * normal, 0.0, 0.0, 0.0, 0.0]);
            let g = DVector::from_element(1, r * normal);
            let weight = ShapeSquare::from_diagonal(&Shape::new(weight, 0.0, 0.0, 0.0, 0.0));
            patches.push(Some(PatchSums { g, a, weight, r: Shape::new(r, 0.0, 0.0, 0.0, 0.0) }));
            of.groups.push(side as u32);
            let x = Vector3::new(x, 0.0, 0.05 * normal);
            of.places.push(PatchPlace::new(x, Vector3::new(0.0, 0.0, normal)));
        }
        LinkPatches { sums: patches, of }
    }

    fn chosen(LinkPatches { sums: mut patches, of }: LinkPatches) -> (Smoothness, f64) {
        let sums = patches.iter().flatten().map(PatchSums::total).sum::<f64>();
        let (mut h, mut g) = (DMatrix::from_element(1, 1, sums), DVector::zeros(1));
        let whole =
            PatchedSums { hessian: &mut h, gradient: &mut g, patches: &mut patches, of: &of };
        let smoothness = take_out(whole, 1e-6, None, &OneByOne);
        let left: f64 = patches.iter().flatten().map(|p| p.g[0]).sum();
        assert!((left - g[0]).abs() < 1e-6 * sums * 1e-3, "the patches' parts add up");
        (smoothness, -g[0] / h[(0, 0)])
    }

    #[test]
    fn residuals_tell_how_smooth_they_are() {
        let smooth = |x: f64| 1e-3 * (9.0 * x).sin();
        // Half of one side is not seen.
        let mut half = link(|_, x| smooth(x) + 1e-3);
        half.sums[15..].fill(None);
        let (thick, shift) = chosen(half);
        let sides = |s: Smoothness| match s {
            Smoothness::Field(kernel) => Some(kernel.sides),
            Smoothness::Apart => None,
        };
        assert_eq!(sides(thick), Some(0.0), "both sides off alike: {thick:?}");
        assert!(shift.abs() < 5e-5, "{shift}");
        let (apart, _) =
            chosen(link(|side, x| if side == 0 { smooth(x) } else { -smooth(x + 0.5) }));
        assert_eq!(sides(apart), Some(1.0), "each side for itself: {apart:?}");
        let rough = |i: f64| 2e-3 * ((i * 78.233 + 1.0).sin() * 43_758.545).fract();
        let (rough, _) = chosen(link(|side, x| rough((x / 0.13).round() + 17.0 * side as f64)));
        assert_eq!(rough, Smoothness::Apart);
    }

    #[test]
    fn offsets_apart_are_those_of_sherman_and_morrison() {
        let link = link(|side, x| 1e-3 * x + 2e-4 * side as f64);
        let LinkPatches { sums: mut patches, of } = link;
        let before = patches.clone();
        let sigma2 = 4e-7;
        let (mut h, mut g) = (DMatrix::zeros(1, 1), DVector::zeros(1));
        let whole =
            PatchedSums { hessian: &mut h, gradient: &mut g, patches: &mut patches, of: &of };
        take_out(whole, sigma2, Some(Smoothness::Apart), &OneByOne);
        let (mut wanted_h, mut wanted_g) = (0.0, 0.0);
        for p in before.iter().flatten() {
            let k = sigma2 / (1.0 + sigma2 * p.total());
            wanted_h -= k * p.a[0] * p.a[0];
            wanted_g += p.g[0] - k * p.r[0] * p.a[0];
        }
        assert!((h[(0, 0)] / wanted_h - 1.0).abs() < 1e-12);
        assert!((g[0] / wanted_g - 1.0).abs() < 1e-9);
    }

    #[test]
    fn a_patch_holds_a_turn_no_better_than_its_tilt_is_known() {
        // Even weight over the patch; one unknown turns it about its middle.
        let (w, sigma2) = (1e12, 1e-6);
        let weight = ShapeSquare::from_diagonal(&Shape::new(w, w / 3.0, w / 3.0, 0.0, 0.0));
        let turn = HALF_PATCH * w / 3.0;
        let a = PatchColumns::from_row_slice(&[0.0, turn, 0.0, 0.0, 0.0]);
        let mut patches =
            vec![Some(PatchSums { a, g: DVector::zeros(1), weight, r: Shape::zeros() })];
        let places = vec![PatchPlace::new(Vector3::zeros(), Vector3::z())];
        let of = Patches { groups: vec![0], places };
        let (mut h, mut g) = (DMatrix::from_element(1, 1, HALF_PATCH * turn), DVector::zeros(1));
        let told = Some(Smoothness::Apart);
        let whole =
            PatchedSums { hessian: &mut h, gradient: &mut g, patches: &mut patches, of: &of };
        take_out(whole, sigma2, told, &OneByOne);
        let known = (h[(0, 0)] * sigma2).sqrt().recip();
        assert!((known * ROUGH.length - 1.0).abs() < 1e-3, "{known}");
    }
}
