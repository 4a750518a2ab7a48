//! A fit: a robot model found in the scans, with base pose, posture, uncertainty and verdict.

use crate::Certainty;
use geometry::Pose;
use nalgebra::{Translation3, UnitQuaternion};
use serde::{Deserialize, Serialize};

/// How far a fit may be trusted.
#[derive(
    Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
pub enum Verdict {
    /// The fit is wrong, or it is another robot; it gives no labels.
    Refused,
    /// The fit may be right; a person should check it.
    #[default]
    Doubtful,
    /// The fit is right as far as the points can tell.
    Trusted,
}

impl Verdict {
    /// The word for the verdict in `result.json`.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Trusted => "trusted",
            Self::Doubtful => "doubtful",
            Self::Refused => "refused",
        }
    }
}

/// The fitted value of one joint.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct JointFit {
    /// Name of the joint in the URDF.
    pub name: String,
    /// Value, radians; metres for prismatic joints.
    pub value: f64,
    /// Standard deviation in the same unit. If the points do not determine a revolute joint, it is
    /// that of a uniform angle, π/√3.
    pub sigma: f64,
    /// How well the points determine the value.
    pub certainty: Certainty,
    /// Other values within the limits, whole turns away, at which the posture is the same.
    pub equivalents: Vec<f64>,
}

impl JointFit {
    /// Whether the points determine the value.
    #[must_use]
    pub fn is_determined(&self) -> bool {
        self.certainty == Certainty::Determined
    }
}

/// The evidence of the scans for one link in the fitted posture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LinkEvidence {
    /// Name of the link in the URDF.
    pub name: String,
    /// Share of the link's outer surface that at least one beam could judge, 0..1.
    pub seen: f64,
    /// Share of the judged surface on which a beam ends, 0..1.
    pub matched: f64,
    /// Share of the judged surface that a beam passes through, 0..1.
    pub violated: f64,
    /// Number of points within the gate (the largest distance at which a point counts).
    pub n_points: usize,
    /// RMS distance of those points from the surface, metres.
    pub rms: f64,
}

/// The best other explanation of the points: another model, or the same one elsewhere.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunnerUp {
    /// Name of its model in the library.
    pub model: String,
    /// Its score, on the scale of [`Fit::score`].
    pub score: f64,
    /// Whether it is the same model in another posture.
    pub same_model: bool,
    /// How clearly the beams prefer the fit to this explanation, judged on the surface of the
    /// links that stand differently: about 0 where neither is better.
    pub margin: f64,
}

/// Difference of a scan from its stated pose, as estimated near one robot.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ScanShift {
    /// The scan.
    pub scan: crate::ScanId,
    /// Shift that the scan's points need at the robot's base, metres, world axes.
    pub shift: [f64; 3],
    /// Rotation that they need about the scanner, rotation vector, radians, world axes.
    pub turn: [f64; 3],
    /// By how much the scan's ranges are too long, metres.
    pub range_bias: f64,
}

/// The information of one robot's points about the errors of the scans that see it, used to
/// estimate these errors from all robots together. Each scan has seven values: shift (metres),
/// rotation vector about its scanner (radians), both in world axes, and range bias (metres).
/// The values of the scans follow one another in the order of `scans`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct ScanShare {
    /// The scans.
    pub scans: Vec<crate::ScanId>,
    /// Errors as estimated from this robot alone, prior included, 7 values a scan.
    pub errors: Vec<f64>,
    /// Information matrix of the robot's points alone, prior left out, row-major, (7·n scans)².
    pub information: Vec<f64>,
    /// Derivative of base twist (translation, rotation; world axes at the base) and free joints by
    /// each scan error, row-major: one row a parameter, one column an error.
    pub gain: Vec<f64>,
}

/// Another posture of the same robot that explains the points as well.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Equal {
    /// Values of the free joints, in the order of the model, radians or metres.
    pub posture: Vec<f64>,
    /// How clearly the beams prefer the fit, as in [`RunnerUp::margin`].
    pub margin: f64,
}

/// A tool from the library on a robot's flange.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Mounted {
    /// Name of the tool's model in the library.
    pub model: String,
    /// The robot's link that the tool is bolted to.
    pub link: String,
    /// Rotation of the tool's root link about the axis of the robot's last joint, radians.
    pub mount: f64,
    /// Other mounting rotations that explain the points as well, each with the value of the last
    /// joint that belongs to it, radians.
    pub alike: Vec<[f64; 2]>,
}

/// The estimated frame of a joint relative to its frame in the model.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct JointFrame {
    /// Name of the joint in the URDF.
    pub name: String,
    /// Axis of the joint, unit length, joint frame.
    pub axis: [f64; 3],
    /// Whether the joint slides along the axis; otherwise it turns about it.
    pub slides: bool,
    /// Shift of the joint's origin, joint frame of the model, metres.
    pub shift: [f64; 3],
    /// Rotation vector of the joint's frame, joint frame of the model, radians. Its component
    /// along the axis is zero, since the joint's own value takes that part.
    pub turn: [f64; 3],
    /// Standard deviations of `shift` (metres) and `turn` (radians), axis by axis.
    pub sigma: [f64; 6],
}

impl JointFrame {
    /// The pose `model_joint_from_joint`: what the joint's origin in the model is moved by, metres.
    #[must_use]
    pub fn moved(&self) -> Pose {
        let turn = UnitQuaternion::from_scaled_axis(self.turn.into());
        Pose::from_parts(Translation3::from(self.shift), turn)
    }

    /// Angle between the joint's axis and the model's, and its standard deviation, radians.
    #[must_use]
    pub fn swing(&self) -> [f64; 2] {
        self.across(self.turn, [3, 4, 5])
    }

    /// Distance of the joint's axis from the model's at the origin, and its standard deviation,
    /// metres.
    #[must_use]
    pub fn offset(&self) -> [f64; 2] {
        self.across(self.shift, [0, 1, 2])
    }

    /// Length of the component of `v` across the axis, and its standard deviation; `at` are the
    /// indices of its three deviations in `sigma`.
    fn across(&self, v: [f64; 3], at: [usize; 3]) -> [f64; 2] {
        let along: f64 = (0..3).map(|i| v[i] * self.axis[i]).sum();
        let part = [0, 1, 2].map(|i| v[i] - along * self.axis[i]);
        let size = part.iter().map(|p| p * p).sum::<f64>().sqrt();
        let variance = (0..3).map(|i| (part[i] * self.sigma[at[i]]).powi(2)).sum::<f64>();
        let whole = (0..3).map(|i| self.sigma[at[i]]).fold(0.0, f64::max);
        [size, if size > 0.0 { variance.sqrt() / size } else { whole }]
    }
}

/// The differences of a robot from its model, as its points determine them.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// The frames of the free joints, in the order of the model.
    pub frames: Vec<JointFrame>,
    /// Standard deviations of the prior: of each shift, metres, and of each rotation, radians.
    pub prior: [f64; 2],
    /// For each link the RMS distance of its points from its surface before and after, metres.
    pub link_rms: Vec<[f64; 2]>,
}

/// A robot found in the scans.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Fit {
    /// Index of the model in the library.
    pub model: usize,
    /// Name of the model in the library.
    pub model_name: String,
    /// Pose of the base link (the root of the URDF's tree) in the world, metres.
    pub world_from_base: Pose,
    /// Standard deviations of the base: translation along x, y, z (metres), rotation about x, y, z
    /// (radians), world axes at the base.
    pub base_sigma: [f64; 6],
    /// The free joints, in the order of the model.
    pub joints: Vec<JointFit>,
    /// Covariance of the base twist (translation, then rotation about the base's origin, world
    /// axes; metres and radians) and of the n free joints, row-major, (6+n)².
    pub covariance: Vec<f64>,
    /// Share of the surface that is explained less the share that is contradicted, −1.5..1.
    pub score: f64,
    /// Surface explained less 1.5 × surface contradicted, m²: comparable between models of
    /// different size.
    pub explained: f64,
    /// RMS distance of the points of the robot from its surface, metres.
    pub rms: f64,
    /// Standard deviation of the robot's true surface from the model's, averaged over patches of
    /// about 0.1 m, metres.
    pub surface_sigma: f64,
    /// Standard deviation of the position of the main chain's tip in the base frame, metres.
    pub tip_sigma: f64,
    /// Errors of the scans' stated poses, as the points of the robot determine them.
    pub scans: Vec<ScanShift>,
    /// The robot's part in the joint estimate of these errors; `None` where a scanner's position
    /// is unknown.
    pub share: Option<ScanShare>,
    /// Evidence for each link of the model, in the order of the model.
    pub links: Vec<LinkEvidence>,
    /// Scans in which the robot has this posture; empty if it has it in all scans.
    pub stands_in: Vec<crate::ScanId>,
    /// Its postures in the other scans, if it moved between scans.
    pub stays: Vec<Fit>,
    /// The best other explanation, if one came near.
    pub runner_up: Option<RunnerUp>,
    /// Other postures that explain the points as well (a symmetric link, a wrist that no beam
    /// reached), best first.
    pub equals: Vec<Equal>,
    /// Posture before registration, for methods that search link by link; empty for others.
    pub rough: Vec<f64>,
    /// Indices of the closed loops of the model that stand on the other of their two solutions
    /// than at the model's zero posture.
    pub other_branches: Vec<usize>,
    /// The tool from the library that the robot carries, if one was found; its joints follow the
    /// robot's own in `joints`.
    pub tool: Option<Mounted>,
    /// The calibrated joint frames, where calibration was requested. Base and joints are then
    /// those of the calibrated robot.
    pub calibration: Option<Calibration>,
    /// Names of other models that explain the points as well.
    pub alike: Vec<String>,
    /// How far the fit may be trusted.
    pub verdict: Verdict,
    /// Reasons for the verdict, in words; empty only for a trusted fit without remarks.
    pub reasons: Vec<String>,
    /// Whether the fit gives no labels although it is not refused, because a later step of the
    /// same run explains its points better. Not part of any file.
    #[serde(skip)]
    pub is_without_labels: bool,
}

impl Fit {
    /// Whether points are labelled by this fit.
    #[must_use]
    pub fn gives_labels(&self) -> bool {
        !self.is_without_labels && self.verdict != Verdict::Refused
    }
}
