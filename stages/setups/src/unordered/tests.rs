//! Rooms measured by several scanners, their points without order.

use super::{FoundRasters, find_unordered};
use crate::tests::{PLAIN, Random, Room, scan};
use contract::OneByOne;
use geometry::Vector;

/// Memory for the votes of any room.
const BYTES: usize = 64 << 20;
/// No column is left out.
const ALL_COLUMNS: i32 = 1;

/// Points of a drawn room in a drawn order, with the places of its scanners.
fn shuffled(seed: u64, n_scanners: usize) -> (Vec<[f32; 3]>, Vec<Vector>) {
    let mut random = Random::new(seed);
    let room = Room::drawn(&mut random);
    let places: Vec<Vector> = (0..n_scanners).map(|_| room.place(&mut random)).collect();
    let mut errors = PLAIN;
    errors.step = 0.005;
    let mut points: Vec<[f32; 3]> = Vec::new();
    for at in &places {
        let own = scan(&room, at, errors, ALL_COLUMNS, &mut random);
        points.extend(own.iter().map(|p| p.map(|v| v as f32)));
    }
    for i in (1..points.len()).rev() {
        points.swap(i, random.between(0.0, (i + 1) as f64) as usize);
    }
    (points, places)
}

fn errors(found: &FoundRasters, places: &[Vector]) -> Vec<f64> {
    let off = |at: Vector| places.iter().map(|p| (p - at).norm()).fold(f64::INFINITY, f64::min);
    found.setups.iter().map(|s| off(s.world_from_scanner.translation.vector)).collect()
}

#[test]
fn scanners_are_found_in_points_without_order() {
    let (points, places) = shuffled(41, 2);
    let found = find_unordered(&points, BYTES, &OneByOne);
    let errors = errors(&found, &places);
    assert_eq!(errors.len(), 2, "{found:?}");
    assert!(errors.iter().all(|e| *e < 0.001), "{errors:?} {found:?}");
    let stated = |s: &super::RasterSetup| s.sigma.iter().all(|v| *v > 0.0 && *v < 0.001);
    assert!(found.setups.iter().all(stated), "{found:?}");
    // One point of four, and the order of their places instead of a drawn one.
    let mut few: Vec<[f32; 3]> = points.iter().copied().step_by(4).collect();
    few.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let found = find_unordered(&few, BYTES, &OneByOne);
    assert!(self::errors(&found, &places).iter().all(|e| *e < 0.003), "{found:?}");
}

#[test]
fn nothing_is_invented() {
    let (points, places) = shuffled(43, 2);
    let end = |a: usize, side: f32| points.iter().map(|p| side * p[a]).fold(0.0, f32::max);
    let ends = [[end(0, -1.0), end(0, 1.0)], [end(1, -1.0), end(1, 1.0)]];
    let is_wall = |p: &[f32; 3]| {
        let near = |a: usize| -p[a] > ends[a][0] - 0.02 || p[a] > ends[a][1] - 0.02;
        (near(0) || near(1)) && p[2] > 0.1
    };
    let walls: Vec<[f32; 3]> = points.iter().copied().filter(is_wall).collect();
    assert!(walls.len() > 50_000);
    // A level band of the walls may do for a floor; what it gives must be right.
    let found = find_unordered(&walls, BYTES, &OneByOne);
    assert!(errors(&found, &places).iter().all(|e| *e < 0.002), "{found:?}");
    // Points that scatter by a centimetre in all directions lie on no raster.
    let mut random = Random::new(44);
    let mut scattered = |p: &[f32; 3]| p.map(|v| v + 0.01 * random.normal() as f32);
    let moved: Vec<[f32; 3]> = points.iter().map(&mut scattered).collect();
    let found = find_unordered(&moved, BYTES, &OneByOne);
    assert!(found.setups.is_empty() && found.cause.is_some(), "{found:?}");
    assert!(find_unordered(&[[1.0, 2.0, 3.0]; 5000], BYTES, &OneByOne).setups.is_empty());
    assert!(find_unordered(&[[f32::NAN; 3]; 5000], BYTES, &OneByOne).setups.is_empty());
    assert!(find_unordered(&[], BYTES, &OneByOne).setups.is_empty());
}

/// A drawn cloud without order, with the scanner of each point.
struct DrawnPoints {
    points: Vec<[f32; 3]>,
    scanners: Vec<usize>,
    places: Vec<Vector>,
}

/// Scanners with graduation errors, of a drawn number of steps, so that a turn does not end on a
/// column; of the last `n_strange` the points scatter, so that these are not found.
fn drawn(seed: u64, n_scanners: usize, n_strange: usize) -> DrawnPoints {
    let mut random = Random::new(seed);
    let room = Room::drawn(&mut random);
    let places: Vec<Vector> = (0..n_scanners).map(|_| room.place(&mut random)).collect();
    let arcsec = |v: f64| (v / 3600.0).to_radians();
    let mut errors = PLAIN;
    errors.step = random.between(0.0042, 0.0055);
    errors.jitter = arcsec([5.0, 10.0, 20.0][(seed % 3) as usize]);
    errors.ripple = arcsec(random.between(0.0, 8.0));
    errors.waves = [(); 2].map(|()| random.between(1.0, 13.0).floor());
    let mut all: Vec<([f32; 3], usize)> = Vec::new();
    for (i, at) in places.iter().enumerate() {
        let own = scan(&room, at, errors, ALL_COLUMNS, &mut random);
        let scatter = if i + n_strange < n_scanners { 0.0 } else { 0.02 };
        all.extend(own.iter().map(|p| (p.map(|v| (v + scatter * random.normal()) as f32), i)));
    }
    for i in (1..all.len()).rev() {
        all.swap(i, random.between(0.0, (i + 1) as f64) as usize);
    }
    let (points, scanners) = all.into_iter().unzip();
    DrawnPoints { points, scanners, places }
}

impl DrawnPoints {
    fn nearest(&self, setup: &super::RasterSetup) -> (usize, Vector) {
        let at = setup.world_from_scanner.translation.vector;
        let off = |i: &usize| (at - self.places[*i]).norm();
        let truth = (0..self.places.len()).min_by(|a, b| off(a).total_cmp(&off(b)));
        let truth = truth.expect("a place");
        (truth, at - self.places[truth])
    }

    /// For each setup, the share of its points that are given to it, and the share of the points
    /// that are given to it wrongly.
    fn given(&self, found: &FoundRasters) -> Vec<[f64; 2]> {
        let setups = found.setups.iter().enumerate();
        let rasters: Vec<_> = setups
            .filter_map(|(i, s)| Some((i, s.raster.as_ref()?, s.world_from_scanner.inverse())))
            .collect();
        let truth: Vec<usize> = found.setups.iter().map(|s| self.nearest(s).0).collect();
        let mut counts = vec![[0.0; 2]; found.setups.len()];
        for (p, scanner) in self.points.iter().zip(&self.scanners) {
            let seen = rasters.iter().map(|(_, raster, scanner_from_world)| {
                let p = scanner_from_world * geometry::Point::from(p.map(f64::from));
                (*raster, p.coords.into())
            });
            if let Some(at) = contract::PointRaster::owner(seen, 3e-5) {
                let setup = rasters[at].0;
                counts[setup][usize::from(truth[setup] != *scanner)] += 1.0;
            }
        }
        let own = |i: usize| self.scanners.iter().filter(|s| **s == truth[i]).count() as f64;
        let share = |(i, [right, wrong]): (usize, [f64; 2])| {
            [right / own(i), wrong / f64::max(right + wrong, 1.0)]
        };
        counts.into_iter().enumerate().map(share).collect()
    }
}

#[test]
fn points_are_given_to_their_own_scanners_and_deviations_are_honest() {
    let mut ratios: Vec<f64> = Vec::new();
    for (seed, n_scanners) in [(3, 3), (4, 2), (5, 3)] {
        let cloud = drawn(seed, n_scanners, 0);
        let found = find_unordered(&cloud.points, BYTES, &OneByOne);
        assert_eq!(found.setups.len(), n_scanners, "{seed}: {found:?}");
        assert!(!found.is_alone);
        for [right, wrong] in cloud.given(&found) {
            assert!(right > 0.6 && wrong < 0.001, "{seed}: {right} {wrong}");
        }
        for setup in &found.setups {
            let off = cloud.nearest(setup).1;
            ratios.extend((0..3).map(|a| (off[a] / setup.sigma[a]).abs()));
        }
    }
    assert!(ratios.iter().all(|r| *r < 4.0), "{ratios:?}");
    assert!(ratios.iter().filter(|r| **r > 3.0).count() <= 1, "{ratios:?}");
}

#[test]
fn points_of_scanners_that_are_not_found_are_given_to_few() {
    let cloud = drawn(6, 3, 1);
    let found = find_unordered(&cloud.points, BYTES, &OneByOne);
    assert_eq!(found.setups.len(), 2, "{found:?}");
    for ([right, wrong], setup) in cloud.given(&found).into_iter().zip(&found.setups) {
        // A third of all points are of nobody.
        assert!(wrong < 0.006, "{wrong} {setup:?}");
        assert!(right > 0.3 || setup.raster.is_none(), "{right} {setup:?}");
    }
    let alone = drawn(7, 2, 1);
    let found = find_unordered(&alone.points, BYTES, &OneByOne);
    assert!(found.setups.len() == 1 && !found.is_alone, "{found:?}");
    let alone = drawn(8, 1, 0);
    let found = find_unordered(&alone.points, BYTES, &OneByOne);
    assert!(found.setups.len() == 1 && found.is_alone, "{found:?}");
}
