//! A posture that is adjusted, with the values that the points leave to its leaf joints.

use geometry::angle;

use super::settings::MODES;
use crate::adjust::Adjusted;
use crate::problem::Judgement;
use crate::refine::Refined;

/// Values of one joint.
#[derive(Debug, Clone)]
pub(crate) struct JointModes {
    pub(crate) joint: usize,
    /// All values at which the points fit as well as at the best one, best first.
    pub(crate) values: Vec<f64>,
    /// How far around the posture's own value all values are as good, at most, radians: 0 where
    /// those beside it are worse.
    pub(crate) extent: f64,
}

impl JointModes {
    /// Whether the joint may stand at several values.
    pub(crate) fn is_several(&self) -> bool {
        self.values.len() > 1
    }
}

/// A posture with the best values of its leaf joints, where one of them is another mode, not the
/// same one found again.
pub(crate) fn better_leaves(posture: &[f64], leaves: &[JointModes]) -> Option<Vec<f64>> {
    let mut out = posture.to_vec();
    leaves.iter().for_each(|s| out[s.joint] = s.values[0]);
    let is_other = |s: &JointModes| angle::apart(posture[s.joint], out[s.joint]) > MODES.same_turn;
    leaves.iter().any(is_other).then_some(out)
}

/// A posture adjusted, with the values that the points leave to its leaf joints.
#[derive(Debug, Clone)]
pub(crate) struct Settled {
    pub(crate) adjusted: Adjusted,
    pub(crate) judgement: Judgement,
    pub(crate) leaves: Vec<JointModes>,
}

impl Settled {
    /// Where it stands, without what the adjustment knows of it.
    pub(crate) fn refined(&self) -> Refined {
        let (hypothesis, judgement) = (self.adjusted.hypothesis.clone(), self.judgement.clone());
        Refined { hypothesis, judgement }
    }

    /// Leaf joints that may stand at several values.
    pub(crate) fn open_leaves(&self) -> Vec<usize> {
        self.leaves.iter().filter(|s| s.is_several()).map(|s| s.joint).collect()
    }
}
