//! What can be tuned in reading; defaults in, no file knows another number.

/// Tunables of this room.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Points of a strip. 65,536: a message through a channel costs nothing at that size, and a
    /// strip (1 MB) fits the second-level cache.
    pub strip_points: usize,
    /// Largest XML section of an E57 file that is read, bytes. Real ones stay below 1 MB even with
    /// thousands of images.
    pub max_xml_bytes: u64,
    /// Most elements, attributes and texts of that section: its reader keeps about 80 bytes of
    /// each.
    pub max_xml_nodes: u64,
    /// Most attributes of one element of it: real ones have below ten, and its reader compares
    /// each with all others.
    pub max_xml_attributes: u64,
    /// Largest `--scanners` file, bytes: 100,000 scanners fit.
    pub max_scanners_bytes: u64,
    /// Largest configuration, review, scene, path or list of readings, bytes: texts that people or
    /// small programs write.
    pub max_text_bytes: u64,
    /// Points of a scan that the lattice is estimated from: angles to a hundredth of a pixel need
    /// no more.
    pub sample_points: usize,
    /// Largest memory for one LAZ chunk once decompressed, bytes. Chunks have 50,000 points (2 MB)
    /// in practice; a file in one piece is decompressed point by point and does not count.
    pub max_laz_chunk_bytes: u64,
    /// Coordinates farther than this from the scanner, or from the middle of points without one,
    /// are not measured but broken, metres: such points are dropped and counted. No
    /// terrestrial scanner reaches 10 km; files without scanner may span a region, hence a
    /// hundred: as far as coordinates in steps of 0.1 mm reach (214 km).
    pub max_range: f64,
    /// Residual of native rows and columns from a regular lattice that is accepted, pixels RMS.
    /// Above it, native pixels cannot map one to one anyway.
    pub max_native_rms: f64,
    /// Finest lattice step, radians (0.005°: below the best terrestrial scanners, 0.0018°, only in
    /// name: their beam is wider).
    pub min_step: f64,
    /// Coarsest lattice step, radians (2°).
    pub max_step: f64,
    /// Units of coordinates: `declared` for what each file declares, else one such as `mm`,
    /// `us-ft/m` (heights apart), or `hall.las=ft,mm` (one file's own).
    pub units: String,
}

impl Settings {
    /// Sees that what is set can be.
    ///
    /// # Errors
    /// Units that are none.
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
