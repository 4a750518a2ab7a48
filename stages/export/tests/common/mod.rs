//! Synthetic points by index, tiles and clouds of them in a folder, and readers of such files.
#![allow(dead_code, reason = "each test file uses some of it")]
#![allow(unreachable_pub, reason = "of tests only")]

use contract::{Label, PointKind};
use export::*;
use geometry::Aabb;
use std::path::{Path, PathBuf};

pub fn folder(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).expect("folder");
    path
}

pub const N: usize = 20_000;

pub fn label(i: usize) -> Label {
    match i % 10 {
        0..3 => Label::FLOOR,
        3..6 => Label::FIXED,
        6 | 7 => Label { kind: PointKind::Link, robot: 0, link: (i / 10 % 3) as i16 },
        8 => Label { kind: PointKind::Attachment, robot: 1, link: 2 },
        _ => Label::UNCERTAIN,
    }
}

pub fn world(i: usize) -> [f64; 3] {
    let turn = i as f64 * 0.37;
    [
        400_000.0 + 15.0 * turn.sin(),
        5_000_000.0 + 12.0 * turn.cos(),
        100.0 + (i % 300) as f64 * 0.01,
    ]
}

pub fn intensity(i: usize) -> u16 {
    (i * 7 % 65536) as u16
}

pub fn source_id(i: usize) -> u16 {
    (i % 4) as u16 + 1
}

pub fn clouds(
    out: &Path,
    n: usize,
    [compress, with_color]: [bool; 2],
    waiting_bytes: usize,
) -> WrittenFiles {
    let around =
        Aabb { min: [399_985.0, 4_999_988.0, 100.0], max: [400_015.0, 5_000_012.0, 103.0] };
    let las = LasSettings { with_color, ..LasSettings::new(Quantum::around(&around)) };
    let settings = Settings { compress, waiting_bytes, ..Settings::default() };
    let las = settings.records(&las);
    let mut clouds = Clouds::create(out, &las, &settings).expect("create");
    let mut tiles = Tiles::create(out, &las, &settings).expect("create").expect("asked");
    let pack = Pack::of_clouds(&las, &settings);
    // The length of a strip divides no other number here.
    let all: Vec<usize> = (0..n).collect();
    for strip in all.chunks(1013) {
        let world: Vec<_> = strip.iter().map(|&i| world(i)).collect();
        let labels: Vec<_> = strip.iter().map(|&i| label(i)).collect();
        let points = PointColumns {
            world: &world,
            labels: &labels,
            intensity: &strip.iter().map(|&i| intensity(i)).collect::<Vec<_>>(),
            color: &strip.iter().map(|&i| [i as u16, 2, 65535]).collect::<Vec<_>>(),
            gps_time: &strip.iter().map(|&i| i as f64 * 0.001).collect::<Vec<_>>(),
            source_id: &strip.iter().map(|&i| source_id(i)).collect::<Vec<_>>(),
            ..PointColumns::default()
        };
        let packed = pack.pack(&points).expect("packs");
        tiles.add(&packed, &contract::OneByOne).expect("adds");
        clouds.add(&packed).expect("adds");
    }
    let tiles = tiles.finish(&contract::OneByOne).expect("finish");
    let (robots, fixed) = clouds.finish().expect("finish");
    WrittenFiles { tiles, robots, fixed }
}

pub fn read(path: &Path) -> (las::Header, Vec<las::Point>) {
    let mut reader = las::Reader::from_path(path).expect("opens");
    let points = reader.read_all().expect("reads").points().map(|p| p.expect("decodes")).collect();
    (reader.header().clone(), points)
}

/// A progress receiver that reports nothing and never cancels.
struct Quiet;

impl CopcSteps for Quiet {
    fn begins(&self, _: &'static str, _: u64) {}
    fn is_at(&self, _: u64) {}
    fn ends(&self) -> contract::Result<()> {
        Ok(())
    }
}

/// Writes one COPC file of the tiles; returns whether there were any.
pub fn copc(out: &Path, n_threads: usize) -> bool {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().expect("threads");
    let write = || {
        write_copc(&tiles(out)?, &out.join(COPC), &out.join("scratch"), &std::sync::Arc::new(Quiet))
    };
    pool.install(write).expect("writes")
}
