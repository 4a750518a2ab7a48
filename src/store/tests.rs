//! Tests of the store through its public calls: strips, memory and threads do not change the tiles,
//! and damage is reported by name.

use super::catalogue::TILES;
use super::record::N_LEVELS;
use super::*;
use crate::engine::Engine;
use contract::{
    InputId, Kind, Lattice, MAX_SKIP, MaskId, Scan, ScanId, Strip, TILE_SIDE, Tile, TileAt,
    TilePoints,
};
use geometry::{Aabb, Pose};
use std::io::{Seek, SeekFrom, Write};
use std::path::Path;

const SCAN_POINTS: usize = 60_000;

fn noise(x: u64) -> f32 {
    let z = (x ^ (x >> 31)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    ((z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb) >> 40) as f32 / (1 << 24) as f32
}

fn scan(id: u32, lattice: Option<Lattice>) -> Scan {
    Scan {
        id: ScanId(id),
        input: InputId(0),
        mask: MaskId(id),
        name: format!("scan {id}"),
        source_id: None,
        places: Vec::new(),
        raster: None,
        scanner: contract::ScannerPosition::Stated,
        world_from_scan: Pose::new([10.0, f64::from(id), 1.0].into(), [0.0, 0.0, 0.3].into()),
        lattice,
        stated_bounds: None,
        stated_points: None,
        notes: Vec::new(),
    }
}

pub(super) fn scans() -> Vec<Scan> {
    let mut turned = Lattice::new(0.003, 0.002, 0.1, 0.2);
    turned.lattice_from_scan = nalgebra::UnitQuaternion::from_euler_angles(1.2, 0.1, 0.0);
    vec![scan(0, Some(Lattice::new(0.004, 0.003, 0.0, 0.0))), scan(1, Some(turned)), scan(2, None)]
}

/// A strip of a scanned room, in rows or shuffled; every seventh place is a gap.
fn strip(scan: u32, from: usize, to: usize) -> Strip {
    let xyz = (from..to)
        .map(|i| {
            let i = i as u64;
            let a =
                if scan == 1 { noise(i) } else { (i / 200) as f32 / 300.0 } * std::f32::consts::TAU;
            let e =
                if scan == 1 { noise(i + 7_000_000) } else { (i % 200) as f32 / 200.0 } * 2.0 - 1.0;
            let r = 3.0 + noise(i + 99_000_000);
            [r * e.cos() * a.cos(), r * e.cos() * a.sin(), r * e.sin()]
        })
        .collect::<Vec<_>>();
    let place = |i: usize| (i + i / 7) as u64;
    Strip {
        scan: ScanId(scan),
        mask: MaskId(scan),
        first_place: place(from),
        place: (from..to).map(|i| (place(i) - place(from)) as u32).collect(),
        xyz,
        attributes: None,
    }
}

fn strips(n: usize) -> Vec<Strip> {
    let cuts = |s: u32| (0..SCAN_POINTS).step_by(n).map(move |i| (s, i));
    let cut = |(s, i): (u32, usize)| strip(s, i, (i + n).min(SCAN_POINTS));
    (0..3).flat_map(cuts).map(cut).collect()
}

pub(super) fn build(
    dir: &Path,
    strips: Vec<Strip>,
    budget_bytes: usize,
    n_workers: usize,
) -> (Store, u64) {
    let scans = scans();
    let engine = Engine::new(n_workers);
    let mut sink = TileSink::create(dir, &scans, 0, budget_bytes).expect("begins");
    let scatter = Scatter::new(&scans);
    engine
        .pass("read", strips.into_iter().map(Ok), |f| f.map(&scatter).for_each(|s| sink.add(&s)))
        .expect("fills");
    let spilled = sink.spilled_bytes();
    (sink.finish(&engine, 1 << 16).expect("finishes"), spilled)
}

/// All tiles of a store, independent of their order in the file.
pub(super) fn tiles(store: &Store) -> Vec<Tile> {
    store.picks(|_| 0).map(|pick| pick.and_then(|p| store.read(&p)).expect("whole")).collect()
}

#[test]
fn strips_spill_and_threads_do_not_change_a_byte() {
    let first = tempfile::tempdir().expect("a folder");
    let (store, spilled) = build(first.path(), strips(7000), usize::MAX, 1);
    assert_eq!((store.n_points(), spilled), (3 * SCAN_POINTS as u64, 0));
    let expected = tiles(&store);
    for (n, budget, n_workers, reversed) in
        [(500, 300_000, 2, false), (7000, 1, 4, false), (333, 1_000_000, 1, true)]
    {
        let dir = tempfile::tempdir().expect("a folder");
        let mut strips = strips(n);
        if reversed {
            strips.reverse();
        }
        let (store, spilled) = build(dir.path(), strips, budget, n_workers);
        assert!(spilled > 0);
        assert!(tiles(&store) == expected, "{n} points a strip, {budget} bytes");
        // No temporary file is left.
        assert_eq!(std::fs::read_dir(dir.path()).expect("a folder").count(), 2);
    }
}

#[test]
fn every_point_is_in_its_tile_with_its_place() {
    let dir = tempfile::tempdir().expect("a folder");
    let (store, _) = build(dir.path(), strips(4096), 500_000, 2);
    let scans = scans();
    let wholes = [0, 1, 2].map(|s| strip(s, 0, SCAN_POINTS));
    let mut seen = [0; 3];
    for (i, tile) in store.picks(|_| 0).map(|p| store.read(&p?)).enumerate() {
        let tile = tile.expect("whole");
        let entry = store.entries()[i];
        assert_eq!((entry.at, entry.n_points), (tile.at, tile.len() as u64));
        assert_eq!(store.find(tile.at), i..i + 1);
        let s = tile.at.scan.0 as usize;
        seen[s] += tile.len();
        let keys: Vec<_> = tile.pixel.iter().zip(&tile.place).collect();
        assert!(keys.is_sorted());
        for k in 0..tile.len() {
            let place = (tile.first_place + u64::from(tile.place[k])) as u32;
            let at = wholes[s].place.binary_search(&place).expect("a place of the input");
            assert!(wholes[s].xyz[at] == tile.xyz[k]);
            let world =
                scans[s].world_from_scan * nalgebra::Point3::from(tile.xyz[k].map(f64::from));
            assert!(tile.bounds.grown(1e-9).contains(world.into()));
            if let Some(lattice) = scans[s].lattice {
                assert_eq!(lattice.pixel(tile.xyz[k]).0, tile.pixel_at(k));
            }
        }
    }
    assert_eq!(seen, [SCAN_POINTS; 3]);
    let nowhere = TileAt { scan: ScanId(9), row: 0, col: 0 };
    assert!(store.find(nowhere).is_empty());
    let all = Aabb { min: [-100.0; 3], max: [100.0; 3] };
    assert_eq!(store.touching(&all).len(), store.entries().len());
    assert!(store.touching(&Aabb { min: [50.0; 3], max: [60.0; 3] }).is_empty());
}

#[test]
fn of_a_part_of_a_tile_each_square_has_one_pixel() {
    let dir = tempfile::tempdir().expect("a folder");
    let (store, _) = build(dir.path(), strips(4096), 500_000, 2);
    for skip in 0..=MAX_SKIP {
        for (i, from_all) in store.picks(|_| skip).map(|p| store.read(&p?)).enumerate() {
            let whole = store.tile(i, 0).expect("whole");
            let expected = whole.thinned(skip);
            assert!(from_all.expect("whole") == expected);
            assert!(store.tile(i, skip).expect("whole") == expected);
            let mut places = Vec::new();
            let look = |level: &TilePoints<'_>| {
                assert!(level.skip >= skip && level.pixel.is_sorted());
                places.extend_from_slice(level.place);
            };
            store.look_at(&[i], skip, look).expect("whole");
            places.sort_unstable();
            let mut known = expected.place;
            known.sort_unstable();
            assert_eq!(places, known);
        }
    }
}

#[test]
fn ground_squares_of_a_scan_without_lattice() {
    let dir = tempfile::tempdir().expect("a folder");
    let (store, _) = build(dir.path(), vec![strip(2, 0, 5000)], usize::MAX, 1);
    let offset = i64::from(TILE_SIDE) * Tile::GROUND_OFFSET;
    for tile in store.picks(|_| 0).map(|p| store.read(&p?)) {
        let tile = tile.expect("whole");
        for k in 0..tile.len() {
            let at = tile.pixel_at(k);
            let cell = |v: f32| ((v / Tile::GROUND_CELL).floor() as i64 + offset) as u32;
            assert_eq!((at.row, at.col), (cell(tile.xyz[k][1]), cell(tile.xyz[k][0])));
        }
    }
}

#[test]
fn a_crowded_tile_comes_in_parts() {
    let n = TILE_POINTS + 1000;
    let crowd = |from: usize, to: usize| Strip {
        scan: ScanId(2),
        mask: MaskId(2),
        first_place: from as u64,
        place: (0..(to - from) as u32).collect(),
        xyz: (from..to).map(|i| [1.0, 1.0, i as f32]).collect(),
        attributes: None,
    };
    // One far place: no tile may span 2³² places.
    let mut far = crowd(0, 1);
    far.first_place = 1 << 33;
    let mut strips: Vec<Strip> =
        (0..n).step_by(1 << 16).map(|i| crowd(i, (i + (1 << 16)).min(n))).collect();
    strips.push(far);
    let mut expected = Vec::new();
    for (budget, reversed) in [(usize::MAX, false), (1 << 20, false), (10 << 20, true)] {
        let dir = tempfile::tempdir().expect("a folder");
        if reversed {
            strips.reverse();
        }
        let (store, _) = build(dir.path(), strips.clone(), budget, 2);
        let sizes: Vec<_> = store.entries().iter().map(|e| (e.n_points, e.first_place)).collect();
        assert_eq!(sizes, [(TILE_POINTS as u64, 0), (1000, TILE_POINTS as u64), (1, 1 << 33)]);
        assert_eq!(store.find(store.entries()[0].at), 0..3);
        let tiles = tiles(&store);
        if expected.is_empty() {
            expected = tiles;
        } else {
            assert!(tiles == expected, "{budget} bytes");
        }
    }
}

#[test]
fn damage_is_named() {
    let dir = tempfile::tempdir().expect("a folder");
    let (store, _) = build(dir.path(), strips(9000), usize::MAX, 1);
    let entry = store.entries()[0];
    let finest = (0..N_LEVELS).rfind(|&level| entry.n_of[level] > 0).expect("points");
    let fine = entry.offset + layout::blocks(&entry.n_of)[finest].start as u64;
    drop(store);
    let tiles = dir.path().join(TILES);
    let mut file = std::fs::OpenOptions::new().write(true).open(&tiles).expect("a file");
    file.seek(SeekFrom::Start(fine)).and_then(|_| file.write_all(&[0xab])).expect("writes");
    let store = Store::open(dir.path(), 0, 1 << 20).expect("opens");
    let error = store.tile(0, 0).expect_err("damaged");
    assert_eq!(error.kind(), Kind::BadInput);
    let place = format!("{}: scan 0, tile", tiles.display());
    assert!(error.to_string().starts_with(&place), "{error}");
    // Reading only the undamaged levels succeeds.
    let coarse = (N_LEVELS - finest) as u32;
    assert!(finest > 0 && store.tile(0, coarse).is_ok() && store.tile(1, 0).is_ok());
    drop(store);
    file.set_len(5000).expect("cuts");
    assert!(Store::open(dir.path(), 0, 1 << 20).is_err());
    std::fs::remove_file(&tiles).expect("removes");
    assert!(Store::open(dir.path(), 0, 1 << 20).is_err());
}

#[cfg(unix)]
#[test]
fn a_store_that_is_cut_short_under_a_run_is_named_and_the_program_lives() {
    let dir = tempfile::tempdir().expect("a folder");
    let (store, _) = build(dir.path(), strips(9000), usize::MAX, 1);
    let path = dir.path().join(TILES);
    let n = store.entries().len();
    let cut = |len| std::fs::OpenOptions::new().write(true).open(&path)?.set_len(len);
    // One tile whose checksums were compared before, and others that were never read.
    store.tile(0, 0).expect("is whole");
    cut(64).expect("cuts");
    let named = |error: contract::Error| {
        assert_eq!(error.kind(), Kind::BadInput);
        let text = error.to_string();
        assert!(
            text.starts_with(&path.display().to_string()) && text.contains("truncated"),
            "{text}"
        );
    };
    // Cached pages of the file remain valid; those beyond the new end are gone.
    let errors: Vec<_> = (0..n).filter_map(|i| store.tile(i, 0).err()).collect();
    assert_eq!(errors.len(), n, "every tile lies in pages that are gone");
    errors.into_iter().for_each(named);
    named(store.look_at(&[0, n - 1], 0, |_| ()).expect_err("cut short"));
}

#[test]
fn what_a_store_holds_has_one_digest_whatever_its_file_looks_like() {
    let digest = |strips, budget| {
        let dir = tempfile::tempdir().expect("a folder");
        let (store, _) = build(dir.path(), strips, budget, 2);
        store.contents()
    };
    let whole = digest(strips(9000), usize::MAX);
    assert_eq!(whole.len(), 1);
    assert_eq!(whole, digest(strips(9000), 1 << 20));
    assert_eq!(whole, digest(strips(6000), usize::MAX), "the same points in other strips");
    let fewer = strips(9000).split_off(1);
    assert_ne!(whole, digest(fewer, usize::MAX));
}

#[test]
fn an_empty_store_is_a_store() {
    let dir = tempfile::tempdir().expect("a folder");
    let (store, _) = build(dir.path(), Vec::new(), 1000, 2);
    assert_eq!((store.entries().len(), store.n_points()), (0, 0));
}
