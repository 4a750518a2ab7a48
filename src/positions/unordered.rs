//! A sample of a cloud's points, and the setups in it, where the order of the points tells none.

use crate::engine::{AllThreads, Engine, Task};
use crate::io::read_parts::InputReader;
use contract::{Map, Result, Scan, Strip};
use geometry::{Point, Vector};
use ingest::{Sources, Want};
use setups::FoundRasters;

/// Largest number of points that are looked at: more do not make the answer better.
const MOST: usize = 20_000_000;
/// Memory for each of them, bytes: 12 of the sample, as many again while it is thinned, and up to
/// 36 of the points of the floor while they are sorted.
const POINT_BYTES: usize = 60;

/// Setups of a scan from its points in any order, with the number of its points. A sample of these
/// is held in so many bytes.
pub(super) fn of_scan(
    sources: &Sources,
    scan: &Scan,
    bytes: usize,
    engine: &Engine,
) -> Result<(FoundRasters, u64)> {
    let mut sample = EvenSample::new((bytes / POINT_BYTES).clamp(2, MOST));
    let input = &sources.inputs[scan.input.0 as usize];
    let reading = InputReader { sources, input, want: Want::Coordinates };
    let task = Task::new("scanners").of(reading.amount());
    reading.each(task, &Levelled(scan), None, &engine.quiet(), |strip| {
        strip.into_iter().flat_map(|strip| strip.xyz).for_each(|p| sample.add(p));
        Ok(())
    })?;
    let pool = engine.pool()?;
    let find = || setups::find_unordered(&sample.points, bytes / 2, &AllThreads);
    let mut found = pool.install(find);
    let origin = Point::from(scan.world_from_scan.translation.vector);
    for setup in &mut found.setups {
        setup.world_from_scanner.translation.vector += origin.coords;
    }
    Ok((found, sample.n_seen))
}

/// Turns the points of a scan so that the world's z is up; drops strips of other scans.
struct Levelled<'a>(&'a Scan);

impl Map for Levelled<'_> {
    type In = Strip;
    type Out = Option<Strip>;
    type Scratch = ();

    fn apply(&self, mut strip: Strip, (): &mut ()) -> Result<Option<Strip>> {
        let turn = self.0.world_from_scan.rotation;
        if strip.scan != self.0.id {
            return Ok(None);
        }
        if turn.angle() > 1e-12 {
            for p in &mut strip.xyz {
                *p = (turn * Vector::from(p.map(f64::from))).cast::<f32>().into();
            }
        }
        Ok(Some(strip))
    }
}

/// Points evenly chosen from a stream of any length, the same ones each time.
struct EvenSample {
    points: Vec<[f32; 3]>,
    most: usize,
    n_seen: u64,
    /// One point of so many is kept.
    every: u64,
}

impl EvenSample {
    fn new(most: usize) -> Self {
        Self { points: Vec::new(), most, n_seen: 0, every: 1 }
    }

    fn add(&mut self, point: [f32; 3]) {
        let (group, place) = (self.n_seen / self.every, self.n_seen % self.every);
        self.n_seen += 1;
        // Which point of a group is kept is drawn: an even step could take single rows of a scan.
        if place != mixed(group) % self.every {
            return;
        }
        self.points.push(point);
        if self.points.len() == self.most {
            let pairs = self.points.chunks(2).enumerate();
            self.points = pairs
                .map(|(i, pair)| pair[(mixed(i as u64 ^ self.every) as usize) % pair.len()])
                .collect();
            self.every *= 2;
        }
    }
}

/// A number whose bits look random (the finaliser of SplitMix64).
fn mixed(mut x: u64) -> u64 {
    x = x.wrapping_add(0x9E37_79B9_7F4A_7C15);
    x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    x ^ (x >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_is_even_and_bounded() {
        let mut sample = EvenSample::new(1000);
        for i in 0..50_000 {
            sample.add([i as f32, 0.0, 0.0]);
            assert!(sample.points.len() < 1000);
        }
        assert_eq!(sample.n_seen, 50_000);
        assert!(sample.points.len() >= 400);
        assert!(sample.points.windows(2).all(|w| w[0][0] < w[1][0]));
        let half = sample.points.iter().filter(|p| p[0] < 25_000.0).count();
        assert!((2 * half).abs_diff(sample.points.len()) < sample.points.len() / 10);
        let odd = sample.points.iter().filter(|p| p[0] % 2.0 == 1.0).count();
        assert!(odd > sample.points.len() / 3 && odd < 2 * sample.points.len() / 3);
    }
}
