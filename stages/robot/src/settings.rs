//! The settings of loading robots: limits on files, and the density of surface samples.

use contract::XmlLimits;

/// What to load, and how finely.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Make CAD clouds. Without them loading takes a tenth of the time: for linting and
    /// simulation.
    pub clouds: bool,
    /// Distance between neighbouring samples, metres. 5 mm: the spacing of a scan at 10 m.
    pub spacing: f64,
    /// Most samples of a link; a larger link gets a wider spacing. 60 k: one cubic metre's surface
    /// at 10 mm.
    pub max_samples: usize,
    /// Largest mesh file that is read, bytes. 256 MiB: ten times the largest robot met, all links
    /// together.
    pub max_mesh_bytes: u64,
    /// What a COLLADA file may come to in memory and work, times its size and a megabyte more: a
    /// file names the same geometry again and again, and nodes that do. Real ones come to four
    /// times their size.
    pub max_mesh_growth: u64,
    /// Largest URDF and `robot.toml` that is read, bytes: text about a few dozen links. Real ones
    /// stay below 1 MiB.
    pub max_urdf_bytes: u64,
    /// Most elements, attributes and texts of a URDF or COLLADA file: their reader keeps about 80
    /// bytes of each.
    pub max_xml_nodes: u64,
    /// Most attributes of one element of them: real ones have below ten, and their reader compares
    /// each with all others.
    pub max_xml_attributes: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            clouds: true,
            spacing: 0.005,
            max_samples: 60_000,
            max_mesh_bytes: 256 << 20,
            max_mesh_growth: 32,
            max_urdf_bytes: 4 << 20,
            max_xml_nodes: 4_000_000,
            max_xml_attributes: 256,
        }
    }
}

impl Settings {
    /// Meshes and kinematics only.
    #[must_use]
    pub fn without_clouds() -> Self {
        Self { clouds: false, ..Self::default() }
    }

    pub(crate) fn xml(&self) -> XmlLimits {
        XmlLimits {
            max_nodes: self.max_xml_nodes,
            max_attributes: self.max_xml_attributes,
            room: "robot",
        }
    }
}
