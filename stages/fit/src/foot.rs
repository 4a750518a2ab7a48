//! An adjusted posture in; out comes how far its base may turn under the robot, the first joint turned back, before the points of
//! the foot say no: a round foot of which little is seen may stand anyhow, and its valley of squares has no slope to tell
//! the covariance so (METHOD.md §14).

use contract::Fan;
use geometry::Vector;
use nalgebra::{DMatrix, DVector, UnitQuaternion};
use robot::JointKind;

use crate::beam::Hypothesis;
use crate::refine::Refine;
use crate::spin::{AS_GOOD, extent};
use crate::sweep::{CAP, MIN_POINTS};

/// Turns that are tried, to either side and between one another, radians: 20° and 0.5°.
const SPAN: f64 = 0.35;
const STEP: f64 = 0.0087;
/// Within this the covariance tells, radians: 2°.
const VALLEY: f64 = 0.035;

impl Refine<'_> {
    /// The covariance of base twist (base axes) and joints, widened by what the points of the foot leave open.
    pub(crate) fn with_foot(
        &self,
        h: &Hypothesis,
        mut covariance: DMatrix<f64>,
        near: &[u32],
        fan: &impl Fan,
    ) -> DMatrix<f64> {
        let model = self.prepared.model;
        let Some(&first) = model.free.first() else { return covariance };
        let (first, fixed) = (&model.joints[first], &self.prepared.fixed);
        if first.kind == JointKind::Prismatic || fixed.is_empty() {
            return covariance;
        }
        let points = self.swept(h, near, fixed);
        let base_from_first = model.poses(&h.posture)[first.parent] * first.parent_from_joint;
        let turned = |angle: f64| {
            let turn = UnitQuaternion::from_axis_angle(&first.axis, angle);
            let mut other = h.clone();
            other.local_from_base *= base_from_first * turn * base_from_first.inverse();
            other.posture[0] -= angle;
            other
        };
        let extent = if points.len() < MIN_POINTS {
            SPAN
        } else {
            let still = self.distances(h, &points, |l| !fixed.contains(&l));
            let n = (SPAN / STEP) as i32;
            let angles = (-n..=n).map(|k| f64::from(k) * STEP).collect();
            let squares = |angle: f64| -> (f64, Vec<f64>) {
                let own = self.distances(&turned(angle), &points, |l| fixed.contains(&l));
                let least = own.iter().zip(&still).map(|(a, b)| f64::from(a.min(*b)));
                (angle, least.map(|d| d * d).collect())
            };
            run(&fan.fan(angles, squares), self.scene.noise * self.scene.noise)
        };
        if extent > VALLEY {
            let spread = extent / 3.0_f64.sqrt();
            let axis: Vector = base_from_first.rotation * first.axis.into_inner();
            let at = base_from_first.translation.vector;
            let mut way = DVector::zeros(covariance.nrows());
            way.rows_mut(0, 3).copy_from(&at.cross(&axis));
            way.rows_mut(3, 3).copy_from(&axis);
            way[6] = -1.0;
            covariance.ger(spread * spread, &way, &way, 1.0);
        }
        covariance
    }
}

/// How far the turns reach at which the points fit as well as at the best one: `squares[turn].1[point]`. Points that no turn
/// explains say nothing.
fn run(squares: &[(f64, Vec<f64>)], variance: f64) -> f64 {
    let most = 0.99 * f64::from(CAP).powi(2);
    let n_points = squares.first().map_or(0, |s| s.1.len());
    let is_own = |i: &usize| squares.iter().any(|s| s.1[*i] < most);
    let own: Vec<usize> = (0..n_points).filter(is_own).collect();
    let cost = |s: &(f64, Vec<f64>)| (s.0, own.iter().map(|&i| s.1[i]).sum::<f64>());
    let costs: Vec<(f64, f64)> = squares.iter().map(cost).collect();
    let least = costs.iter().map(|c| c.1).fold(f64::INFINITY, f64::min);
    extent(&costs, 0.0, least + (AS_GOOD.0 * least).max(AS_GOOD.1 * variance))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_that_no_turn_explains_do_not_make_all_turns_as_good() {
        let clutter = f64::from(CAP).powi(2);
        // One point on a box of the foot, which a turn by two steps leaves; a thousand on a crate beside it.
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
