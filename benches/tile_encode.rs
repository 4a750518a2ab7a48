//! How many labelled points per second are encoded as records of the tiles that a run writes?
//! `records` packs them into bytes, tile by tile; `las` and `laz` also write them to files, `laz`
//! compressed.
//!
//! Input: one scan of a million beams in tiles of 5 m, records of LAS point format 6 with robot and
//! link. One thread. Files go to the system's folder for temporary files.

mod common;

use common::{Cell, N_BEAMS, World};
use contract::OneByOne;
use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use export::{LasSettings, Pack, Settings, Tiles};

fn main() {
    divan::main();
}

/// Number of points that are packed together: those of a strip.
const STRIP: usize = 65_536;

/// The points of one scan, cut into strips.
fn strips(cell: &Cell) -> (Vec<World>, LasSettings, usize) {
    let world = World::of(&[cell.simulator.scan(0)]);
    let (las, n) = (world.las(), world.xyz.len());
    let cut = |first: usize| {
        let range = first..(first + STRIP).min(n);
        World {
            xyz: world.xyz[range.clone()].to_vec(),
            labels: world.labels[range.clone()].to_vec(),
            intensity: world.intensity[range].to_vec(),
        }
    };
    ((0..n).step_by(STRIP).map(cut).collect(), las, n)
}

#[divan::bench(sample_count = 20, sample_size = 1)]
fn records(bencher: Bencher<'_, '_>) {
    let (strips, las, n) = strips(&Cell::new(N_BEAMS));
    let pack = Pack::of_clouds(&las, &Settings::default());
    bencher.counter(ItemsCount::new(n)).bench_local(|| {
        let packed = strips.iter().map(|s| pack.pack(&s.columns()).expect("packs").weight_bytes());
        black_box(packed.sum::<usize>())
    });
}

fn write(bencher: Bencher<'_, '_>, compress: bool) {
    let cell = Cell::new(N_BEAMS);
    let (strips, las, n) = strips(&cell);
    let las = LasSettings { compress, ..las };
    let settings = Settings { compress, ..Settings::default() };
    let pack = Pack::of_clouds(&las, &settings);
    bencher.counter(ItemsCount::new(n)).bench_local(|| {
        let tiles = Tiles::create(cell.folder(), &las, &settings).expect("a folder");
        let mut tiles = tiles.expect("tiles are asked for");
        for strip in &strips {
            let packed = pack.pack(&strip.columns()).expect("packs");
            tiles.add(&packed, &OneByOne).expect("is written");
        }
        black_box(tiles.finish(&OneByOne).expect("is written").len())
    });
}

#[divan::bench(sample_count = 10, sample_size = 1)]
fn las(bencher: Bencher<'_, '_>) {
    write(bencher, false);
}

#[divan::bench(sample_count = 10, sample_size = 1)]
fn laz(bencher: Bencher<'_, '_>) {
    write(bencher, true);
}
