//! How many beams per second does the virtual scanner cast on one thread? The scenes are that of
//! the source (one robot on a bare floor) and that of the demo (three robots in a furnished hall),
//! whose beams have a width and are cast as several rays each.
//!
//! Casting is private to `simulate`, so that this measures `Simulator::columns`, which casts whole
//! columns, combines the rays of a beam, and adds noise.

mod common;

use common::Cell;
use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use robot::Library;
use simulate::Simulator;
use simulate::demo_robots;

fn main() {
    divan::main();
}

/// Number of columns that are cast at once, from the middle of the scan on.
const N_COLUMNS: u32 = 64;

fn cast(bencher: Bencher<'_, '_>, simulator: &Simulator) {
    let first = simulator.frame(0).n_cols / 2;
    let columns = || simulator.columns(0, first..first + N_COLUMNS);
    bencher.counter(ItemsCount::new(columns().len())).bench_local(|| black_box(columns().len()));
}

#[divan::bench(sample_count = 20, sample_size = 1)]
fn one_robot(bencher: Bencher<'_, '_>) {
    cast(bencher, &Cell::new(common::N_BEAMS).simulator);
}

#[divan::bench(sample_count = 20, sample_size = 1)]
fn furnished_hall(bencher: Bencher<'_, '_>) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (path, bytes) in demo_robots::files() {
        let path = folder.path().join(path);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("is made");
        std::fs::write(path, bytes).expect("is written");
    }
    let settings = robot::Settings::without_clouds();
    let models = Library::load(folder.path(), &settings).expect("the models load").models;
    let scene = simulate::demo_scene(1, &models).expect("the scene is drawn");
    cast(bencher, &Simulator::new(&scene, &models).expect("the scene can be built"));
}
