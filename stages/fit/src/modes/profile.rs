//! The profile of one joint: the distances from the arm of the points near the links that the joint
//! moves, at each of its values, with all else as it stands (METHOD.md §9).

use super::settings::MODES;
use crate::correspond::{MIN_POINTS, distances, squares, swept};
use crate::problem::Problem;
use crate::state::Hypothesis;

/// The links behind one joint, which turn apart from the rest of a posture.
pub(crate) struct JointProfile<'a> {
    problem: Problem<'a>,
    h: &'a Hypothesis,
    joint: usize,
    /// Points that any turn of those links may explain.
    points: Vec<u32>,
    /// Distances of the points to all other links, metres.
    still: Vec<f32>,
    /// The links that turn.
    pub(crate) moved: Vec<usize>,
}

impl<'a> JointProfile<'a> {
    /// `None` where the joint slides or moves nothing, or the points are too few.
    pub(crate) fn new(problem: &Problem<'a>, h: &'a Hypothesis, joint: usize) -> Option<Self> {
        let moved = problem.prepared.carried(joint);
        if problem.prepared.slides(joint) || moved.is_empty() {
            return None;
        }
        let points = swept(problem, h, &moved);
        if points.len() < MIN_POINTS {
            return None;
        }
        let still = distances(problem, h, &points, |l| !moved.contains(&l));
        Some(Self { problem: *problem, h, joint, points, still, moved })
    }

    /// Number of values that tell all there is over a span, radians.
    pub(crate) fn n_values(&self, span: f64) -> usize {
        let step = MODES.profile.arc / self.problem.prepared.lever[self.joint];
        (span / step.min(MODES.profile.most)).ceil() as usize
    }

    /// The posture with another value of the joint.
    pub(crate) fn at(&self, value: f64) -> Hypothesis {
        let mut other = self.h.clone();
        other.posture[self.joint] = value;
        other
    }

    /// Distances of the points to some of the links where the joint has a value, metres.
    pub(crate) fn distances(&self, value: f64, links: &[usize]) -> Vec<f32> {
        distances(&self.problem, &self.at(value), &self.points, |l| links.contains(&l))
    }

    /// Squared distances to the nearest of what stands still and what is turned, m².
    fn squares(&self, turned: &[&[f32]]) -> impl Iterator<Item = f64> {
        let least = |i: usize| turned.iter().map(|d| d[i]).fold(self.still[i], f32::min);
        (0..self.points.len()).map(move |i| f64::from(least(i)).powi(2))
    }

    /// Their sum, m².
    pub(crate) fn cost(&self, turned: &[&[f32]]) -> f64 {
        self.squares(turned).sum()
    }

    /// How clearly a value of the joint is worse than one whose distances are given, in standard
    /// deviations: what its squares exceed the other's by, over what that would be if each point's
    /// excess were chance. A few strays say nothing, many points that agree much.
    pub(crate) fn sigmas_worse(&self, value: f64, than: &[f32]) -> f64 {
        let own = self.distances(value, &self.moved);
        let (other, best) = ([own.as_slice()], [than]);
        let excess = self.squares(&other).zip(self.squares(&best)).map(|(o, b)| o - b);
        let [sum, squares] = excess.fold([0.0, 0.0], |s, d| [s[0] + d, s[1] + d * d]);
        if squares > 0.0 { sum / squares.sqrt() } else { 0.0 }
    }

    /// The cost where the joint has a value, and something may hang on the flange, m².
    pub(crate) fn cost_held(&self, value: f64) -> f64 {
        let own = self.distances(value, &self.moved);
        squares(&self.problem, &self.at(value), &self.points, &[&own, &self.still])
    }
}
