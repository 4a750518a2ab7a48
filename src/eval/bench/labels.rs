//! Compares the labels of a cell's points with the truth: links, hoses and fixed points.

use super::cell::FoundInCell;
use crate::eval::confusion::Confusion;
use contract::{Label, MaskId};
use serde::Serialize;

/// Least number of points of a link that enters the median of links.
pub(super) const MIN_LINK_POINTS: u64 = 50;

/// Agreement of the labels of a case with the truth.
#[derive(Debug, Clone, Default, Serialize)]
pub(super) struct LabelScores {
    /// Intersection over union of each link of the robot that has points enough.
    pub(super) links: Vec<f64>,
    /// Points of hoses on the robot: those labelled as moving, and all.
    pub(super) hoses: [u64; 2],
    /// Points of everything attached to the robot (hoses, tool, part): those labelled as moving,
    /// and all.
    pub(super) attached: [u64; 2],
    /// Fixed points: all, and those labelled as moving.
    pub(super) fixed: [u64; 2],
}

impl LabelScores {
    /// Compares the labels with the truth, where robot 0 is the fit `here`, if there is one, with
    /// so many links. Points of other robots are ignored.
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

/// Ratio of the counts `[part, whole]`; `None` for an empty whole.
pub(super) fn share_of([part, whole]: [u64; 2]) -> Option<f64> {
    (whole > 0).then(|| part as f64 / whole as f64)
}
