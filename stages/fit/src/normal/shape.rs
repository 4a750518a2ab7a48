//! Sums of residuals over the patches of a model's surface, and where those lie, in; out come the same sums with the patches'
//! offsets taken out, smooth over each link as far as the residuals say so (METHOD.md §11.4).
//!
//! An offset is `u_c = φ_c·z + e_c`: a smooth field over its link, a Gaussian process given by its values at a few nodes
//! (sparse approximation "FITC" of Snelson and Ghahramani, 2006), and a rest of its own. Both are integrated out.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use std::ops::Range;

use super::Patch;

/// Sides of a link that its patches look to: two for each axis.
pub(crate) const N_SIDES: u32 = 6;

/// The patches of a model's surface, link by link.
#[derive(Debug, Clone, Default)]
pub(crate) struct Patches {
    /// For each patch: its group, one for each link and side ([`N_SIDES`] a link).
    pub(crate) groups: Vec<u32>,
    /// Middle, metres, and mean normal of each, in the frame of its link.
    pub(crate) places: Vec<[f64; 6]>,
}

impl Patches {
    pub(crate) fn len(&self) -> usize {
        self.groups.len()
    }

    /// Those of each link.
    fn links(&self) -> impl Iterator<Item = Range<usize>> {
        let mut end = 0;
        self.groups.chunk_by(|a, b| a / N_SIDES == b / N_SIDES).map(move |link| {
            end += link.len();
            end - link.len()..end
        })
    }
}

/// How far offsets of neighbouring patches are alike: their correlation falls as a Gaussian in the distance of their middles and
/// that of their normals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Smoothness {
    /// Metres; 0: each patch is off by itself.
    length: f64,
    /// Weight of the normals: 0 where a link is too thick or too thin all around, 1 where opposite sides are off apart.
    sides: f64,
}

impl Smoothness {
    /// Each patch is off by itself.
    pub(crate) const APART: Self = Self { length: 0.0, sides: 0.0 };

    /// Shares of the patches' variance that are common to a side of a link, and that rise along it, and are not in their sums.
    pub(super) fn alike(self) -> [f64; 2] {
        match (self.is_around(), self.is_apart()) {
            (true, _) => ALIKE_AROUND,
            (_, true) => ALIKE,
            _ => ALIKE_SIDES,
        }
    }

    fn is_apart(self) -> bool {
        self == Self::APART
    }

    /// Whether all sides of a link are off alike.
    fn is_around(self) -> bool {
        self.length > 0.0 && self.sides == 0.0
    }
}

/// What castings, hulls and sheets are looked for as.
const LENGTHS: [f64; 3] = [0.1, 0.2, 0.4];
const SIDES: [f64; 2] = [0.0, 1.0];
/// Patches are off apart, but castings and hulls by waves that are longer than a patch: what the fit takes in does not show.
const ALIKE: [f64; 2] = [0.5, 0.25];
/// Sides are off each by itself, by such waves.
const ALIKE_SIDES: [f64; 2] = [1.0, 0.5];
/// All sides are off alike: opposite ones tell how much.
const ALIKE_AROUND: [f64; 2] = [0.06, 0.0];
/// Share of the variance of a smooth offset that is a patch's own: a field is not the same all over it.
const OWN: f64 = 0.02;
/// Nodes of the field are this near to each patch, in lengths, …
const NODE_GAP: f64 = 0.8;
/// … but no more than so many on a link.
const MAX_NODES: usize = 64;
/// Added to the nodes' correlation with themselves, for rounding.
const JITTER: f64 = 1e-6;
/// Smaller offsets are not worth a choice, metres.
const NO_OFFSET: f64 = 1e-4;

/// What the offsets of a link's patches take from the normal equations.
struct Taken {
    hessian: DMatrix<f64>,
    gradient: DVector<f64>,
    /// How much likelier the residuals are with the offsets than without, as a logarithm.
    evidence: f64,
}

/// The patches of a link that have residuals.
struct Link {
    /// Where they are among all.
    at: Vec<usize>,
    places: Vec<[f64; 6]>,
    /// Σ w J, a column for each.
    a: DMatrix<f64>,
    /// Σ w and Σ w r of each.
    sums: Vec<[f64; 2]>,
}

/// A link's offsets under one smoothness.
struct Offsets<'a> {
    link: &'a Link,
    /// For each patch: variance of its own part, and the share of its sums that is left with that taken out.
    own: Vec<[f64; 2]>,
    /// The smooth part, where there is one.
    field: Option<Field>,
}

struct Field {
    /// Values of the patches for unit values at the nodes: nodes × patches.
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

/// Takes the patches' offsets of variance `sigma2` out of the normal equations (with all priors, without the residuals' gradient)
/// and of the patches' own sums. How smooth they were taken for: as told, or as is likeliest.
pub(super) fn take_out(
    (hessian, gradient): (&mut DMatrix<f64>, &mut DVector<f64>),
    (patches, of): (&mut [Option<Patch>], &Patches),
    sigma2: f64,
    told: Option<Smoothness>,
) -> Smoothness {
    patches.iter().flatten().for_each(|patch| *gradient += &patch.g);
    if sigma2 <= 0.0 {
        return told.unwrap_or(Smoothness::APART);
    }
    let links: Vec<Link> = of.links().filter_map(|at| Link::new(patches, of, at)).collect();
    let smoothness = match told {
        Some(told) => told,
        None if sigma2.sqrt() < NO_OFFSET => Smoothness::APART,
        None => likeliest((hessian, gradient), &links, sigma2),
    };
    // A field of one side would take in what moves the link, and seem to know it.
    let used = if smoothness.is_around() { smoothness } else { Smoothness::APART };
    for link in &links {
        let offsets = link.offsets(used, sigma2);
        let taken = offsets.taken();
        *hessian -= taken.hessian;
        *gradient -= taken.gradient;
        offsets.write(patches);
    }
    smoothness
}

/// The smoothness under which the residuals are likeliest, whatever base, posture and scans are.
fn likeliest(
    (hessian, gradient): (&DMatrix<f64>, &DVector<f64>),
    links: &[Link],
    sigma2: f64,
) -> Smoothness {
    let smooth = LENGTHS
        .into_iter()
        .flat_map(|length| SIDES.into_iter().map(move |sides| Smoothness { length, sides }));
    let mut best = (f64::NEG_INFINITY, Smoothness::APART);
    for smoothness in std::iter::once(Smoothness::APART).chain(smooth) {
        let (mut h, mut g, mut evidence) = (hessian.clone(), gradient.clone(), 0.0);
        for link in links {
            let taken = link.offsets(smoothness, sigma2).taken();
            h -= taken.hessian;
            g -= taken.gradient;
            evidence += taken.evidence;
        }
        let Some(h) = h.cholesky() else { continue };
        evidence += 0.5 * g.dot(&h.solve(&g)) - 0.5 * log_det(&h);
        if evidence > best.0 {
            best = (evidence, smoothness);
        }
    }
    best.1
}

fn log_det(matrix: &Cholesky<f64, Dyn>) -> f64 {
    2.0 * matrix.l_dirty().diagonal().iter().map(|v| v.ln()).sum::<f64>()
}

impl Link {
    fn new(patches: &[Option<Patch>], of: &Patches, range: Range<usize>) -> Option<Self> {
        let at: Vec<usize> =
            range.filter(|&c| patches[c].as_ref().is_some_and(|p| p.weight > 0.0)).collect();
        let own: Vec<&Patch> = at.iter().filter_map(|&c| patches[c].as_ref()).collect();
        if own.is_empty() {
            return None;
        }
        let columns: Vec<_> = own.iter().map(|p| p.a.column(0)).collect();
        Some(Self {
            places: at.iter().map(|&c| of.places[c]).collect(),
            at,
            a: DMatrix::from_columns(&columns),
            sums: own.iter().map(|p| [p.weight, p.r]).collect(),
        })
    }

    fn offsets(&self, smoothness: Smoothness, sigma2: f64) -> Offsets<'_> {
        let left = |variance: f64, weight: f64| [variance, 1.0 / (1.0 + variance * weight)];
        if smoothness.is_apart() {
            let own = self.sums.iter().map(|[weight, _]| left(sigma2, *weight)).collect();
            return Offsets { link: self, own, field: None };
        }
        let basis = self.basis(smoothness);
        let own = basis.column_iter().zip(&self.sums).map(|(b, [weight, _])| {
            // What lies between the nodes is a patch's own, too.
            let between = (1.0 - b.norm_squared()).max(0.0);
            left(sigma2 * ((1.0 - OWN) * between + OWN), *weight)
        });
        let own: Vec<[f64; 2]> = own.collect();
        let prior = 1.0 / (sigma2 * (1.0 - OWN));
        let field = self.field(basis, &own, prior);
        Offsets { link: self, own, field }
    }

    /// Values of the patches for independent unit values of a field given by its nodes.
    fn basis(&self, smoothness: Smoothness) -> DMatrix<f64> {
        let places: Vec<[f64; 6]> = self.places.iter().map(|p| scaled(p, smoothness)).collect();
        let nodes = nodes(&places);
        let like = |a: &[f64; 6], b: &[f64; 6]| (-0.5 * apart2(a, b)).exp();
        let n = nodes.len();
        let own = DMatrix::from_fn(n, n, |i, j| {
            like(&nodes[i], &nodes[j]) + if i == j { JITTER } else { 0.0 }
        });
        let mut basis = DMatrix::from_fn(n, places.len(), |i, c| like(&nodes[i], &places[c]));
        if let Some(own) = own.cholesky() {
            own.l_dirty().solve_lower_triangular_mut(&mut basis);
        }
        basis
    }

    fn field(&self, basis: DMatrix<f64>, own: &[[f64; 2]], prior: f64) -> Option<Field> {
        let mut weighted = basis.clone();
        let mut left = basis.clone();
        let mut pull = DVector::zeros(basis.nrows());
        for (c, ([_, share], [weight, r])) in own.iter().zip(&self.sums).enumerate() {
            weighted.column_mut(c).scale_mut(share * weight);
            left.column_mut(c).scale_mut(*share);
            pull.axpy(share * r, &basis.column(c), 1.0);
        }
        let mut precision = weighted * basis.transpose();
        (0..basis.nrows()).for_each(|i| precision[(i, i)] += prior);
        let precision = precision.cholesky()?;
        let cross = &self.a * left.transpose();
        let (gain, values) = (precision.solve(&cross.transpose()), precision.solve(&pull));
        Some(Field { basis, precision, values, gain, cross, prior, pull })
    }
}

/// A place so that a distance of one is where likeness has fallen to 0.6.
fn scaled(place: &[f64; 6], smoothness: Smoothness) -> [f64; 6] {
    let (x, n) = (1.0 / smoothness.length, smoothness.sides.sqrt());
    std::array::from_fn(|i| place[i] * if i < 3 { x } else { n })
}

fn apart2(a: &[f64; 6], b: &[f64; 6]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum()
}

/// Places as far from each other as can be, until all are near to one.
fn nodes(places: &[[f64; 6]]) -> Vec<[f64; 6]> {
    let mut away = vec![f64::INFINITY; places.len()];
    let mut nodes: Vec<[f64; 6]> = Vec::new();
    let mut next = 0;
    while nodes.len() < MAX_NODES {
        nodes.push(places[next]);
        let mut farthest = NODE_GAP * NODE_GAP;
        let before = nodes.len();
        for (i, (away, place)) in away.iter_mut().zip(places).enumerate() {
            *away = away.min(apart2(place, &nodes[before - 1]));
            if *away > farthest {
                (farthest, next) = (*away, i);
            }
        }
        if farthest <= NODE_GAP * NODE_GAP {
            break;
        }
    }
    nodes
}

impl Offsets<'_> {
    /// The likeliest offset of the smooth part at a patch.
    fn smooth(&self, c: usize) -> f64 {
        self.field.as_ref().map_or(0.0, |field| field.basis.column(c).dot(&field.values))
    }

    fn taken(&self) -> Taken {
        let link = self.link;
        let mut weighted = link.a.clone();
        let mut by = DVector::zeros(link.sums.len());
        let mut evidence = 0.0;
        for (c, ([variance, share], [_, r])) in self.own.iter().zip(&link.sums).enumerate() {
            weighted.column_mut(c).scale_mut(variance * share);
            by[c] = share * (variance * r + self.smooth(c));
            evidence += 0.5 * (share.ln() + variance * share * r * r);
        }
        let mut hessian = weighted * link.a.transpose();
        if let Some(field) = &self.field {
            hessian.gemm(1.0, &field.cross, &field.gain, 1.0);
            evidence += 0.5 * field.pull.dot(&field.values) - 0.5 * log_det(&field.precision);
            evidence += 0.5 * field.prior.ln() * field.values.len() as f64;
        }
        Taken { hessian, gradient: &link.a * by, evidence }
    }

    /// Each patch gets its part of the gradient that is left, and what an offset of its own adds to it.
    fn write(&self, patches: &mut [Option<Patch>]) {
        for (c, ([variance, share], [weight, r])) in
            self.own.iter().zip(&self.link.sums).enumerate()
        {
            let Some(patch) = &mut patches[self.link.at[c]] else { continue };
            patch.g.axpy(-share * (variance * r + self.smooth(c)), &patch.a, 1.0);
            patch.a *= *share;
            if let Some(field) = &self.field {
                let column = field.basis.column(c);
                patch.a.gemv_tr(-share * weight, &field.gain, &column, 1.0);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A link of two sides, ten patches each along a line, on which an offset of `wave` lies; one unknown shifts all.
    fn link(wave: impl Fn(usize, f64) -> f64) -> (Vec<Option<Patch>>, Patches) {
        let (weight, mut patches, mut of) = (1e9, Vec::new(), Patches::default());
        for i in 0..20_usize {
            let (side, x) = (i / 10, (i % 10) as f64 * 0.13);
            let normal = if side == 0 { 1.0 } else { -1.0 };
            let r = weight * wave(side, x);
            let a = DVector::from_element(1, weight * normal);
            patches.push(Some(Patch { g: DVector::from_element(1, r * normal), a, weight, r }));
            of.groups.push(side as u32);
            of.places.push([x, 0.0, 0.05 * normal, 0.0, 0.0, normal]);
        }
        (patches, of)
    }

    fn chosen((mut patches, of): (Vec<Option<Patch>>, Patches)) -> (Smoothness, f64) {
        let sums = patches.iter().flatten().map(|p| p.weight).sum::<f64>();
        let (mut h, mut g) = (DMatrix::from_element(1, 1, sums), DVector::zeros(1));
        let smoothness = take_out((&mut h, &mut g), (&mut patches, &of), 1e-6, None);
        let left: f64 = patches.iter().flatten().map(|p| p.g[0]).sum();
        assert!((left - g[0]).abs() < 1e-6 * sums * 1e-3, "the patches' parts add up");
        (smoothness, -g[0] / h[(0, 0)])
    }

    #[test]
    fn residuals_tell_how_smooth_they_are() {
        let smooth = |x: f64| 1e-3 * (9.0 * x).sin();
        // Half of one side is not seen.
        let (mut patches, of) = link(|_, x| smooth(x) + 1e-3);
        patches[15..].fill(None);
        let (thick, shift) = chosen((patches, of));
        assert_eq!(thick.sides, 0.0, "both sides off alike: {thick:?}");
        assert!(!thick.is_apart() && shift.abs() < 5e-5, "{thick:?} {shift}");
        let (apart, _) =
            chosen(link(|side, x| if side == 0 { smooth(x) } else { -smooth(x + 0.5) }));
        assert_eq!(apart.sides, 1.0, "each side for itself: {apart:?}");
        let rough = |i: f64| 2e-3 * ((i * 78.233 + 1.0).sin() * 43_758.545).fract();
        let (rough, _) = chosen(link(|side, x| rough((x / 0.13).round() + 17.0 * side as f64)));
        assert!(rough.is_apart(), "{rough:?}");
    }

    #[test]
    fn offsets_apart_are_those_of_sherman_and_morrison() {
        let (mut patches, of) = link(|side, x| 1e-3 * x + 2e-4 * side as f64);
        let before = patches.clone();
        let sigma2 = 4e-7;
        let (mut h, mut g) = (DMatrix::zeros(1, 1), DVector::zeros(1));
        take_out((&mut h, &mut g), (&mut patches, &of), sigma2, Some(Smoothness::APART));
        let (mut wanted_h, mut wanted_g) = (0.0, 0.0);
        for p in before.iter().flatten() {
            let k = sigma2 / (1.0 + sigma2 * p.weight);
            wanted_h -= k * p.a[0] * p.a[0];
            wanted_g += p.g[0] - k * p.r * p.a[0];
        }
        assert!((h[(0, 0)] / wanted_h - 1.0).abs() < 1e-12);
        assert!((g[0] / wanted_g - 1.0).abs() < 1e-9);
    }
}
