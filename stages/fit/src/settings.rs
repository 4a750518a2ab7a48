//! Settings of the fit, with units and reasons.

/// Tunables of search, refinement and verdict.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Hypotheses kept at each joint of the beam. METHOD.md §8: 150 lost none of 60; 100 lose at
    /// most one of 200.
    pub beam: usize,
    /// Hypotheses that are settled (joints so far shaken, the base with the first of them) at each
    /// joint, best first.
    pub settle: usize,
    /// Samples of a link in the beam: the mean of 100 is known to 0.05, less than hypotheses
    /// differ by.
    pub n_search: usize,
    /// Samples of a link in the final judgement.
    pub n_judge: usize,
    /// Tolerance of the beam, metres: what a parent may be off before its child no longer scores.
    pub search_tolerance: f64,
    /// Largest step of a joint sweep, radians.
    pub max_step: f64,
    /// Finished hypotheses that are refined.
    pub n_refine: usize,
    /// Refined hypotheses that are polished on all points and judged.
    pub n_polish: usize,
    /// Edge of the grid that thins points for refinement, metres.
    pub thin: f64,
    /// Most points in the adjustment that is reported. Three hundred thousand left tips of robots
    /// with a million and more three times as far off.
    pub max_points: usize,
    /// Points nearer than this to the installation plane are not the robot's, metres (3σ of 2 mm
    /// noise and more).
    pub floor_band: f64,
    /// Range noise that is assumed at least, metres, one sigma.
    pub min_noise: f64,
    /// The same of depth cameras, which err by half a percent of the metre or two from which they
    /// see arms, alike over a link's width: what is even over a hand's width shows a part of
    /// that.
    pub camera_noise: f64,
    /// Number of a depth camera's points that err alike: those of a hand's width.
    pub camera_alike: f64,
    /// Standard deviation of the base about the installation plane, metres and radians: feet are
    /// shimmed and floors wavy.
    pub plane_sigma: [f64; 2],
    /// The same where no plane is in view: any height, but upright as plumb as people bolt robots
    /// down.
    pub guess_sigma: [f64; 2],
    /// Standard deviations of a scan's errors of registration and range: shift on each axis,
    /// metres, turn about each axis, radians (0.02°), range bias, metres (METHOD.md §11).
    pub scan_sigma: [f64; 3],
    /// Whether robots tell one another of the errors of scans that see several of them.
    pub together: bool,
    /// Whether the places of the joints on their links are estimated, too: for robots that their
    /// models fit poorly.
    pub calibrate: bool,
    /// How far a joint may be from where its model has it, one sigma: shift on each axis, metres,
    /// turn about each axis, radians (0.15°).
    pub frame_sigma: [f64; 2],
    /// A joint is determined by the points if its standard deviation is below this, radians or
    /// metres.
    pub determined_sigma: f64,
    /// Lowest score that is reported at all.
    pub min_score: f64,
    /// Highest share of seen-through samples over all links that is reported at all.
    pub max_violation: f64,
}

impl Settings {
    /// Points that are enough for what is asked many times over.
    pub(crate) fn part(&self) -> usize {
        self.max_points / 6
    }
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            beam: 100,
            settle: 40,
            n_search: 100,
            n_judge: 400,
            search_tolerance: 0.045,
            max_step: 0.05,
            n_refine: 10,
            n_polish: 3,
            thin: 0.012,
            max_points: 600_000,
            floor_band: 0.008,
            min_noise: 0.0015,
            camera_noise: 0.006,
            camera_alike: 100.0,
            plane_sigma: [0.004, 0.006],
            guess_sigma: [1.0, 0.01],
            scan_sigma: [0.003, 0.000_35, 0.001],
            together: true,
            calibrate: false,
            frame_sigma: [0.003, 0.0026],
            determined_sigma: contract::DETERMINED_SIGMA,
            min_score: 0.30,
            max_violation: 0.20,
        }
    }
}
