//! Least squares of position, axis and step of a scanner on all points of its columns: elevations
//! on a comb, and the points of each column in one plane through the axis.

use geometry::robust::tukey;
use geometry::{Pose, Vector};
use nalgebra::{Matrix6, UnitQuaternion, Vector6};

/// A point of a column with its place on the comb.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CombPoint {
    /// Coordinates less the origin of the search, metres.
    pub(crate) at: Vector,
    /// Number of its run.
    pub(crate) run: u32,
    /// Number of the point in its run.
    pub(crate) order: u32,
    /// Number of the group of points that share a phase of elevation.
    pub(crate) phase: u32,
    /// Side of the axis: 1, or -1 beyond the zenith.
    pub(crate) side: f64,
    /// Number of its row on the comb, relative to any other of its group.
    pub(crate) row: f64,
}

/// A scanner that is fitted: where it stands, how its axis is directed, and its step of elevation.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ScannerFit {
    /// The scanner in the frame of the search.
    pub(crate) pose: Pose,
    /// Step between rows, radians.
    pub(crate) step: f64,
}

/// The state of the normal equations at one fit.
pub(crate) struct NormalEquations {
    hessian: Matrix6<f64>,
    gradient: Vector6<f64>,
    /// Standard deviations of the elevations about the comb and of the points about the planes,
    /// radians.
    pub(crate) sigmas: [f64; 2],
    rows: Vec<WeightedRow>,
}

/// One equation: which point it is of, its derivatives, residual (radians) and weight.
struct WeightedRow {
    point: usize,
    of_elevation: bool,
    slope: Vector6<f64>,
    residual: f64,
    weight: f64,
}

/// Distance below which errors along the surface (rounding, beam width) count for more than those
/// of the angle, metres.
const NEAR: f64 = 2.0;
/// Cut-off of residuals, in standard deviations.
const CUT: f64 = 4.5;
/// Least standard deviation of an angle, radians: 0.2″, below what any encoder has.
const LEAST_SIGMA: f64 = 1e-6;
/// Size of the bins of elevation over which errors are taken for one, radians (5°): graduation
/// errors of an encoder are the same in all columns.
const ELEVATION_BIN: f64 = 0.087;

/// Direction of a point in the frame of the scanner, with derivatives by the point's coordinates.
struct Seen {
    /// Elevation, on the far side beyond the zenith, radians.
    elevation: f64,
    /// Azimuth of the half plane that is the column's, radians.
    azimuth: f64,
    /// Cosine of the elevation.
    flat: f64,
    range: f64,
    local: Vector,
    /// Derivatives of elevation and of the angle across the column by the local coordinates.
    slopes: [Vector; 2],
}

impl ScannerFit {
    /// Elevation of a point as the comb counts it, radians.
    pub(crate) fn elevation(&self, at: &Vector, side: f64) -> f64 {
        let p = self.local(at);
        p.z.atan2(side * p.x.hypot(p.y))
    }

    /// A point in the frame of the scanner.
    pub(crate) fn local(&self, at: &Vector) -> Vector {
        self.pose.rotation.inverse() * (at - self.pose.translation.vector)
    }

    fn see(&self, point: &CombPoint) -> Option<Seen> {
        let p = self.local(&point.at);
        let h = p.x.hypot(p.y);
        let range = p.norm();
        if h < 1e-6 || range < 1e-3 {
            return None;
        }
        let s = point.side;
        let r2 = range * range;
        let up = Vector::new(-p.z * s * p.x / h, -p.z * s * p.y / h, s * h) / r2;
        let across = Vector::new(-p.y, p.x, 0.0) / (h * range);
        Some(Seen {
            elevation: p.z.atan2(s * h),
            azimuth: (s * p.y).atan2(s * p.x),
            flat: h / range,
            range,
            local: p,
            slopes: [up, across],
        })
    }

    /// The next fit by one step of least squares, and the equations at this one. `None` where they
    /// leave something undetermined.
    pub(crate) fn improved(&self, points: &[CombPoint]) -> Option<(Self, NormalEquations)> {
        let normal = self.normal(points)?;
        let x = normal.hessian.cholesky()?.solve(&-normal.gradient);
        let turn = self.pose.rotation;
        let shift = turn * Vector::new(x[0], x[1], x[2]);
        let tilt = UnitQuaternion::from_scaled_axis(Vector::new(x[3], x[4], 0.0));
        let at = self.pose.translation.vector + shift;
        let pose = Pose::from_parts(at.into(), turn * tilt);
        Some((Self { pose, step: self.step + x[5] }, normal))
    }

    fn normal(&self, points: &[CombPoint]) -> Option<NormalEquations> {
        let (rows, sigmas) = self.rows(points)?;
        let (mut hessian, mut gradient) = (Matrix6::zeros(), Vector6::zeros());
        for row in &rows {
            hessian += row.slope * row.slope.transpose() * row.weight;
            gradient += row.slope * (row.weight * row.residual);
        }
        Some(NormalEquations { hessian, gradient, sigmas, rows })
    }

    /// The equations of all points, less the mean of their groups: phases of elevation and azimuths
    /// of columns are free.
    fn rows(&self, points: &[CombPoint]) -> Option<(Vec<WeightedRow>, [f64; 2])> {
        let mut rows = [Vec::new(), Vec::new()];
        let n_runs = points.iter().map(|p| p.run as usize + 1).max()?;
        let mut azimuths = vec![None; n_runs];
        for (i, point) in points.iter().enumerate() {
            let Some(seen) = self.see(point) else { continue };
            let azimuth = *azimuths[point.run as usize].get_or_insert(seen.azimuth);
            let off = wrapped(seen.azimuth - azimuth) * seen.flat;
            let weight = seen.range * seen.range / (seen.range * seen.range + NEAR * NEAR);
            let angles = [seen.elevation - point.row * self.step, off];
            for (kind, residual) in angles.into_iter().enumerate() {
                let slope = slope(&seen, kind, point.row);
                let of_elevation = kind == 0;
                rows[kind].push(WeightedRow { point: i, of_elevation, slope, residual, weight });
            }
        }
        let by_phase = |row: &WeightedRow| points[row.point].phase;
        let by_run = |row: &WeightedRow| points[row.point].run;
        let sigmas = [centred(&mut rows[0], by_phase)?, centred(&mut rows[1], by_run)?];
        let [mut all, second] = rows;
        all.extend(second);
        Some((all, sigmas))
    }
}

/// The same angle within a half turn of zero, radians.
pub(crate) fn wrapped(angle: f64) -> f64 {
    angle - (angle / std::f64::consts::TAU).round() * std::f64::consts::TAU
}

/// Derivatives of an angle of a point by shift (scanner frame), tilt about x and y, and step.
fn slope(seen: &Seen, kind: usize, row: f64) -> Vector6<f64> {
    let d = seen.slopes[kind];
    let p = seen.local;
    // A turn of the scanner by w moves the local point by p × w.
    let about_x = d.dot(&p.cross(&Vector::x()));
    let about_y = d.dot(&p.cross(&Vector::y()));
    let of_step = if kind == 0 { -row } else { 0.0 };
    Vector6::new(-d.x, -d.y, -d.z, about_x, about_y, of_step)
}

/// Subtracts the weighted mean of each group, weights residuals robustly and by their deviation,
/// and returns that deviation, radians.
fn centred(rows: &mut [WeightedRow], group: impl Fn(&WeightedRow) -> u32) -> Option<f64> {
    let mut sigma = 0.0;
    let n_groups = rows.iter().map(|row| group(row) as usize + 1).max()?;
    for pass in 0..2 {
        let mut means = vec![(0.0, 0.0, Vector6::zeros()); n_groups];
        for row in rows.iter() {
            let cut = if pass == 0 { 1.0 } else { tukey(row.residual, CUT * sigma) };
            let w = row.weight * cut;
            let mean = &mut means[group(row) as usize];
            *mean = (mean.0 + w, mean.1 + w * row.residual, mean.2 + row.slope * w);
        }
        for row in rows.iter_mut() {
            let (w, residual, slope) = means[group(row) as usize];
            if w > 0.0 {
                row.residual -= residual / w;
                row.slope -= slope / w;
            }
        }
        let mut sizes: Vec<f64> = rows.iter().map(|r| r.residual.abs()).collect();
        // The median deviation of a normal error is 0.6745 standard deviations.
        sigma = (geometry::robust::median(&mut sizes)? / 0.6745).max(LEAST_SIGMA);
    }
    for row in rows {
        row.weight *= tukey(row.residual, CUT * sigma) / (sigma * sigma);
    }
    Some(sigma)
}

impl NormalEquations {
    /// Standard deviations of the position along the axes of the scanner, metres, from how much the
    /// pulls of runs and of bins of elevation differ: points of one column, and those of one
    /// elevation, share errors.
    pub(crate) fn position_covariance(
        &self,
        fit: &ScannerFit,
        points: &[CombPoint],
    ) -> Option<nalgebra::Matrix3<f64>> {
        let inverse = self.hessian.try_inverse()?;
        let bin = |point: &CombPoint| {
            let e = fit.elevation(&point.at, point.side);
            (e / ELEVATION_BIN).floor() as i64
        };
        let by_run = self.pulls(|row| i64::from(points[row.point].run));
        let by_bin = self.pulls(|row| {
            let point = &points[row.point];
            // What bends columns is the column's own.
            if row.of_elevation { bin(point) } else { i64::from(point.run) + (1 << 40) }
        });
        let cov = [by_run, by_bin].map(|pulls| {
            let c = inverse * pulls * inverse;
            c.fixed_view::<3, 3>(0, 0).into_owned()
        });
        let turn = fit.pose.rotation.to_rotation_matrix();
        let [a, b] = cov.map(|c| turn * c * turn.inverse());
        // Columns and encoders err independently of each other.
        Some(a + b)
    }

    /// Sum over clusters of the outer products of their pulls.
    fn pulls(&self, cluster: impl Fn(&WeightedRow) -> i64) -> Matrix6<f64> {
        let mut sums = std::collections::BTreeMap::<i64, Vector6<f64>>::new();
        for row in &self.rows {
            *sums.entry(cluster(row)).or_insert_with(Vector6::zeros) +=
                row.slope * (row.weight * row.residual);
        }
        let n = sums.len() as f64;
        let all = sums.values().map(|g| g * g.transpose()).sum::<Matrix6<f64>>();
        // Six unknowns are fitted to as many pulls as there are clusters.
        all * (n / (n - 6.0).max(1.0))
    }
}
