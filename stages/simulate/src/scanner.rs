//! The description of a scanner in a scene file: position, raster, range and errors.

use crate::random::Random;
use contract::{Error, Result};
use geometry::{Pose, Vector};
use nalgebra::{Quaternion, Translation3, UnitQuaternion};
use serde::{Deserialize, Serialize};

/// A terrestrial laser scanner on its tripod.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Scanner {
    /// Name of the scan.
    pub name: String,
    /// Position, metres.
    pub position: [f64; 3],
    /// Roll, pitch, yaw, degrees; ignored if a quaternion is given.
    pub rpy_deg: [f64; 3],
    /// Rotation `world_from_scan`, unit quaternion.
    pub quaternion_wxyz: Option<[f64; 4]>,
    /// The angular raster.
    pub raster: BeamRaster,
    /// Smallest range that is measured, metres.
    pub min_range: f64,
    /// Largest range that is measured, metres.
    pub max_range: f64,
    /// Standard deviation of a range at the scanner, metres.
    pub noise: f64,
    /// Growth of that standard deviation with range, metres a metre.
    pub noise_per_metre: f64,
    /// Standard deviation of the true direction about the stated one, on each axis, radians.
    pub jitter: f64,
    /// Systematic error that is added to every range, metres.
    pub range_bias: f64,
    /// Share of beams that are lost at random, 0..1.
    pub dropouts: f64,
    /// Share of beams that are lost on a black surface at grazing incidence, 0..1; fewer are lost
    /// at normal incidence, and none on bright surfaces.
    pub dark_dropouts: f64,
    /// Width of beams, which matters at edges; `None` for infinitely thin beams.
    pub mixed: Option<Mixed>,
    /// Error of the stated pose.
    pub registration: RegistrationError,
}

impl Default for Scanner {
    fn default() -> Self {
        Self {
            name: String::new(),
            position: [0.0, 0.0, 1.6],
            rpy_deg: [0.0; 3],
            quaternion_wxyz: None,
            raster: BeamRaster::default(),
            min_range: 0.3,
            max_range: 80.0,
            noise: 0.002,
            noise_per_metre: 0.0,
            jitter: 0.0,
            range_bias: 0.0,
            dropouts: 0.0,
            dark_dropouts: 0.0,
            mixed: None,
            registration: RegistrationError::default(),
        }
    }
}

/// Directions of beams: rows by elevation, upwards; columns by azimuth, counter-clockwise.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct BeamRaster {
    /// Lowest and highest elevation, degrees.
    pub elevation_deg: [f64; 2],
    /// First azimuth and, exclusive, the last one, degrees.
    pub azimuth_deg: [f64; 2],
    /// Angle between neighbouring beams, degrees; ignored if `n_beams` is given.
    pub step_deg: f64,
    /// Approximate number of beams, from which the step is computed.
    pub n_beams: Option<u64>,
}

impl Default for BeamRaster {
    fn default() -> Self {
        Self {
            elevation_deg: [-60.0, 90.0],
            azimuth_deg: [-180.0, 180.0],
            step_deg: 0.1,
            n_beams: None,
        }
    }
}

impl BeamRaster {
    /// Angle between neighbouring beams, degrees; a whole number of columns fills the azimuth
    /// range.
    #[must_use]
    pub fn step(&self) -> f64 {
        let width = self.azimuth_deg[1] - self.azimuth_deg[0];
        let height = self.elevation_deg[1] - self.elevation_deg[0];
        let step = match self.n_beams {
            Some(n) => (width * height / n.max(1) as f64).sqrt(),
            None => self.step_deg,
        };
        width / (width / step).round().max(1.0)
    }

    /// Number of rows.
    #[must_use]
    pub fn n_rows(&self) -> u32 {
        // A small margin, so that a range of a whole number of steps keeps its last row.
        (((self.elevation_deg[1] - self.elevation_deg[0]) / self.step() + 1e-6).floor() as u32) + 1
    }

    /// Number of columns.
    #[must_use]
    pub fn n_cols(&self) -> u32 {
        ((self.azimuth_deg[1] - self.azimuth_deg[0]) / self.step()).round().max(1.0) as u32
    }

    /// Elevation of a row's middle, radians.
    #[must_use]
    pub fn elevation(&self, row: u32) -> f64 {
        (self.elevation_deg[0] + f64::from(row) * self.step()).to_radians()
    }

    /// Azimuth of a column's middle, radians.
    #[must_use]
    pub fn azimuth(&self, col: u32) -> f64 {
        (self.azimuth_deg[0] + f64::from(col) * self.step()).to_radians()
    }
}

/// The width of a beam, and how its parts are combined.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Mixed {
    /// Number of thin beams that represent a wide one: its middle, and others on a ring. They are
    /// cast only where a neighbouring beam sees something else.
    pub sub_beams: u32,
    /// Radius of the beam at the scanner, metres.
    pub radius: f64,
    /// Growth of the radius with range, metres a metre.
    pub divergence: f64,
    /// Largest difference in range of parts that are averaged, metres; parts farther apart
    /// compete.
    pub depth: f64,
}

impl Default for Mixed {
    fn default() -> Self {
        Self { sub_beams: 5, radius: 0.0011, divergence: 0.000_15, depth: 0.6 }
    }
}

/// Difference of the stated pose of a scan from its true one.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RegistrationError {
    /// Shift in the scan frame, metres.
    pub xyz: [f64; 3],
    /// Roll, pitch, yaw, degrees.
    pub rpy_deg: [f64; 3],
}

impl RegistrationError {
    /// The difference between a true and a stated pose, for example of another world frame.
    #[must_use]
    pub fn between(world_from_scan: &Pose, stated: &Pose) -> Self {
        let error = world_from_scan.inverse() * stated;
        let (roll, pitch, yaw) = error.rotation.euler_angles();
        Self {
            xyz: error.translation.vector.into(),
            rpy_deg: [roll, pitch, yaw].map(f64::to_degrees),
        }
    }

    /// A random difference with these standard deviations: of the shift on each axis, metres, and
    /// of the rotation about each axis, degrees.
    #[must_use]
    pub fn drawn([shift, turn]: [f64; 2], random: &mut Random) -> Self {
        let mut three = |sigma: f64| [(); 3].map(|()| sigma * random.normals()[0]);
        Self { xyz: three(shift), rpy_deg: three(turn) }
    }
}

impl Scanner {
    /// True pose `world_from_scan` without the scene's origin, metres.
    ///
    /// # Errors
    /// `BadInput` if the quaternion is not of unit length to 1 %.
    pub fn world_from_scan(&self) -> Result<Pose> {
        let turn = match self.quaternion_wxyz {
            None => return Ok(crate::rpy::pose(self.position, self.rpy_deg)),
            Some([w, x, y, z]) => Quaternion::new(w, x, y, z),
        };
        // 1 % is more than rounding in a file, and less than a mistake.
        if (turn.norm() - 1.0).abs() < 0.01 {
            let at = Translation3::from(Vector::from(self.position));
            Ok(Pose::from_parts(at, UnitQuaternion::from_quaternion(turn)))
        } else {
            Err(Error::bad_input(format!("quaternion is not of unit length: \"{}\"", turn.norm()))
                .at(&self.name))
        }
    }

    /// Pose `world_from_scan` that files state, without the scene's origin, metres.
    ///
    /// # Errors
    /// As [`Scanner::world_from_scan`].
    pub fn stated_world_from_scan(&self) -> Result<Pose> {
        let error = crate::rpy::pose(self.registration.xyz, self.registration.rpy_deg);
        Ok(self.world_from_scan()? * error)
    }
}
