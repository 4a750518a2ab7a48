//! The truth of a scene for comparison with results, written as JSON beside the scans.

use contract::{Error, Kind, Result};
use geometry::Pose;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Name and version of the schema.
pub const SCHEMA: &str = "stillpoint.truth/1";

/// Truth of a scene: robots and scans. The label of each point is given beside the points.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Truth {
    /// [`SCHEMA`].
    pub schema: String,
    /// The robots in the order of the scene; labels hold their indices.
    pub robots: Vec<TrueRobot>,
    /// The scans in the order of the scene.
    pub scans: Vec<TrueScan>,
    /// Names of the objects of the scene; `labels/N.object.npy` holds their indices.
    #[serde(default)]
    pub objects: Vec<String>,
}

/// The true state of a robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TrueRobot {
    /// Name in the scene.
    pub name: String,
    /// Name of its folder in the library.
    pub model: String,
    /// Name of the root link.
    pub base_link: String,
    /// Pose of the root link in the world.
    pub base_pose: TruePose,
    /// Value of each free joint, radians or metres.
    pub joints: BTreeMap<String, f64>,
    /// Names of its links; labels hold their indices.
    pub links: Vec<String>,
    /// Its postures in other scans, if it moved in between.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub later: Vec<LaterPosture>,
}

/// The posture of a robot in some of the scans.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LaterPosture {
    /// Names of the scans.
    pub scans: Vec<String>,
    /// Value of each free joint, radians or metres.
    pub joints: BTreeMap<String, f64>,
}

/// The true state of a scan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TrueScan {
    /// Name of the scan.
    pub name: String,
    /// True pose of the scan in the world.
    pub pose: TruePose,
    /// Pose of the scan that files state.
    pub stated_pose: TruePose,
    /// Number of beams.
    pub n_beams: u64,
    /// Number of beams that returned; 0 until counted.
    pub n_points: u64,
}

/// A pose as numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TruePose {
    /// Position, metres.
    pub xyz: [f64; 3],
    /// Rotation as a unit quaternion whose real part is not negative.
    pub quat_wxyz: [f64; 4],
}

impl From<&Pose> for TruePose {
    fn from(pose: &Pose) -> Self {
        let q = pose.rotation.quaternion();
        let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
        Self {
            xyz: pose.translation.vector.into(),
            quat_wxyz: [q.w, q.i, q.j, q.k].map(|v| sign * v),
        }
    }
}

impl Truth {
    /// The truth as JSON text.
    ///
    /// # Errors
    /// `Bug` if it cannot be serialised.
    pub fn to_json(&self) -> Result<String> {
        serde_json::to_string_pretty(self)
            .map_err(|e| Error::new(Kind::Bug, "truth cannot be written").because(e))
    }

    /// Reads what [`Truth::to_json`] wrote.
    ///
    /// # Errors
    /// `BadInput` if the text is no truth.
    pub fn from_json(text: &str) -> Result<Self> {
        serde_json::from_str(text).map_err(|e| Error::bad_input("truth cannot be read").because(e))
    }
}
