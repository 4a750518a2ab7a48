//! What is tuned about the search for bases: samples, base poses that are kept, and scores.

/// What is tuned.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Samples of the base link at the coarse level.
    pub n_coarse: usize,
    /// Samples of a link at finer levels.
    pub n_fine: usize,
    /// Base poses of the coarse level whose first link is looked at.
    pub keep_feet: usize,
    /// Base poses that survive the coarse level.
    pub keep_coarse: usize,
    /// Base poses that survive the middle level.
    pub keep_middle: usize,
    /// Places (bases farther apart than `place_radius`) that go on to the fit.
    pub max_places: usize,
    /// Base poses that go on to the fit for each place.
    pub bases_per_place: usize,
    /// Bases nearer than this are at the same place, metres.
    pub place_radius: f64,
    /// Lowest mean sample score of base and first link that is worth a fit.
    pub min_score: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            n_coarse: 80,
            n_fine: 160,
            keep_feet: 800,
            keep_coarse: 120,
            keep_middle: 60,
            max_places: 5,
            bases_per_place: 12,
            place_radius: 0.30,
            min_score: 0.05,
        }
    }
}
