//! The description of a scene, read from TOML and checked: hall, robots and scanners. No other
//! files are opened; robot models are given by name.

use contract::{Error, Result};
use serde::{Deserialize, Serialize};

pub use crate::place::{Later, RobotPlace, Tool, ToolShape};
pub use crate::rpy::pose;
pub use crate::scanner::{BeamRaster, Mixed, RegistrationError, Scanner};

/// A scene. Lengths are in metres, angles in degrees where a name ends in `_deg`; z of the world
/// frame points up.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Seed of all random errors.
    #[serde(default)]
    pub seed: u64,
    /// Added to all world coordinates of the output (for large map coordinates), metres.
    #[serde(default)]
    pub origin: [f64; 3],
    /// The building; without it there are only floor and sky.
    #[serde(default)]
    pub hall: Option<Building>,
    /// The ground; `None` for a scene without ground.
    #[serde(default)]
    pub floor: Option<SceneFloor>,
    /// Boxes.
    #[serde(default, rename = "box")]
    pub boxes: Vec<Cuboid>,
    /// Upright cylinders or I-beams.
    #[serde(default, rename = "column")]
    pub columns: Vec<Column>,
    /// Fences.
    #[serde(default, rename = "fence")]
    pub fences: Vec<Fence>,
    /// Roller conveyors.
    #[serde(default, rename = "conveyor")]
    pub conveyors: Vec<Furniture>,
    /// Work benches.
    #[serde(default, rename = "bench")]
    pub benches: Vec<Furniture>,
    /// Stands and pedestals for robots.
    #[serde(default, rename = "stand")]
    pub stands: Vec<SceneStand>,
    /// Hoses, fixed or attached to robots.
    #[serde(default, rename = "hose")]
    pub hoses: Vec<Hose>,
    /// Boxes carried by robots.
    #[serde(default, rename = "carried")]
    pub carried: Vec<CarriedBox>,
    /// Robots, in the order of the truth.
    #[serde(default, rename = "robot")]
    pub robots: Vec<RobotPlace>,
    /// Scanners, in the order of the scans.
    #[serde(default, rename = "scanner")]
    pub scanners: Vec<Scanner>,
}

/// The building, centred at the world's origin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Building {
    /// Length, width, height, metres.
    pub size: [f64; 3],
    /// Whether it has walls.
    #[serde(default = "yes")]
    pub walls: bool,
    /// Whether it has a ceiling.
    #[serde(default = "yes")]
    pub ceiling: bool,
}

/// The ground: tilt plus waves, over the area of the hall or of `size`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneFloor {
    /// Length and width, metres; by default those of the hall, or 20 × 20 without a hall.
    #[serde(default)]
    pub size: Option<[f64; 2]>,
    /// Slope along x and y, degrees.
    #[serde(default)]
    pub tilt_deg: [f64; 2],
    /// Amplitude of the waves, metres.
    #[serde(default)]
    pub wave_amplitude: f64,
    /// Length of the waves, metres.
    #[serde(default = "wave_length")]
    pub wave_length: f64,
    /// Raised rectangles of floor.
    #[serde(default, rename = "level")]
    pub levels: Vec<RaisedFloor>,
}

/// A raised rectangle of floor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RaisedFloor {
    /// Smallest corner, metres.
    pub min: [f64; 2],
    /// Largest corner, metres.
    pub max: [f64; 2],
    /// Height above the ground, metres.
    pub height: f64,
}

/// A box in any position.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cuboid {
    /// Display name.
    #[serde(default)]
    pub name: String,
    /// Centre, metres.
    pub xyz: [f64; 3],
    /// Edge lengths, metres.
    pub size: [f64; 3],
    /// Roll, pitch, yaw, degrees.
    #[serde(default)]
    pub rpy_deg: [f64; 3],
    /// Share of light that it reflects, 0..1.
    #[serde(default = "grey")]
    pub reflectance: f64,
}

/// An upright column on the ground.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Column {
    /// Display name.
    #[serde(default)]
    pub name: String,
    /// Position on the ground, metres.
    pub xy: [f64; 2],
    /// Half of its width, metres.
    pub radius: f64,
    /// Height above the ground, metres.
    pub height: f64,
    /// Cross-section.
    #[serde(default)]
    pub section: Section,
}

/// Cross-section of a column.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Section {
    /// A cylinder.
    #[default]
    Round,
    /// Two flanges and a web.
    IBeam,
}

/// A straight fence on the ground.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fence {
    /// Display name.
    #[serde(default)]
    pub name: String,
    /// One end, metres.
    pub from: [f64; 2],
    /// Other end, metres.
    pub to: [f64; 2],
    /// Height above the ground, metres.
    #[serde(default = "fence_height")]
    pub height: f64,
    /// Filling between the posts.
    #[serde(default)]
    pub filling: FenceFilling,
}

/// The filling between the posts of a fence.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FenceFilling {
    /// Welded wires of 4 mm, 50 mm apart.
    #[default]
    Wires,
    /// A closed sheet.
    Panel,
}

/// A conveyor or bench on the ground.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Furniture {
    /// Display name.
    #[serde(default)]
    pub name: String,
    /// Position of its centre on the ground, metres.
    pub xy: [f64; 2],
    /// Rotation about z, degrees.
    #[serde(default)]
    pub yaw_deg: f64,
    /// Length, width, height, metres.
    pub size: [f64; 3],
}

/// A stand on the ground.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneStand {
    /// Display name.
    #[serde(default)]
    pub name: String,
    /// Position of its centre on the ground, metres.
    pub xy: [f64; 2],
    /// Rotation about z, degrees.
    #[serde(default)]
    pub yaw_deg: f64,
    /// Height of its level top in the world (not above the ground), metres.
    pub top: f64,
    /// Side of its top plate, metres.
    pub side: f64,
    /// Its form.
    #[serde(default)]
    pub shape: StandShape,
}

/// The form of a stand.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StandShape {
    /// A column between two plates.
    #[default]
    Pedestal,
    /// A table of four legs.
    Table,
    /// A solid block.
    Plinth,
}

/// A point that is fixed to a robot's link or to the world.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Anchor {
    /// Name of the robot; the world without it.
    #[serde(default)]
    pub robot: Option<String>,
    /// Name of the link; the robot's root without it.
    #[serde(default)]
    pub link: Option<String>,
    /// Position in the frame of the link or the world, metres.
    pub xyz: [f64; 3],
}

/// A hose that hangs from anchor to anchor. It is attached to the first robot that holds it by a
/// link that moves; if there is none, it is fixed. A run between two anchors that do not move is
/// fixed as well.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hose {
    /// Display name.
    #[serde(default)]
    pub name: String,
    /// The points that hold it, at least two.
    pub anchors: Vec<Anchor>,
    /// Half of its thickness, metres.
    pub radius: f64,
    /// Depth of each hanging arc, as share of the distance between its ends.
    #[serde(default = "sag")]
    pub sag: f64,
}

/// A box held by a robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CarriedBox {
    /// Display name.
    #[serde(default)]
    pub name: String,
    /// Name of the robot.
    pub robot: String,
    /// Name of the link that holds it.
    pub link: String,
    /// Centre in the link's frame, metres.
    pub xyz: [f64; 3],
    /// Roll, pitch, yaw in the link's frame, degrees.
    #[serde(default)]
    pub rpy_deg: [f64; 3],
    /// Edge lengths, metres.
    pub size: [f64; 3],
}

impl Scene {
    /// The scene during the scan of one scanner, with robots in their postures of that time.
    pub(crate) fn as_seen_by(&self, scanner: &str) -> Self {
        let mut out = self.clone();
        for robot in &mut out.robots {
            let then = robot.later.iter().find(|l| l.scanners.iter().any(|s| s == scanner));
            if let Some(then) = then {
                robot.posture = then.posture.clone();
            }
            robot.later.clear();
        }
        out
    }
}

impl Scene {
    /// The scene as text of a scene file, which [`Scene::from_toml`] reads.
    ///
    /// # Errors
    /// `Bug` if the scene cannot be serialised.
    pub fn to_toml(&self) -> Result<String> {
        toml::to_string(self)
            .map_err(|e| Error::new(contract::Kind::Bug, "scene cannot be written").because(e))
    }

    /// Height of the ground at (x, y), metres, without the scene's origin; 0 without a floor.
    #[must_use]
    pub fn ground(&self, x: f64, y: f64) -> f64 {
        let Some(floor) = &self.floor else { return 0.0 };
        let inside =
            |l: &&RaisedFloor| x >= l.min[0] && x <= l.max[0] && y >= l.min[1] && y <= l.max[1];
        let raised = floor.levels.iter().filter(inside).map(|l| l.height).fold(0.0, f64::max);
        raised + floor.base_height(x, y)
    }

    /// Length and width of the ground, metres.
    #[must_use]
    pub fn ground_size(&self) -> [f64; 2] {
        let hall = self.hall.as_ref().map(|h| [h.size[0], h.size[1]]);
        self.floor.as_ref().and_then(|f| f.size).or(hall).unwrap_or([20.0, 20.0])
    }
}

impl SceneFloor {
    /// Height of the ground below raised levels at (x, y), metres: tilt and two crossing waves.
    #[must_use]
    pub fn base_height(&self, x: f64, y: f64) -> f64 {
        let tilt = self.tilt_deg.map(|a| a.to_radians().tan());
        let k = std::f64::consts::TAU / self.wave_length;
        // The second wave is shorter and rotated, so that the pattern does not repeat along an
        // axis.
        let waves = 0.6 * (k * x).sin() * (k * y + 0.7).cos()
            + 0.4 * (1.37 * k * (0.8 * x - 0.6 * y)).sin();
        tilt[0] * x + tilt[1] * y + self.wave_amplitude * waves
    }
}

fn yes() -> bool {
    true
}
fn wave_length() -> f64 {
    5.0
}
fn grey() -> f64 {
    0.5
}
fn fence_height() -> f64 {
    2.0
}
fn sag() -> f64 {
    0.15
}
