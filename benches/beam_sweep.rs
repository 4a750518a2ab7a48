//! What is the cost of the beam search over the joints of one robot? It starts from the true base,
//! with all hypotheses of the default settings.
//!
//! The sweep is private to `fit`, so that this measures the smallest public call that is dominated
//! by it: `fit::fit` without the quick test before it (the base is stated to be clear), with one
//! hypothesis refined and polished, and with a least score that nothing reaches, so that no posture
//! is adjusted or reported.
//!
//! Input: a robot with seven joints at 5 m from six scanners of a million beams each. One thread.

mod common;

use common::{Cell, N_BEAMS};
use contract::OneByOne;
use divan::{Bencher, black_box};
use fit::{MeasuredScene, Prepared, Settings};

fn main() {
    divan::main();
}

#[divan::bench(sample_count = 10, sample_size = 1)]
fn search(bencher: Bencher<'_, '_>) {
    let cell = Cell::new(N_BEAMS);
    let (region, views) = (cell.region(), cell.views(&cell.scans()));
    let floors = [cell.floor()];
    let usual = Settings::default();
    let settings = Settings { min_score: f64::INFINITY, n_refine: 1, n_polish: 1, ..usual };
    let prepared = Prepared::new(0, &cell.models[0], &OneByOne);
    let scene = MeasuredScene::new(&region, &views, &floors, &settings, &OneByOne);
    let candidate = cell.candidate();
    bencher.bench_local(|| {
        black_box(fit::fit(&candidate, &prepared, &scene, &settings, &OneByOne).is_none())
    });
}
