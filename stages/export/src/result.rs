//! `result.json`: what was found, how certain it is, and from which inputs. The schema is
//! `stillpoint.result/1`, which grows by adding fields. Numbers that are not finite become null.

use crate::calibration::CalibrationEntry;
use crate::finite::finite;
use crate::mask::MaskFiles;
use crate::places::NamedMap;
use crate::review::ReviewEntry;
use crate::scan_entry::ScanEntry;
use crate::session::RescanEntry;
use crate::space::SpaceEntry;
use contract::{Certainty, Fit, JointFit, Mask};
use geometry::Pose;
use serde::{Deserialize, Serialize};

/// Name and version of the schema.
pub const SCHEMA: &str = "stillpoint.result/1";

/// The content of `result.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ResultFile {
    /// [`SCHEMA`].
    pub schema: String,
    /// Version of the program that wrote it.
    pub version: String,
    /// The robots; their indices are those of the masks.
    pub robots: Vec<RobotEntry>,
    /// Paths of the masks.
    pub labels: LabelFiles,
    /// The inputs that were read.
    pub inputs: Vec<InputEntry>,
    /// The stages that ran.
    pub stages: Vec<StageEntry>,
    /// Warnings for the user.
    pub warnings: Vec<String>,
    /// Effect of each entry of the review, if one was given.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub review: Vec<ReviewEntry>,
    /// The earlier result, if one cell was scanned again.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rescan: Option<RescanEntry>,
}

/// One robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RobotEntry {
    /// Identifier: `R1`, `R2` …
    pub id: String,
    /// Name of the model in the library.
    pub model: String,
    /// Name of the link whose pose is `base_pose`.
    pub base_link: String,
    /// Pose of the base link in the world.
    pub base_pose: BasePose,
    /// Standard deviation of the base.
    pub base_sigma: BaseSigma,
    /// Value of each free joint, radians or metres, in the order of the model.
    pub joints: NamedMap<f64>,
    /// Names of the joints whose values are metres; those of all others are radians.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub slides: Vec<String>,
    /// Standard deviation of each free joint in the same unit; π/√3, that of a uniform angle, if
    /// the points do not determine it.
    pub sigma: NamedMap<f64>,
    /// Values of the joints that follow the free ones by a rule or in a closed loop, in the same
    /// units.
    #[serde(default)]
    pub passive: NamedMap<f64>,
    /// Whether the points determine each free joint.
    #[serde(default)]
    pub determined: NamedMap<bool>,
    /// How well they do: `determined`, `coarse` or `undetermined`.
    #[serde(default)]
    pub certainty: NamedMap<Certainty>,
    /// Names of the links; their indices are those of the masks.
    pub links: Vec<String>,
    /// Pose of each link in the world.
    #[serde(default)]
    pub link_poses: NamedMap<BasePose>,
    /// `trusted`, `doubtful` or `refused`.
    pub verdict: String,
    /// Share of the surface that is explained less the share that is contradicted.
    pub score: Option<f64>,
    /// RMS distance of its points from its surface, metres.
    #[serde(default)]
    pub rms: Option<f64>,
    /// Reasons for the verdict, in words.
    #[serde(default)]
    pub reasons: Vec<String>,
    /// The best other explanation of the points.
    #[serde(default)]
    pub runner_up: Option<RunnerUpEntry>,
    /// Other postures that explain the points as well, for example at a flange with six bolts or
    /// with a wrist that no beam reached.
    #[serde(default)]
    pub equals: Vec<EqualEntry>,
    /// For each joint other values within its limits, whole turns away, at which the posture is
    /// the same.
    #[serde(default)]
    pub equivalents: NamedMap<Vec<f64>>,
    /// The tool that it carries; the tool's joints and links follow the robot's own.
    #[serde(default)]
    pub tool: Option<ToolEntry>,
    /// Calibrated joint frames, if requested; base and joints are then those of the calibrated
    /// robot.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration: Option<CalibrationEntry>,
    /// Names of other models that explain the points as well.
    #[serde(default)]
    pub alike: Vec<String>,
    /// Standard deviation of the robot's true surface from the model's, averaged over patches of
    /// about 0.1 m, metres.
    #[serde(default)]
    pub surface_sigma: Option<f64>,
    /// Standard deviation of the tip's position in the base frame, metres.
    #[serde(default)]
    pub tip_sigma: Option<f64>,
    /// Errors of the scans' stated poses near the robot.
    #[serde(default)]
    pub scans: Vec<ShiftEntry>,
    /// Number of scans near the robot by how the positions of their scanners are known: `stated`,
    /// `given`, `found` or `unknown`.
    #[serde(default, skip_serializing_if = "NamedMap::is_empty")]
    pub scanners: NamedMap<u32>,
    /// Numbers of the scans in which the robot has this posture, if it moved between scans; empty
    /// means all scans.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub stands_in: Vec<u32>,
    /// Its postures in other scans, if it moved between scans.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub stays: Vec<RobotEntry>,
    /// The known space around it; what a robot hides is unknown, not free.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub space: Option<SpaceEntry>,
    /// Pose of the tip of the main chain.
    #[serde(default)]
    pub tip: Option<TipPose>,
    /// Evidence of the scans for each link.
    #[serde(default)]
    pub evidence: Vec<LinkEntry>,
}

/// A pose of a link in the world.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct BasePose {
    /// Position, metres.
    pub xyz: [f64; 3],
    /// Rotation as a unit quaternion.
    pub quat_wxyz: [f64; 4],
}

impl From<&Pose> for BasePose {
    fn from(pose: &Pose) -> Self {
        let (p, q) = (pose.translation, pose.rotation);
        // Of the two quaternions of a rotation always the same is written.
        let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
        Self { xyz: [p.x, p.y, p.z], quat_wxyz: [q.w, q.i, q.j, q.k].map(|v| sign * v + 0.0) }
    }
}

/// Standard deviations of a base.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct BaseSigma {
    /// Of the position, along world axes, metres.
    pub xyz: [Option<f64>; 3],
    /// Of the rotation, about world axes, radians.
    pub rotation: [Option<f64>; 3],
}

/// Pose of the tip of the main chain.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TipPose {
    /// Name of the link.
    pub link: String,
    /// Pose of the link in the world.
    pub pose: BasePose,
}

/// Evidence of the scans for a link.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LinkEntry {
    /// Name of the link.
    pub link: String,
    /// Share of its surface that at least one beam could judge.
    pub seen: Option<f64>,
    /// Share of the judged surface on which a beam ends.
    pub matched: Option<f64>,
    /// Share of the judged surface that a beam passed through.
    pub violated: Option<f64>,
    /// Number of points within the gate.
    pub n_points: usize,
    /// RMS distance of these points from the surface, metres.
    pub rms: Option<f64>,
}

/// The best other explanation of the points.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunnerUpEntry {
    /// Name of its model.
    pub model: String,
    /// Score, comparable with that of the robot.
    pub score: Option<f64>,
    /// Whether it is the same model in another posture.
    pub same_model: bool,
    /// How clearly the beams prefer the robot to it, on the links that stand differently: about 0
    /// for equally good ones, 1 for a clear preference.
    #[serde(default)]
    pub margin: Option<f64>,
}

/// A tool on a robot's flange.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ToolEntry {
    /// Name of its model in the library.
    pub model: String,
    /// The robot's link that it is bolted to.
    pub link: String,
    /// Rotation of its root link about the axis of the robot's last joint, radians.
    pub mount: f64,
}

/// Another posture that explains the points as well.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EqualEntry {
    /// Value of each joint, radians or metres.
    pub joints: NamedMap<f64>,
    /// How clearly the beams prefer the robot's posture, as in [`RunnerUpEntry`].
    pub margin: Option<f64>,
}

/// Difference of a scan from its stated pose, as estimated near one robot.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ShiftEntry {
    /// Number of the scan, in the order of the inputs.
    pub scan: u32,
    /// Shift that the scan's points need at the robot's base, metres, world axes.
    pub shift: [f64; 3],
    /// Rotation vector that they need about the scanner, radians, world axes.
    pub turn: [f64; 3],
    /// By how much the scan's ranges are too long, metres.
    pub range_bias: f64,
}

/// Paths of the masks.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct LabelFiles {
    /// Path of the legend.
    pub table: String,
    /// The files of each mask.
    pub scans: Vec<ScanLabels>,
}

/// The files of one mask, relative to `result.json`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ScanLabels {
    /// Name of the scan, or of the LAS file.
    pub scan: String,
    /// Index of its input in `inputs`.
    pub input: u32,
    /// Number of entries of each file.
    pub n_points: u64,
    /// Path of the array of kinds, u8.
    pub kind: String,
    /// Path of the array of robots, i16.
    pub robot: String,
    /// Path of the array of links, i16.
    pub link: String,
    /// Path of the list of places (u64, ascending) of points that a later scan replaced or showed
    /// to be gone. They are no longer part of the plant, whatever their labels are.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub superseded: Option<String>,
}

/// An input that was read.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct InputEntry {
    /// Path as given by the user.
    pub path: String,
    /// `e57`, `ptx`, `las` or `laz`.
    pub format: String,
    /// Length of the file, bytes.
    pub n_bytes: u64,
    /// Digest of the file with its method, such as `blake3:…`; empty where none was computed.
    pub digest: String,
    /// Number of scans.
    pub n_scans: u32,
    /// Number of points that the file does not flag as invalid.
    pub n_points: u64,
    /// Number of these points that were dropped, since they are not finite.
    pub n_dropped: u64,
    /// Units of the coordinates in the file; everything that is written is in metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub units: Option<UnitsEntry>,
    /// Messages about what the file lacks and which results suffer from it.
    pub notes: Vec<String>,
    /// The scans of the file, and how the positions of their scanners are known.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub scans: Vec<ScanEntry>,
}

/// Units of an input's coordinates.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct UnitsEntry {
    /// Units and their source, in words.
    pub text: String,
    /// `given`, `declared`, `format` (the format prescribes them) or `assumed`.
    pub origin: String,
    /// Metres of one unit of x, y and z.
    pub metres: [f64; 3],
}

/// A stage that ran, without anything that differs from run to run, such as times.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct StageEntry {
    /// Name of the stage.
    pub name: String,
    /// Number of items that went in.
    pub n_in: u64,
    /// Number of items that came out.
    pub n_out: u64,
}

impl RobotEntry {
    /// The entry of the robot with this id; `links` are the names of the model's links in order.
    #[must_use]
    pub fn new(id: &str, fit: &Fit, links: &[String], tip: Option<(String, Pose)>) -> Self {
        let sigma = |range: usize| finite(fit.base_sigma[range]);
        Self {
            id: id.into(),
            model: fit.model_name.clone(),
            base_link: links.first().cloned().unwrap_or_default(),
            base_pose: (&fit.world_from_base).into(),
            base_sigma: BaseSigma { xyz: [0, 1, 2].map(sigma), rotation: [3, 4, 5].map(sigma) },
            joints: NamedMap(each(fit, |j| j.value)),
            sigma: NamedMap(each(fit, |j| j.sigma)),
            determined: NamedMap(each(fit, |j| j.is_determined())),
            certainty: NamedMap(each(fit, |j| j.certainty)),
            passive: NamedMap::default(),
            links: links.to_vec(),
            link_poses: NamedMap::default(),
            verdict: fit.verdict.word().into(),
            score: finite(fit.score),
            rms: finite(fit.rms),
            reasons: fit.reasons.clone(),
            runner_up: fit.runner_up.as_ref().map(|r| RunnerUpEntry {
                model: r.model.clone(),
                score: finite(r.score),
                same_model: r.same_model,
                margin: finite(r.margin),
            }),
            equals: fit.equals.iter().map(|e| EqualEntry::new(fit, e)).collect(),
            equivalents: NamedMap(
                fit.joints
                    .iter()
                    .filter(|j| !j.equivalents.is_empty())
                    .map(|j| (j.name.clone(), j.equivalents.clone()))
                    .collect(),
            ),
            tool: fit.tool.as_ref().map(|t| ToolEntry {
                model: t.model.clone(),
                link: t.link.clone(),
                mount: t.mount,
            }),
            calibration: fit.calibration.as_ref().map(|c| CalibrationEntry::new(fit, c)),
            alike: fit.alike.clone(),
            surface_sigma: finite(fit.surface_sigma),
            tip_sigma: finite(fit.tip_sigma),
            scans: fit.scans.iter().map(ShiftEntry::from).collect(),
            scanners: NamedMap::default(),
            stands_in: fit.stands_in.iter().map(|s| s.0).collect(),
            space: None,
            slides: Vec::new(),
            stays: fit
                .stays
                .iter()
                .map(|f| Self::new(id, f, &links[..f.links.len().min(links.len())], None))
                .collect(),
            tip: tip.map(|(link, pose)| TipPose { link, pose: (&pose).into() }),
            evidence: fit.links.iter().map(LinkEntry::from).collect(),
        }
    }
}

impl EqualEntry {
    fn new(fit: &Fit, equal: &contract::Equal) -> Self {
        let names = fit.joints.iter().map(|j| j.name.clone());
        Self {
            joints: NamedMap(names.zip(equal.posture.iter().copied()).collect()),
            margin: finite(equal.margin),
        }
    }
}

impl From<&contract::ScanShift> for ShiftEntry {
    fn from(s: &contract::ScanShift) -> Self {
        Self { scan: s.scan.0, shift: s.shift, turn: s.turn, range_bias: s.range_bias }
    }
}

impl From<&contract::LinkEvidence> for LinkEntry {
    fn from(e: &contract::LinkEvidence) -> Self {
        Self {
            link: e.name.clone(),
            seen: finite(e.seen),
            matched: finite(e.matched),
            violated: finite(e.violated),
            n_points: e.n_points,
            rms: finite(e.rms),
        }
    }
}

impl LabelFiles {
    /// Path of the legend.
    pub const TABLE: &'static str = "labels/table.json";
}

impl ScanLabels {
    /// The entry of a mask with `n_points` entries.
    #[must_use]
    pub fn new(mask: &Mask, n_points: u64) -> Self {
        let MaskFiles { kind, robot, link } = MaskFiles::of(mask.id);
        let (scan, input) = (mask.name.clone(), mask.input.0);
        Self { scan, input, n_points, kind, robot, link, superseded: None }
    }
}

/// A property of each joint of a fit, by name.
fn each<T>(fit: &Fit, of: impl Fn(&JointFit) -> T) -> Vec<(String, T)> {
    fit.joints.iter().map(|joint| (joint.name.clone(), of(joint))).collect()
}
