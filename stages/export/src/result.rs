//! `result.json`: what was found, how sure that is, and from what; schema `stillpoint.result/1`,
//! which grows by adding fields. Numbers that are not finite are written as null.

use crate::calibration::CalibrationEntry;
use crate::finite::finite;
use crate::mask::MaskFiles;
use crate::places::NamedMap;
use crate::review::ReviewEntry;
use crate::session::RescanEntry;
use crate::space::SpaceEntry;
use contract::{Certainty, Fit, JointFit, Mask};
use geometry::Pose;
use serde::{Deserialize, Serialize};

/// Name and version of the schema.
pub const SCHEMA: &str = "stillpoint.result/1";

/// The whole file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ResultFile {
    /// [`SCHEMA`].
    pub schema: String,
    /// Version of the program.
    pub version: String,
    /// Robots; their places here are the numbers in the masks.
    pub robots: Vec<RobotEntry>,
    /// Where the masks are.
    pub labels: LabelFiles,
    /// What was read.
    pub inputs: Vec<InputEntry>,
    /// What was done.
    pub stages: Vec<StageEntry>,
    /// What a person should know, in words.
    pub warnings: Vec<String>,
    /// What each entry of the review did, where there was one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub review: Vec<ReviewEntry>,
    /// Which result it goes on from, where one cell was scanned again.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rescan: Option<RescanEntry>,
}

/// One robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RobotEntry {
    /// `R1`, `R2` …
    pub id: String,
    /// Name in the library.
    pub model: String,
    /// Name of the link that `base_pose` places.
    pub base_link: String,
    /// World from base link.
    pub base_pose: BasePose,
    /// Its standard deviation.
    pub base_sigma: BaseSigma,
    /// Value of each joint, radians or metres, in the order of the model.
    pub joints: NamedMap<f64>,
    /// Joints whose values are metres; those of the others are radians.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub slides: Vec<String>,
    /// Standard deviation of each joint, same unit; that of any angle, π/√3, where the points say
    /// nothing of it.
    pub sigma: NamedMap<f64>,
    /// Values of the joints that follow those, by a rule of the model or as a closed loop needs
    /// it, same units.
    #[serde(default)]
    pub passive: NamedMap<f64>,
    /// Whether the points determine each joint.
    #[serde(default)]
    pub determined: NamedMap<bool>,
    /// The same in three words: `determined`, `coarse` or `undetermined`.
    #[serde(default)]
    pub certainty: NamedMap<Certainty>,
    /// Names of the links; their places here are the numbers in the masks.
    pub links: Vec<String>,
    /// World from each link.
    #[serde(default)]
    pub link_poses: NamedMap<BasePose>,
    /// `trusted`, `doubtful` or `refused`.
    pub verdict: String,
    /// Share explained less share contradicted.
    pub score: Option<f64>,
    /// RMS distance of its points from its surface, metres.
    #[serde(default)]
    pub rms: Option<f64>,
    /// Why not plainly trusted, in words.
    #[serde(default)]
    pub reasons: Vec<String>,
    /// The best other explanation.
    #[serde(default)]
    pub runner_up: Option<RunnerUpEntry>,
    /// Other postures that explain the points as well: a flange with six bolts, a wrist that
    /// nobody saw.
    #[serde(default)]
    pub equals: Vec<EqualEntry>,
    /// Other values within the limits, whole turns away, at which the robot stands the same, by
    /// joint.
    #[serde(default)]
    pub equivalents: NamedMap<Vec<f64>>,
    /// The tool of the library that it carries; its joints and links follow the robot's own.
    #[serde(default)]
    pub tool: Option<ToolEntry>,
    /// Where its joints are against the model, where that was asked for: base and joints are then
    /// those of the robot so corrected.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration: Option<CalibrationEntry>,
    /// Models that fit as well where the points can tell.
    #[serde(default)]
    pub alike: Vec<String>,
    /// How far the robot's surface is off the model's, standard deviation over patches of a hand's
    /// width, metres.
    #[serde(default)]
    pub surface_sigma: Option<f64>,
    /// Standard deviation of the tip's place in the frame of the base, metres.
    #[serde(default)]
    pub tip_sigma: Option<f64>,
    /// How the scans stand to one another near the robot.
    #[serde(default)]
    pub scans: Vec<ShiftEntry>,
    /// Numbers of the scans in which it stands so, if it moved between scans; else empty: in all.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub stands_in: Vec<u32>,
    /// The same robot as it stands in other scans, if it moved between scans.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub stays: Vec<RobotEntry>,
    /// What is known of the space around it: what a robot hides is unknown, not free.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub space: Option<SpaceEntry>,
    /// Where the tip of the main chain is.
    #[serde(default)]
    pub tip: Option<TipPose>,
    /// What the scans say of each link.
    #[serde(default)]
    pub evidence: Vec<LinkEntry>,
}

/// A pose, to world from link.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct BasePose {
    /// Position, metres.
    pub xyz: [f64; 3],
    /// Rotation, unit quaternion.
    pub quat_wxyz: [f64; 4],
}

impl From<&Pose> for BasePose {
    fn from(pose: &Pose) -> Self {
        let (p, q) = (pose.translation, pose.rotation);
        // One of the two quaternions of a rotation: the same rotation gives the same text.
        let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
        Self { xyz: [p.x, p.y, p.z], quat_wxyz: [q.w, q.i, q.j, q.k].map(|v| sign * v + 0.0) }
    }
}

/// Standard deviations of a base.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct BaseSigma {
    /// World axes, metres.
    pub xyz: [Option<f64>; 3],
    /// About world axes, radians.
    pub rotation: [Option<f64>; 3],
}

/// Pose of the last link of the main chain.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TipPose {
    /// Name of the link.
    pub link: String,
    /// World from that link.
    pub pose: BasePose,
}

/// What the scans say of a link.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LinkEntry {
    /// Name of the link.
    pub link: String,
    /// Share of its surface that some beam could judge.
    pub seen: Option<f64>,
    /// Of the judged, share with a beam ending on it.
    pub matched: Option<f64>,
    /// Of the judged, share that a beam went through.
    pub violated: Option<f64>,
    /// Points within the gate.
    pub n_points: usize,
    /// RMS distance of those, metres.
    pub rms: Option<f64>,
}

/// The best other explanation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunnerUpEntry {
    /// Its model.
    pub model: String,
    /// Its score.
    pub score: Option<f64>,
    /// Whether it is the same model in another posture.
    pub same_model: bool,
    /// How clearly the beams prefer the best, on the links that stand differently: about 0 for
    /// equals, 1 for clear.
    #[serde(default)]
    pub margin: Option<f64>,
}

/// A tool on a robot's flange.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ToolEntry {
    /// Its name in the library.
    pub model: String,
    /// The robot's link that it is bolted to.
    pub link: String,
    /// Turn of its root about the axis of the robot's last joint, along that link's own axis,
    /// radians.
    pub mount: f64,
}

/// Another posture that explains the points as well.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EqualEntry {
    /// Value of each joint, radians or metres.
    pub joints: NamedMap<f64>,
    /// As in [`RunnerUpEntry`].
    pub margin: Option<f64>,
}

/// How a scan is off its stated pose near a robot, as far as the robot's points tell.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ShiftEntry {
    /// Number of the scan, in the order of the inputs.
    pub scan: u32,
    /// Shift that its points need at the robot's base, metres, world axes.
    pub shift: [f64; 3],
    /// Turn that they need about the scanner, radians, world axes.
    pub turn: [f64; 3],
    /// Its ranges are too long by this, metres.
    pub range_bias: f64,
}

/// Where the masks are.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct LabelFiles {
    /// The legend.
    pub table: String,
    /// One for each mask.
    pub scans: Vec<ScanLabels>,
}

/// The files of one mask, relative to `result.json`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ScanLabels {
    /// Name of the scan, or of the LAS file.
    pub scan: String,
    /// Index into `inputs`.
    pub input: u32,
    /// Entries in each file.
    pub n_points: u64,
    /// Kinds, u8.
    pub kind: String,
    /// Robots, i16.
    pub robot: String,
    /// Links, i16.
    pub link: String,
    /// Points that a later scan has replaced or proved gone: their places in the mask, u64,
    /// ascending. They are no part of the plant any more, whatever their labels say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub superseded: Option<String>,
}

/// An input as it was read.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct InputEntry {
    /// As given.
    pub path: String,
    /// `e57`, `ptx`, `las` or `laz`.
    pub format: String,
    /// Length, bytes.
    pub n_bytes: u64,
    /// Digest of the bytes, with its method, such as `blake3:…`; empty where none was taken.
    pub digest: String,
    /// Scans in it.
    pub n_scans: u32,
    /// Points that the file does not flag as invalid.
    pub n_points: u64,
    /// Of those, points that were dropped (not finite).
    pub n_dropped: u64,
    /// Units that its coordinates were read in; all that is written is in metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub units: Option<UnitsEntry>,
    /// What is missing in it and what is worse for that.
    pub notes: Vec<String>,
}

/// Units of an input's own coordinates.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct UnitsEntry {
    /// In words, with where they come from.
    pub text: String,
    /// `given`, `declared`, `format` (the format prescribes them) or `assumed`.
    pub origin: String,
    /// Metres of one unit of x, y and z.
    pub metres: [f64; 3],
}

/// A stage as it ran. Holds nothing that differs from run to run, such as times.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct StageEntry {
    /// Its name.
    pub name: String,
    /// Items that went in.
    pub n_in: u64,
    /// Items that came out.
    pub n_out: u64,
}

impl RobotEntry {
    /// The entry of the robot with this id; names of the model's links in their order.
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
    /// Name of the legend.
    pub const TABLE: &'static str = "labels/table.json";
}

impl ScanLabels {
    /// The entry of a mask with so many entries.
    #[must_use]
    pub fn new(mask: &Mask, n_points: u64) -> Self {
        let MaskFiles { kind, robot, link } = MaskFiles::of(mask.id);
        let (scan, input) = (mask.name.clone(), mask.input.0);
        Self { scan, input, n_points, kind, robot, link, superseded: None }
    }
}

/// Something of each joint of a fit, by name.
fn each<T>(fit: &Fit, of: impl Fn(&JointFit) -> T) -> Vec<(String, T)> {
    fit.joints.iter().map(|joint| (joint.name.clone(), of(joint))).collect()
}
