//! The settings of the lattice stage, each with its unit and reason.

/// Settings of the lattice stage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Range noise close to the scanner, metres: a common terrestrial scanner on matt surfaces.
    pub noise: f64,
    /// Growth of the range noise with range, metres a metre.
    pub noise_growth: f64,
    /// Noise of a beam's direction, radians: 19 seconds of arc, as in data sheets.
    pub angular_noise: f64,
    /// Largest factor by which the measured noise of a tile may exceed the expected noise (depth
    /// cameras).
    pub noise_limit: f64,
    /// Incidence up to which neighbours always belong to one surface, radians: 80°.
    pub max_incidence: f64,
    /// Incidence up to which neighbours belong to one surface if the next pixels continue it,
    /// radians: 88°.
    pub max_grazing: f64,
    /// Half-width of the window of a normal, metres: several steps of the raster at working range,
    /// less than a pipe.
    pub window: f64,
    /// Largest half-width of that window, pixels, which keeps near surfaces cheap and local.
    pub max_window_pixels: u32,
    /// Angle between normals of one plane that is always tolerated, radians: 6°.
    pub normal_tolerance: f64,
    /// Largest angle between normals of one plane that is tolerated where normals are noisy,
    /// radians: 14°.
    pub max_normal_tolerance: f64,
    /// Deviation of a flat surface beside noise, metres.
    pub flatness: f64,
    /// Smallest number of points of a patch: enough for three parameters and their errors.
    pub min_patch_points: usize,
    /// Smallest area of a horizontal patch, m²: a piece of the ring around a robot's foot.
    pub min_level_area: f64,
    /// Smallest width of a horizontal patch, metres.
    pub min_level_width: f64,
    /// Smallest area of any other patch, m².
    pub min_patch_area: f64,
    /// Smallest width of any other patch, metres: wider than the flat strip on a pipe of 50 mm
    /// radius.
    pub min_patch_width: f64,
    /// Tilt up to which a patch counts as nearly horizontal, radians: 8°, more than a floor may
    /// have.
    pub level_tilt: f64,
    /// Distance of neighbouring points that suffices for floors, planes and occupied space,
    /// metres; rows and columns of denser scans are skipped there. A cable is
    /// thicker than the default of 10 mm; scans of five million points have that at six metres.
    pub spacing: f64,
    /// Edge of a voxel of the occupied space, metres: finer than the gap between robot and fence.
    pub voxel: f64,
    /// Edge of the voxels that replace the lattice where the scanner is unknown, metres.
    pub surface_voxel: f64,
    /// Noise of a surface where the scanner is unknown, metres: registered scans from several
    /// positions.
    pub surface_noise: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            noise: 0.002,
            noise_growth: 1e-4,
            angular_noise: 9e-5,
            noise_limit: 12.0,
            max_incidence: 80_f64.to_radians(),
            max_grazing: 88_f64.to_radians(),
            window: 0.015,
            max_window_pixels: 16,
            normal_tolerance: 6_f64.to_radians(),
            max_normal_tolerance: 14_f64.to_radians(),
            flatness: 0.001,
            min_patch_points: 24,
            min_level_area: 0.0015,
            min_level_width: 0.015,
            min_patch_area: 0.01,
            min_patch_width: 0.04,
            level_tilt: 8_f64.to_radians(),
            spacing: 0.010,
            voxel: 0.05,
            surface_voxel: 0.10,
            surface_noise: 0.006,
        }
    }
}
