//! The normal equations of robot and scans, with the offsets of the model's patches taken out in
//! closed form, and their solution (METHOD.md §11).
//!
//! Residuals of patch c have `φ·u_c` in common: it is off as a whole, tilted, and what is on it
//! shifted (`φ`: `PatchPlace::shape`). Sums over a patch are all that is needed of them:
//! `A_c = Σ w J φᵀ`, `R_c = Σ w r φ`, `W_c = Σ w φ φᵀ`.

mod covariance;
mod patch_sums;
mod shape;

use contract::Fan;
use geometry::robust;
use nalgebra::{DMatrix, DMatrixView, DVector};

use crate::model::{Patches, Shape, Smoothness};
use crate::refine::add_scaled;
use crate::state::N_SCAN;
use patch_sums::PatchSums;
use shape::PatchedSums;

/// One residual.
pub(crate) struct ResidualRow<'a> {
    /// Derivatives by base twist and joints.
    pub(crate) robot: &'a [f64],
    /// Derivatives by the errors of its scan.
    pub(crate) scan: [f64; N_SCAN],
    pub(crate) view: usize,
    pub(crate) patch: usize,
    /// What it changes by with each way in which that may be off.
    pub(crate) shape: Shape,
    /// Robust weight over variance, m⁻².
    pub(crate) weight: f64,
    /// Of the robust kernel: square of its influence, and its slope, both over variance.
    pub(crate) influence: [f64; 2],
    /// The residual, metres.
    pub(crate) r: f64,
}

/// Residuals whose products are added together.
const BATCH: usize = 64;

/// Rows of one scan that wait for that.
#[derive(Debug, Clone)]
struct RowBatch {
    view: usize,
    n: usize,
    /// Length of a row: unknowns of the robot, then those of the scan.
    width: usize,
    /// ResidualRow after row, plain and with their weights.
    rows: Vec<f64>,
    weighted: Vec<f64>,
}

impl RowBatch {
    fn new(width: usize) -> Self {
        let zeros = || vec![0.0; BATCH * width];
        Self { view: 0, n: 0, width, rows: zeros(), weighted: zeros() }
    }

    /// Keeps a row; it, with its weight, back.
    #[inline]
    fn push(&mut self, row: &ResidualRow<'_>) -> &[f64] {
        let at = self.n * self.width..(self.n + 1) * self.width;
        (self.view, self.n) = (row.view, self.n + 1);
        let (plain, weighted) = (&mut self.rows[at.clone()], &mut self.weighted[at]);
        plain[..row.robot.len()].copy_from_slice(row.robot);
        plain[row.robot.len()..].copy_from_slice(&row.scan);
        weighted.iter_mut().zip(&*plain).for_each(|(w, v)| *w = row.weight * v);
        weighted
    }

    /// `Σ w Jᵀ J` of the rows, which are gone then.
    fn take(&mut self) -> DMatrix<f64> {
        let (n, width) = (std::mem::take(&mut self.n), self.width);
        let mut sum = DMatrix::zeros(width, width);
        let rows = DMatrixView::from_slice(&self.rows, width, n);
        let weighted = DMatrixView::from_slice_with_strides(&self.weighted, n, width, width, 1);
        sum.gemm(1.0, &rows, &weighted, 0.0);
        sum
    }
}

/// The normal equations.
#[derive(Debug, Clone)]
pub(crate) struct Normal {
    n_robot: usize,
    n: usize,
    hessian: DMatrix<f64>,
    gradient: DVector<f64>,
    patches: Vec<Option<PatchSums>>,
    batch: RowBatch,
    /// What the priors add to the normal matrix: how well they are known does not depend on the
    /// residuals.
    priors: DMatrix<f64>,
    /// Sums of the rows' influences, of slopes over variance, and of weights.
    kernel: [f64; 3],
    n_rows: usize,
    sigma2: f64,
    smoothness: Smoothness,
}

impl Normal {
    pub(crate) fn new(n_robot: usize, n_views: usize, n_patches: usize) -> Self {
        let n = n_robot + n_views * N_SCAN;
        Self {
            n_robot,
            n,
            hessian: DMatrix::zeros(n, n),
            gradient: DVector::zeros(n),
            patches: vec![None; n_patches],
            batch: RowBatch::new(n_robot + N_SCAN),
            priors: DMatrix::zeros(n, n),
            kernel: [0.0; 3],
            n_rows: 0,
            sigma2: 0.0,
            smoothness: Smoothness::Apart,
        }
    }

    /// Unknowns of the robot: all but the scans'.
    pub(crate) fn n_robot(&self) -> usize {
        self.n_robot
    }

    /// Adds a residual.
    pub(crate) fn add(&mut self, row: &ResidualRow<'_>) {
        if self.batch.view != row.view || self.batch.n == BATCH {
            self.flush();
        }
        let (n, at) = (self.n_robot, self.n_robot + row.view * N_SCAN);
        let patch = self.patches[row.patch].get_or_insert_with(|| PatchSums::new(self.n));
        let weighted = self.batch.push(row);
        let sum = |sums: &mut [f64], factor: f64| {
            add_scaled(&mut sums[..n], factor, &weighted[..n]);
            add_scaled(&mut sums[at..at + N_SCAN], factor, &weighted[n..]);
        };
        let shape = row.shape;
        let sums = patch.a.as_mut_slice().chunks_exact_mut(self.n);
        sums.zip(shape.iter()).for_each(|(sums, factor)| sum(sums, *factor));
        sum(patch.g.as_mut_slice(), row.r);
        let w = row.weight;
        patch.weight += shape * (w * shape).transpose();
        patch.r += shape * (w * row.r);
        self.kernel[0] += row.influence[0];
        self.kernel[1] += row.influence[1];
        self.kernel[2] += w;
        self.n_rows += 1;
    }

    /// Adds the products of the rows that wait: one product of matrices for many rows.
    fn flush(&mut self) {
        if self.batch.n == 0 {
            return;
        }
        let (n, at) = (self.n_robot, self.n_robot + self.batch.view * N_SCAN);
        let sum = self.batch.take();
        let mut robot = self.hessian.view_mut((0, 0), (n, n));
        robot += sum.view((0, 0), (n, n));
        let mut both = self.hessian.view_mut((at, 0), (N_SCAN, n));
        both += sum.view((n, 0), (N_SCAN, n));
        let mut scan = self.hessian.view_mut((at, at), (N_SCAN, N_SCAN));
        scan += sum.view((n, n), (N_SCAN, N_SCAN));
    }

    /// Sums of both; before either is closed.
    pub(crate) fn join(mut self, mut later: Self) -> Self {
        self.flush();
        later.flush();
        self.hessian += later.hessian;
        self.n_rows += later.n_rows;
        (0..3).for_each(|i| self.kernel[i] += later.kernel[i]);
        for (own, other) in self.patches.iter_mut().zip(later.patches) {
            match (own.as_mut(), other) {
                (Some(own), Some(other)) => {
                    own.a += other.a;
                    own.g += other.g;
                    own.weight += other.weight;
                    own.r += other.r;
                }
                (None, other) => *own = other,
                (Some(_), None) => {}
            }
        }
        self
    }

    /// Takes the patches' offsets out, as smooth as told, or as is likeliest. Call once, after the
    /// last residual and all priors.
    pub(crate) fn close(&mut self, of: &Patches, told: Option<Smoothness>, fan: &dyn Fan) {
        self.flush();
        self.hessian.fill_upper_triangle_with_lower_triangle();
        self.sigma2 = patch_variance(self.patches.iter().flatten());
        let (hessian, gradient) = (&mut self.hessian, &mut self.gradient);
        let sums = PatchedSums { hessian, gradient, patches: &mut self.patches, of };
        self.smoothness = shape::take_out(sums, self.sigma2, told, fan);
    }

    pub(crate) fn add_robot_prior(&mut self, hessian: &DMatrix<f64>, gradient: &DVector<f64>) {
        let n = hessian.nrows();
        for matrix in [&mut self.hessian, &mut self.priors] {
            let mut block = matrix.view_mut((0, 0), (n, n));
            block += hessian;
        }
        let mut rows = self.gradient.rows_mut(0, n);
        rows += gradient;
    }

    /// One error of a scan is known to be zero, as much as `weight` says; it has the value.
    pub(crate) fn add_scan_prior(&mut self, view: usize, i: usize, value: f64, weight: f64) {
        self.add_weight(self.n_robot + view * N_SCAN + i, value, weight);
    }

    /// One unknown is known to be zero, give or take; it has the value.
    pub(crate) fn add_prior(&mut self, at: usize, value: f64, sigma: f64) {
        self.add_weight(at, value, 1.0 / (sigma * sigma));
    }

    fn add_weight(&mut self, at: usize, value: f64, weight: f64) {
        self.hessian[(at, at)] += weight;
        self.priors[(at, at)] += weight;
        self.gradient[at] += weight * value;
    }

    /// The step to the minimum; `None` where the points say nothing.
    pub(crate) fn solve(&self) -> Option<DVector<f64>> {
        if self.n_rows < MIN_ROWS {
            return None;
        }
        let [_, slopes, weights] = self.kernel;
        // What points say gives way as the kernel does; priors are squares, and ask for no longer
        // step.
        let of_points = &self.hessian - &self.priors;
        let hessian = of_points / robust::stretch(weights, slopes) + &self.priors;
        let step = hessian.cholesky()?.solve(&-&self.gradient);
        let longest = step.amax();
        // The posture was near already: a longer step has left the linear range.
        Some(if longest > MAX_STEP { step * (MAX_STEP / longest) } else { step })
    }

    /// Squared length of a step in stated standard deviations: no unknown moves by more than its
    /// root.
    pub(crate) fn deviations(&self, step: &DVector<f64>) -> f64 {
        step.dot(&(&self.hessian * step))
    }

    /// Standard deviation of the patches' offsets, metres.
    pub(crate) fn patch_sigma(&self) -> f64 {
        self.sigma2.sqrt()
    }

    /// How smooth the offsets are.
    pub(crate) fn smoothness(&self) -> Smoothness {
        self.smoothness
    }
}

/// Fewer residuals than this do not hold a robot.
const MIN_ROWS: usize = 30;
/// Longest step of an adjustment, radians and metres.
const MAX_STEP: f64 = 0.1;

/// Variance of the patches' offsets, m²: that of their mean residuals beyond what noise explains,
/// each weighted by how well it is known against an offset of a millimetre (METHOD.md §11).
fn patch_variance<'a>(patches: impl Iterator<Item = &'a PatchSums>) -> f64 {
    let (mut sum, mut total) = (0.0, 0.0);
    for patch in patches.filter(|p| p.total() > 0.0) {
        let noise2 = 1.0 / patch.total();
        let mean = (patch.r[0] / patch.total()).clamp(-OFFSETS.most, OFFSETS.most);
        let weight = (OFFSETS.typical * OFFSETS.typical + noise2).powi(-2);
        sum += weight * (mean * mean - noise2);
        total += weight;
    }
    if total > 0.0 { (sum / total).max(0.0) } else { 0.0 }
}

/// Offsets that the shapes of models have, metres.
struct ShapeOffsets {
    typical: f64,
    /// Larger mean residuals are things beside the robot, not its shape.
    most: f64,
}

const OFFSETS: ShapeOffsets = ShapeOffsets { typical: 0.001, most: 0.008 };

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_go_as_far_as_the_curvature_of_the_kernel_says() {
        // All residuals ask for the same shift; the kernel's slope is a share of its weight.
        let step = |slope: f64, stiff: f64| {
            let mut normal = Normal::new(1, 1, 1);
            for _ in 0..100 {
                let (weight, influence) = (1e4, [1.0, 1e4 * slope]);
                let (robot, scan, shape) = (&[1.0], [0.0; N_SCAN], Shape::x());
                let (view, patch, r) = (0, 0, 0.001);
                normal.add(&ResidualRow { robot, scan, view, patch, shape, weight, influence, r });
            }
            (0..N_SCAN).for_each(|i| normal.add_scan_prior(0, i, 0.0, 1.0));
            normal.flush();
            normal.gradient[0] = 100.0 * 1e4 * 0.001;
            normal.add_weight(0, 0.0, stiff);
            normal.solve().expect("a step")[0]
        };
        let slopes = [(1.0, 1.0), (1.0 / 1.2, 1.2), (0.5, 1.25)];
        for (slope, factor) in slopes {
            let step = step(slope, 0.0);
            assert!((step + 0.001 * factor).abs() < 1e-9, "{step} for {slope}");
        }
        // A stop as stiff as all the points: what it asks for is no kernel's.
        for (slope, factor) in slopes {
            let (step, wanted) = (step(slope, 1e6), -0.001 / (1.0 / factor + 1.0));
            assert!((step - wanted).abs() < 1e-9, "{step} for {slope}");
        }
    }

    #[test]
    fn batches_of_rows_add_up_as_single_ones_do() {
        let (n_robot, n_views) = (8, 2);
        let n = n_robot + n_views * N_SCAN;
        let mut normal = Normal::new(n_robot, n_views, 3);
        let mut wanted = DMatrix::<f64>::zeros(n, n);
        for i in 0..300_usize {
            let value = |k: usize| ((i * 31 + k * 17) % 23) as f64 - 11.0;
            let robot: Vec<f64> = (0..n_robot).map(value).collect();
            let scan: [f64; N_SCAN] = std::array::from_fn(|k| value(50 + k));
            // Runs of one scan, longer and shorter than a batch.
            let (view, weight) = (usize::from(i % 150 > 110), 1.0 + (i % 4) as f64);
            normal.add(&ResidualRow {
                robot: &robot,
                scan,
                view,
                patch: i % 3,
                shape: Shape::x(),
                weight,
                influence: [0.0; 2],
                r: value(99),
            });
            let mut whole = DVector::zeros(n);
            whole.rows_mut(0, n_robot).copy_from_slice(&robot);
            whole.rows_mut(n_robot + view * N_SCAN, N_SCAN).copy_from_slice(&scan);
            wanted.ger(weight, &whole, &whole, 1.0);
        }
        normal.flush();
        normal.hessian.fill_upper_triangle_with_lower_triangle();
        assert!((&normal.hessian - &wanted).amax() < 1e-6 * wanted.amax());
    }
}
