//! The settings of the floor stage, each with its unit and reason.

/// Settings of the floor stage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Largest tilt of an installation plane other than the floor, radians: 3° (METHOD.md §5).
    pub max_tilt: f64,
    /// Largest tilt of a floor level, radians: 5°, since scanners on carts are not levelled.
    pub max_floor_tilt: f64,
    /// Largest tilt of a single patch of a floor level, radians: small patches determine their
    /// normal poorly.
    pub max_patch_tilt: f64,
    /// Largest step in height between neighbouring ground cells of one surface, metres: a floor
    /// tilted by 5° steps 31 mm across the diagonal of a cell.
    pub max_step: f64,
    /// Difference in height at which two separate pieces belong to one level, metres: scans are
    /// registered to a centimetre.
    pub level_tolerance: f64,
    /// Further difference in height that is allowed for each metre between the pieces, metres a
    /// metre: 0.2°.
    pub level_bend: f64,
    /// Largest difference in height of two pieces of one level at any distance, metres.
    pub max_level_tolerance: f64,
    /// Smallest area of a floor level, m²: more than a table or a car roof.
    pub min_area: f64,
    /// Smallest area of a single piece of a level with something below it, m²: a mezzanine counts,
    /// a row of tables does not.
    pub min_raised_area: f64,
    /// Share of a level's cells with something below from which on the level counts as raised.
    pub raised_share: f64,
    /// Largest waviness of a level, RMS, metres.
    pub max_waviness: f64,
    /// Edge of a cell of the height map, metres: it follows waves of some metres and averages
    /// noise.
    pub height_cell: f64,
    /// Smallest number of points of a ground cell that gives a height.
    pub min_cell_points: u32,
    /// Share of beams through a level above from which on a surface is a mirror image.
    pub ghost_share: f64,
    /// Smallest visible area of an installation plane, m²: the ring around a robot's foot.
    pub min_stand_area: f64,
    /// Height above the floor below which a plane is the floor itself, metres.
    pub floor_band: f64,
    /// Largest number of installation planes beside floor levels; the largest are kept.
    pub max_stands: usize,
    /// Largest gap between patches of one installation plane, metres: what a foot or cable hides.
    pub stand_gap: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            max_tilt: 3_f64.to_radians(),
            max_floor_tilt: 5_f64.to_radians(),
            max_patch_tilt: 7_f64.to_radians(),
            max_step: 0.032,
            level_tolerance: 0.025,
            level_bend: 0.0035,
            max_level_tolerance: 0.06,
            min_area: 3.0,
            min_raised_area: 10.0,
            raised_share: 0.25,
            max_waviness: 0.06,
            height_cell: 1.0,
            min_cell_points: 4,
            ghost_share: 0.5,
            min_stand_area: 0.02,
            floor_band: 0.012,
            max_stands: 512,
            stand_gap: 0.3,
        }
    }
}
