//! Robots of a scene as its file has them: where they stand, how, and with which tool.

use crate::scene::pose;
use geometry::Pose;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A robot and how it stands.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RobotPlace {
    /// Its name in the scene.
    pub name: String,
    /// Its folder in the library.
    pub model: String,
    /// Origin of the root link in the world, metres.
    pub xyz: [f64; 3],
    /// Roll, pitch, yaw of the root link, degrees.
    #[serde(default)]
    pub rpy_deg: [f64; 3],
    /// Value of each free joint by name, radians or metres; the model's home value where left out.
    #[serde(default)]
    pub posture: BTreeMap<String, f64>,
    /// A tool that no URDF describes.
    #[serde(default)]
    pub tool: Option<Tool>,
    /// How it stands while other scanners look: it moved between two stations.
    #[serde(default, rename = "later")]
    pub later: Vec<Later>,
}

/// How a robot stands while some scanners look.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Later {
    /// Names of those scanners.
    pub scanners: Vec<String>,
    /// Value of each free joint by name, as for the robot.
    pub posture: BTreeMap<String, f64>,
}

impl RobotPlace {
    /// World from root link, without the scene's origin.
    #[must_use]
    pub fn world_from_base(&self) -> Pose {
        pose(self.xyz, self.rpy_deg)
    }
}

/// A tool that no URDF describes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tool {
    /// The link that carries it.
    pub link: String,
    /// What it looks like.
    pub shape: ToolShape,
    /// Place in the link's frame; the tool points along +z of the turned frame, metres.
    #[serde(default)]
    pub xyz: [f64; 3],
    /// Roll, pitch, yaw in the link's frame, degrees.
    #[serde(default)]
    pub rpy_deg: [f64; 3],
    /// Its length, metres.
    #[serde(default = "tool_length")]
    pub length: f64,
}

/// What a tool looks like.
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
