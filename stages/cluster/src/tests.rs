//! Clusters of small scenes of voxels.

use super::*;
use crate::connect::Counted;
use contract::{FloorLevel, Voxel};
use geometry::{Plane, Vector};

fn occupancy(mut voxels: Vec<Voxel>) -> Occupancy {
    voxels.sort_by_key(|v| (v[2], v[1], v[0]));
    voxels.dedup();
    Occupancy { edge: 0.05, voxels: voxels.into_iter().map(|v| (v, 20)).collect() }
}

fn cube(at: Voxel, side: i32) -> Vec<Voxel> {
    let mut out = Vec::new();
    for k in 0..side {
        for j in 0..side {
            out.extend((0..side).map(|i| [at[0] + i, at[1] + j, at[2] + k]));
        }
    }
    out
}

fn floor(height: impl Fn(f64, f64) -> f64) -> Floor {
    let mut heights = Vec::new();
    for i in -5..15 {
        for j in -5..15 {
            heights.push(([i, j], height(f64::from(i) + 0.5, f64::from(j) + 0.5)));
        }
    }
    let plane = Plane { normal: Vector::z(), offset: 0.0 };
    let level =
        FloorLevel { plane, waviness: 0.005, scatter: 0.002, area: 400.0, cell: 1.0, heights };
    Floor { levels: vec![level], planes: Vec::new() }
}

/// The reference: connected sets by comparing every pair of voxels.
fn by_pairs(voxels: &[Counted], reach: i32) -> Vec<usize> {
    let mut set: Vec<usize> = (0..voxels.len()).collect();
    loop {
        let mut changed = false;
        for i in 0..voxels.len() {
            for j in 0..i {
                let near = (0..3).all(|k| (voxels[i].0[k] - voxels[j].0[k]).abs() <= reach);
                if near && set[i] != set[j] {
                    let low = set[i].min(set[j]);
                    set[i] = low;
                    set[j] = low;
                    changed = true;
                }
            }
        }
        if !changed {
            return set;
        }
    }
}

#[test]
fn sets_are_those_of_all_pairs() {
    let mut state = 7_u64;
    let mut random = |n: u64| {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 33) % n) as i32
    };
    for (round, gap) in [(0, 0), (1, 1), (2, 2), (3, 1), (4, 0)] {
        let spread = [9, 14, 20, 12, 7][round];
        let voxels =
            (0..150).map(|_| [random(spread) - 4, random(spread), random(spread) - 9]).collect();
        let occupancy = occupancy(voxels);
        let got = connect::connect(&occupancy.voxels, gap);
        let expected = by_pairs(&occupancy.voxels, gap + 1);
        for i in 0..got.len() {
            for j in 0..i {
                assert_eq!(got[i] == got[j], expected[i] == expected[j], "round {round}: {i} {j}");
            }
        }
    }
}

#[test]
fn two_boxes_on_a_wavy_floor_are_two_clusters_and_the_floor_is_none() {
    let wave = |x: f64, y: f64| 0.02 * (0.7 * x).sin() + 0.01 * y;
    let mut voxels = Vec::new();
    for i in 0..200 {
        for j in 0..200 {
            let (x, y) = ((f64::from(i) + 0.5) * 0.05, (f64::from(j) + 0.5) * 0.05);
            voxels.push([i, j, (wave(x, y) / 0.05).floor() as i32]);
        }
    }
    voxels.extend(cube([20, 20, 1], 12));
    voxels.extend(cube([60, 20, 0], 8));
    // A mirror image below the floor, and a voxel that is connected across a gap.
    voxels.extend(cube([20, 20, -30], 6));
    voxels.push([20, 33, 6]);
    let got = split(&occupancy(voxels), &floor(wave), &Settings::default());
    assert_eq!(got.len(), 2, "{:?}", got.iter().map(|c| c.bounds).collect::<Vec<_>>());
    assert!(got[0].n_points > got[1].n_points && got[0].id == 0 && got[1].id == 1);
    assert!(got[0].voxels.contains(&[20, 33, 6]));
    assert!(got[0].voxels.len() >= 12 * 12 * 10 && got[1].voxels.len() >= 8 * 8 * 6);
    assert!(
        got.iter()
            .all(|c| c.bounds.min[2] > -0.05 && c.voxels.is_sorted_by_key(|v| (v[2], v[1], v[0])))
    );
}

#[test]
fn without_floor_everything_is_kept_and_nothing_gives_nothing() {
    let got = split(&occupancy(cube([-3, -3, -3], 5)), &Floor::default(), &Settings::default());
    assert_eq!((got.len(), got[0].voxels.len(), got[0].n_points), (1, 125, 2500));
    assert!(split(&Occupancy::default(), &floor(|_, _| 0.0), &Settings::default()).is_empty());
}
