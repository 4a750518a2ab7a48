//! What a calibration found in; its part of `result.json` out, and back.

use crate::finite::finite;
use crate::places::NamedMap;
use contract::{Calibration, Fit, JointFrame};
use serde::{Deserialize, Serialize};

/// How a robot differs from its model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CalibrationEntry {
    /// Its free joints.
    pub joints: Vec<FrameEntry>,
    /// Standard deviations that were assumed beforehand: shift, metres, turn, radians.
    pub prior: [f64; 2],
    /// RMS distance of each link's points from its surface, metres: as in the model, and
    /// corrected.
    pub link_rms: NamedMap<[Option<f64>; 2]>,
}

/// Where a joint is against its model, in the joint's own frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrameEntry {
    /// Name of the joint.
    pub joint: String,
    /// Its axis.
    pub axis: [f64; 3],
    /// Whether it slides.
    pub slides: bool,
    /// Shift of its origin, metres.
    pub shift: [f64; 3],
    /// Turn of its frame, radians.
    pub turn: [f64; 3],
    /// Standard deviations of both.
    pub sigma: [f64; 6],
    /// How far its axis runs beside the model's, metres, and standard deviation.
    pub offset: [f64; 2],
    /// How far its axis leans, radians, and standard deviation.
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

    /// As the fit had it.
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
