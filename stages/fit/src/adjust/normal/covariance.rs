//! The covariance of base, joints and the scans' errors, from the normal equations and the
//! residuals (METHOD.md §14.1).

use nalgebra::{DMatrix, DVector};

use super::Normal;
use crate::model::Patches;

/// Beyond this factor the kernel says nothing any more.
const MAX_FACTOR: f64 = 4.0;
/// Least share of its stated variance that a point keeps: what is left without noise, of meshes and
/// of rounding, is alike for many points.
const MIN_SHARE: f64 = 0.3;

impl Normal {
    /// Covariance of base twist and joints: the inverse of the normal matrix, as wide as the
    /// residuals are, and wider in every direction in which those of whole groups of patches
    /// pull harder than independent errors would.
    pub(crate) fn covariance(&self, of: &Patches) -> DMatrix<f64> {
        let groups = &of.groups;
        let n_robot = self.n_robot;
        let Some(cholesky) = self.hessian.clone().cholesky() else {
            return DMatrix::identity(n_robot, n_robot) * 1e3;
        };
        let [share, stretch] = self.kernel_factors();
        let n_groups = groups.iter().max().map_or(0, |g| *g as usize + 1);
        let mut pulls: Vec<Option<DVector<f64>>> = vec![None; n_groups];
        for (patch, group) in self.patches.iter().zip(groups) {
            let Some(patch) = patch else { continue };
            let pull = pulls[*group as usize].get_or_insert_with(|| DVector::zeros(self.n));
            *pull += &patch.g;
        }
        let l_inverse = cholesky
            .l()
            .solve_lower_triangular(&DMatrix::identity(self.n, self.n))
            .unwrap_or_else(|| DMatrix::identity(self.n, self.n));
        let mut meat: DMatrix<f64> = DMatrix::zeros(self.n, self.n);
        let mut count = 0.0;
        for pull in pulls.iter().flatten() {
            let white = &l_inverse * pull;
            meat.ger(1.0, &white, &white, 1.0);
            count += 1.0;
        }
        if count > 1.0 {
            meat *= count / (count - 1.0);
        }
        let mut eigen = meat.symmetric_eigen();
        eigen.eigenvalues.iter_mut().for_each(|v| *v = v.max(share));
        let inverse = l_inverse.transpose() * &l_inverse;
        let mut wide = l_inverse.transpose() * eigen.recompose() * &l_inverse * stretch;
        // Residuals that are smaller than thought make no prior better known.
        wide += &inverse * &self.priors * &inverse * (1.0 - share * stretch).max(0.0);
        wide.view((0, 0), (n_robot, n_robot)).into_owned()
    }

    /// What the residuals say of the scans' errors whatever the robot does, without the priors, and
    /// how the robot gives way to each of them.
    pub(crate) fn shared(&self) -> Option<[DMatrix<f64>; 2]> {
        let (n, n_scans) = (self.n_robot, self.n - self.n_robot);
        let robot = self.hessian.view((0, 0), (n, n)).into_owned().cholesky()?;
        let both = self.hessian.view((0, n), (n, n_scans)).into_owned();
        let gain = -robot.solve(&both);
        let of_scans = |m: &DMatrix<f64>| m.view((n, n), (n_scans, n_scans)).into_owned();
        let information =
            of_scans(&self.hessian) + both.transpose() * &gain - of_scans(&self.priors);
        let [share, stretch] = self.kernel_factors();
        Some([gain, information / (share * stretch)])
    }

    /// What the rows show of their own variance, over what was taken for it: `Σψ²/Σw`; and how much
    /// wider the kernel makes errors than its weights say: `(Σw/Σψ′)²`. Where noise is not
    /// small against the gate, points beyond it are missing on both sides.
    pub(super) fn kernel_factors(&self) -> [f64; 2] {
        let [influence, slope, weight] = self.kernel;
        if slope <= 0.0 {
            return [1.0, MAX_FACTOR];
        }
        let stretch = (weight / slope).powi(2).clamp(1.0, MAX_FACTOR);
        [(influence / weight).max(MIN_SHARE), stretch]
    }
}

#[cfg(test)]
mod tests {
    use super::super::ResidualRow;
    use super::*;
    use crate::model::{PatchPlace, Shape, Smoothness};
    use crate::state::N_SCAN;
    use contract::OneByOne;
    use nalgebra::Vector3;

    #[test]
    fn deviations_are_those_of_the_residuals_and_of_the_prior() {
        // Residuals of half the variance that is stated, on two patches; a prior that says as much
        // as all of them.
        let (n_rows, r, weight) = (1000, 0.002_f64, 1.0 / (2.0 * 0.002 * 0.002));
        let mut normal = Normal::new(1, 1, 2);
        for i in 0..n_rows {
            let r = if i / 2 % 2 == 0 { r } else { -r };
            let influence = [(weight * r).powi(2), weight];
            let (robot, scan) = (&[1.0], [0.0; N_SCAN]);
            let (view, patch, shape) = (0, i % 2, Shape::x());
            normal.add(&ResidualRow { robot, scan, view, patch, shape, weight, influence, r });
        }
        let patches = Patches {
            groups: vec![0, 1],
            places: vec![PatchPlace::new(Vector3::zeros(), Vector3::z()); 2],
        };
        normal.close(&patches, Some(Smoothness::Apart), &OneByOne);
        let all = n_rows as f64 * weight;
        normal.add_robot_prior(&DMatrix::from_element(1, 1, all), &DVector::zeros(1));
        (0..N_SCAN).for_each(|i| normal.add_scan_prior(0, i, 0.0, 1.0));
        let variance = normal.covariance(&patches)[(0, 0)];
        assert!((variance * all - (0.5 + 1.0) / 4.0).abs() < 1e-9, "{}", variance * all);
    }
}
