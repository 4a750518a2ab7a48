//! Plans of Fourier transforms. They are made here alone: each crate that makes plans would hold
//! all kernels of the library, a megabyte of them.

pub use rustfft::Fft;
pub use rustfft::num_complex::Complex32;

use rustfft::{FftDirection, FftPlanner};
use std::sync::Arc;

/// The plan of a transform of `n` values from places to frequencies, without a factor.
#[must_use]
pub fn forward(n: usize) -> Arc<dyn Fft<f32>> {
    plan(n, FftDirection::Forward)
}

/// The plan of its inverse, which returns `n` times the values.
#[must_use]
pub fn inverse(n: usize) -> Arc<dyn Fft<f32>> {
    plan(n, FftDirection::Inverse)
}

#[inline(never)]
fn plan(n: usize, direction: FftDirection) -> Arc<dyn Fft<f32>> {
    FftPlanner::new().plan_fft(n, direction)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_inverse_returns_the_values_n_fold() {
        let values: Vec<Complex32> = (0..12).map(|k| Complex32::new(k as f32, 1.0)).collect();
        let mut there_and_back = values.clone();
        forward(12).process(&mut there_and_back);
        inverse(12).process(&mut there_and_back);
        for (a, b) in values.iter().zip(&there_and_back) {
            assert!((a * 12.0 - b).norm() < 1e-4, "{a} and {b}");
        }
    }
}
