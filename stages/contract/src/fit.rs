//! A fit: which robot, where, in which posture, and how far to trust it.

use crate::Certainty;
use geometry::Pose;
use nalgebra::{Translation3, UnitQuaternion};
use serde::{Deserialize, Serialize};

/// How far a fit may be trusted.
#[derive(
    Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
pub enum Verdict {
    /// Wrong, or not this robot: not used for labels.
    Refused,
    /// May be right: a person should look.
    #[default]
    Doubtful,
    /// Right as far as the points can tell.
    Trusted,
}

impl Verdict {
    /// As in `result.json`.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Trusted => "trusted",
            Self::Doubtful => "doubtful",
            Self::Refused => "refused",
        }
    }
}

/// One joint of a fit.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct JointFit {
    /// As in the URDF.
    pub name: String,
    /// Radians, or metres for prismatic joints.
    pub value: f64,
    /// Standard deviation, same unit; that of any angle, π/√3, where the points say nothing of it.
    pub sigma: f64,
    /// How well the points tell it.
    pub certainty: Certainty,
    /// Other values within the limits, whole turns away, at which the robot stands the same.
    pub equivalents: Vec<f64>,
}

impl JointFit {
    /// Whether the points determine it.
    #[must_use]
    pub fn is_determined(&self) -> bool {
        self.certainty == Certainty::Determined
    }
}

/// What the scans say of one link at the fitted posture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LinkEvidence {
    /// As in the URDF.
    pub name: String,
    /// Share of its outer surface that some beam could judge, 0..1.
    pub seen: f64,
    /// Of the judged: share with a beam ending on it.
    pub matched: f64,
    /// Of the judged: share that a beam went through.
    pub violated: f64,
    /// Number of points within the gate.
    pub n_points: usize,
    /// RMS distance of those points, metres.
    pub rms: f64,
}

/// The best other explanation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunnerUp {
    /// Its model.
    pub model: String,
    /// Its score, on the scale of [`Fit::score`].
    pub score: f64,
    /// Whether it is the same model in another posture.
    pub same_model: bool,
    /// How clearly the beams prefer the best, on the surface of the links that stand differently:
    /// about 0 for equals.
    pub margin: f64,
}

/// How a scan differs from its stated pose near a robot.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ScanShift {
    /// Whose.
    pub scan: crate::ScanId,
    /// Shift that its points need at the robot's base, metres, world axes.
    pub shift: [f64; 3],
    /// Turn that they need about the scanner, radians, world axes.
    pub turn: [f64; 3],
    /// Its ranges are too long by this, metres.
    pub range_bias: f64,
}

/// What a robot's points say of the errors of the scans that see it, for others that the same scans
/// see: of each scan its shift, metres, its turn about its scanner, radians, both world axes, and
/// its range bias, metres: seven values, scan after scan.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct ScanShare {
    /// Whose.
    pub scans: Vec<crate::ScanId>,
    /// Errors as this robot alone tells them, with the prior.
    pub errors: Vec<f64>,
    /// Information of its points alone, prior left out, row-major.
    pub information: Vec<f64>,
    /// By how much base twist (world axes at the base: translation, rotation) and joints give way
    /// to each of them, row-major.
    pub gain: Vec<f64>,
}

/// Another posture that explains the points as well.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Equal {
    /// Free joints, in the order of the model, radians or metres.
    pub posture: Vec<f64>,
    /// As [`RunnerUp::margin`].
    pub margin: f64,
}

/// A tool on a robot's flange.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Mounted {
    /// Its name in the library.
    pub model: String,
    /// The robot's link that it is bolted to.
    pub link: String,
    /// Turn of its root about the axis of the robot's last joint, along that link's own axis,
    /// radians.
    pub mount: f64,
    /// Other such turns, and the last joint's value with each, radians, that explain the points as
    /// well.
    pub alike: Vec<[f64; 2]>,
}

/// Where a joint really is, against its model.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct JointFrame {
    /// As in the URDF.
    pub name: String,
    /// Its axis, joint's frame.
    pub axis: [f64; 3],
    /// Whether it slides along it; else it turns about it.
    pub slides: bool,
    /// Shift of its origin, joint's frame of the model, metres.
    pub shift: [f64; 3],
    /// Turn of its frame, joint's frame of the model, radians; about the axis zero, since the
    /// joint itself turns there.
    pub turn: [f64; 3],
    /// Standard deviations of both, axis by axis.
    pub sigma: [f64; 6],
}

impl JointFrame {
    /// The joint's own frame from the model's: what the joint's origin is moved by, joint's frame,
    /// metres.
    #[must_use]
    pub fn moved(&self) -> Pose {
        let turn = UnitQuaternion::from_scaled_axis(self.turn.into());
        Pose::from_parts(Translation3::from(self.shift), turn)
    }

    /// How far its axis leans from the model's, radians, and standard deviation.
    #[must_use]
    pub fn swing(&self) -> [f64; 2] {
        self.across(self.turn, [3, 4, 5])
    }

    /// How far its axis runs beside the model's, metres, and standard deviation.
    #[must_use]
    pub fn offset(&self) -> [f64; 2] {
        self.across(self.shift, [0, 1, 2])
    }

    /// Size of the part of a vector across the axis, and its standard deviation.
    fn across(&self, v: [f64; 3], at: [usize; 3]) -> [f64; 2] {
        let along: f64 = (0..3).map(|i| v[i] * self.axis[i]).sum();
        let part = [0, 1, 2].map(|i| v[i] - along * self.axis[i]);
        let size = part.iter().map(|p| p * p).sum::<f64>().sqrt();
        let variance = (0..3).map(|i| (part[i] * self.sigma[at[i]]).powi(2)).sum::<f64>();
        let whole = (0..3).map(|i| self.sigma[at[i]]).fold(0.0, f64::max);
        [size, if size > 0.0 { variance.sqrt() / size } else { whole }]
    }
}

/// How a robot differs from its model, as far as its points tell.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// Its free joints, in the order of the model.
    pub frames: Vec<JointFrame>,
    /// Standard deviations of the prior: shift, metres, turn, radians.
    pub prior: [f64; 2],
    /// RMS distance of each link's points from its surface before and after, metres.
    pub link_rms: Vec<[f64; 2]>,
}

/// A robot found in the scans.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Fit {
    /// Index into the library.
    pub model: usize,
    /// Name in the library.
    pub model_name: String,
    /// World from base link (the root of the URDF's tree), metres.
    pub world_from_base: Pose,
    /// Standard deviations of the base: x, y, z (metres), rotations about x, y, z (radians), world
    /// axes at the base.
    pub base_sigma: [f64; 6],
    /// Free joints, in the order of the model.
    pub joints: Vec<JointFit>,
    /// Covariance of (base twist: translation, rotation about the base's origin, world axes; free
    /// joints), row-major, (6+n)².
    pub covariance: Vec<f64>,
    /// Share explained less share contradicted, −1.5..1.
    pub score: f64,
    /// Surface explained less 1.5 × surface contradicted, m²: compares models of different size.
    pub explained: f64,
    /// RMS distance of the points of the robot from its surface, metres.
    pub rms: f64,
    /// How far the robot's surface is off the model's, standard deviation over patches of a hand's
    /// width, metres.
    pub surface_sigma: f64,
    /// Standard deviation of the place of the main chain's tip in the base's frame, metres.
    pub tip_sigma: f64,
    /// How the scans stand to one another, as far as the points of the robot tell.
    pub scans: Vec<ScanShift>,
    /// The same for others; nothing where a scanner is unknown.
    pub share: Option<ScanShare>,
    /// One for each link of the model, in its order.
    pub links: Vec<LinkEvidence>,
    /// Scans in which it stands so, if it moved between scans; else empty: in all of them.
    pub stands_in: Vec<crate::ScanId>,
    /// How it stands in other scans, if it moved between scans.
    pub stays: Vec<Fit>,
    /// The best other explanation, if any came near.
    pub runner_up: Option<RunnerUp>,
    /// Other postures that explain the points as well (a symmetric link, a wrist that nobody saw),
    /// best first.
    pub equals: Vec<Equal>,
    /// Posture after the sweeps and before the registration, where the method goes link after
    /// link; else empty.
    pub rough: Vec<f64>,
    /// Closed loops, by their place in the model, that stand on the other of their two solutions
    /// than at the model's zero.
    pub other_branches: Vec<usize>,
    /// The tool of the library that it carries, if one was found; its joints follow the robot's
    /// own.
    pub tool: Option<Mounted>,
    /// Where its joints really are, where that was asked for; base and joints are those of the
    /// robot so corrected.
    pub calibration: Option<Calibration>,
    /// Other models that fit as well where the points can tell.
    pub alike: Vec<String>,
    /// How far to trust it.
    pub verdict: Verdict,
    /// Why, in words; empty only for a plain `Trusted`.
    pub reasons: Vec<String>,
    /// Whether it gives no labels although it is not refused, in a run that knows better where its
    /// points are: kept within the run, and not in files.
    #[serde(skip)]
    pub is_without_labels: bool,
}

impl Fit {
    /// Whether points are labelled by this fit.
    #[must_use]
    pub fn gives_labels(&self) -> bool {
        self.label_verdict() != Verdict::Refused
    }

    /// The verdict as the labels have it: refused where the fit gives none.
    #[must_use]
    pub fn label_verdict(&self) -> Verdict {
        if self.is_without_labels { Verdict::Refused } else { self.verdict }
    }
}
