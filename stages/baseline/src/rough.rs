//! Finds roughly where a base stands among points that may be its own, by boxes in the plane and
//! equal steps of yaw (the source, §3.2).

use geometry::{Plane, Point, Pose, Vector};
use nalgebra::{Matrix2, Rotation3, Translation3, Unit, UnitQuaternion, Vector2};
use std::f64::consts::{PI, TAU};

use crate::context::SequentialFit;

/// Eigenvalues of a footprint nearer than this ratio: its axes mean nothing (METHOD.md §10).
const SQUARE: f64 = 1.3;
/// Yaws that are searched more finely and registered …
const N_FINE: usize = 6;
/// … at least so far apart, radians: 20°.
const APART: f64 = 0.35;
/// A yaw off the boxes' axes by more than this is not tried where the boxes have axes, radians:
/// 20°.
const OFF_AXIS: f64 = 0.35;

/// Local from base: the best yaws, best first.
pub(crate) fn places(
    robot: &SequentialFit<'_>,
    plane: &Plane,
    points: &[Vector],
    foot: f64,
) -> Vec<Pose> {
    let n = plane.normal;
    let tilt = Rotation3::rotation_between(&Vector::z(), &n).unwrap_or_else(Rotation3::identity);
    let flat = |p: &Vector| (tilt.inverse() * p).xy();
    let prints = Footprint::of(points.iter().map(flat))
        .zip(Footprint::of(robot.base_samples().iter().map(|p| p.xy())));
    let Some((seen, model)) = prints else { return Vec::new() };
    let pose = |yaw: f64| {
        let turn = Rotation3::from_axis_angle(&Unit::new_normalize(Vector::z()), yaw);
        let middle = seen.middle - (turn * model.middle.push(0.0)).xy();
        let at = tilt * middle.push(plane.offset - foot);
        let rotation = UnitQuaternion::from_rotation_matrix(&(tilt * turn));
        Pose::from_parts(Translation3::from(at), rotation)
    };
    let cost = |yaw: f64| off(robot, &pose(yaw), points);
    let has_axes = seen.ratio > SQUARE && model.ratio > SQUARE;
    let on_axis = |yaw: f64| {
        let d = (yaw - (seen.yaw - model.yaw)).rem_euclid(PI);
        d.min(PI - d) < OFF_AXIS
    };
    let n_yaw = (TAU / robot.settings.yaw_step[0]).round() as usize;
    let mut tried: Vec<(f64, f64)> = (0..n_yaw)
        .map(|k| TAU * k as f64 / n_yaw as f64)
        .filter(|yaw| !has_axes || on_axis(*yaw))
        .map(|yaw| (cost(yaw), yaw))
        .collect();
    tried.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut kept: Vec<f64> = Vec::new();
    for (_, yaw) in tried {
        let apart = |k: &f64| {
            let d = (yaw - k).rem_euclid(TAU);
            d.min(TAU - d) > APART
        };
        if kept.len() < N_FINE && kept.iter().all(apart) {
            kept.push(yaw);
        }
    }
    let steps = (robot.settings.yaw_step[0] / robot.settings.yaw_step[1]).ceil() as i32;
    let finer = |yaw: f64| {
        let fine = (-steps..=steps).map(|k| yaw + f64::from(k) * robot.settings.yaw_step[1]);
        fine.map(|yaw| (cost(yaw), yaw)).min_by(|a, b| a.0.total_cmp(&b.0))
    };
    kept.into_iter().filter_map(finer).map(|(_, yaw)| pose(yaw)).collect()
}

/// Mean distance of the points from the base's surface, each at most the truncation, metres.
fn off(robot: &SequentialFit<'_>, local_from_base: &Pose, points: &[Vector]) -> f64 {
    let truncation = robot.settings.truncation;
    let link_from_local = (local_from_base * robot.base_pose()).inverse();
    let sum: f64 = points
        .iter()
        .map(|p| {
            let q = link_from_local * Point::from(*p);
            robot
                .closest(robot.base, &q)
                .map_or(truncation, |(x, _)| (q - x).norm().min(truncation))
        })
        .sum();
    sum / points.len().max(1) as f64
}

/// Box of points in a plane along their principal axes.
struct Footprint {
    middle: Vector2<f64>,
    yaw: f64,
    /// Ratio of the larger to the smaller eigenvalue.
    ratio: f64,
}

impl Footprint {
    fn of(points: impl Iterator<Item = Vector2<f64>>) -> Option<Self> {
        let points: Vec<Vector2<f64>> = points.collect();
        if points.len() < 3 {
            return None;
        }
        let mean = points.iter().sum::<Vector2<f64>>() / points.len() as f64;
        let spread: Matrix2<f64> = points.iter().map(|p| (p - mean) * (p - mean).transpose()).sum();
        let eigen = spread.symmetric_eigen();
        let major = usize::from(eigen.eigenvalues[1] > eigen.eigenvalues[0]);
        let axes = [eigen.eigenvectors.column(major), eigen.eigenvectors.column(1 - major)];
        let middle = axes.iter().map(|axis| {
            let (low, high) = points
                .iter()
                .map(|p| axis.dot(p))
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
                    (low.min(v), high.max(v))
                });
            axis * ((low + high) / 2.0)
        });
        let least = eigen.eigenvalues[1 - major].max(1e-12);
        Some(Self {
            middle: middle.sum(),
            yaw: axes[0].y.atan2(axes[0].x),
            ratio: eigen.eigenvalues[major] / least,
        })
    }
}
