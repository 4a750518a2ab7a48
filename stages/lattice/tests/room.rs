//! The lattice stage on a synthetic room: floor, pipes, veils and rings are found, and reused
//! buffers do not change the result.

mod caster;

use caster::{FLOOR, NOTHING, PIPE, ROOM, Truth, room, scan};
use contract::{Map, Scan, Tile, TileSummary};
use lattice::{LatticeScratch, Settings, Summarise};
use std::sync::LazyLock;

/// Step of the raster, radians: 7.5 mm at 3 m.
const STEP: f64 = 0.0025;

/// The tiles of the room, made once for all tests.
static TILES: LazyLock<(Scan, Vec<Truth>)> = LazyLock::new(|| {
    let scan = scan([0.3, 0.2, 1.6], 0.4, STEP);
    let tiles = room(0.008).tiles(&scan);
    (scan, tiles)
});

#[test]
fn veils_are_found_and_surfaces_are_not_veils() {
    let (scan, tiles) = &*TILES;
    let (mut found, mut veils, mut wrong, mut clean) = (0, 0, 0, 0);
    for t in tiles {
        let got = lattice::veils(&t.tile, scan, &Settings::default());
        for i in 0..got.len() {
            if t.veil[i] {
                veils += 1;
                found += usize::from(got[i]);
            } else if !t.mixed[i] {
                clean += 1;
                wrong += usize::from(got[i]);
            }
        }
    }
    let (recall, falsely) =
        (f64::from(found as u32) / veils as f64, f64::from(wrong as u32) / clean as f64);
    assert!(veils > 1000, "{veils}");
    assert!(
        recall >= 0.95 && falsely <= 0.001,
        "recall {recall} of {veils}, false {falsely} of {clean}"
    );
}

#[test]
fn normals_of_floor_and_walls_are_within_degrees() {
    let (scan, tiles) = &*TILES;
    let (mut n, mut near, mut none) = (0, 0, 0);
    for t in tiles {
        let normals = lattice::normals(&t.tile, scan, &Settings::default());
        for i in (0..normals.len()).filter(|&i| t.shape[i] == FLOOR && !t.mixed[i]) {
            n += 1;
            match normals[i] {
                None => none += 1,
                Some(m) => near += usize::from(m[2] > 8_f32.to_radians().cos()),
            }
        }
    }
    assert!(near as f64 >= 0.95 * n as f64, "{near} of {n}, without {none}");
    assert!((none as f64) < 0.01 * n as f64, "{none} of {n}");
}

/// A tile as the store gives it: a dense one is subsampled.
fn given(stage: &Summarise, tile: &Tile) -> Tile {
    let range = |p: &[f32; 3]| p.iter().map(|v| v * v).sum::<f32>().sqrt();
    let mut ranges: Vec<f32> = tile.xyz.iter().map(range).collect();
    ranges.sort_by(f32::total_cmp);
    tile.thinned(stage.skip(tile.at.scan, ranges[ranges.len() * 4 / 5]))
}

fn summaries(scan: &Scan, tiles: &[Truth]) -> Vec<TileSummary> {
    let stage = Summarise::new(std::slice::from_ref(scan), &Settings::default());
    let mut scratch = LatticeScratch::default();
    let tiles = tiles.iter().map(|t| given(&stage, &t.tile));
    tiles.map(|tile| stage.apply(tile, &mut scratch).expect("a tile")).collect()
}

#[test]
fn floor_cells_lie_on_horizontal_patches() {
    let (scan, tiles) = &*TILES;
    let got = summaries(scan, tiles);
    // Number of floor points on an upward patch of their tile, by distance.
    let (mut on, mut all, mut edge_off) = (0, 0, 0);
    for (t, summary) in tiles.iter().zip(&got) {
        let up: Vec<_> = summary.patches.iter().filter(|p| p.plane.normal.z > 0.99).collect();
        for i in (0..t.shape.len()).filter(|&i| t.shape[i] == FLOOR && !t.mixed[i]) {
            let w = scan.world_from_scan * geometry::Point::from(t.tile.xyz[i].map(f64::from));
            all += 1;
            on += usize::from(up.iter().any(|p| {
                p.plane.distance(&w.coords).abs() < 0.012 && p.bounds.grown(0.02).contains(w.into())
            }));
        }
        for p in up.iter().filter(|p| p.bounds.max[2] < 0.2) {
            let outside =
                p.bounds.max[0] > 6.02 || p.bounds.min[0] < -6.02 || p.bounds.max[1] > 5.02;
            edge_off += usize::from(outside);
        }
    }
    assert!(on as f64 >= 0.99 * all as f64, "{on} of {all}");
    assert_eq!(edge_off, 0);
    let area: f64 = got
        .iter()
        .flat_map(|s| &s.patches)
        .filter(|p| p.plane.normal.z > 0.99 && p.bounds.max[2] < 0.3)
        .map(|p| p.area)
        .sum();
    assert!((85.0..112.0).contains(&area), "visible floor {area} m² of 108");
}

#[test]
fn pipes_are_not_planes_and_rings_are() {
    let (scan, tiles) = &*TILES;
    let got = summaries(scan, tiles);
    let pipe: std::collections::HashSet<usize> =
        (0..tiles.len()).filter(|&i| tiles[i].shape.contains(&PIPE)).collect();
    for (i, summary) in got.iter().enumerate().filter(|(i, _)| pipe.contains(i)) {
        for p in &summary.patches {
            let c = p.bounds.center();
            let axis = 2.0 + (c.x + 5.0) / 10.5 * 0.5;
            let near = (c.y - axis).abs() < 0.07 && (c.z - 1.8).abs() < 0.07;
            let fit = p.moments.plane().expect("a patch has a plane");
            assert!(!near || fit.spread[1] * 12_f64.sqrt() <= 0.03, "tile {i}: {p:?}");
        }
    }
    let ring: f64 = got
        .iter()
        .flat_map(|s| &s.patches)
        .filter(|p| p.plane.normal.z > 0.99 && (p.moments.mean().z - 0.5).abs() < 0.01)
        .map(|p| p.area)
        .sum();
    // 0.36 m² less the foot's 0.18 m², half of it behind the foot.
    assert!(ring > 0.08 && ring < 0.2, "{ring}");
}

#[test]
fn used_buffers_and_far_worlds_change_nothing() {
    let (scan, tiles) = &*TILES;
    let mut scan = scan.clone();
    let some = &tiles[..12.min(tiles.len())];
    let used = summaries(&scan, some);
    let stage = Summarise::new(std::slice::from_ref(&scan), &Settings::default());
    for (t, summary) in some.iter().zip(&used) {
        let tile = given(&stage, &t.tile);
        let fresh = stage.apply(tile, &mut LatticeScratch::default()).expect("a tile");
        assert!(fresh == *summary, "{:?}", t.tile.at);
    }
    scan.world_from_scan.translation.vector += geometry::Vector::new(4e5, 5e6, 100.0);
    for (a, b) in used.iter().zip(summaries(&scan, some)) {
        assert_eq!(a.patches.len(), b.patches.len());
        for (p, q) in a.patches.iter().zip(&b.patches) {
            assert!(
                (p.plane.normal - q.plane.normal).norm() < 1e-5 && (p.area - q.area).abs() < 1e-6
            );
        }
        let sum = |s: &TileSummary| s.occupancy.voxels.iter().map(|v| u64::from(v.1)).sum::<u64>();
        assert_eq!(sum(a), sum(&b));
        // Dense tiles are subsampled, and the sample represents the whole tile.
        let all = (sum(a) + a.n_veils) as f64 / a.n_points as f64;
        assert!((0.97..1.04).contains(&all), "{all}");
    }
}

#[test]
fn odd_tiles_do_no_harm() {
    let (scan, tiles) = &*TILES;
    let mut tile = tiles[0].tile.clone();
    tile.xyz.iter_mut().enumerate().for_each(|(i, p)| {
        *p = [[0.0; 3], [1e9, -1e9, 3.0], [1e-30; 3], *p][i % 4];
    });
    let stage = Summarise::new(std::slice::from_ref(scan), &Settings::default());
    let got = stage.apply(tile.clone(), &mut LatticeScratch::default()).expect("a tile");
    assert_eq!(got.n_points, tile.len() as u64);
    tile.xyz.clear();
    tile.pixel.clear();
    tile.place.clear();
    let got = stage.apply(tile.clone(), &mut LatticeScratch::default()).expect("an empty tile");
    assert!(got.patches.is_empty() && got.occupancy.voxels.is_empty());
    tile.at.scan = contract::ScanId(9);
    assert!(stage.apply(tile, &mut LatticeScratch::default()).is_err());
    assert_ne!(ROOM, NOTHING);
}
