//! Tests of the lattice estimate on synthetic scans.
#![allow(clippy::unwrap_used)] // tests may panic

use super::*;
use crate::angular_grid::Axis;
use geometry::direction::unit;
use nalgebra::{Rotation3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::SplitMix64;
use std::f64::consts::FRAC_PI_2;

/// A value of approximately normal distribution with mean 0 and standard deviation 1.
fn normal(random: &mut SplitMix64) -> f64 {
    (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0
}

/// A scan of a room about the z axis of the lattice frame, column by column.
struct Synthetic {
    row_deg: f64,
    col_deg: f64,
    n_cols: u32,
    n_rows: u32,
    /// Pixels.
    jitter: f64,
    /// Share of returns that are missing.
    missing: f64,
    clockwise: bool,
}

const PLAIN: Synthetic = Synthetic {
    row_deg: 0.11,
    col_deg: 0.09,
    n_cols: 200,
    n_rows: 450,
    jitter: 0.0,
    missing: 0.1,
    clockwise: false,
};

impl Synthetic {
    fn points(&self) -> Vec<SampledPoint> {
        let mut random = SplitMix64::seed_from_u64(7);
        let mut points = Vec::new();
        for col in 0..self.n_cols {
            for row in 0..self.n_rows {
                if random.random::<f64>() < self.missing {
                    continue;
                }
                let e = (-45.03
                    + (f64::from(row) + self.jitter * normal(&mut random)) * self.row_deg)
                    .to_radians();
                let a = (170.02
                    + (f64::from(col) + self.jitter * normal(&mut random)) * self.col_deg)
                    .to_radians();
                let range = 4.0 + 2.0 * (3.0 * a).sin() + e;
                let d = unit(if self.clockwise { -a } else { a }, e);
                points.push(SampledPoint {
                    xyz: d.map(|v| (v * range) as f32),
                    native: Some([row, col]),
                });
            }
        }
        points
    }
}

fn plain(points: &[SampledPoint]) -> Vec<SampledPoint> {
    points.iter().map(|p| SampledPoint { native: None, ..*p }).collect()
}

fn turned(points: &[SampledPoint], turn: &Rotation3<f64>) -> Vec<SampledPoint> {
    let to = |p: [f32; 3]| {
        let q = turn * Vector3::from(p.map(f64::from));
        [q.x as f32, q.y as f32, q.z as f32]
    };
    points.iter().map(|p| SampledPoint { xyz: to(p.xyz), native: p.native }).collect()
}

fn of(points: &[SampledPoint]) -> ScanRaster {
    estimate(points, Some(points.len() as u64), &Settings::default()).unwrap()
}

fn near(value: f64, degrees: f64, share: f64) -> bool {
    (value.to_degrees() / degrees - 1.0).abs() < share
}

/// Share of points that are alone in their pixel.
fn alone(points: &[SampledPoint], lattice: &Lattice) -> f64 {
    let mut pixels: Vec<_> = points.iter().map(|p| lattice.pixel(p.xyz).0).collect();
    pixels.sort_unstable();
    pixels.chunk_by(|a, b| a == b).filter(|c| c.len() == 1).count() as f64 / points.len() as f64
}

#[test]
fn native_pixels_map_one_to_one() {
    for clockwise in [false, true] {
        let points = Synthetic { clockwise, jitter: 0.05, ..PLAIN }.points();
        let raster = of(&points);
        assert_eq!(raster.steps, StepSource::Native);
        assert!(
            near(raster.lattice.row_step, 0.11, 1e-3) && near(raster.lattice.col_step, 0.09, 1e-3)
        );
        assert!(alone(&points, &raster.lattice) > 0.999);
        // Points of one native column lie in one column of the lattice, also across the jump at
        // 180°.
        let cols: Vec<u32> = points
            .iter()
            .map(|p| {
                let col = p.native.unwrap()[1];
                let n = raster.lattice.n_cols;
                let got = raster.lattice.pixel(p.xyz).0.col;
                if clockwise { (got + col) % n } else { (got + n - col) % n }
            })
            .collect();
        assert!(cols.iter().filter(|c| **c == cols[0]).count() * 1000 > cols.len() * 999);
    }
}

#[test]
fn a_horizontal_spin_axis_is_found() {
    for (axis, turn) in [
        (Axis::Y, Rotation3::from_axis_angle(&Vector3::x_axis(), -FRAC_PI_2)),
        (Axis::X, Rotation3::from_axis_angle(&Vector3::y_axis(), FRAC_PI_2)),
    ] {
        let points = turned(&PLAIN.points(), &turn);
        for points in [points.clone(), plain(&points)] {
            let raster = of(&points);
            assert!(near(raster.lattice.row_step, 0.11, 0.01), "{raster:?}");
            assert!(near(raster.lattice.col_step, 0.09, 0.01), "{raster:?}");
            let z = raster.lattice.lattice_from_scan * Vector3::from(axis_of(axis));
            assert!((z - Vector3::z()).norm() < 1e-9);
            assert!(alone(&points, &raster.lattice) > 0.99);
        }
    }
}

fn axis_of(axis: Axis) -> [f64; 3] {
    match axis {
        Axis::X => [1.0, 0.0, 0.0],
        Axis::Y => [0.0, 1.0, 0.0],
        Axis::Z => [0.0, 0.0, 1.0],
    }
}

#[test]
fn directions_alone_give_steps_and_phase() {
    let points = plain(&PLAIN.points());
    let raster = of(&points[..60_000]);
    assert_eq!(raster.steps, StepSource::Directions);
    assert!(near(raster.lattice.row_step, 0.11, 2e-3), "{raster:?}");
    assert!(near(raster.lattice.col_step, 0.09, 2e-2), "{raster:?}");
    assert!(alone(&points[..60_000], &raster.lattice) > 0.98);
}

#[test]
fn rows_about_the_axis_are_distinguished_from_columns() {
    let mut points = plain(&PLAIN.points());
    let elevation = |p: &SampledPoint| Axis::Z.angles(p.xyz)[1];
    points.sort_by(|a, b| {
        (elevation(a) / 0.11_f64.to_radians())
            .round()
            .total_cmp(&(elevation(b) / 0.11_f64.to_radians()).round())
    });
    let raster = of(&points);
    assert!(near(raster.lattice.row_step, 0.11, 0.02), "{raster:?}");
    assert!(near(raster.lattice.col_step, 0.09, 0.02), "{raster:?}");
}

#[test]
fn jitter_leaves_the_steps_about_right() {
    let points = plain(&Synthetic { jitter: 0.25, missing: 0.3, ..PLAIN }.points());
    let raster = of(&points);
    let area = raster.lattice.row_step * raster.lattice.col_step;
    let truth = 0.11_f64.to_radians() * 0.09_f64.to_radians();
    assert!((0.6..2.2).contains(&(area / truth)), "{raster:?}");
    assert!(near(raster.lattice.row_step, 0.11, 0.4), "{raster:?}");
}

#[test]
fn shuffled_points_give_the_density() {
    let mut points = plain(&PLAIN.points());
    let n_total = points.len() as u64;
    let mut random = SplitMix64::seed_from_u64(3);
    for i in (1..points.len()).rev() {
        points.swap(i, (random.random::<f64>() * (i + 1) as f64) as usize);
    }
    let sample = &points[..40_000];
    let raster = estimate(sample, Some(n_total), &Settings::default()).unwrap();
    let area = raster.lattice.row_step * raster.lattice.col_step;
    let truth = 0.11_f64.to_radians() * 0.09_f64.to_radians() / 0.9;
    assert!((0.7..1.5).contains(&(area / truth)), "{raster:?}");
}

#[test]
fn irregular_rows_and_columns_still_give_steps() {
    let points = Synthetic { jitter: 0.8, ..PLAIN }.points();
    let raster = of(&points);
    assert_eq!(raster.steps, StepSource::Irregular);
    assert!(near(raster.lattice.row_step, 0.11, 0.01) && near(raster.lattice.col_step, 0.09, 0.01));
}

#[test]
fn nothing_and_nonsense_have_no_raster_or_any() {
    let settings = Settings::default();
    assert!(estimate(&[], Some(0), &settings).is_none());
    let one = vec![SampledPoint { xyz: [1.0, 2.0, 3.0], native: None }; 1000];
    if let Some(raster) = estimate(&one, None, &settings) {
        assert!(raster.lattice.row_step >= settings.min_step);
    }
    let zero = vec![SampledPoint { xyz: [0.0; 3], native: Some([0, 0]) }; 1000];
    assert!(estimate(&zero, None, &settings).is_none());
    let up = vec![SampledPoint { xyz: [0.0, 0.0, 1.0], native: Some([3, 4]) }; 1000];
    let _ = estimate(&up, None, &settings);
}
