//! What the points of a cell are said to be, and what they are, in; how well links, hoses and fixed
//! points are told out.

use super::cell::FoundInCell;
use crate::eval::confusion::Confusion;
use contract::{Label, MaskId};
use serde::Serialize;

/// A link with fewer points has no say in the median of links.
pub(super) const MIN_LINK_POINTS: u64 = 50;

/// How well the labels of a case are.
#[derive(Debug, Clone, Default, Serialize)]
pub(super) struct LabelScores {
    /// Intersection over union of each link of the robot that has points enough.
    pub(super) links: Vec<f64>,
    /// Points of hoses that hang on the robot: said to move, and all.
    pub(super) hoses: [u64; 2],
    /// Points of all that hangs on the robot, hoses, tool and part: said to move, and all.
    pub(super) attached: [u64; 2],
    /// Points that stand still: all, and those said to move.
    pub(super) fixed: [u64; 2],
}

impl LabelScores {
    /// Compares the labels with the truth, where robot 0 is what the fit `here` found, if any did,
    /// with so many links. Of points of other robots nothing is asked.
    pub(super) fn of(found: &FoundInCell, here: Option<usize>, n_links: usize) -> Option<Self> {
        let (near, truth) = found.labels.as_ref()?;
        let mut tally = Confusion::new(std::iter::once(n_links));
        let mut hoses = [0; 2];
        for (scan, points) in truth.iter().enumerate() {
            let mut said = near.of(MaskId(scan as u32));
            for (place, real) in points.iter().enumerate().filter(|(_, p)| p.label.robot <= 0) {
                let said = said.label(place as u64).unwrap_or(Label::FIXED);
                tally.add(said, real.label, |robot| (Some(robot) == here).then_some(0));
                if real.on_hose {
                    hoses[0] += u64::from(said.moves());
                    hoses[1] += 1;
                }
            }
        }
        let links = tally.link_ious(0, MIN_LINK_POINTS).collect();
        Some(Self { links, hoses, attached: tally.attached, fixed: tally.fixed })
    }
}

/// Share of counts `[part, whole]`; none of nothing.
pub(super) fn share_of([part, whole]: [u64; 2]) -> Option<f64> {
    (whole > 0).then(|| part as f64 / whole as f64)
}
