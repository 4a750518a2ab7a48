//! Normal equations with all that was added to them in; how well base, joints and the scans' errors are known, out
//! (METHOD.md §14).

use nalgebra::{DMatrix, DVector};

use super::{Normal, Patch, Patches};

/// Beyond this factor the kernel says nothing any more.
const MAX_FACTOR: f64 = 4.0;
/// Least share of its stated variance that a point keeps: what is left without noise, of meshes and of rounding, is alike
/// for many points.
const MIN_SHARE: f64 = 0.3;
/// Patches that lie nearer than this to each other along an axis do not rise along it, metres.
const MIN_SPREAD: f64 = 0.02;

impl Normal {
    /// Covariance of base twist and joints: the inverse of the normal matrix, as wide as the residuals are, and wider in
    /// every direction in which those of whole groups of patches pull harder than independent errors would.
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
        // Errors of shape are alike all over a side of a link, and the fit takes most of that in: its residuals do not
        // show it, so the patches' variance stands for it.
        for (share, push) in self.pushes(of) {
            let moved = &inverse * push;
            wide.ger(share * self.sigma2, &moved, &moved, 1.0);
        }
        wide.view((0, 0), (n_robot, n_robot)).into_owned()
    }

    /// What the residuals say of the scans' errors whatever the robot does, without the priors, and how the robot gives way to
    /// each of them.
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

    /// Gradients for offsets that the patches of a group share, of a root mean square of one, and the share of the patches'
    /// variance that they have: the same for all, and, where each side is off by itself, rising along each axis of the link.
    fn pushes(&self, of: &Patches) -> Vec<(f64, DVector<f64>)> {
        let [alike, rising] = self.smoothness.alike();
        let seen = |(c, patch): (usize, &'_ Option<Patch>)| patch.is_some().then_some(c);
        let seen: Vec<usize> = self.patches.iter().enumerate().filter_map(seen).collect();
        let sum = |group: &[usize], offset: &dyn Fn(usize) -> f64| {
            let mut push = DVector::zeros(self.n);
            for &c in group {
                self.patches[c].iter().for_each(|patch| push.axpy(offset(c), &patch.a, 1.0));
            }
            push
        };
        let mut out = Vec::new();
        for group in seen.chunk_by(|a, b| of.groups[*a] == of.groups[*b]) {
            out.push((alike, sum(group, &|_| 1.0)));
            for axis in (0..3).filter(|_| rising > 0.0) {
                let along = |c: &usize| of.places[*c][axis];
                let mean = group.iter().map(along).sum::<f64>() / group.len() as f64;
                let square = group.iter().map(|c| (along(c) - mean).powi(2)).sum::<f64>();
                let spread = (square / group.len() as f64).sqrt();
                if spread > MIN_SPREAD {
                    out.push((rising, sum(group, &|c| (along(&c) - mean) / spread)));
                }
            }
        }
        out
    }

    /// What the rows show of their own variance, over what was taken for it: `Σψ²/Σw`; and how much wider the kernel makes
    /// errors than its weights say: `(Σw/Σψ′)²`. Where noise is not small against the gate, points beyond it are missing on
    /// both sides.
    fn kernel_factors(&self) -> [f64; 2] {
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
    use super::super::{N_SCAN, Row, Smoothness};
    use super::*;

    #[test]
    fn deviations_are_those_of_the_residuals_and_of_the_prior() {
        // Residuals of half the variance that is stated, on two patches; a prior that says as much as all of them.
        let (n_rows, r, weight) = (1000, 0.002_f64, 1.0 / (2.0 * 0.002 * 0.002));
        let mut normal = Normal::new(1, 1, 2);
        for i in 0..n_rows {
            let r = if i / 2 % 2 == 0 { r } else { -r };
            let influence = [(weight * r).powi(2), weight];
            let (robot, scan) = (&[1.0], [0.0; N_SCAN]);
            normal.add(&Row { robot, scan, view: 0, patch: i % 2, weight, influence, r });
        }
        let patches = Patches { groups: vec![0, 1], places: vec![[0.0; 6]; 2] };
        normal.close(&patches, Some(Smoothness::APART));
        let all = n_rows as f64 * weight;
        normal.add_robot_prior(&DMatrix::from_element(1, 1, all), &DVector::zeros(1));
        (0..N_SCAN).for_each(|i| normal.add_scan_prior(0, i, 0.0, 1.0));
        let variance = normal.covariance(&patches)[(0, 0)];
        assert!((variance * all - (0.5 + 1.0) / 4.0).abs() < 1e-9, "{}", variance * all);
    }
}
