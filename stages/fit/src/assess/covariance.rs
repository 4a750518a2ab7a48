//! The covariance that is reported: widened by what the parabola of an adjustment misses, in the
//! axes that are asked for, and carried to the tip; and what the points say of the scans' errors
//! (METHOD.md §14, §18).

use contract::{ScanShare, ScanShift};
use geometry::{Pose, Vector};
use nalgebra::{DMatrix, DVector};
use robot::Model;

use crate::adjust::Adjusted;
use crate::modes::{JointModes, PostureModes, coupled_spread, marginal_spread};
use crate::problem::Problem;

/// Adds to the covariance of the joints what their valleys, others that may stand elsewhere and the
/// wrist leave open.
pub(super) fn widen(
    problem: &Problem<'_>,
    answer: &PostureModes,
    several: &[&JointModes],
    in_base: &mut DMatrix<f64>,
) {
    let best = &answer.best.adjusted;
    let n = best.hypothesis.posture.len();
    let mut of_joints = in_base.view_mut((6, 6), (n, n));
    of_joints += coupled_spread(problem, best, several, &answer.points);
    let marginal = marginal_spread(problem, best, &answer.points);
    marginal.into_iter().enumerate().for_each(|(j, variance)| of_joints[(j, j)] += variance);
    if let Some(wrist) = &answer.wrist {
        let at = (wrist.joint, wrist.joint);
        of_joints[at] = of_joints[at].max(wrist.variance());
    }
}

/// Standard deviation of an entry of the covariance: metres or radians.
pub(super) fn sigma_of(covariance: &DMatrix<f64>, i: usize) -> f64 {
    covariance[(i, i)].max(0.0).sqrt()
}

/// Standard deviation of the tip of the main chain in the base's frame, metres.
pub(crate) fn tip_sigma(model: &Model, posture: &[f64], covariance: &DMatrix<f64>) -> f64 {
    let Some(link) = model.main_chain.last().map(|&j| model.joints[j].child) else { return 0.0 };
    let kinematics = model.kinematics(posture);
    let tip = kinematics.base_from_link[link].translation.vector;
    let n = posture.len();
    let mut moves = DMatrix::zeros(3, n);
    for (j, t) in kinematics.twists[link].iter().enumerate() {
        let v = Vector::new(t[0], t[1], t[2]) + Vector::new(t[3], t[4], t[5]).cross(&tip);
        moves.set_column(j, &DVector::from_column_slice(v.as_slice()));
    }
    let joints = covariance.view((6, 6), (n, n));
    (&moves * joints * moves.transpose()).trace().max(0.0).sqrt()
}

/// The covariance with the base's twist turned from base axes to world axes.
pub(super) fn in_world_axes(covariance: &DMatrix<f64>, local_from_base: &Pose) -> DMatrix<f64> {
    let turn = world_from_base(covariance.nrows(), local_from_base);
    &turn * covariance * turn.transpose()
}

/// Turns a base twist, with joints behind it, from base axes to world axes.
fn world_from_base(n: usize, local_from_base: &Pose) -> DMatrix<f64> {
    let turn = local_from_base.rotation.to_rotation_matrix();
    let mut out = DMatrix::identity(n, n);
    for block in [0, 3] {
        out.fixed_view_mut::<3, 3>(block, block).copy_from(turn.matrix());
    }
    out
}

/// What each scan is off, where a scanner is known.
pub(super) fn scans(problem: &Problem<'_>, best: &Adjusted) -> Vec<ScanShift> {
    let views = problem.scene.views.iter().zip(&best.scans);
    let base = best.hypothesis.local_from_base.translation.vector;
    views
        .filter_map(|(view, error)| {
            let scanner = view.scanner?.coords;
            Some(ScanShift {
                scan: view.scan,
                shift: (error.shift + error.turn.cross(&(base - scanner))).into(),
                turn: error.turn.into(),
                range_bias: error.bias,
            })
        })
        .collect()
}

/// The same for others that these scans see.
pub(super) fn share(problem: &Problem<'_>, best: &Adjusted) -> Option<ScanShare> {
    let views = &problem.scene.views;
    let [gain, information] = best.shared.as_ref()?;
    let is_known = views.iter().all(|view| view.scanner.is_some());
    let turn = world_from_base(gain.nrows(), &best.hypothesis.local_from_base);
    is_known.then(|| ScanShare {
        scans: views.iter().map(|view| view.scan).collect(),
        errors: best.scans.iter().flat_map(|error| error.values()).collect(),
        information: information.transpose().as_slice().to_vec(),
        gain: (turn * gain).transpose().as_slice().to_vec(),
    })
}
