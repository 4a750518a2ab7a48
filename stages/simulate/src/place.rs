//! Robots of a scene, as in a scene file: base pose, posture and tool.

use crate::rpy::pose;
use geometry::Pose;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A robot with its base pose and posture.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RobotPlace {
    /// Name in the scene.
    pub name: String,
    /// Name of its folder in the library.
    pub model: String,
    /// Position of the root link in the world, metres.
    pub xyz: [f64; 3],
    /// Roll, pitch, yaw of the root link, degrees.
    #[serde(default)]
    pub rpy_deg: [f64; 3],
    /// Value of each free joint by name, radians or metres; the model's home value where it is
    /// absent.
    #[serde(default)]
    pub posture: BTreeMap<String, f64>,
    /// A tool that no URDF describes.
    #[serde(default)]
    pub tool: Option<Tool>,
    /// Its other postures, if it moved between two scanner positions.
    #[serde(default, rename = "later")]
    pub later: Vec<Later>,
}

/// The posture of a robot in the scans of some scanners.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Later {
    /// Names of the scanners.
    pub scanners: Vec<String>,
    /// Value of each free joint by name, as for the robot.
    pub posture: BTreeMap<String, f64>,
}

impl RobotPlace {
    /// Pose of the root link in the world without the scene's origin, metres.
    #[must_use]
    pub fn world_from_base(&self) -> Pose {
        pose(self.xyz, self.rpy_deg)
    }
}

/// A tool that no URDF describes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tool {
    /// Name of the link that carries it.
    pub link: String,
    /// Its form.
    pub shape: ToolShape,
    /// Position in the link's frame, metres; the tool points along +z of its own frame.
    #[serde(default)]
    pub xyz: [f64; 3],
    /// Roll, pitch, yaw in the link's frame, degrees.
    #[serde(default)]
    pub rpy_deg: [f64; 3],
    /// Length, metres.
    #[serde(default = "tool_length")]
    pub length: f64,
}

/// The form of a tool.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ToolShape {
    /// A body with two fingers.
    Gripper,
    /// A frame with suction cups.
    Cups,
    /// A bent welding torch.
    Torch,
}

fn tool_length() -> f64 {
    0.25
}
