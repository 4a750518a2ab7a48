//! What is tuned in the source's method (METHOD.md §10 of `fit`), with units.

/// Tunables of `--method paper`.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Edge of the grid that thins points and base for the graph, metres (METHOD.md §10).
    pub voxel: f64,
    /// Neighbours of a point in the graph.
    pub n_neighbours: usize,
    /// Longest edge of the graph, metres.
    pub max_edge: f64,
    /// Lower end of the band above the plane where paths begin, metres.
    pub foot_low: f64,
    /// Upper end of that band, metres.
    pub foot_high: f64,
    /// Points higher above the plane are no base's, metres.
    pub max_height: f64,
    /// Factor on, and addition to (metres), the base's largest distance from the plane along its
    /// surface.
    pub geodesic_slack: [f64; 2],
    /// Most connected sets that are tried as a base.
    pub max_bases: usize,
    /// Step of yaw, radians, and the finer one about the best.
    pub yaw_step: [f64; 2],
    /// Steps along the axes of a registered base, metres, and of yaw, radians, round by round.
    pub settle_steps: [[f64; 2]; 2],
    /// Distances beyond this count as this when yaws are compared, metres: missing sides must not
    /// shift it.
    pub truncation: f64,
    /// Exponent of the sparse norm, 0..1.
    pub sparse_p: f64,
    /// First penalty of the multipliers (unit size), and its growth.
    pub sparse_mu: [f64; 2],
    /// Most iterations of the sparse registration: correspondences, multipliers.
    pub sparse_rounds: [usize; 2],
    /// Step of a joint's sweep, radians or (prismatic) metres, and the finer one about the best.
    pub sweep_step: [f64; 2],
    /// Half width of the window on a lattice, pixels.
    pub window: i32,
    /// Share of a link's samples that a quarter turn about its joint must move off its surface,
    /// else the child decides too.
    pub near_symmetric: f64,
    /// Weight of the two points of the axis in Eq. 4.1, against all correspondences together.
    pub axis_weight: f64,
    /// Distance between the two points of the axis, metres: about a link's length.
    pub axis_span: f64,
    /// Gate of the registration at first and in the end, metres.
    pub gate: [f64; 2],
    /// Most iterations of the registration.
    pub n_rounds: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            voxel: 0.012,
            n_neighbours: 10,
            max_edge: 0.04,
            foot_low: 0.008,
            foot_high: 0.04,
            max_height: 1.5,
            geodesic_slack: [1.05, 0.02],
            max_bases: 3,
            yaw_step: [0.087, 0.0175],
            settle_steps: [[0.006, 0.05], [0.002, 0.01]],
            truncation: 0.03,
            sparse_p: 0.4,
            sparse_mu: [10.0, 1.2],
            sparse_rounds: [30, 20],
            sweep_step: [0.05, 0.005],
            window: 2,
            near_symmetric: 0.3,
            axis_weight: 0.5,
            axis_span: 0.5,
            gate: [0.03, 0.006],
            n_rounds: 40,
        }
    }
}
