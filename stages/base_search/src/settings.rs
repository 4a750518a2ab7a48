//! The settings of this crate: samples, numbers of base poses, scores, and the sizes of regions.

/// The settings of the search for bases.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Number of samples of the base link at the coarse level.
    pub n_coarse: usize,
    /// Number of samples of a link at finer levels.
    pub n_fine: usize,
    /// Number of base poses of the coarse level whose first moving link is scored.
    pub keep_feet: usize,
    /// Number of base poses that are kept after the coarse level.
    pub keep_coarse: usize,
    /// Number of base poses that are kept after the middle level.
    pub keep_middle: usize,
    /// Number of places (bases at least `place_radius` apart) that are fitted.
    pub max_places: usize,
    /// Number of base poses that are fitted for each place.
    pub bases_per_place: usize,
    /// Bases nearer to each other than this are at the same place, metres.
    pub place_radius: f64,
    /// Least mean score of the samples of base and first moving link for a fit.
    pub min_score: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            n_coarse: 80,
            n_fine: 160,
            keep_feet: 800,
            keep_coarse: 60,
            keep_middle: 30,
            max_places: 5,
            bases_per_place: 12,
            place_radius: 0.30,
            min_score: 0.05,
        }
    }
}

/// How much of the search space a search leaves out.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Thrift {
    /// Quick score (on a quarter of the samples, best of every other yaw) below which a place is
    /// dropped.
    pub(crate) min_quick_score: f64,
    /// Difference from the best quick score of a place up to which a yaw is scored with all
    /// samples.
    pub(crate) yaw_lag: f64,
    /// Least mean score of the judged samples of a base on a coarse grid.
    pub(crate) min_judged: f64,
    /// Limit of base poses of one place once the first link is scored. A cabinet that scores at any
    /// yaw must leave room for other places that fewer scans see.
    pub(crate) quota: usize,
    /// Factor on the number of base poses that are kept.
    pub(crate) keep: usize,
    /// Whether a climb changes height and place in one step.
    pub(crate) climbs_aslant: bool,
    /// Whether the finest level is searched best first, and ends where the wanted places are found.
    pub(crate) is_best_first: bool,
}

/// Scanners: at 96 places of trusted fits no judged score on a coarse grid was below 0.596.
pub(crate) const THRIFTY: Thrift = Thrift {
    min_quick_score: -0.05,
    yaw_lag: 0.25,
    min_judged: 0.5,
    quota: 6,
    keep: 1,
    climbs_aslant: false,
    is_best_first: true,
};

/// Guessed planes, of which the coarse level tries every sixth at most: a base may stand 9 cm above
/// or below the nearest one. There 50 right bases on hidden stands were judged 0.35 to 0.88, seven
/// of them below 0.5.
pub(crate) const GUESSING: Thrift = Thrift { min_judged: 0.1, ..THRIFTY };

/// Depth cameras, which bend surfaces and see little of a base; robots that moved between scans;
/// a place that a person gives.
pub(crate) const THOROUGH: Thrift = Thrift {
    min_quick_score: -0.2,
    yaw_lag: 0.35,
    min_judged: f64::NEG_INFINITY,
    quota: 16,
    keep: 2,
    climbs_aslant: true,
    is_best_first: false,
};

/// The settings of the regions.
#[derive(Debug, Clone, PartialEq)]
pub struct RegionSettings {
    /// Largest distance between the boxes of clusters of one region, metres: a shadow may cut a
    /// thin arm from its body.
    pub join_gap: f64,
    /// Margin of a region around its clusters, metres.
    pub margin: f64,
    /// Least height of a region, metres: no robot is lower when folded.
    pub min_height: f64,
    /// Least length of the longest edge of a region, metres.
    pub min_extent: f64,
    /// Fewest points of a region.
    pub min_points: u64,
    /// Least length of the longest edge of a cluster that counts, metres.
    pub min_seed: f64,
    /// Largest edge of a region on the ground, metres. A larger region is cut into overlapping
    /// squares.
    pub max_extent: f64,
    /// Overlap of these squares, metres: the reach of a large robot.
    pub overlap: f64,
    /// Largest edge on the ground of a cluster that is one body, metres. A larger cluster is a
    /// structure (walls, fences and what touches them): its flat parts are left out, and the rest
    /// is split into bodies.
    pub max_body: f64,
}

impl Default for RegionSettings {
    fn default() -> Self {
        Self {
            join_gap: 0.15,
            margin: 0.4,
            min_height: 0.25,
            min_extent: 0.3,
            min_points: 300,
            min_seed: 0.2,
            max_extent: 12.0,
            overlap: 3.0,
            max_body: 6.0,
        }
    }
}
