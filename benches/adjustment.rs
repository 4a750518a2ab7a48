//! What is the cost of least squares once a posture is known? Both cases start from the true base
//! and posture. `rounds` is the coarse and fine rounds on some thousand points of each link;
//! `whole` adds the adjustment on all points with all that is reported of it.
//!
//! The sums of the normal equations are private to `fit`, so this measures the smallest public
//! calls that are dominated by matching points and summing: `fit::converge` and `fit::again`.
//!
//! Input: a robot with seven joints at 5 m from six scanners of a million beams each. One thread.

mod common;

use common::{Cell, N_BEAMS};
use contract::OneByOne;
use divan::{Bencher, black_box};
use fit::{MeasuredScene, Prepared, Settings};
use geometry::Pose;

fn main() {
    divan::main();
}

#[divan::bench(sample_count = 10, sample_size = 1)]
fn rounds(bencher: Bencher<'_, '_>) {
    let cell = Cell::new(N_BEAMS);
    let (region, views) = (cell.region(), cell.views(&cell.scans()));
    let (floors, settings) = ([cell.floor()], Settings::default());
    let prepared = Prepared::new(0, &cell.models[0], &OneByOne);
    let scene = MeasuredScene::new(&region, &views, &floors, &settings, &OneByOne);
    let (base, posture) = (Pose::identity(), &cell.posture[..]);
    bencher.bench_local(|| {
        black_box(fit::converge(&prepared, &scene, &settings, &base, posture));
    });
}

#[divan::bench(sample_count = 5, sample_size = 1)]
fn whole(bencher: Bencher<'_, '_>) {
    let cell = Cell::new(N_BEAMS);
    let (region, views) = (cell.region(), cell.views(&cell.scans()));
    let (floors, settings) = ([cell.floor()], Settings::default());
    let prepared = Prepared::new(0, &cell.models[0], &OneByOne);
    let scene = MeasuredScene::new(&region, &views, &floors, &settings, &OneByOne);
    let found = fit::fit(&cell.candidate(), &prepared, &scene, &settings, &OneByOne);
    let found = found.expect("the robot is found");
    bencher.bench_local(|| {
        black_box(fit::again(&found, &prepared, &scene, &settings, &OneByOne).is_some())
    });
}
