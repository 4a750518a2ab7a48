//! Registers a new scan to the planes of an earlier session: the rigid motion that brings the
//! scan's points onto surfaces that did not move, with its uncertainty.
//!
//! Residuals are point-to-plane distances (Chen and Medioni 1992). Planes come from the plant's
//! points, one for each voxel. Each voxel has one residual, so that a densely sampled wall counts
//! by its area only. Tukey weights suppress surfaces that moved between the sessions.
#![forbid(unsafe_code)]

use geometry::{Moments, Plane, Point, Pose, Vector};
use nalgebra::{Matrix6, Translation3, UnitQuaternion, Vector6};
use rustc_hash::FxHashMap;
use std::collections::hash_map::Entry;

/// Edge of a voxel, metres: large enough for a hundred points of a common scan, small enough that
/// the surface of a machine is flat within it.
const EDGE: f64 = 0.10;
/// Offset of the voxel grid, metres. Floors and walls often lie at round coordinates and must not
/// lie on the borders of voxels.
const BEGIN: f64 = 0.0371;
/// Fewest points of a plane, and its largest RMS distance from them, metres.
const MIN_POINTS: f64 = 12.0;
const MAX_RMS: f64 = 0.008;
/// Least spread of a plane's points across their main direction, metres. Points on a line give no
/// plane.
const MIN_SPREAD: f64 = 0.012;
/// Points farther from a plane than this belong to another surface, metres. Sessions differ by
/// less.
const GATE: f64 = 0.05;
/// Fewest points of the new scan in a voxel that gives a residual.
const MIN_NEW: usize = 3;
/// Fewest voxels with residuals that determine a registration.
const MIN_CELLS: usize = 50;
/// Prior standard deviations of a scan's registration: shift in metres, rotation in radians.
const PRIOR: [f64; 2] = [0.02, 0.003];
/// Limit of iterations; each computes the weights anew.
const ROUNDS: usize = 12;
/// Iterations end at a step smaller than this, metres and radians: a hundredth of the uncertainty
/// of the shift.
const SETTLED: f64 = 1e-6;
/// Tukey's tuning constant, and the standard deviation of normal deviates by their median absolute
/// value.
const TUKEY: f64 = 4.685;
const FROM_MEDIAN: f64 = 1.4826;

/// The moments of a plant's points in each voxel. No result depends on the order of the voxels.
#[derive(Debug, Clone, Default)]
pub struct SurfaceVoxels {
    cells: FxHashMap<[i32; 3], Moments>,
}

/// The planes of the voxels whose points are flat.
#[derive(Debug, Clone)]
pub struct Planes {
    cells: FxHashMap<[i32; 3], Plane>,
}

/// The registration of a scan to a plant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Registration {
    /// The motion from the scan's stated world frame to the plant's frame.
    pub plant_from_stated: Pose,
    /// Standard deviations of the shift in x, y, z at the centre of rotation, metres, and of the
    /// rotation about x, y, z, radians.
    pub sigma: [f64; 6],
    /// Number of voxels with residuals.
    pub n_surfaces: usize,
    /// Robust standard deviation of the distances from the plant's planes, before and after,
    /// metres.
    pub rms: [f64; 2],
}

/// The residual of one voxel: mean distance of the new points from its plane, normal of the plane,
/// and mean of the points, metres. While points are added these are sums.
struct VoxelResidual {
    distance: f64,
    normal: Vector,
    at: Vector,
}

impl SurfaceVoxels {
    /// Adds a point, world frame, metres.
    pub fn add(&mut self, p: [f64; 3]) {
        let cell = cell(&p);
        let middle = Vector::from(cell.map(|i| (f64::from(i) + 0.5) * EDGE + BEGIN));
        self.cells.entry(cell).or_insert_with(|| Moments::new(middle)).add(&p.into());
    }

    /// Adds all points of another set.
    pub fn join(&mut self, other: Self) {
        other.cells.into_iter().for_each(|(cell, moments)| match self.cells.entry(cell) {
            Entry::Vacant(slot) => drop(slot.insert(moments)),
            Entry::Occupied(mut own) => own.get_mut().join(&moments),
        });
    }

    /// The planes of the voxels that have enough points and are flat.
    #[must_use]
    pub fn planes(&self) -> Planes {
        let flat = self.cells.iter().filter_map(|(cell, moments)| {
            let fit = (moments.n >= MIN_POINTS).then(|| moments.plane()).flatten()?;
            let is_flat = fit.rms <= MAX_RMS && fit.spread[1] >= MIN_SPREAD;
            is_flat.then_some((*cell, fit.plane))
        });
        Planes { cells: flat.collect() }
    }
}

impl Planes {
    /// The rigid motion that brings points of a scan (its stated world frame, metres) onto the
    /// planes. `about` is the centre of rotation, world frame. `None` if fewer than 50 voxels have
    /// residuals, or if the normal equations are singular.
    #[must_use]
    pub fn register(&self, points: &[[f64; 3]], about: &Point) -> Option<Registration> {
        let (mut pose, mut sigma, mut rms) = (Pose::identity(), [0.0; 6], [None; 2]);
        let mut n_surfaces = 0;
        for _ in 0..ROUNDS {
            let residuals = voxel_residuals(&self.cells, points, &pose);
            if residuals.len() < MIN_CELLS {
                return None;
            }
            let scale = scale(&residuals);
            let step = solve(&residuals, scale, about, &total(&pose, about))?;
            rms[0] = rms[0].or(Some(scale));
            rms[1] = Some(scale);
            n_surfaces = residuals.len();
            sigma = step.1;
            pose = motion(&step.0, about) * pose;
            if step.0.amax() < SETTLED {
                break;
            }
        }
        let rms = rms.map(Option::unwrap_or_default);
        Some(Registration { plant_from_stated: pose, sigma, n_surfaces, rms })
    }
}

fn cell(p: &[f64; 3]) -> [i32; 3] {
    p.map(|v| ((v - BEGIN) / EDGE).floor() as i32)
}

/// The rigid motion of a step: shift (metres) and rotation vector (radians) about a centre.
fn motion(step: &Vector6<f64>, about: &Point) -> Pose {
    let turn = UnitQuaternion::from_scaled_axis(Vector::new(step[3], step[4], step[5]));
    let shift = Vector::new(step[0], step[1], step[2]);
    Pose::from_parts(Translation3::from(about.coords + shift - turn * about.coords), turn)
}

/// The shift of a centre (metres) and the rotation vector (radians) of a motion: the inverse of
/// `motion`.
fn total(pose: &Pose, about: &Point) -> Vector6<f64> {
    let (shift, turn) = (pose * about - about, pose.rotation.scaled_axis());
    Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z)
}

/// The residuals of the voxels at a pose, in the order in which points reach them.
fn voxel_residuals(
    planes: &FxHashMap<[i32; 3], Plane>,
    points: &[[f64; 3]],
    pose: &Pose,
) -> Vec<VoxelResidual> {
    // Consecutive points mostly lie in the same voxel, so that its plane and its sums are looked up
    // only once for them.
    let mut sums: FxHashMap<[i32; 3], usize> = FxHashMap::default();
    let mut residuals: Vec<(usize, VoxelResidual)> = Vec::new();
    let (mut last, mut current): (Option<[i32; 3]>, Option<(&Plane, usize)>) = (None, None);
    for p in points {
        let p = (pose * Point::from(*p)).coords;
        let cell = cell(&p.into());
        if last != Some(cell) {
            last = Some(cell);
            current = planes.get(&cell).map(|plane| {
                let at = *sums.entry(cell).or_insert_with(|| {
                    let (normal, at) = (plane.normal, Vector::zeros());
                    residuals.push((0, VoxelResidual { distance: 0.0, normal, at }));
                    residuals.len() - 1
                });
                (plane, at)
            });
        }
        let Some((plane, at)) = current else { continue };
        let distance = plane.distance(&p);
        if distance.abs() < GATE {
            let (n, sum) = &mut residuals[at];
            *n += 1;
            sum.distance += distance;
            sum.at += p;
        }
    }
    let supported = residuals.into_iter().filter(|(n, _)| *n >= MIN_NEW);
    let mean = |(n, sum): (usize, VoxelResidual)| VoxelResidual {
        distance: sum.distance / n as f64,
        at: sum.at / n as f64,
        ..sum
    };
    supported.map(mean).collect()
}

/// Robust standard deviation of the residuals, metres.
fn scale(residuals: &[VoxelResidual]) -> f64 {
    let mut all: Vec<f64> = residuals.iter().map(|t| t.distance.abs()).collect();
    let middle = all.len() / 2;
    let (_, median, _) = all.select_nth_unstable_by(middle, f64::total_cmp);
    (FROM_MEDIAN * *median).max(1e-4)
}

/// Solves the weighted normal equations for one Gauss-Newton step: shift and rotation vector about
/// the centre, and their standard deviations. `total` is the motion so far, which the prior draws
/// to zero.
fn solve(
    residuals: &[VoxelResidual],
    scale: f64,
    about: &Point,
    total: &Vector6<f64>,
) -> Option<(Vector6<f64>, [f64; 6])> {
    let (mut normal, mut right) = (Matrix6::zeros(), Vector6::zeros());
    for t in residuals {
        let u = t.distance / (TUKEY * scale);
        if u.abs() >= 1.0 {
            continue;
        }
        let weight = (1.0 - u * u).powi(2) / (scale * scale);
        let turn = (t.at - about.coords).cross(&t.normal);
        let n = t.normal;
        let row = Vector6::new(n.x, n.y, n.z, turn.x, turn.y, turn.z);
        normal += weight * row * row.transpose();
        right -= weight * t.distance * row;
    }
    for i in 0..6 {
        let information = PRIOR[i / 3].powi(-2);
        normal[(i, i)] += information;
        right[i] -= information * total[i];
    }
    let covariance = normal.try_inverse()?;
    Some((covariance * right, std::array::from_fn(|i| covariance[(i, i)].max(0.0).sqrt())))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points on a floor and two walls, with some noise; `phase` tells scans apart.
    fn room(phase: f64) -> Vec<[f64; 3]> {
        let noise = |k: usize| 0.002 * ((k as f64 * 12.9898 + phase).sin() * 43758.5453).fract();
        let mut out = Vec::new();
        for i in 0..160 {
            for j in 0..160 {
                let (u, v) = (0.02 * f64::from(i) + 0.003 * phase, 0.02 * f64::from(j));
                let k = out.len();
                out.push([u, v, noise(k)]);
                out.push([u, 3.3 + noise(k + 1), v]);
                out.push([3.4 + noise(k + 2), u, v]);
            }
        }
        out
    }

    #[test]
    fn a_shifted_scan_is_registered() {
        let mut surfaces = SurfaceVoxels::default();
        room(0.0).iter().for_each(|p| surfaces.add(*p));
        let about = Point::new(1.5, 1.5, 1.0);
        let off = motion(&Vector6::new(0.004, -0.006, 0.003, 0.0005, -0.0003, 0.001), &about);
        let mut seen: Vec<[f64; 3]> =
            room(1.0).iter().map(|p| (off * Point::from(*p)).coords.into()).collect();
        // A quarter of one wall was pushed by 3 cm: it must not count.
        seen.iter_mut().filter(|p| p[0] > 3.3 && p[1] < 0.9).for_each(|p| p[0] += 0.03);
        let found = surfaces.planes().register(&seen, &about).expect("enough walls");
        let left = total(&(found.plant_from_stated * off), &about);
        for i in 0..6 {
            assert!(left[i].abs() < 3e-4, "{i}: {left:?}");
            assert!(
                left[i].abs() < 5.0 * found.sigma[i].max(2e-5),
                "{i}: {left:?} {:?}",
                found.sigma
            );
        }
        assert!(found.rms[1] < 0.002 && found.rms[0] > found.rms[1], "{:?}", found.rms);
        assert!(surfaces.planes().register(&seen[..20], &about).is_none());
    }
}
