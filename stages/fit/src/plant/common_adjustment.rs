//! Adjusts all robots of a plant together: base and joints of each follow what the others, and
//! pieces of surface that stand still, say of the errors of the scans that see them (METHOD.md
//! §18).
//!
//! Near its minimum an adjustment is linear: what a robot's points say of the errors `e_i` of its
//! scans is a normal distribution (information `Λ_i`, vector `η_i`), and robot and joints follow
//! the errors by `x_i = x̂_i + G_i (e_i − ê_i)`. Scans err alike near all robots but for what is
//! each robot's own (its paint, the shape of its castings): `e_i = e + d_i`, `d_i ~ N(0, D_i)`.
//! What the others say of `e` then takes the place of the prior of `e_i`, and no point is read
//! again.

use contract::{Fit, Overlap, Scan, ScanId, ScanShare, Verdict};
use geometry::Vector;
use nalgebra::{DMatrix, DVector, UnitQuaternion};
use robot::Model;

use crate::Settings;
use crate::assess::tip_sigma;
use crate::problem::scan_priors;
use crate::state::N_SCAN;

/// Errors of a scan that are a robot's own, one sigma.
struct OwnError {
    /// Metres; what its surface is off is added.
    shift: f64,
    /// Radians.
    turn: f64,
    /// Of the ranges, metres.
    bias: f64,
}

const OWN: OwnError = OwnError { shift: 0.000_3, turn: 0.000_02, bias: 0.000_5 };
/// How flat a piece of floor or wall is, and how well a scan has its middle, metres, one sigma.
const FLAT: f64 = 0.002;
/// Share of a prior's variance that errors of a robot's own may be.
const MOST_OWN: f64 = 0.5;
/// A robot that others would move farther than this is none of whose scans err as theirs do, or is
/// no robot: metres, radians.
const MAX_STEP: f64 = 0.01;
/// A robot whose own points others would move farther off than this is left as it stands, too:
/// squared deviations for each unknown of its scans.
const MAX_WORSE: f64 = 2.0;
/// No variance shrinks to less than this share: what others say is no more than its own model of
/// errors.
const LEAST_LEFT: f64 = 0.05;

/// What one thing says of the errors that scans have everywhere: information and its vector, seven
/// values a scan.
struct ScanEvidence {
    scans: Vec<ScanId>,
    information: DMatrix<f64>,
    vector: DVector<f64>,
}

/// A robot's own adjustment.
struct RobotShare {
    scans: Vec<ScanId>,
    errors: DVector<f64>,
    information: DMatrix<f64>,
    vector: DVector<f64>,
    gain: DMatrix<f64>,
    /// Variances of what is its own, by value of a scan.
    apart: [f64; N_SCAN],
}

/// Brings robots up to date with what others, and pieces of surface that stand still, say of their
/// scans; those that stand in all scans only.
pub fn together(
    fits: &mut [Fit],
    models: &[Model],
    scans: &[Scan],
    still: &[Overlap],
    settings: &Settings,
) {
    let priors = scan_priors(settings);
    let own: Vec<Option<RobotShare>> =
        fits.iter().map(|fit| RobotShare::of(fit, &priors)).collect();
    let is_sure = |fit: &Fit| fit.verdict == Verdict::Trusted;
    let told = own.iter().zip(&*fits);
    let told = told.map(|(own, fit)| own.as_ref().filter(|_| is_sure(fit))?.told());
    let told: Vec<Option<ScanEvidence>> = told.collect();
    for (i, fit) in fits.iter_mut().enumerate() {
        let Some(own) = &own[i] else { continue };
        let others = told.iter().enumerate().filter(|(j, _)| *j != i);
        let still = ScanEvidence::by_surfaces(still, scans, &own.scans);
        let others = others.filter_map(|(_, told)| told.as_ref()).chain(&still);
        if let Some(new) = own.among(others, &priors) {
            new.bring(fit, own, &models[fit.model], scans);
        }
    }
}

impl RobotShare {
    fn of(fit: &Fit, priors: &[f64; N_SCAN]) -> Option<Self> {
        let stands = fit.verdict != Verdict::Refused && fit.stands_in.is_empty();
        let share = fit.share.as_ref().filter(|_| stands && fit.calibration.is_none())?;
        let ScanShare { scans, errors, information, gain } = share;
        let (n, n_robot) = (scans.len() * N_SCAN, 6 + fit.joints.len());
        let is_whole = errors.len() == n && information.len() == n * n && gain.len() == n_robot * n;
        if !is_whole || fit.covariance.len() != n_robot * n_robot {
            return None;
        }
        let errors = DVector::from_column_slice(errors);
        let information = without_negative(DMatrix::from_row_slice(n, n, information));
        let mut vector = &information * &errors;
        (0..n).for_each(|k| vector[k] += priors[k % N_SCAN] * errors[k]);
        let apart = apart(fit.surface_sigma, Some(priors));
        let gain = DMatrix::from_row_slice(n_robot, n, gain);
        Some(Self { scans: scans.clone(), errors, information, vector, gain, apart })
    }

    /// What it says of the errors that the scans have everywhere.
    fn told(&self) -> Option<ScanEvidence> {
        ScanEvidence::softened(self.scans.clone(), &self.information, &self.vector, &self.apart)
    }

    /// The errors of its scans by what it and others say; `None` where no other says anything of
    /// them, or where what they say is not to be believed.
    fn among<'t>(
        &self,
        others: impl Iterator<Item = &'t ScanEvidence>,
        priors: &[f64; N_SCAN],
    ) -> Option<ScanUpdate> {
        let n = self.errors.len();
        let apart = DMatrix::from_diagonal(&repeated(&self.apart, n));
        let prior = |k: usize| 1.0 / (1.0 / priors[k] - self.apart[k]);
        let everywhere: [f64; N_SCAN] = std::array::from_fn(prior);
        let mut information = DMatrix::from_diagonal(&repeated(&everywhere, n));
        let mut vector = DVector::zeros(n);
        let mut is_alone = true;
        for told in others {
            is_alone &= !told.add_to(&self.scans, &everywhere, &mut information, &mut vector);
        }
        if is_alone {
            return None;
        }
        let known = information.cholesky()?;
        let (middle, spread) = (known.solve(&vector), known.inverse() + apart);
        let weight = spread.cholesky()?.inverse();
        let posterior = (&self.information + &weight).cholesky()?;
        let errors = posterior.solve(&(&self.vector + &weight * middle));
        let alone = &self.information + DMatrix::from_diagonal(&repeated(priors, n));
        let gained = alone.cholesky()?.inverse() - posterior.inverse();
        let step = &errors - &self.errors;
        let worse = (step.transpose() * &self.information * &step)[(0, 0)];
        (worse <= MAX_WORSE * n as f64).then_some(ScanUpdate { step, gained })
    }
}

impl ScanEvidence {
    /// What pieces of surface say of some scans: each is at an unknown place on which those that
    /// saw it agree.
    fn by_surfaces(still: &[Overlap], all: &[Scan], scans: &[ScanId]) -> Option<Self> {
        let scanner = |id: &ScanId| {
            let scan = all.iter().find(|scan| scan.id == *id)?;
            Some(scan.world_from_scan.translation.vector)
        };
        let scanners: Vec<Vector> = scans.iter().map(scanner).collect::<Option<_>>()?;
        let n = scans.len() * N_SCAN;
        let (mut information, mut vector) = (DMatrix::zeros(n, n), DVector::zeros(n));
        for piece in still {
            let normal = Vector::from(piece.normal);
            let row = |(id, at): &(ScanId, [f64; 3])| {
                let k = scans.iter().position(|own| own == id)?;
                let (at, beam) = (Vector::from(*at), Vector::from(*at) - scanners[k]);
                let lever = beam.cross(&normal);
                let along = -normal.dot(&beam.normalize());
                let [x, y, z] = normal.into();
                Some((k, [x, y, z, lever.x, lever.y, lever.z, along], normal.dot(&at)))
            };
            let rows: Vec<(usize, [f64; N_SCAN], f64)> =
                piece.seen.iter().filter_map(row).collect();
            if rows.len() < 2 {
                continue;
            }
            // About their mean: where the piece is, nobody knows.
            let (weight, share) = (1.0 / (FLAT * FLAT), 1.0 / rows.len() as f64);
            let middle = rows.iter().map(|row| row.2).sum::<f64>() * share;
            for (k, row, r) in &rows {
                for (v, value) in row.iter().enumerate() {
                    let at = k * N_SCAN + v;
                    vector[at] -= weight * value * (r - middle);
                    for (l, other, _) in &rows {
                        let factor = weight * value * (f64::from(u8::from(k == l)) - share);
                        let mut block = information.view_mut((at, l * N_SCAN), (1, N_SCAN));
                        block.iter_mut().zip(other).for_each(|(sum, v)| *sum += factor * v);
                    }
                }
            }
        }
        if information.amax() <= 0.0 {
            return None;
        }
        Self::softened(scans.to_vec(), &information, &vector, &apart(0.0, None))
    }

    /// Of what is told about errors that are a thing's own by so much (variances).
    fn softened(
        scans: Vec<ScanId>,
        information: &DMatrix<f64>,
        vector: &DVector<f64>,
        apart: &[f64; N_SCAN],
    ) -> Option<Self> {
        let weights = repeated(&apart.map(|variance| 1.0 / variance), vector.len());
        let own = DMatrix::from_diagonal(&weights);
        let share = &own * (information + &own).cholesky()?.inverse();
        let information = without_negative(&own - &share * &own);
        Some(Self { scans, vector: share * vector, information })
    }

    /// Adds what is told of some scans, the others of it known as priors say; whether it tells of
    /// any of them.
    fn add_to(
        &self,
        scans: &[ScanId],
        priors: &[f64; N_SCAN],
        information: &mut DMatrix<f64>,
        vector: &mut DVector<f64>,
    ) -> bool {
        let place = |scan: &ScanId| scans.iter().position(|own| own == scan);
        let (mut here, mut there, mut rest) = (Vec::new(), Vec::new(), Vec::new());
        for (k, scan) in self.scans.iter().enumerate() {
            let values = (0..N_SCAN).map(|v| k * N_SCAN + v);
            match place(scan) {
                Some(at) => {
                    here.extend(values);
                    there.extend((0..N_SCAN).map(|v| at * N_SCAN + v));
                }
                None => rest.extend(values),
            }
        }
        let block = |a: &[usize], b: &[usize]| {
            DMatrix::from_fn(a.len(), b.len(), |i, j| self.information[(a[i], b[j])])
        };
        let of = |a: &[usize]| DVector::from_fn(a.len(), |i, _| self.vector[a[i]]);
        let mut others = block(&rest, &rest);
        (0..rest.len()).for_each(|i| others[(i, i)] += priors[i % N_SCAN]);
        let both = block(&here, &rest);
        let Some(others) = others.cholesky() else { return false };
        let own = block(&here, &here) - &both * others.solve(&both.transpose());
        let own_vector = of(&here) - &both * others.solve(&of(&rest));
        for (i, &a) in there.iter().enumerate() {
            vector[a] += own_vector[i];
            for (j, &b) in there.iter().enumerate() {
                information[(a, b)] += own[(i, j)];
            }
        }
        !here.is_empty()
    }
}

/// What others change about a robot's scans.
struct ScanUpdate {
    /// Of their errors.
    step: DVector<f64>,
    /// By which their covariance shrinks.
    gained: DMatrix<f64>,
}

impl ScanUpdate {
    /// Brings a fit up to date; one that would move too far stays as it is, and so does a joint
    /// that nothing determines.
    fn bring(&self, fit: &mut Fit, own: &RobotShare, model: &Model, scans: &[Scan]) {
        let mut step = &own.gain * &self.step;
        let joints = fit.joints.iter().enumerate();
        joints.filter(|(_, joint)| !joint.is_determined()).for_each(|(j, _)| step[6 + j] = 0.0);
        if step.amax() > MAX_STEP {
            return;
        }
        let n = step.len();
        let old = DMatrix::from_row_slice(n, n, &fit.covariance);
        let mut new = &old - &own.gain * &self.gained * own.gain.transpose();
        // A variance that is nearly all the scans' would vanish: correlations stay, what is left is
        // at least so much.
        let left = (0..n).map(|i| new[(i, i)] / old[(i, i)].max(f64::MIN_POSITIVE));
        let least = left.fold(1.0, f64::min);
        if least < LEAST_LEFT {
            let share = (1.0 - LEAST_LEFT) / (1.0 - least);
            new = &old + (new - &old) * share;
        }
        let shrunk = |sigma: f64, i: usize| {
            (sigma * sigma - old[(i, i)] + new[(i, i)]).max(LEAST_LEFT * sigma * sigma).sqrt()
        };
        fit.base_sigma = std::array::from_fn(|i| shrunk(fit.base_sigma[i], i));
        let posture: Vec<f64> = fit.joints.iter().map(|joint| joint.value).collect();
        let [before, after] = [&old, &new].map(|cov| tip_sigma(model, &posture, cov).powi(2));
        let least = LEAST_LEFT * fit.tip_sigma.powi(2);
        fit.tip_sigma = (fit.tip_sigma.powi(2) - before + after).max(least).sqrt();
        // What does not follow the others is known no better by them.
        let joints = fit.joints.iter_mut().enumerate();
        for (j, joint) in joints.filter(|(_, joint)| joint.is_determined()) {
            joint.value += step[6 + j];
            joint.sigma = shrunk(joint.sigma, 6 + j);
        }
        fit.covariance = new.transpose().as_slice().to_vec();
        self.shift_scans(fit, own, scans);
        let twist = Vector::new(step[3], step[4], step[5]);
        fit.world_from_base.translation.vector += Vector::new(step[0], step[1], step[2]);
        fit.world_from_base.rotation =
            UnitQuaternion::from_scaled_axis(twist) * fit.world_from_base.rotation;
    }

    /// What is said of the scans near the robot, about its base as it stood.
    fn shift_scans(&self, fit: &mut Fit, own: &RobotShare, scans: &[Scan]) {
        let base = fit.world_from_base.translation.vector;
        for shift in &mut fit.scans {
            let (Some(k), Some(scan)) = (
                own.scans.iter().position(|scan| *scan == shift.scan),
                scans.iter().find(|scan| scan.id == shift.scan),
            ) else {
                continue;
            };
            let value = |v: usize| self.step[k * N_SCAN + v];
            let turn = Vector::new(value(3), value(4), value(5));
            let lever = base - scan.world_from_scan.translation.vector;
            let moved = Vector::new(value(0), value(1), value(2)) + turn.cross(&lever);
            (0..3).for_each(|i| shift.shift[i] += moved[i]);
            (0..3).for_each(|i| shift.turn[i] += turn[i]);
            shift.range_bias += value(6);
        }
    }
}

/// Variances of what is a thing's own, whose surface is off by so much, metres.
fn apart(surface_sigma: f64, priors: Option<&[f64; N_SCAN]>) -> [f64; N_SCAN] {
    let [shift, turn, bias] = [OWN.shift, OWN.turn, OWN.bias].map(|sigma| sigma * sigma);
    let shift = shift + surface_sigma * surface_sigma;
    let all = [shift, shift, shift, turn, turn, turn, bias];
    std::array::from_fn(|k| priors.map_or(all[k], |p| all[k].min(MOST_OWN / p[k])))
}

/// Values of a scan, again for each of them.
fn repeated(values: &[f64; N_SCAN], n: usize) -> DVector<f64> {
    DVector::from_fn(n, |k, _| values[k % N_SCAN])
}

/// A symmetric matrix without what rounding left below zero.
fn without_negative(matrix: DMatrix<f64>) -> DMatrix<f64> {
    let mut eigen = ((&matrix + matrix.transpose()) * 0.5).symmetric_eigen();
    eigen.eigenvalues.iter_mut().for_each(|v| *v = v.max(0.0));
    eigen.recompose()
}

#[cfg(test)]
mod tests;
