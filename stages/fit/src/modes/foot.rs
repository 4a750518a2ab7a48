//! How far the base may turn under the robot, with the first joint turned back, before the points
//! of the foot contradict it (METHOD.md §14.2). A round foot of which little is seen may stand at
//! any yaw, and its valley of squares is too flat for the covariance to show that.

use geometry::{Pose, Vector};
use nalgebra::{DMatrix, DVector, Unit, UnitQuaternion};
use robot::JointKind;

use super::leaf::extent;
use super::settings::{FootLimits, MODES, unexplained_square};
use crate::correspond::{MIN_POINTS, distances, swept};
use crate::problem::Problem;
use crate::state::Hypothesis;

const LIMITS: FootLimits = MODES.foot;

/// The covariance of base twist (base axes) and joints, widened by what the points of the foot
/// leave open.
pub(crate) fn with_foot(
    problem: &Problem<'_>,
    h: &Hypothesis,
    mut covariance: DMatrix<f64>,
) -> DMatrix<f64> {
    let Some(foot) = Foot::new(problem, h) else { return covariance };
    let n = (LIMITS.span / LIMITS.step) as i32;
    let extent = foot.reach((-n..=n).map(|k| f64::from(k) * LIMITS.step).collect(), 1.0);
    if extent > LIMITS.valley {
        let spread = extent / 3.0_f64.sqrt();
        let way = foot.way(covariance.nrows());
        covariance.ger(spread * spread, &way, &way, 1.0);
    }
    covariance
}

/// The foot of a robot as it stands, and the points about it.
pub(crate) struct Foot<'a> {
    problem: Problem<'a>,
    h: &'a Hypothesis,
    points: Vec<u32>,
    base_from_first: Pose,
    axis: Unit<Vector>,
}

impl<'a> Foot<'a> {
    /// `None` where nothing turns on a foot.
    pub(crate) fn new(problem: &Problem<'a>, h: &'a Hypothesis) -> Option<Self> {
        let (model, fixed) = (problem.prepared.model, &problem.prepared.fixed);
        let first = &model.joints[*model.free.first()?];
        if first.kind == JointKind::Prismatic || fixed.is_empty() {
            return None;
        }
        let points = swept(problem, h, fixed);
        let base_from_first = model.poses(&h.posture)[first.parent] * first.parent_from_joint;
        Some(Self { problem: *problem, h, points, base_from_first, axis: first.axis })
    }

    /// The base turned by an angle, the first joint turned back.
    fn turned(&self, angle: f64) -> Hypothesis {
        let turn = UnitQuaternion::from_axis_angle(&self.axis, angle);
        let mut other = self.h.clone();
        other.local_from_base *= self.base_from_first * turn * self.base_from_first.inverse();
        other.posture[0] -= angle;
        other
    }

    /// How far turns reach at which the points fit as well, radians, if so many points share one
    /// error: the farthest of those tried where there are too few points to tell.
    pub(crate) fn reach(&self, angles: Vec<f64>, n_alike: f64) -> f64 {
        let Self { problem, points, .. } = self;
        if points.len() < MIN_POINTS {
            return angles.into_iter().fold(0.0, f64::max);
        }
        let fixed = &problem.prepared.fixed;
        let still = distances(problem, self.h, points, |l| !fixed.contains(&l));
        let squares = |angle: f64| -> (f64, Vec<f64>) {
            let own = distances(problem, &self.turned(angle), points, |l| fixed.contains(&l));
            let least = own.iter().zip(&still).map(|(a, b)| f64::from(a.min(*b)));
            (angle, least.map(|d| d * d).collect())
        };
        let noise = problem.scene.noise;
        run(&problem.fan.fan(angles, squares), n_alike * noise * noise)
    }

    /// How base twist (base axes) and joints of so many unknowns change with such a turn.
    pub(crate) fn way(&self, n: usize) -> DVector<f64> {
        let axis = self.base_from_first.rotation * self.axis.into_inner();
        let at = self.base_from_first.translation.vector;
        let mut way = DVector::zeros(n);
        way.rows_mut(0, 3).copy_from(&at.cross(&axis));
        way.rows_mut(3, 3).copy_from(&axis);
        way[6] = -1.0;
        way
    }
}

/// How far the turns reach at which the points fit as well as at the best one:
/// `squares[turn].1[point]`. Points that no turn explains say nothing.
fn run(squares: &[(f64, Vec<f64>)], variance: f64) -> f64 {
    let most = unexplained_square();
    let n_points = squares.first().map_or(0, |s| s.1.len());
    let is_own = |i: &usize| squares.iter().any(|s| s.1[*i] < most);
    let own: Vec<usize> = (0..n_points).filter(is_own).collect();
    let cost = |s: &(f64, Vec<f64>)| (s.0, own.iter().map(|&i| s.1[i]).sum::<f64>());
    let costs: Vec<(f64, f64)> = squares.iter().map(cost).collect();
    let least = costs.iter().map(|c| c.1).fold(f64::INFINITY, f64::min);
    extent(&costs, 0.0, MODES.as_good.limit(least, variance))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::correspond::CAP;

    const STEP: f64 = LIMITS.step;

    #[test]
    fn points_that_no_turn_explains_do_not_make_all_turns_as_good() {
        let clutter = f64::from(CAP).powi(2);
        // One point on a box of the foot, which a turn by two steps leaves; a thousand on a crate
        // beside it.
        let squares = |slope: f64| -> Vec<(f64, Vec<f64>)> {
            let turns = (-9..=9).map(|k| f64::from(k) * STEP);
            let of =
                |t: f64| [vec![(slope * t * t).min(clutter); 30], vec![clutter; 1000]].concat();
            turns.map(|t| (t, of(t))).collect()
        };
        let variance = 2.25e-6;
        assert!(run(&squares(0.02), variance) < 2.5 * STEP);
        assert!((run(&squares(0.0), variance) - 9.0 * STEP).abs() < 1e-12);
    }
}
