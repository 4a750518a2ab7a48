//! What really stands in a scene, to compare results with; written as JSON beside the scans.

use contract::{Error, Kind, Result};
use geometry::Pose;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Name and version of the form.
pub const SCHEMA: &str = "stillpoint.truth/1";

/// Truth of a scene: robots and scans. The label of each point is given beside the points.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Truth {
    /// [`SCHEMA`].
    pub schema: String,
    /// In the order of the scene: labels count them.
    pub robots: Vec<TrueRobot>,
    /// In the order of the scene.
    pub scans: Vec<TrueScan>,
    /// What stands in the scene, by name: `labels/N.object.npy` counts them.
    #[serde(default)]
    pub objects: Vec<String>,
}

/// A robot as it stands.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TrueRobot {
    /// Its name in the scene.
    pub name: String,
    /// Its folder in the library.
    pub model: String,
    /// Root link of its tree.
    pub base_link: String,
    /// World from root link.
    pub base_pose: TruePose,
    /// Value of each free joint, radians or metres.
    pub joints: BTreeMap<String, f64>,
    /// Names of its links, in the order that labels count.
    pub links: Vec<String>,
    /// How it stood for other scans, where it moved in between.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub later: Vec<LaterPosture>,
}

/// How a robot stood for some of the scans.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LaterPosture {
    /// Names of those scans.
    pub scans: Vec<String>,
    /// Value of each free joint, radians or metres.
    pub joints: BTreeMap<String, f64>,
}

/// A scan as it was made.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TrueScan {
    /// Its name.
    pub name: String,
    /// World from scan as it really was.
    pub pose: TruePose,
    /// World from scan as the files state it.
    pub stated_pose: TruePose,
    /// Number of beams.
    pub n_beams: u64,
    /// Number of beams that came back; 0 until counted.
    pub n_points: u64,
}

/// A pose as numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TruePose {
    /// Metres.
    pub xyz: [f64; 3],
    /// Unit quaternion, real part first and not negative.
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
    /// `Bug` where it cannot be written.
    pub fn to_json(&self) -> Result<String> {
        serde_json::to_string_pretty(self)
            .map_err(|e| Error::new(Kind::Bug, "truth cannot be written").because(e))
    }

    /// Reads what [`Truth::to_json`] wrote.
    ///
    /// # Errors
    /// `BadInput` where the text is no truth.
    pub fn from_json(text: &str) -> Result<Self> {
        serde_json::from_str(text).map_err(|e| Error::bad_input("truth cannot be read").because(e))
    }
}
