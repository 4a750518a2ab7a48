//! A sample of a cloud's points, and the setups in it, where the order of the points tells none.

use crate::engine::AllThreads;
use contract::{Result, Scan};
use geometry::{Point, Vector};
use ingest::{Sources, Want};
use setups::FoundRasters;

/// Largest number of points that are looked at: 240 MB.
const MOST: usize = 20_000_000;

/// Setups of a scan from its points in any order, with the number of its points.
pub(super) fn of_scan(sources: &Sources, scan: &Scan) -> Result<(FoundRasters, u64)> {
    let mut sample = EvenSample::new(MOST);
    let turn = scan.world_from_scan.rotation;
    let is_level = turn.angle() < 1e-12;
    for strip in sources.strips(scan.input, Want::Coordinates)? {
        let strip = strip?;
        if strip.scan != scan.id {
            continue;
        }
        for p in strip.xyz {
            let turned = || (turn * Vector::from(p.map(f64::from))).cast::<f32>().into();
            sample.add(if is_level { p } else { turned() });
        }
    }
    let mut found = setups::find_unordered(&sample.points, &AllThreads);
    let origin = Point::from(scan.world_from_scan.translation.vector);
    for setup in &mut found.setups {
        setup.world_from_scanner.translation.vector += origin.coords;
    }
    Ok((found, sample.n_seen))
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
