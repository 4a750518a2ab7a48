//! Least squares of place, axis and steps of a scanner on points in any order: azimuths and
//! elevations lie on combs, of which the phases are free in each cell of direction.

use geometry::robust::{tukey, tukey_slope};
use geometry::{Pose, Vector};
use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, SVector, UnitQuaternion};
use rustc_hash::FxHashMap;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Shift in the frame of the scanner, tilt about its x and y, steps of azimuth and elevation.
pub(crate) type Unknowns = SVector<f64, 7>;
type UnknownsSquare = SMatrix<f64, 7, 7>;

/// A scanner with the raster of its angles.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RasterFit {
    /// The scanner in the frame of the points.
    pub(crate) pose: Pose,
    /// Steps of azimuth and elevation, radians.
    pub(crate) steps: [f64; 2],
}

/// How points are compared with the raster.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CombComparison {
    /// Size of the cells in which phases are free, radians of azimuth and elevation; infinite for
    /// one cell.
    pub(crate) cell: [f64; 2],
    /// Cut-off of residuals, steps.
    pub(crate) cut: f64,
    /// Whether azimuths and elevations count.
    pub(crate) uses: [bool; 2],
}

/// The angles of a point.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SeenAngles {
    pub(crate) azimuth: f64,
    pub(crate) elevation: f64,
    pub(crate) range: f64,
    flat: f64,
    local: Vector,
}

/// Distance below which errors along the surface (rounding, beam width) count for more than those
/// of the angle, metres.
const NEAR: f64 = 1.5;
/// Relative gain of the score below which no further step is made.
const ENOUGH: f64 = 1e-4;
/// Elevations beyond which azimuths mean little, radians.
const STEEP: f64 = 1.3;

impl RasterFit {
    /// Angles of a point as the raster counts them.
    pub(crate) fn see(&self, at: &[f64; 3]) -> Option<SeenAngles> {
        let p = self.pose.rotation.inverse() * (Vector::from(*at) - self.pose.translation.vector);
        let flat2 = p.x * p.x + p.y * p.y;
        let (flat, range) = (flat2.sqrt(), (flat2 + p.z * p.z).sqrt());
        (flat > 1e-6).then(|| SeenAngles {
            azimuth: p.y.atan2(p.x),
            elevation: p.z.atan2(flat),
            range,
            flat,
            local: p,
        })
    }

    /// The fit moved by the unknowns.
    pub(crate) fn moved(&self, by: &Unknowns) -> Self {
        let turn = self.pose.rotation;
        let at = self.pose.translation.vector + turn * Vector::new(by[0], by[1], by[2]);
        let tilt = UnitQuaternion::from_scaled_axis(Vector::new(by[3], by[4], 0.0));
        let pose = Pose::from_parts(at.into(), turn * tilt);
        Self { pose, steps: [self.steps[0] + by[5], self.steps[1] + by[6]] }
    }

    /// Places from the seven unknowns that keep the foot of the axis on the plane z = 0.
    pub(crate) fn about_foot(&self) -> [Unknowns; 3] {
        let axis = self.pose.rotation * Vector::z();
        let s = self.pose.translation.vector.z / axis.z;
        [
            Unknowns::from([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]),
            Unknowns::from([0.0, -s, 0.0, 1.0, 0.0, 0.0, 0.0]),
            Unknowns::from([s, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0]),
        ]
    }
}

impl SeenAngles {
    fn slopes(&self) -> [Unknowns; 2] {
        let (p, h) = (self.local, self.flat);
        let r2 = self.range * self.range;
        let of_azimuth = Vector::new(-p.y, p.x, 0.0) / (h * h);
        let of_elevation = Vector::new(-p.z * p.x / h, -p.z * p.y / h, h) / r2;
        [of_azimuth, of_elevation].map(|d| {
            // A turn of the scanner by w moves the local point by p × w.
            let about_x = d.dot(&p.cross(&Vector::x()));
            let about_y = d.dot(&p.cross(&Vector::y()));
            Unknowns::from([-d.x, -d.y, -d.z, about_x, about_y, 0.0, 0.0])
        })
    }

    fn angle(&self, kind: usize) -> f64 {
        [self.azimuth, self.elevation][kind]
    }

    fn weight(&self, kind: usize) -> f64 {
        let near = self.range * self.range / (self.range * self.range + NEAR * NEAR);
        // Errors along the surface turn the azimuth of steep beams more.
        let steep = if kind == 0 { (self.flat / self.range).powi(2) } else { 1.0 };
        near * steep
    }

    pub(crate) fn is_flat(&self) -> bool {
        self.elevation.abs() < STEEP
    }
}

/// Phasors of one cell.
#[derive(Debug, Clone, Copy, Default)]
struct PhaseSum {
    n: f64,
    phasors: [[f64; 2]; 2],
}

/// Weighted sums of a cell.
#[derive(Debug, Clone, Default)]
struct EquationMean {
    w: f64,
    residual: f64,
    slope: Unknowns,
}

impl EquationMean {
    fn add(&mut self, e: &AngleEquation, weight: f64) {
        self.w += weight;
        self.residual += weight * e.residual;
        self.slope += e.slope * weight;
    }
}

/// Points as a raster sees them, and how clear its combs are.
pub(crate) struct SeenRaster {
    rows: Vec<SeenPoint>,
    sums: Vec<PhaseSum>,
    /// Power of the phasors above chance, over cells and kinds, in standard deviations.
    score: f64,
    /// Length of the mean phasors of azimuth and elevation over all cells, weighted by points.
    coherence: [f64; 2],
}

/// The equations of least squares at a raster.
struct RasterEquations {
    hessian: UnknownsSquare,
    gradient: Unknowns,
    /// Standard deviations of the residuals of what is within the cut-off, radians.
    sigmas: [f64; 2],
}

/// One point as it is compared.
struct SeenPoint {
    angles: SeenAngles,
    cell: u32,
}

impl SeenRaster {
    fn of(fit: &RasterFit, points: &[[f64; 3]], how: &CombComparison) -> Self {
        let mut of_key: FxHashMap<(i32, i32), u32> = FxHashMap::default();
        let mut sums: Vec<PhaseSum> = Vec::new();
        let mut rows = Vec::with_capacity(points.len());
        let per_step = fit.steps.map(|step| TAU / step);
        for p in points {
            let Some(angles) = fit.see(p).filter(SeenAngles::is_flat) else { continue };
            let key = |v: f64, size: f64| (v / size).floor() as i32;
            let key = (key(angles.azimuth, how.cell[0]), key(angles.elevation, how.cell[1]));
            let cell = *of_key.entry(key).or_insert_with(|| {
                sums.push(PhaseSum::default());
                sums.len() as u32 - 1
            });
            let sum = &mut sums[cell as usize];
            sum.n += 1.0;
            for kind in (0..2).filter(|kind| how.uses[*kind]) {
                let (sin, cos) = (angles.angle(kind) * per_step[kind]).sin_cos();
                sum.phasors[kind][0] += cos;
                sum.phasors[kind][1] += sin;
            }
            rows.push(SeenPoint { angles, cell });
        }
        let (mut score, mut coherence) = (0.0, [0.0; 2]);
        let n_cells = sums.len().max(1) as f64;
        for kind in (0..2).filter(|kind| how.uses[*kind]) {
            let length = |s: &PhaseSum| s.phasors[kind][0].hypot(s.phasors[kind][1]);
            let power = sums.iter().map(|s| length(s).powi(2) / s.n).sum::<f64>();
            score += (power - n_cells) / n_cells.sqrt();
            coherence[kind] = sums.iter().map(length).sum::<f64>() / rows.len().max(1) as f64;
        }
        Self { rows, sums, score, coherence }
    }

    fn equations(&self, fit: &RasterFit, how: &CombComparison) -> RasterEquations {
        let mut out = RasterEquations {
            hessian: UnknownsSquare::zeros(),
            gradient: Unknowns::zeros(),
            sigmas: [0.0; 2],
        };
        for kind in (0..2).filter(|kind| how.uses[*kind]) {
            let phases = CellPhases::of(kind, fit.steps[kind], &self.sums);
            let mut means = vec![EquationMean::default(); self.sums.len()];
            let (mut squares, mut total) = (0.0, 0.0);
            for e in self.rows.iter().filter_map(|row| phases.equation(row, how.cut)) {
                squares += e.cut * e.off * e.off;
                total += e.cut;
                means[e.cell].add(&e, e.weight);
                out.hessian.syger(e.weight, &e.slope, &e.slope, 1.0);
                out.gradient += e.slope * (e.weight * e.residual);
            }
            for mean in means.iter().filter(|m| m.w > 0.0) {
                out.hessian.syger(-1.0 / mean.w, &mean.slope, &mean.slope, 1.0);
                out.gradient -= mean.slope * (mean.residual / mean.w);
            }
            out.sigmas[kind] = (squares / f64::max(total, 1.0)).sqrt() * fit.steps[kind];
        }
        out.hessian.fill_upper_triangle_with_lower_triangle();
        out
    }
}

/// Standard deviations of the points about the combs of a raster, radians.
pub(crate) fn deviations(fit: &RasterFit, points: &[[f64; 3]], how: &CombComparison) -> [f64; 2] {
    SeenRaster::of(fit, points, how).equations(fit, how).sigmas
}

/// The raster of one kind of angle as its cells have it.
struct CellPhases {
    kind: usize,
    step: f64,
    /// Phase of each cell, cycles.
    phase: Vec<f64>,
    /// Weight of each cell: how much its phasors exceed chance.
    trust: Vec<f64>,
}

/// One equation of a point.
struct AngleEquation {
    cell: usize,
    /// Residual, cycles and radians.
    off: f64,
    residual: f64,
    slope: Unknowns,
    /// Weight of the residual alone, and with all that is known.
    cut: f64,
    weight: f64,
}

impl CellPhases {
    fn of(kind: usize, step: f64, sums: &[PhaseSum]) -> Self {
        let length = |s: &PhaseSum| s.phasors[kind][0].hypot(s.phasors[kind][1]);
        let phase = |s: &PhaseSum| s.phasors[kind][1].atan2(s.phasors[kind][0]) / TAU;
        let trust = |s: &PhaseSum| ((length(s) / s.n).powi(2) - 2.0 / s.n).max(0.0);
        Self {
            kind,
            step,
            phase: sums.iter().map(phase).collect(),
            trust: sums.iter().map(trust).collect(),
        }
    }

    /// The equation of a point; `None` where it lies beyond the cut-off.
    fn equation(&self, row: &SeenPoint, cut: f64) -> Option<AngleEquation> {
        let cell = row.cell as usize;
        if self.trust[cell] <= 0.0 {
            return None;
        }
        let cycles = row.angles.angle(self.kind) / self.step - self.phase[cell];
        let number = cycles.round();
        let off = cycles - number;
        let cut = tukey(off, cut);
        if cut <= 0.0 {
            return None;
        }
        let known = self.trust[cell] * row.angles.weight(self.kind) / (self.step * self.step);
        let mut slope = row.angles.slopes()[self.kind];
        slope[5 + self.kind] = -number;
        Some(AngleEquation {
            cell,
            off,
            residual: off * self.step,
            slope,
            cut,
            weight: cut * known,
        })
    }
}

/// Length of the mean phasors of azimuth and elevation over all cells, weighted by points.
pub(crate) fn coherence(fit: &RasterFit, points: &[[f64; 3]], how: &CombComparison) -> [f64; 2] {
    SeenRaster::of(fit, points, how).coherence
}

/// Covariance of the position in the frame of the points, from how much the pulls of directions
/// differ: points of one azimuth, and those of one elevation, share errors of the encoders.
///
/// How far a pull moves the position depends on the slope of the pulls there and not on the weights
/// of the points: near the cut-off a point that comes closer pulls more, not less, and points of
/// others, which lie evenly beside the combs, hold nothing back.
pub(crate) fn position_covariance(
    fit: &RasterFit,
    points: &[[f64; 3]],
    how: &CombComparison,
) -> Option<Matrix3<f64>> {
    /// Size of the bins of angle in which errors are taken for one, radians (5°).
    const BIN: f64 = 0.087;
    let SeenRaster { rows, sums, .. } = SeenRaster::of(fit, points, how);
    let mut hessian = UnknownsSquare::zeros();
    let mut pulls = [BTreeMap::<(usize, i64), Unknowns>::new(), BTreeMap::new()];
    for kind in 0..2 {
        let phases = CellPhases::of(kind, fit.steps[kind], &sums);
        let equations =
            || rows.iter().filter_map(|row| Some((row, phases.equation(row, how.cut)?)));
        let mut means = vec![EquationMean::default(); sums.len()];
        for (_, e) in equations() {
            let held = e.weight * tukey_slope(e.off, how.cut) / e.cut;
            means[e.cell].add(&e, held);
            hessian.syger(held, &e.slope, &e.slope, 1.0);
        }
        for mean in means.iter().filter(|m| m.w > 0.0) {
            hessian.syger(-1.0 / mean.w, &mean.slope, &mean.slope, 1.0);
        }
        for (row, e) in equations().filter(|(_, e)| means[e.cell].w > 0.0) {
            let mean = &means[e.cell];
            let pull = (e.slope - mean.slope / mean.w) * (e.weight * e.residual);
            for (by, pulls) in pulls.iter_mut().enumerate() {
                let bin = (row.angles.angle(by) / BIN).floor() as i64;
                *pulls.entry((kind, bin)).or_insert_with(Unknowns::zeros) += pull;
            }
        }
    }
    hessian.fill_upper_triangle_with_lower_triangle();
    // Where it is not positive, the combs are no clearer here than beside.
    let inverse = hessian.cholesky()?.inverse();
    let turn = fit.pose.rotation.to_rotation_matrix();
    let of = |pulls: &BTreeMap<(usize, i64), Unknowns>| {
        let n = pulls.len() as f64;
        let all = pulls.values().map(|g| g * g.transpose()).sum::<UnknownsSquare>();
        // Seven unknowns are fitted to as many pulls as there are bins.
        let c = inverse * (all * (n / (n - 7.0).max(1.0))) * inverse;
        turn * c.fixed_view::<3, 3>(0, 0).into_owned() * turn.inverse()
    };
    // Errors along azimuth and along elevation are independent of each other.
    Some(of(&pulls[0]) + of(&pulls[1]))
}

/// The fit by steps of least squares along some directions of the unknowns, for as long as the
/// combs become clearer; and the coherence of azimuths and elevations then.
pub(crate) fn improved(
    mut fit: RasterFit,
    points: &[[f64; 3]],
    how: &CombComparison,
    along: impl Fn(&RasterFit) -> Vec<Unknowns>,
    rounds: usize,
) -> (RasterFit, [f64; 2]) {
    let mut seen = SeenRaster::of(&fit, points, how);
    for _ in 0..rounds {
        let Some(by) = step(&seen.equations(&fit, how), &along(&fit)) else { break };
        let tried = [1.0, 0.5, 0.25].into_iter().find_map(|scale| {
            let moved = fit.moved(&(by * scale));
            let other = SeenRaster::of(&moved, points, how);
            (other.score > seen.score).then_some((moved, other))
        });
        let Some((moved, other)) = tried else { break };
        let gain = other.score - seen.score;
        (fit, seen) = (moved, other);
        if gain < ENOUGH * seen.score.abs() {
            break;
        }
    }
    (fit, seen.coherence)
}

/// The step of least squares along some directions of the unknowns; `None` where they leave
/// something undetermined.
fn step(equations: &RasterEquations, along: &[Unknowns]) -> Option<Unknowns> {
    let columns: Vec<DVector<f64>> =
        along.iter().map(|u| DVector::from_column_slice(u.as_slice())).collect();
    let basis = DMatrix::from_columns(&columns);
    let h = DMatrix::from_column_slice(7, 7, equations.hessian.as_slice());
    let g = DVector::from_column_slice(equations.gradient.as_slice());
    let h = basis.transpose() * h * &basis;
    let by = &basis * h.cholesky()?.solve(&-(basis.transpose() * g));
    Some(Unknowns::from_column_slice(by.as_slice()))
}

/// Directions of the unknowns that are single ones.
pub(crate) fn single<const N: usize>(which: [usize; N]) -> Vec<Unknowns> {
    which
        .map(|i| {
            let mut one = Unknowns::zeros();
            one[i] = 1.0;
            one
        })
        .to_vec()
}
