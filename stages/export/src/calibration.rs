//! The calibration of a robot's joints in `result.json`.

use crate::finite::finite;
use crate::places::NamedMap;
use contract::{Calibration, Fit, JointFrame};
use serde::{Deserialize, Serialize};

/// The calibration of a robot: how it differs from its model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CalibrationEntry {
    /// The frames of its free joints.
    pub joints: Vec<FrameEntry>,
    /// Standard deviations of the prior: of each shift, metres, and of each rotation, radians.
    pub prior: [f64; 2],
    /// For each link the RMS distance of its points from its surface, metres: with the model as it
    /// is, and calibrated.
    pub link_rms: NamedMap<[Option<f64>; 2]>,
}

/// The frame of a joint relative to the model, in the joint's own frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrameEntry {
    /// Name of the joint.
    pub joint: String,
    /// Axis of the joint, unit length.
    pub axis: [f64; 3],
    /// Whether the joint slides along the axis.
    pub slides: bool,
    /// Shift of the joint's origin, metres.
    pub shift: [f64; 3],
    /// Rotation vector of the joint's frame, radians.
    pub turn: [f64; 3],
    /// Standard deviations of `shift` (metres) and `turn` (radians).
    pub sigma: [f64; 6],
    /// Distance of the joint's axis from the model's, and its standard deviation, metres.
    pub offset: [f64; 2],
    /// Angle between the joint's axis and the model's, and its standard deviation, radians.
    pub swing: [f64; 2],
}

impl CalibrationEntry {
    pub(crate) fn new(fit: &Fit, found: &Calibration) -> Self {
        let names = fit.links.iter().map(|l| l.name.clone());
        let rms = found.link_rms.iter().map(|r| r.map(finite));
        Self {
            joints: found.frames.iter().map(FrameEntry::from).collect(),
            prior: found.prior,
            link_rms: NamedMap(names.zip(rms).collect()),
        }
    }

    /// The calibration as the fit had it.
    #[must_use]
    pub fn calibration(&self) -> Calibration {
        let frame = |e: &FrameEntry| JointFrame {
            name: e.joint.clone(),
            axis: e.axis,
            slides: e.slides,
            shift: e.shift,
            turn: e.turn,
            sigma: e.sigma,
        };
        let link_rms = self.link_rms.0.iter().map(|(_, r)| r.map(|v| v.unwrap_or(f64::NAN)));
        Calibration {
            frames: self.joints.iter().map(frame).collect(),
            prior: self.prior,
            link_rms: link_rms.collect(),
        }
    }
}

impl From<&JointFrame> for FrameEntry {
    fn from(f: &JointFrame) -> Self {
        Self {
            joint: f.name.clone(),
            axis: f.axis,
            slides: f.slides,
            shift: f.shift,
            turn: f.turn,
            sigma: f.sigma,
            offset: f.offset(),
            swing: f.swing(),
        }
    }
}
