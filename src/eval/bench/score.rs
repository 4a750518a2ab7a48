//! Scores a case: compares what was found in a random cell with the truth, as one row of figures.

use super::cell::{FoundInCell, Start};
use super::condition::DrawnCase;
use super::draw::{DrawnCell, Mount};
use super::labels::LabelScores;
use contract::{Calibration, Error, Fit, Verdict};
use geometry::{Point, Pose, Vector, angle};
use robot::{JointKind, Model, Role};
use serde::Serialize;

/// Distance of bases beyond which a fit is not the true robot, metres.
const SAME_PLACE: f64 = 0.5;
/// Greatest error of a correct joint, radians (0.3°) or metres.
const RIGHT: f64 = 0.005_236;
/// Greatest error of a correct joint that the fit states as undetermined, in its standard
/// deviations.
const RIGHT_SIGMAS: f64 = 4.0;
/// Tolerance of the angles of alternative holes of a flange, radians (2°): they come from sweeps in
/// steps of a degree.
const NEARLY_RIGHT: f64 = 0.035;
/// Standard deviation beyond which a joint counts as open, so that nothing is claimed, radians.
const OPEN: f64 = 0.02;
/// Greatest error of a correct base, metres: three standard deviations of a usual registration.
const RIGHT_BASE: f64 = 0.010;
/// Samples of a link for the displacement of its surface.
const N_SAMPLES: usize = 200;

/// One joint of a row.
#[derive(Debug, Clone, Serialize)]
pub(super) struct JointRow {
    pub(super) name: String,
    pub(super) truth: f64,
    /// Error after the sweep, for the link-by-link method.
    pub(super) rough: Option<f64>,
    /// Error without whole turns, radians or metres.
    pub(super) error: f64,
    pub(super) sigma: f64,
    pub(super) determined: bool,
    /// Whether it slides: error and deviation are metres.
    pub(super) slides: bool,
}

/// One case.
#[derive(Debug, Clone, Default, Serialize)]
pub(super) struct AccuracyRow {
    pub(super) suite: String,
    /// Whether it belongs to a baseline.
    pub(super) is_baseline: bool,
    pub(super) model: String,
    pub(super) seed: u64,
    pub(super) n_scanners: usize,
    pub(super) n_robot_points: usize,
    /// Error message of a failed case.
    pub(super) failed: Option<String>,
    pub(super) found: Option<String>,
    pub(super) verdict: String,
    pub(super) right_model: bool,
    /// Whether model, base and every claimed joint are correct.
    pub(super) right: bool,
    /// Number of reported robots that do not exist.
    pub(super) n_invented: usize,
    /// Their models, verdicts and distances from the true robot's base.
    pub(super) invented: Vec<String>,
    /// Metres, radians.
    pub(super) base: [f64; 2],
    pub(super) joints: Vec<JointRow>,
    /// Error of the tip in the base's frame, in the world, and the stated σ of the former, metres.
    pub(super) tip: [f64; 3],
    /// Displacement of the surface in the base's frame: mean and 95th percentile, metres.
    pub(super) surface: [f64; 2],
    /// Largest turn and shift of a sub link in the base's frame, radians and metres; zero without
    /// such links.
    pub(super) sub: [f64; 2],
    /// Gap of its closed loops, metres.
    pub(super) loop_gap: f64,
    /// Of the refinement alone: how far its starts were off, degrees, how many there were, and how
    /// many came home.
    pub(super) perturbed_deg: f64,
    pub(super) n_starts: usize,
    pub(super) n_home: usize,
    pub(super) score: f64,
    pub(super) rms: f64,
    pub(super) margin: Option<f64>,
    pub(super) reasons: Vec<String>,
    pub(super) seconds: f64,
    /// Scores of its labels.
    pub(super) labels: Option<LabelScores>,
    /// Found and true joint axes, where calibration was requested.
    #[serde(skip)]
    pub(super) calibration: Option<(Calibration, Vec<Pose>)>,
}

impl AccuracyRow {
    fn new(case: &DrawnCase, model: &Model) -> Self {
        Self {
            model: model.name.clone(),
            suite: case.suite.into(),
            is_baseline: case.is_baseline(),
            seed: case.seed,
            n_scanners: case.condition.n_scanners,
            ..Self::default()
        }
    }

    /// A case that could not be done.
    pub(super) fn failed(case: &DrawnCase, model: &Model, error: &Error, seconds: f64) -> Self {
        Self { failed: Some(error.to_string()), seconds, ..Self::new(case, model) }
    }

    /// Largest error of the joints said to be determined, radians.
    pub(super) fn worst(&self) -> f64 {
        self.turning().map(|j| j.error.abs()).fold(0.0, f64::max)
    }

    pub(super) fn determined(&self) -> impl Iterator<Item = &JointRow> {
        self.joints.iter().filter(|j| j.determined)
    }

    /// Those of them that turn.
    pub(super) fn turning(&self) -> impl Iterator<Item = &JointRow> {
        self.determined().filter(|j| !j.slides)
    }

    /// The refinement alone: which starts came home, to the truth or to where the start at the
    /// truth itself ended: a few points on a small wrist pull it off. What a wrist of round
    /// parts leaves open does not count.
    fn with_ends(
        mut self,
        case: &DrawnCase,
        model: &Model,
        drawn: &DrawnCell,
        found: &FoundInCell,
    ) -> Self {
        let n = model.free.len();
        let Some(((_, from_truth), ends)) = found.ends.split_first() else { return self };
        let home = |(_, posture): &&Start| {
            let near = |j: usize, other: &[f64]| angle::apart(posture[j], other[j]) < RIGHT;
            (0..n.saturating_sub(1)).all(|j| near(j, &drawn.posture) || near(j, from_truth))
        };
        self.perturbed_deg = case.condition.perturbed_deg;
        self.n_starts = ends.len();
        self.n_home = ends.iter().filter(home).count();
        self
    }

    /// One line for people who watch the bench.
    pub(super) fn line(&self) -> String {
        let what = match (&self.failed, &self.found) {
            (Some(why), _) => format!("failed: {why}"),
            _ if self.n_starts > 0 => format!(
                "{} of {} starts, each joint off by up to {}°, come home",
                self.n_home, self.n_starts, self.perturbed_deg
            ),
            (None, None) => "not found".into(),
            (None, Some(model)) => format!(
                "{}{}{}, worst determined joint {:.3}°, base {:.2} mm, tip {:.2} mm, {:.1} s{}",
                if self.right { "right, " } else { "WRONG, " },
                self.verdict,
                if self.right_model { String::new() } else { format!(" as {model}") },
                self.worst().to_degrees(),
                self.base[0] * 1e3,
                self.tip[0] * 1e3,
                self.seconds,
                self.reasons.first().map_or_else(String::new, |r| format!(" ({r})")),
            ),
        };
        let invented = if self.invented.is_empty() {
            String::new()
        } else {
            format!("; invented: {}", self.invented.join(", "))
        };
        format!("{} {} {}: {what}{invented}", self.suite, self.model, self.seed)
    }
}

/// The figures of a case.
pub(super) fn score(
    case: &DrawnCase,
    models: &[Model],
    mount: Option<&Mount>,
    drawn: &DrawnCell,
    found: &FoundInCell,
) -> AccuracyRow {
    let model = &models[case.model];
    let base = drawn.world_from_base.translation.vector;
    let apart = |f: &Fit| (f.world_from_base.translation.vector - base).norm();
    let here = found
        .fits
        .iter()
        .filter(|f| f.verdict != Verdict::Refused && apart(f) < SAME_PLACE)
        .min_by(|a, b| apart(a).total_cmp(&apart(b)));
    let is_other =
        |f: &&Fit| here.is_none_or(|h| !std::ptr::eq(*f, h)) && !is_beside(f, model, drawn);
    let others: Vec<&Fit> = found.fits.iter().filter(is_other).collect();
    let mut row = AccuracyRow {
        n_robot_points: found.n_robot_points,
        n_invented: others.len(),
        seconds: found.seconds,
        ..AccuracyRow::new(case, model)
    };
    row.invented = others
        .into_iter()
        .map(|f| format!("{} {}, {:.2} m away", f.verdict.word(), f.model_name, apart(f)))
        .collect();
    if !found.ends.is_empty() {
        return row.with_ends(case, model, drawn, found);
    }
    let index = found.fits.iter().position(|f| here.is_some_and(|fit| std::ptr::eq(f, fit)));
    row.labels = LabelScores::of(found, index, model.links.len());
    let Some(fit) = here else { return row };
    row.found = Some(fit.model_name.clone());
    row.verdict = fit.verdict.word().into();
    row.right_model = fit.model_name == model.name || fit.alike.contains(&model.name);
    row.base = [apart(fit), fit.world_from_base.rotation.angle_to(&drawn.world_from_base.rotation)];
    row.score = fit.score;
    row.rms = fit.rms;
    row.margin = fit.runner_up.as_ref().map(|r| r.margin);
    row.reasons = fit.reasons.clone();
    row.calibration = calibration(case, models, drawn, fit);
    if fit.model_name == model.name && fit.joints.len() == model.free.len() {
        row.joints = joints(model, fit, &drawn.posture, mount);
        displacements(&mut row, model, fit, drawn);
        sub_links(&mut row, model, fit, drawn);
    }
    let tool = mount.map(|m| models[m.tool].name.as_str());
    row.right = row.right_model
        && fit.tool.as_ref().map(|t| t.model.as_str()) == tool
        && row.base[0] < RIGHT_BASE
        && (0..row.joints.len()).all(|j| {
            is_right(&row.joints[j], j, fit)
                || mount.is_some_and(|m| bolted_elsewhere(m, j, fit, &drawn.posture))
        });
    row
}

/// Found and true joint axes of a fit, each relative to the model, where calibration was requested.
fn calibration(
    case: &DrawnCase,
    models: &[Model],
    drawn: &DrawnCell,
    fit: &Fit,
) -> Option<(Calibration, Vec<Pose>)> {
    let (model, found) = (&models[case.model], fit.calibration.as_ref()?);
    let real = drawn.models(models, case).swap_remove(case.model);
    let moved =
        |&j: &usize| model.joints[j].parent_from_joint.inverse() * real.joints[j].parent_from_joint;
    Some((found.clone(), model.free.iter().map(moved).collect()))
}

/// Whether a fit belongs to the other robot of a cell, which is not scored.
fn is_beside(fit: &Fit, model: &Model, drawn: &DrawnCell) -> bool {
    let apart = |base: Vector| (fit.world_from_base.translation.vector - base).norm();
    fit.model_name == model.name && drawn.beside.is_some_and(|base| apart(base) < SAME_PLACE)
}

/// The hole that a tool is bolted to and the arm's last joint are one turn: only their sum is
/// compared.
fn joints(model: &Model, fit: &Fit, posture: &[f64], mount: Option<&Mount>) -> Vec<JointRow> {
    let bolted = fit.tool.as_ref().map_or(0.0, |t| t.mount);
    let turned =
        |j: usize| mount.filter(|m| m.n_arm == j + 1).map_or(0.0, |m| m.way * (bolted - m.turn));
    let each = fit.joints.iter().zip(posture).enumerate().map(|(j, (joint, truth))| {
        let slides = model.joints[model.free[j]].kind == JointKind::Prismatic;
        let whole = |e: f64| if slides { e } else { angle::from_to(0.0, e) };
        let error = joint.value - truth + turned(j);
        JointRow {
            rough: fit.rough.get(j).map(|v| whole(v - truth)),
            name: joint.name.clone(),
            truth: *truth,
            error: whole(error),
            sigma: joint.sigma,
            // The source's method does not say; its table has all joints.
            determined: joint.is_determined() || !fit.rough.is_empty(),
            slides,
        }
    });
    each.collect()
}

/// Whether the tool hangs as it should with another of the holes that are said to be as good.
fn bolted_elsewhere(mount: &Mount, joint: usize, fit: &Fit, posture: &[f64]) -> bool {
    let Some(tool) = fit.tool.as_ref().filter(|_| mount.n_arm == joint + 1) else { return false };
    let error = |[hole, value]: &[f64; 2]| value - posture[joint] + mount.way * (hole - mount.turn);
    tool.alike.iter().map(error).any(|e| angle::apart(e, 0.0) < NEARLY_RIGHT)
}

/// Whether the claim about a joint is true.
fn is_right(joint: &JointRow, index: usize, fit: &Fit) -> bool {
    let near = |e: f64| angle::apart(e, 0.0) < RIGHT;
    if near(joint.error) {
        return true;
    }
    if joint.determined {
        return false;
    }
    joint.sigma >= OPEN
        || joint.error.abs() < RIGHT_SIGMAS * joint.sigma
        || fit.equals.iter().any(|e| near(joint.error + e.posture[index] - fit.joints[index].value))
}

/// Errors of the links that follow through loops.
fn sub_links(row: &mut AccuracyRow, model: &Model, fit: &Fit, drawn: &DrawnCell) {
    let fitted: Vec<f64> = fit.joints.iter().map(|j| j.value).collect();
    row.loop_gap = model.loop_gap(&fitted);
    let (ours, theirs) = (
        model.with_other_branches(&fit.other_branches).poses(&fitted),
        model.with_other_branches(&drawn.other_branches).poses(&drawn.posture),
    );
    for (l, _) in model.links.iter().enumerate().filter(|(_, link)| link.role == Role::Sub) {
        let shift = (ours[l].translation.vector - theirs[l].translation.vector).norm();
        let turn = ours[l].rotation.angle_to(&theirs[l].rotation);
        row.sub = [row.sub[0].max(turn), row.sub[1].max(shift)];
    }
}

/// Errors of the tip and of all surfaces.
fn displacements(row: &mut AccuracyRow, model: &Model, fit: &Fit, drawn: &DrawnCell) {
    let fitted: Vec<f64> = fit.joints.iter().map(|j| j.value).collect();
    let (ours, theirs) = (model.poses(&fitted), model.poses(&drawn.posture));
    if let Some(tip) = model.main_chain.last().map(|&j| model.joints[j].child) {
        let (a, b) = (
            Point::from(ours[tip].translation.vector),
            Point::from(theirs[tip].translation.vector),
        );
        let world = (fit.world_from_base * a - drawn.world_from_base * b).norm();
        row.tip = [(a - b).norm(), world, fit.tip_sigma];
    }
    let mut all: Vec<f64> = Vec::new();
    // Of a flange that may stand at several values nothing is claimed.
    let open: Vec<bool> = fit.joints.iter().map(|j| j.sigma >= OPEN).collect();
    let twists = model.kinematics(&fitted).twists;
    for (l, link) in model.links.iter().enumerate() {
        let moves = |j: usize| twists[l][j].iter().any(|v| v.abs() > 1e-9);
        if (0..open.len()).any(|j| open[j] && moves(j)) {
            continue;
        }
        all.extend(link.cad.points.iter().take(N_SAMPLES).map(|p| {
            let p = Point::from(p.map(f64::from));
            (ours[l] * p - theirs[l] * p).norm()
        }));
    }
    all.sort_by(f64::total_cmp);
    if !all.is_empty() {
        row.surface = [all.iter().sum::<f64>() / all.len() as f64, all[all.len() * 95 / 100]];
    }
}
