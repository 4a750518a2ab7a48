//! Rooms measured by several scanners, their points without order.

use super::{FoundRasters, find_unordered};
use crate::tests::{PLAIN, Random, Room, scan};
use contract::OneByOne;
use geometry::Vector;

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
    let found = find_unordered(&points, &OneByOne);
    let errors = errors(&found, &places);
    assert_eq!(errors.len(), 2, "{found:?}");
    assert!(errors.iter().all(|e| *e < 0.001), "{errors:?} {found:?}");
    let stated = |s: &super::RasterSetup| s.sigma.iter().all(|v| *v > 0.0 && *v < 0.001);
    assert!(found.setups.iter().all(stated), "{found:?}");
    // One point of four, and the order of their places instead of a drawn one.
    let mut few: Vec<[f32; 3]> = points.iter().copied().step_by(4).collect();
    few.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let found = find_unordered(&few, &OneByOne);
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
    let found = find_unordered(&walls, &OneByOne);
    assert!(errors(&found, &places).iter().all(|e| *e < 0.002), "{found:?}");
    // Points that scatter by a centimetre in all directions lie on no raster.
    let mut random = Random::new(44);
    let mut scattered = |p: &[f32; 3]| p.map(|v| v + 0.01 * random.normal() as f32);
    let moved: Vec<[f32; 3]> = points.iter().map(&mut scattered).collect();
    let found = find_unordered(&moved, &OneByOne);
    assert!(found.setups.is_empty() && found.cause.is_some(), "{found:?}");
    assert!(find_unordered(&[[1.0, 2.0, 3.0]; 5000], &OneByOne).setups.is_empty());
    assert!(find_unordered(&[[f32::NAN; 3]; 5000], &OneByOne).setups.is_empty());
    assert!(find_unordered(&[], &OneByOne).setups.is_empty());
}
