//! Files that the program alone reads, in: its settings, reviews and paths; its store, plants, kept
//! pieces and lists. They are read as they were written or refused, out. Where a digest guards a
//! file, the target makes it right: it guards against damage, not against somebody who computes it
//! anew.

use crate::{file, folder, refused};
use contract::{InputId, Map as _, MaskId, Scan, ScanId, Strip};
use geometry::{Aabb, Pose};
use std::path::Path;
use std::sync::OnceLock;
use stillpoint::cache::Manifest;
use stillpoint::check::trajectory::Trajectory;
use stillpoint::detect::review::Review;
use stillpoint::engine::Engine;
use stillpoint::eval::fuzz_doors;
use stillpoint::job::{FlagValues, Means};
use stillpoint::result::history;
use stillpoint::store::{Scatter, Store, TileSink};

/// Longest text that is read, bytes: inputs of a target are shorter.
const MOST: u64 = 1 << 26;
/// Lengths of the headers of a store's two files, bytes.
const HEADER: usize = 64;

/// A store: four bytes that say how long the archive of its catalogue is, the archive, and the
/// tiles behind their header.
pub fn store(data: &[u8]) {
    static HEADS: OnceLock<[Vec<u8>; 2]> = OnceLock::new();
    let [catalogue, tiles] = HEADS.get_or_init(|| {
        let dir = folder().join("seed-store");
        small_store(&dir);
        ["catalogue.rkyv", "tiles.bin"].map(|name| {
            let bytes = std::fs::read(dir.join(name)).expect("a store has two files");
            bytes[..HEADER].to_vec()
        })
    });
    let Some((n, rest)) = data.split_first_chunk::<4>() else { return };
    let n = (u32::from_le_bytes(*n) as usize).min(rest.len());
    let (archive, points) = rest.split_at(n);
    let mut head = catalogue.clone();
    head[16..24].copy_from_slice(&(n as u64).to_le_bytes());
    head[24..56].copy_from_slice(blake3::hash(archive).as_bytes());
    file("store/catalogue.rkyv", &[&head, archive].concat());
    file("store/tiles.bin", &[tiles, points].concat());
    let store = match Store::open(&folder().join("store"), 0, 1 << 20) {
        Ok(store) => store,
        Err(error) => return refused(&error),
    };
    let all: u64 = store.entries().iter().map(|e| e.n_points).sum();
    assert_eq!(all, store.n_points(), "points of all tiles");
    for (i, entry) in store.entries().iter().enumerate() {
        assert!(store.find(entry.at).contains(&i), "a tile is found at its place");
        match store.tile(i, 0) {
            Ok(tile) => {
                assert_eq!(tile.place.len() as u64, entry.n_points, "all points of a tile");
                assert!(tile.pixel.is_sorted(), "sorted by pixel");
            }
            Err(error) => refused(&error),
        }
        let mut n = 0;
        match store.look_at(&[i], 0, |points| n += points.xyz.len() as u64) {
            Ok(()) => assert_eq!(n, entry.n_points, "all points of a tile"),
            Err(error) => refused(&error),
        }
    }
    let _ = store.touching(&Aabb::of([[0.0; 3]]));
}

/// A store of one scan of some dozens of points.
pub fn small_store(dir: &Path) {
    let scan = Scan {
        id: ScanId(0),
        input: InputId(0),
        mask: MaskId(0),
        name: "one".into(),
        source_id: None,
        places: Vec::new(),
        raster: None,
        scanner: contract::ScannerPosition::Unknown,
        world_from_scan: Pose::identity(),
        lattice: None,
        stated_bounds: None,
        stated_points: None,
        notes: Vec::new(),
    };
    let strip = Strip {
        scan: ScanId(0),
        mask: MaskId(0),
        first_place: 0,
        place: (0..40).collect(),
        xyz: (0..40).map(|i| [(i % 8) as f32 * 3.0, (i / 8) as f32, 0.5]).collect(),
        attributes: None,
    };
    let scans = [scan];
    let mut sink = TileSink::create(dir, &scans, 0, 1 << 20).expect("a store can be made");
    let strip = Scatter::new(&scans).apply(strip, &mut ()).expect("a strip has tiles");
    sink.add(&strip).expect("a store takes a strip");
    drop(sink.finish(&Engine::new(1), 1 << 20).expect("a store can be ended"));
}

/// `plant.bin`, without format and digest.
pub fn plant(data: &[u8]) {
    file("plant/plant.bin", &fuzz_doors::plant_file(data));
    if let Err(error) = fuzz_doors::plant(&folder().join("plant")) {
        refused(&error);
    }
}

/// A kept piece: fits of a region, or a model of the library.
pub fn pieces(data: &[u8]) {
    let _ = fuzz_doors::piece(data);
}

/// `manifest.json`.
pub fn manifest(data: &[u8]) {
    static ONCE: OnceLock<()> = OnceLock::new();
    ONCE.get_or_init(|| drop(file("manifest/result.json", b"{}")));
    file("manifest/manifest.json", &fuzz_doors::list_file(data));
    let out = folder().join("manifest");
    match Manifest::read(&out) {
        Ok(manifest) => {
            for listed in &manifest.files {
                let parts = Path::new(&listed.path).components();
                let is_name = |part| matches!(part, std::path::Component::Normal(_));
                assert!(parts.clone().count() > 0 && parts.into_iter().all(is_name), "{listed:?}");
            }
            match stillpoint::cache::check(&out, &Engine::new(1)) {
                Ok(checked) => assert!(checked.wrong.len() <= manifest.files.len(), "once each"),
                Err(error) => refused(&error),
            }
        }
        Err(error) => refused(&error),
    }
    let _ = history::sessions(folder()).map(|found| history::words(&found.sessions));
}

/// `--config`.
pub fn settings(data: &[u8]) {
    let given = FlagValues { config: Some(file("config.toml", data)), ..FlagValues::default() };
    match Means::of(&given) {
        Ok(means) => {
            assert!((1..=1024).contains(&means.n_threads), "threads");
            // What was read can be written, and read again.
            for (key, value) in means.settings.all() {
                let mut again = means.settings.clone();
                again.set(key, &value).unwrap_or_else(|e| panic!("{key} = {value}: {e}"));
            }
        }
        Err(error) => refused(&error),
    }
}

/// `--review`.
pub fn review(data: &[u8]) {
    let models = crate::robots::models();
    match Review::read(&file("review.toml", data), models, MOST) {
        Ok(review) => {
            for place in &review.places {
                assert!(place.at.iter().all(|v| v.is_finite()), "a finite place");
                assert!(place.radius > 0.0 && place.radius.is_finite(), "a radius");
                assert!(place.joints.values().all(|v| v.is_finite()), "finite joints");
                let is_known = |name: &String| models.iter().any(|m| m.name == *name);
                assert!(place.model.as_ref().is_none_or(is_known), "a model of the library");
            }
        }
        Err(error) => refused(&error),
    }
}

/// `--trajectory`, CSV or JSON.
pub fn trajectory(data: &[u8]) {
    match Trajectory::read(&file("path.csv", data), MOST) {
        Ok(path) => {
            let n = path.joints.len();
            assert!(n > 0 && !path.points.is_empty(), "a path has joints and waypoints");
            assert!(path.points.iter().all(|p| p.len() == n), "a value for each joint");
            assert!(path.points.iter().flatten().all(|v| v.is_finite()), "finite values");
            let times = &path.times;
            assert!(times.is_empty() || times.len() == path.points.len(), "a time for each");
            assert!(times.iter().all(|t| t.is_finite()), "finite times");
        }
        Err(error) => refused(&error),
    }
}
