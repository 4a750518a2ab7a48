//! Selects samples from candidates so that every prefix of the result keeps its distances, too
//! (Poisson-disk sampling by dart throwing with a shrinking radius).

use super::place::{SurfaceSample, below};
use rand_xoshiro::SplitMix64;

/// Radius of a dart relative to the spacing; with this value there are as many samples as squares
/// of the spacing fit into the area.
const RADIUS: f64 = 0.68;
/// Approximate number of samples for which the first radius leaves room.
const N_COARSEST: f64 = 12.0;
/// Factor from each radius to the next, which halves the area of a dart.
const SHRINK: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// Number of darts thrown for each sample that fits at a radius.
const N_DARTS: f64 = 6.0;

pub(super) fn spread(
    candidates: Vec<SurfaceSample>,
    area: f64,
    spacing: f64,
    random: &mut SplitMix64,
) -> Vec<SurfaceSample> {
    let mut waiting = candidates;
    for at in (1..waiting.len()).rev() {
        waiting.swap(at, below(random, at + 1));
    }
    let mut out: Vec<SurfaceSample> = Vec::new();
    let last = RADIUS * spacing;
    let mut radius = (RADIUS * (area / N_COARSEST).sqrt()).max(last);
    loop {
        let n_fit = area / (radius * radius);
        let n_darts = if radius > last { (n_fit * N_DARTS) as usize } else { waiting.len() };
        throw(&mut out, &mut waiting, n_darts, radius as f32);
        if radius <= last || waiting.is_empty() {
            return out;
        }
        radius = (radius * SHRINK).max(last);
    }
}

/// Moves those of the first `n_darts` that keep their distance from `waiting` to `out`.
fn throw(
    out: &mut Vec<SurfaceSample>,
    waiting: &mut Vec<SurfaceSample>,
    n_darts: usize,
    radius: f32,
) {
    let mut grid = SampleGrid::new(radius, out.len() + waiting.len().min(n_darts));
    for sample in out.iter() {
        grid.add(sample);
    }
    let mut at = 0;
    waiting.retain(|sample| {
        at += 1;
        if at > n_darts || grid.is_taken(sample) {
            return true;
        }
        grid.add(sample);
        out.push(*sample);
        false
    });
}

/// Samples by cell in a hash table with chaining. A collision of two cells costs time only.
struct SampleGrid {
    radius: f32,
    first: Vec<u32>,
    /// Each sample with the index of the next one in its slot.
    samples: Vec<(SurfaceSample, u32)>,
}

const NONE: u32 = u32::MAX;

impl SampleGrid {
    fn new(radius: f32, n: usize) -> Self {
        let n_slots = (2 * n).next_power_of_two().max(64);
        Self { radius, first: vec![NONE; n_slots], samples: Vec::with_capacity(n) }
    }

    /// Cells are two radii wide, so that a ball of one radius touches two of them along each axis.
    fn cell(&self, sample: &SurfaceSample, shift: f32) -> [i32; 3] {
        [0, 1, 2].map(|k| (sample.at[k] / (2.0 * self.radius) + shift).floor() as i32)
    }

    fn slot(&self, cell: [i32; 3]) -> usize {
        let mix = |v: i32, prime: u64| u64::from(v as u32).wrapping_mul(prime);
        let h = mix(cell[0], 0x9e37_79b9_7f4a_7c15)
            ^ mix(cell[1], 0xc2b2_ae3d_27d4_eb4f)
            ^ mix(cell[2], 0x1656_67b1_9e37_79f9);
        ((h ^ (h >> 29)) as usize) & (self.first.len() - 1)
    }

    fn add(&mut self, sample: &SurfaceSample) {
        let slot = self.slot(self.cell(sample, 0.0));
        let at = self.samples.len() as u32;
        self.samples.push((*sample, std::mem::replace(&mut self.first[slot], at)));
    }

    /// Whether a sample that faces into the same half space is nearer than the radius. The other
    /// side of a sheet counts as another surface.
    fn is_taken(&self, sample: &SurfaceSample) -> bool {
        let (low, own) = (self.cell(sample, -0.5), self.cell(sample, 0.0));
        // The sample's own cell is tested first, since most conflicts are found there.
        let own = (0..3).map(|k| (own[k] - low[k]) << k).sum::<i32>();
        let limit = self.radius * self.radius;
        for n in 0..8 {
            let cell = [0, 1, 2].map(|k| low[k] + ((n ^ own) >> k & 1));
            let mut at = self.first[self.slot(cell)];
            while at != NONE {
                let (other, next) = &self.samples[at as usize];
                if (other.at - sample.at).norm_squared() < limit
                    && other.normal.dot(&sample.normal) > 0.0
                {
                    return true;
                }
                at = *next;
            }
        }
        false
    }
}
