//! Statistics of the points of an adjustment: how many lie on each link, how far off they are, and
//! the noise that follows from that.

use crate::correspond::SurfacePair;

/// What is said of the points, not of the robot.
pub(crate) struct Tallies {
    /// For each link: points within the gate, and the sum of the squares of their distances, m².
    links: Vec<(usize, f64)>,
    /// Points by their distances in standard deviations.
    deviations: [u64; N_BINS],
}

/// Bins of those, and how many are one deviation.
const N_BINS: usize = 256;
const BINS_PER_SIGMA: f64 = 50.0;

impl Tallies {
    pub(crate) fn new(n_links: usize) -> Self {
        Self { links: vec![(0, 0.0); n_links], deviations: [0; N_BINS] }
    }

    pub(crate) fn add(&mut self, pair: &SurfacePair) {
        let (n, rr) = &mut self.links[pair.link];
        *n += 1;
        *rr += pair.r * pair.r;
        let bin = BINS_PER_SIGMA * pair.r.abs() / pair.variance.sqrt();
        self.deviations[(bin as usize).min(N_BINS - 1)] += 1;
    }

    pub(crate) fn join(mut self, later: &Self) -> Self {
        for ((n, rr), (other_n, other_rr)) in self.links.iter_mut().zip(&later.links) {
            *n += other_n;
            *rr += other_rr;
        }
        self.deviations.iter_mut().zip(&later.deviations).for_each(|(n, other)| *n += other);
        self
    }

    /// Points of each link.
    pub(crate) fn n_points(&self) -> Vec<usize> {
        self.links.iter().map(|(n, _)| *n).collect()
    }

    /// RMS distance of those, metres.
    pub(crate) fn rms(&self) -> Vec<f64> {
        let rms = |(n, rr): &(usize, f64)| (rr / (*n).max(1) as f64).sqrt();
        self.links.iter().map(rms).collect()
    }

    /// Robust standard deviation of the points, in those that were stated: by the median, as a few
    /// points are always taken for those of another face.
    pub(crate) fn scale(&self) -> f64 {
        let half = self.deviations.iter().sum::<u64>() / 2;
        let mut below = 0;
        let middle = self.deviations.iter().position(|n| {
            below += n;
            below > half
        });
        middle.map_or(1.0, |bin| 1.4826 * (bin as f64 + 0.5) / BINS_PER_SIGMA)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Vector;

    fn tallied(distances: impl Iterator<Item = f64>) -> Tallies {
        let (none, mut tallies) = (Vector::zeros(), Tallies::new(1));
        for r in distances {
            let (p, n, ray, beam) = (none, none, none, none);
            let variance = 4e-6;
            tallies.add(&SurfacePair { link: 0, patch: 0, view: 0, p, n, ray, beam, variance, r });
        }
        tallies
    }

    #[test]
    fn the_noise_is_that_of_the_points_but_for_those_of_another_face() {
        // Noise of a third of what is stated, evenly over its quantiles; every twentieth point 3 mm
        // off.
        let noise = |k: u32| 0.002 / 3.0 * 1.7 * (2.0 * f64::from(k % 1000) / 1000.0 - 1.0);
        let points = (0..20_000).map(|k| if k % 20 == 0 { 0.003 } else { noise(k) });
        let (first, rest): (Vec<_>, Vec<_>) = points.enumerate().partition(|(i, _)| i % 3 == 0);
        let of = |some: Vec<(usize, f64)>| tallied(some.into_iter().map(|(_, r)| r));
        let all = of(first).join(&of(rest));
        // The median of what is even over 1.7 σ, and of the twentieth beyond it.
        let wanted = 1.4826 * 1.7 / 3.0 * 0.5 / 0.95;
        assert!((all.scale() - wanted).abs() < 0.03, "{} for {wanted}", all.scale());
        assert_eq!(all.n_points(), [20_000]);
        // Without noise, and without points.
        assert!(tallied((0..100).map(|_| 0.0)).scale() < 0.02);
        assert!((tallied(std::iter::empty()).scale() - 1.0).abs() < 1e-12);
    }
}
