//! Reproducible random numbers from seeds and counters.

use std::f64::consts::TAU;

/// The SplitMix64 generator. Its state is a counter, so that it can start at any hash.
#[derive(Debug, Clone)]
pub struct Random {
    state: u64,
}

/// Increment of SplitMix64 (2⁶⁴ / golden ratio, odd).
const GOLDEN: u64 = 0x9E37_79B9_7F4A_7C15;

fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

impl Random {
    /// A generator whose sequence depends only on the `keys` and their order.
    #[must_use]
    pub fn keyed(keys: &[u64]) -> Self {
        let state = keys.iter().fold(0, |state, key| mix(state ^ key.wrapping_add(GOLDEN)));
        Self { state }
    }

    /// The next 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.state = self.state.wrapping_add(GOLDEN);
        mix(self.state)
    }

    /// Uniform in 0 ≤ x < 1.
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 * (1.0 / (1_u64 << 53) as f64)
    }

    /// A number uniform between `low` and `high`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// A uniform index below `n`; 0 if `n` is 0.
    pub fn below(&mut self, n: usize) -> usize {
        ((self.unit() * n as f64) as usize).min(n.saturating_sub(1))
    }

    /// Two independent normal deviates of mean 0 and variance 1 (Box–Muller).
    pub fn normals(&mut self) -> [f64; 2] {
        let radius = (-2.0 * (1.0 - self.unit()).ln()).sqrt();
        let (sin, cos) = (TAU * self.unit()).sin_cos();
        [radius * cos, radius * sin]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_have_unit_variance_and_keys_matter() {
        let (mut sum, mut square) = (0.0, 0.0);
        for i in 0..50_000 {
            let [a, b] = Random::keyed(&[7, i]).normals();
            sum += a + b;
            square += a * a + b * b;
        }
        assert!((sum / 1e5).abs() < 0.02, "{sum}");
        assert!((square / 1e5 - 1.0).abs() < 0.02, "{square}");
        assert_ne!(Random::keyed(&[1, 2]).bits(), Random::keyed(&[2, 1]).bits());
    }
}
