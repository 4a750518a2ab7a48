//! Rooms with furniture, drawn from seeds, measured by scanners with the errors of real ones.

use crate::{Cause, ScanWindow, Setup, SetupLimits, find};
use geometry::{Pose, Vector};
use nalgebra::UnitQuaternion;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::SplitMix64;
use std::f64::consts::TAU;

pub(crate) struct Random(SplitMix64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(SplitMix64::seed_from_u64(seed))
    }

    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.random::<f64>()
    }

    pub(crate) fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.0.random::<f64>()).ln()).sqrt();
        radius * (TAU * self.0.random::<f64>()).cos()
    }
}

/// Boxes, the first of which is seen from inside.
pub(crate) struct Room(Vec<[Vector; 2]>);

impl Room {
    pub(crate) fn drawn(random: &mut Random) -> Self {
        let size = Vector::new(
            random.between(9.0, 22.0),
            random.between(7.0, 16.0),
            random.between(3.5, 8.0),
        );
        let mut boxes = vec![[Vector::zeros(), size]];
        for _ in 0..14 {
            let at = Vector::new(
                random.between(0.5, size.x - 2.0),
                random.between(0.5, size.y - 2.0),
                0.0,
            );
            let of = Vector::new(
                random.between(0.2, 1.8),
                random.between(0.2, 1.5),
                random.between(0.3, 2.6),
            );
            boxes.push([at, at + of]);
        }
        Self(boxes)
    }

    fn range(&self, from: &Vector, along: &Vector) -> f64 {
        let mut nearest = f64::INFINITY;
        for (i, [low, high]) in self.0.iter().enumerate() {
            let (mut near, mut far) = (f64::NEG_INFINITY, f64::INFINITY);
            for a in 0..3 {
                let (s, t) = ((low[a] - from[a]) / along[a], (high[a] - from[a]) / along[a]);
                (near, far) = (near.max(s.min(t)), far.min(s.max(t)));
            }
            let hit = if i == 0 { far } else { near };
            if near < far && hit > 0.1 {
                nearest = nearest.min(hit);
            }
        }
        nearest
    }

    /// A place for a scanner, not inside or close to furniture.
    pub(crate) fn place(&self, random: &mut Random) -> Vector {
        let size = self.0[0][1];
        loop {
            let at = Vector::new(
                random.between(1.0, size.x - 1.0),
                random.between(1.0, size.y - 1.0),
                random.between(1.4, 2.1),
            );
            let is_free = self.0[1..]
                .iter()
                .all(|[low, high]| (0..2).any(|a| at[a] < low[a] - 0.6 || at[a] > high[a] + 0.6));
            if is_free {
                return at;
            }
        }
    }
}

/// A scanner with the errors of a real one.
#[derive(Clone, Copy)]
pub(crate) struct Errors {
    noise: f64,
    pub(crate) jitter: f64,
    /// Amplitude of the graduation errors, and how many of them a turn has, of azimuth and of
    /// elevation.
    pub(crate) ripple: f64,
    pub(crate) waves: [f64; 2],
    tilt: f64,
    lost: f64,
    pub(crate) step: f64,
    over_the_top: bool,
}

pub(crate) const PLAIN: Errors = Errors {
    noise: 0.002,
    jitter: 5e-5,
    ripple: 2e-5,
    waves: [0.0, 7.0],
    tilt: 0.03,
    lost: 0.05,
    step: 0.0021,
    over_the_top: false,
};

/// The points of a scanner: the first two of so many columns.
pub(crate) fn scan(
    room: &Room,
    at: &Vector,
    e: Errors,
    every: i32,
    random: &mut Random,
) -> Vec<[f64; 3]> {
    let turn = UnitQuaternion::from_euler_angles(
        e.tilt * random.normal(),
        e.tilt * random.normal(),
        random.between(0.0, TAU),
    );
    let pose = Pose::from_parts((*at).into(), turn);
    let turn_of = if e.over_the_top { TAU / 2.0 } else { TAU };
    let n_rows = ((if e.over_the_top { 4.2 } else { 2.2 }) / e.step) as i32;
    let phase = random.between(0.0, 1.0);
    let mut out = Vec::new();
    for col in 0..(turn_of / e.step) as i32 {
        if col % every > 1 {
            continue;
        }
        let azimuth = f64::from(col) * e.step;
        for row in 0..n_rows {
            let stated = (f64::from(row) + phase) * e.step - 1.05;
            let rise = stated + e.jitter * random.normal() + e.ripple * (e.waves[1] * stated).sin();
            let off = azimuth
                + e.ripple * (e.waves[0] * azimuth).sin()
                + e.jitter * random.normal() / rise.cos().abs().max(0.02);
            let local = Vector::new(rise.cos() * off.cos(), rise.cos() * off.sin(), rise.sin());
            let along = pose.rotation * local;
            let range = room.range(at, &along) + e.noise * random.normal();
            if random.between(0.0, 1.0) < e.lost || !range.is_finite() {
                continue;
            }
            let p = at + along * range;
            out.push([p.x, p.y, p.z].map(|v| (v * 1e4).round() * 1e-4));
        }
    }
    out
}

fn windows(points: &[[f64; 3]], n: usize) -> Vec<ScanWindow> {
    let place = |i: usize| points.len() * i / n;
    let cut = |at: usize| points[at..(at + 512).min(points.len())].to_vec();
    (0..n)
        .map(|i| ScanWindow { place: place(i) as u64, source: 0, points: cut(place(i)) })
        .collect()
}

/// One column of eight is enough, with its neighbour.
const NEIGHBOURS: i32 = 8;

fn error(setup: &Setup, at: &Vector) -> f64 {
    (Vector::from(setup.position()) - at).norm()
}

/// Scans of a drawn room without ids, with the places of the scanners.
fn drawn(seed: u64, n: usize, errors: Errors) -> (Vec<ScanWindow>, Vec<Vector>) {
    let mut random = Random::new(seed);
    let room = Room::drawn(&mut random);
    let places: Vec<Vector> = (0..n).map(|_| room.place(&mut random)).collect();
    let scans = places.iter().map(|at| scan(&room, at, errors, NEIGHBOURS, &mut random));
    let points: Vec<[f64; 3]> = scans.flatten().collect();
    (windows(&points, 320 * n), places)
}

#[test]
fn setups_of_drawn_rooms_are_found_to_parts_of_a_millimetre_and_none_is_invented() {
    for (seed, n) in [(1, 1), (2, 3), (3, 5)] {
        let errors = Errors { jitter: 2.5e-5 * seed as f64, ..PLAIN };
        let (windows, places) = drawn(seed, n, errors);
        let found = find(&windows, &SetupLimits::default());
        assert_eq!(found.setups.len(), n, "seed {seed}");
        for at in &places {
            let best = found
                .setups
                .iter()
                .min_by(|a, b| error(a, at).total_cmp(&error(b, at)))
                .expect("some");
            let (off, sigma) = (error(best, at), best.largest_sigma());
            assert!(
                off < 0.000_6 && off < 8.0 * sigma && sigma < 0.001,
                "seed {seed}: {off} {sigma}"
            );
            assert!((best.comb[1] / PLAIN.step - 1.0).abs() < 1e-3, "{:?}", best.comb);
        }
        let per_scan = windows.len() / n;
        let n_right = (0..windows.len()).filter(|i| {
            found.owners[*i].is_some_and(|o| error(&found.setups[o], &places[i / per_scan]) < 0.01)
        });
        assert!(n_right.count() as f64 > 0.9 * windows.len() as f64);
    }
}

#[test]
fn columns_that_go_on_over_the_top_are_one_comb() {
    let errors = Errors { over_the_top: true, ..PLAIN };
    let (windows, places) = drawn(11, 2, errors);
    let found = find(&windows, &SetupLimits::default());
    assert_eq!(found.setups.len(), 2);
    for at in &places {
        assert!(found.setups.iter().any(|setup| error(setup, at) < 0.001));
    }
}

#[test]
fn an_axis_may_lie_and_a_frame_may_be_far() {
    let (mut windows, places) = drawn(21, 1, PLAIN);
    let far = |[x, y, z]: [f64; 3]| [z + 431_000.0, x + 5_400_000.0, y + 320.0];
    windows.iter_mut().flat_map(|w| &mut w.points).for_each(|p| *p = far(*p));
    let found = find(&windows, &SetupLimits::default());
    let at = Vector::from(far(places[0].into()));
    assert_eq!(found.setups.len(), 1);
    assert!(error(&found.setups[0], &at) < 0.001);
    assert!(found.setups[0].tilt() > 1.3);
}

#[test]
fn without_order_nothing_is_invented() {
    let (windows, _) = drawn(31, 2, PLAIN);
    let mut points: Vec<[f64; 3]> = windows.iter().flat_map(|w| w.points.clone()).collect();
    let mut random = Random::new(5);
    for i in (1..points.len()).rev() {
        points.swap(i, (random.between(0.0, 1.0) * i as f64) as usize);
    }
    let found = find(&self::windows(&points, 400), &SetupLimits::default());
    assert_eq!((found.setups.len(), found.cause), (0, Some(Cause::NoColumns)));
    let few = find(&windows[..5], &SetupLimits::default());
    assert_eq!((few.setups.len(), few.cause), (0, Some(Cause::FewPoints)));
    assert_eq!(find(&[], &SetupLimits::default()).cause, Some(Cause::FewPoints));
}

/// A profile scanner that is carried along a path: no place is that of a scanner.
fn carried(seed: u64) -> Vec<ScanWindow> {
    let mut random = Random::new(seed);
    let room = Room::drawn(&mut random);
    let size = room.0[0][1];
    let (speed, bend) = (random.between(0.000_5, 0.004), random.between(0.0, 0.004));
    let mut at = Vector::new(1.2, 1.2, 1.5);
    let (mut heading, mut points) = (0.3, Vec::new());
    for _ in 0..700 {
        at += Vector::new(f64::cos(heading), f64::sin(heading), 0.0) * speed * 4.0;
        heading += bend;
        at.x = at.x.clamp(0.5, size.x - 0.5);
        at.y = at.y.clamp(0.5, size.y - 0.5);
        for row in 0..1_500 {
            let (rise, flat) = (f64::from(row) * TAU / 1_500.0).sin_cos();
            let moved = at
                + Vector::new(f64::cos(heading), f64::sin(heading), 0.0) * speed * f64::from(row)
                    / 1_500.0;
            let along = Vector::new(-flat * f64::sin(heading), flat * f64::cos(heading), rise);
            let range = room.range(&moved, &along) + 0.003 * random.normal();
            if range.is_finite() {
                points.push((moved + along * range).into());
            }
        }
    }
    windows(&points, 800)
}

#[test]
fn a_scanner_that_is_carried_has_no_setup() {
    for seed in 41..47 {
        let found = find(&carried(seed), &SetupLimits::default());
        assert!(
            found.setups.is_empty() && found.cause.is_some(),
            "seed {seed}: {:?}",
            found.setups
        );
    }
}

#[test]
fn odd_points_do_no_harm() {
    let odd = [f64::NAN, f64::INFINITY, 0.0, 1e300, -1e-300];
    let mut random = Random::new(9);
    let mut point = || [0, 1, 2].map(|_| odd[(random.between(0.0, 4.99)) as usize]);
    let windows: Vec<ScanWindow> = (0..40)
        .map(|i| ScanWindow { place: i, source: 0, points: (0..200).map(|_| point()).collect() })
        .collect();
    assert!(find(&windows, &SetupLimits::default()).setups.is_empty());
    let same = ScanWindow { place: 0, source: 0, points: vec![[1.0, 2.0, 3.0]; 512] };
    assert!(find(&vec![same; 50], &SetupLimits::default()).setups.is_empty());
}
