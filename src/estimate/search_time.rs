//! Predicts the processor time of the search from the expected regions and the number of models.

use super::expected_regions::{ExpectedRegion, ExpectedRegions};
use super::rates::{AREA, REGION, SURFACE};

/// Processor time of the search, seconds.
pub(super) fn seconds(expected: &ExpectedRegions, n_models: usize) -> f64 {
    expected.regions.iter().map(|region| of_region(region, n_models)).sum()
}

/// Processor time of the search of one region, seconds.
pub(super) fn of_region(region: &ExpectedRegion, n_models: usize) -> f64 {
    let (area, surface) = (region.size[0] * region.size[1], region.n_voxels as f64 / 1000.0);
    REGION + AREA * area * n_models as f64 + SURFACE * surface
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_crowded_hall_takes_longer_than_an_empty_one_and_many_models_longer_than_few() {
        let region = ExpectedRegion { size: [4.0, 5.0, 2.5], n_points: 100_000, n_voxels: 10_000 };
        let hall = |n: usize| ExpectedRegions { regions: vec![region; n], has_floor: true };
        assert_eq!(seconds(&hall(0), 10), 0.0);
        // 0.6 s, 20 m² for ten models, and ten thousand voxels.
        let one = seconds(&hall(1), 10);
        assert!((one - 23.5).abs() < 1e-9, "{one}");
        assert!((seconds(&hall(8), 10) - 8.0 * one).abs() < 1e-9);
        assert!(seconds(&hall(1), 3) < 0.5 * one);
    }
}
