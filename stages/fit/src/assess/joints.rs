//! Joints as they are reported: how well each is known, which are open, and which other postures
//! explain the points as well (METHOD.md §14.3).

use contract::{Certainty, Equal, JointFit};
use geometry::angle;
use nalgebra::DMatrix;
use robot::{Model, Motion};
use std::f64::consts::TAU;

use super::covariance::sigma_of;
use super::rival::Rival;
use crate::modes::{JointModes, MODES, closes_tool};
use crate::problem::Problem;
use crate::state::Hypothesis;
use crate::verdict::RIVAL;

/// Standard deviation from which on a joint is open, radians: any value within degrees would do.
const OPEN_SIGMA: f64 = 0.02;
/// Most equals that are listed.
const N_EQUALS: usize = 4;

/// Which joints the points leave open.
pub(super) struct OpenJoints {
    /// For each joint.
    pub(super) is_open: Vec<bool>,
    /// How far away the farthest of its other values is, or how wide a run of values that are all
    /// as good spreads, radians or metres.
    pub(super) spread: Vec<f64>,
    /// How far away the base stands in the farthest of the postures that explain the points as
    /// well: shift, metres, and turn, radians, along and about the world's axes.
    base: [f64; 6],
}

impl OpenJoints {
    /// For each joint, whether the points leave it open: by its standard deviation, or because a
    /// posture that differs in this joint and few others explains the points as well (a flange with
    /// six bolts, a wrist seen from nowhere); and how far away the farthest such value is, radians.
    pub(super) fn of(
        problem: &Problem<'_>,
        covariance: &DMatrix<f64>,
        h: &Hypothesis,
        rivals: &[Rival<'_>],
    ) -> Self {
        let n = h.posture.len();
        let mut is_open: Vec<bool> =
            (0..n).map(|j| covariance[(6 + j, 6 + j)] >= OPEN_SIGMA.powi(2)).collect();
        let mut spread = vec![0.0_f64; n];
        let mut base = [0.0_f64; 6];
        for rival in rivals {
            let other = &rival.other.hypothesis;
            let apart: Vec<bool> = (0..n).map(|j| h.turn(other, j) > MODES.other_turn).collect();
            // Whatever else differs, a flange beside it, the base may stand there.
            if rival.margin < MODES.equal {
                let by = base_apart(h, other);
                base = std::array::from_fn(|i| base[i].max(by[i]));
            }
            // One joint alone, or the tail of the chain, can be open by symmetry; a flip further up
            // is another answer. What a last joint may be beside the rest is asked of it alone: it
            // does not count beside another, whose rivals have any value of it.
            let leaf = &problem.prepared.leaf;
            let all: Vec<usize> = (0..n).filter(|&j| apart[j]).collect();
            let arm: Vec<usize> = all.iter().copied().filter(|&j| !leaf[j]).collect();
            let counted = if arm.is_empty() { &all } else { &arm };
            let is_alone = counted.len() == 1;
            let is_slide = is_alone && closes_tool(problem, counted[0]);
            let is_equal = rival.margin < if is_slide { MODES.slide_equal } else { MODES.equal };
            let is_tail = all.first().is_some_and(|&j| (j..n).all(|j| is_open[j] || j + 1 == n));
            if is_equal && (is_alone || is_tail) {
                for &j in if is_tail { &all } else { counted } {
                    is_open[j] = true;
                    spread[j] = spread[j].max(h.turn(other, j));
                }
            }
        }
        Self { is_open, spread, base }
    }

    /// Standard deviations of the base, where they are those of one of several places.
    pub(super) fn base_sigma(&self, sigma: [f64; 6]) -> [f64; 6] {
        let most = |i: usize| if i < 3 { f64::INFINITY } else { MODES.any_angle };
        std::array::from_fn(|i| sigma[i].max(self.base[i]).min(most(i)))
    }

    /// Joints that may stand at several values are open; how far away the farthest value is, and
    /// how wide a run of values, all as good, spread, radians or metres.
    pub(super) fn add_leaves(&mut self, h: &Hypothesis, leaves: &[JointModes]) {
        let Self { is_open, spread, .. } = self;
        for s in leaves {
            // Any value of the run, each as likely.
            spread[s.joint] = spread[s.joint].max(s.extent / 3.0_f64.sqrt());
        }
        for s in leaves.iter().filter(|s| s.is_several()) {
            is_open[s.joint] = true;
            let value = h.posture[s.joint];
            spread[s.joint] =
                s.values.iter().map(|v| angle::apart(value, *v)).fold(spread[s.joint], f64::max);
        }
    }
}

/// How far apart the bases of two postures stand: shift, metres, and turn, radians, along and about
/// the world's axes; nothing where they differ by no more than a refinement does.
fn base_apart(h: &Hypothesis, other: &Hypothesis) -> [f64; 6] {
    let (a, b) = (&h.local_from_base, &other.local_from_base);
    let shift = b.translation.vector - a.translation.vector;
    let turn = (b.rotation * a.rotation.inverse()).scaled_axis();
    if turn.norm() <= MODES.other_turn {
        return [0.0; 6];
    }
    [shift.x, shift.y, shift.z, turn.x, turn.y, turn.z].map(f64::abs)
}

/// The joints as they are reported; of each, whether it is open, and how far away the farthest of
/// its other values is.
pub(super) fn joints(
    problem: &Problem<'_>,
    h: &Hypothesis,
    covariance: &DMatrix<f64>,
    open: &OpenJoints,
    rivals: &[Rival<'_>],
) -> Vec<JointFit> {
    let (prepared, model) = (problem.prepared, problem.prepared.model);
    // A wrist that may be flipped is not known, however narrow either answer is.
    let is_elsewhere = |j: usize| {
        let differs = |rival: &Rival<'_>| {
            rival.margin < RIVAL && rival.other.hypothesis.turn(h, j) > MODES.other_turn
        };
        !prepared.leaf[j] && rivals.iter().any(differs)
    };
    let joints = (0..h.posture.len()).map(|j| {
        let (value, equivalents) = whole_turns(model, &h.posture, j);
        // The width of one of several values is not how well the joint is known.
        let sigma = sigma_of(covariance, 6 + j).max(open.spread[j]).min(MODES.any_angle);
        JointFit {
            name: model.joints[model.free[j]].name.clone(),
            value,
            sigma,
            certainty: Certainty::of(
                sigma,
                open.is_open[j] || is_elsewhere(j),
                problem.settings.determined_sigma,
            ),
            equivalents,
        }
    });
    joints.collect()
}

/// Postures that explain the points as well: the first few of the rivals, and other values of last
/// joints. Joints that are passed over make no rival another answer.
pub(super) fn equals(
    problem: &Problem<'_>,
    h: &Hypothesis,
    rivals: &[Rival<'_>],
    passed: &[bool],
    several: &[&JointModes],
) -> Vec<Equal> {
    let same = rivals.iter().filter(|rival| {
        let other = &rival.other.hypothesis;
        let mut apart = (0..passed.len()).filter(|&j| other.turn(h, j) > MODES.other_turn);
        let limit = match (apart.next(), apart.next()) {
            (None, _) => return false,
            (Some(j), None) if closes_tool(problem, j) => MODES.slide_equal,
            _ if differs(other, h, passed) => MODES.equal,
            _ => MODES.nearly_equal,
        };
        rival.margin < limit
    });
    let equal = |rival: &Rival<'_>| {
        let posture = rival.other.hypothesis.posture.clone();
        Equal { posture, margin: rival.margin }
    };
    let spun = several.iter().flat_map(|s| {
        s.values[1..].iter().map(|value| {
            let mut posture = h.posture.clone();
            posture[s.joint] = *value;
            Equal { posture, margin: 0.0 }
        })
    });
    same.take(N_EQUALS).map(equal).chain(spun).collect()
}

/// Whether two postures are different answers, some joints passed over.
pub(super) fn differs(a: &Hypothesis, b: &Hypothesis, passed: &[bool]) -> bool {
    let (p, q) = (&a.local_from_base, &b.local_from_base);
    let shift = (p.translation.vector - q.translation.vector).norm();
    shift > MODES.other_base
        || (0..passed.len()).any(|j| !passed[j] && a.turn(b, j) > MODES.other_turn)
}

/// The value of a joint within its limits that is nearest to zero, and the others, where a whole
/// turn changes nothing.
fn whole_turns(model: &Model, posture: &[f64], joint: usize) -> (f64, Vec<f64>) {
    let value = posture[joint];
    let index = model.free[joint];
    let [low, high] = model.limits(joint);
    let followed = model
        .joints
        .iter()
        .any(|j| matches!(j.motion, Motion::Mimic { free, .. } if free == joint));
    let slides = model.joints[index].kind == robot::JointKind::Prismatic;
    if slides || followed {
        return (value, Vec::new());
    }
    // A refinement may have come from beyond a stop: a whole turn away the joint stands within its
    // limits.
    let first = ((low - value) / TAU).ceil() as i32;
    let last = ((high - value) / TAU).floor() as i32;
    let mut all: Vec<f64> = (first..=last).map(|k| value + TAU * f64::from(k)).collect();
    all.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    if all.is_empty() {
        return (value, all);
    }
    let nearest = all.remove(0);
    (nearest, all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::{judged, with_jaw};
    use crate::refine::Refined;
    use geometry::{Pose, Vector};
    use std::f64::consts::FRAC_PI_2;

    #[test]
    fn a_base_that_may_stand_a_quarter_turn_off_is_known_no_better_than_that() {
        with_jaw(|problem, state| {
            let h = &state.hypothesis;
            let about = |base: Pose, turn: f64| {
                let hypothesis =
                    Hypothesis { local_from_base: base, posture: vec![turn, 0.0], ..h.clone() };
                let judgement = judged(problem, &hypothesis);
                Refined { hypothesis, judgement }
            };
            let sure = DMatrix::from_diagonal_element(8, 8, 1e-8);
            let base_sigma = |other: &Refined, margin: f64| {
                let rivals = [Rival { margin, other }];
                let open = OpenJoints::of(problem, &sure, h, &rivals);
                (open.is_open[0], open.base_sigma([1e-4; 6]))
            };
            // The plate stands where it stood: the joint is turned back.
            let quarter = about(Pose::rotation(Vector::x() * FRAC_PI_2), -FRAC_PI_2);
            let (is_open, sigma) = base_sigma(&quarter, 0.0);
            assert!(is_open && (sigma[3] - FRAC_PI_2).abs() < 1e-9, "{sigma:?}");
            assert_eq!([sigma[0], sigma[4], sigma[5]], [1e-4; 3]);
            assert_eq!(base_sigma(&quarter, 0.5), (false, [1e-4; 6]));
            // The same where what it carries differs, too.
            let mut both = quarter.clone();
            both.hypothesis.posture[1] = 0.5;
            let (is_open, sigma) = base_sigma(&both, 0.0);
            assert!(is_open && (sigma[3] - FRAC_PI_2).abs() < 1e-9, "{sigma:?}");
            // A flange that may stand otherwise says nothing of the base.
            let flange = about(Pose::identity(), 1.0);
            assert_eq!(base_sigma(&flange, 0.0), (true, [1e-4; 6]));
        });
    }
}
