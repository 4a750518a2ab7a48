//! How many points per second are decoded from E57, LAS and LAZ on one thread? `strips` reads each
//! file as a run does, with checksums where the format has them: first the coordinates only, then
//! all attributes of each point.
//!
//! Input: the same 336,000 points, one scan of a million beams, in all three formats: E57 with
//! 32-bit floats, LAS and LAZ of point format 6. The files were just written, so they are read
//! from the cache of the system: this measures decoding, not the disk.

mod common;

use common::{Cell, N_BEAMS, World};
use contract::OneByOne;
use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use ingest::{Settings, Want};
use std::path::PathBuf;

fn main() {
    divan::main();
}

fn decode(bencher: Bencher<'_, '_>, want: Want, write: impl Fn(&Cell) -> PathBuf) {
    let cell = Cell::new(N_BEAMS);
    let paths = [write(&cell)];
    // Opening reads a sample of the points for the raster, which is not measured here.
    let sources = ingest::open(&paths, None, &Settings::default(), &OneByOne).expect("opens");
    let read = || {
        let strips = sources.strips(sources.inputs[0].id, want).expect("opens");
        strips.map(|strip| strip.expect("is decoded").len()).sum::<usize>()
    };
    bencher.counter(ItemsCount::new(read())).bench_local(|| black_box(read()));
}

/// The attributes that are read, in words.
const WANTED: [&str; 2] = ["coordinates", "everything"];

fn want(name: &str) -> Want {
    if name == WANTED[0] { Want::Coordinates } else { Want::Everything }
}

#[divan::bench(args = WANTED, sample_count = 10, sample_size = 1)]
fn e57(bencher: Bencher<'_, '_>, wanted: &str) {
    decode(bencher, want(wanted), |cell| cell.write_e57(&[cell.simulator.scan(0)]).0);
}

#[divan::bench(args = WANTED, sample_count = 10, sample_size = 1)]
fn las(bencher: Bencher<'_, '_>, wanted: &str) {
    let write = |cell: &Cell| cell.write_las(&World::of(&[cell.simulator.scan(0)]), false);
    decode(bencher, want(wanted), write);
}

#[divan::bench(args = WANTED, sample_count = 10, sample_size = 1)]
fn laz(bencher: Bencher<'_, '_>, wanted: &str) {
    let write = |cell: &Cell| cell.write_las(&World::of(&[cell.simulator.scan(0)]), true);
    decode(bencher, want(wanted), write);
}
