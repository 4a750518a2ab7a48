//! What is the cost of one look-up in a depth image? All surface samples of the robot are looked up
//! in the image of one scanner, sixteen at a time, as the search does, and one at a time.
//!
//! Input: a robot at 5 m in a scan of a million beams; some 350,000 samples. One thread.
//! Times on one machine differ by a few percent between runs.

mod common;

use common::{Cell, N_BEAMS};
use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use geometry::depth::{LANES, lanes, rows, transform, transform_lanes};

fn main() {
    divan::main();
}

/// Width around a place within which beams are looked up, metres: the spacing of samples in the
/// search.
const FOOTPRINT: f32 = 0.02;

/// Surface samples of all links in the frame of the base, metres.
fn samples(cell: &Cell) -> Vec<[f32; 3]> {
    let model = &cell.models[0];
    let poses = model.poses(&cell.posture);
    let links = model.links.iter().zip(&poses);
    let placed = links.flat_map(|(link, pose)| {
        let m = rows(pose);
        link.cad.points.iter().map(move |p| transform(&m, *p))
    });
    placed.collect()
}

#[divan::bench(args = [1, LANES])]
fn look(bencher: Bencher<'_, '_>, at_once: usize) {
    let cell = Cell::new(N_BEAMS);
    let views = cell.views(&[cell.simulator.scan(0)]);
    let (image, samples) = (&views[0].images[0], samples(&cell));
    let camera = rows(image.camera_from_local());
    let bencher = bencher.counter(ItemsCount::new(samples.len()));
    if at_once == 1 {
        bencher.bench_local(|| {
            let found = samples.iter().filter_map(|p| image.look_at(*p, FOOTPRINT));
            black_box(found.map(|look| look.near).fold(f32::INFINITY, f32::min))
        });
    } else {
        bencher.bench_local(|| {
            let mut least = f32::INFINITY;
            for some in samples.chunks(LANES) {
                let looks = image.look_lanes(&transform_lanes(&camera, &lanes(some)), FOOTPRINT);
                least = looks.near.iter().copied().fold(least, f32::min);
            }
            black_box(least)
        });
    }
}
