//! The settings of this crate with their defaults; no other file has tunable numbers.

/// Settings of reading point files.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Number of points of a strip. At the default of 65,536 the cost of passing it through a
    /// channel is negligible, and a strip (1 MB) fits the second-level cache.
    pub strip_points: usize,
    /// Largest XML section of an E57 file, bytes. Real ones stay below 1 MB even with thousands of
    /// images.
    pub max_xml_bytes: u64,
    /// Largest number of elements, attributes and texts of that section; the XML reader keeps
    /// about 80 bytes of each.
    pub max_xml_nodes: u64,
    /// Largest number of attributes of one element of that section. Real ones have below ten, and
    /// the XML reader compares each with all others.
    pub max_xml_attributes: u64,
    /// Largest `--scanners` file, bytes; 100,000 scanners fit into the default.
    pub max_scanners_bytes: u64,
    /// Largest configuration, review, scene or path file or list of readings, bytes: texts that
    /// people or small programs write.
    pub max_text_bytes: u64,
    /// Number of points from which the lattice of a scan is estimated; it suffices for angles to a
    /// hundredth of a pixel.
    pub sample_points: usize,
    /// Largest memory for one decompressed LAZ chunk, bytes. Chunks usually have 50,000 points
    /// (2 MB); a file in one piece is decompressed gradually and not limited by this.
    pub max_laz_chunk_bytes: u64,
    /// Largest distance of a point from its scanner, or from the middle of the points where no
    /// scanner is known, metres; points farther away are dropped and counted. No terrestrial
    /// scanner reaches 10 km, but a file without scanner may span a region, so that the default is
    /// 100 km: coordinates in steps of 0.1 mm reach to 214 km.
    pub max_range: f64,
    /// Largest residual of native rows and columns from a regular lattice, pixels RMS; above it
    /// native pixels cannot map to lattice pixels one to one.
    pub max_native_rms: f64,
    /// Finest lattice step, radians. The default is 0.005°: the best terrestrial scanners offer
    /// 0.0018°, but their beam is wider than that.
    pub min_step: f64,
    /// Coarsest lattice step, radians; the default is 2°.
    pub max_step: f64,
    /// Units of coordinates: `declared` for what each file declares, else a unit such as `mm`,
    /// `us-ft/m` (another unit for heights), or `hall.las=ft,mm` (another unit for one file).
    pub units: String,
}

impl Settings {
    /// Checks that the settings are valid.
    ///
    /// # Errors
    /// If `units` names no known unit.
    pub fn check(&self) -> contract::Result<()> {
        crate::units::Choice::read(&self.units).map(drop)
    }
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            strip_points: 65_536,
            max_xml_bytes: 16 << 20,
            max_xml_nodes: 2_000_000,
            max_xml_attributes: 256,
            max_scanners_bytes: 16 << 20,
            max_text_bytes: 64 << 20,
            sample_points: 60_000,
            max_laz_chunk_bytes: 512 << 20,
            max_range: 1.0e5,
            max_native_rms: 0.3,
            min_step: 0.005_f64.to_radians(),
            max_step: 2.0_f64.to_radians(),
            units: crate::units::DECLARED.into(),
        }
    }
}
