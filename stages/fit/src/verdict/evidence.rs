//! Collects the numbers and properties of a fit that the rules of the verdict ask for, from the
//! fit, its judgement by the beams, and the scene.

use contract::words::{Unit, count};
use contract::{Fit, JointFit};
use robot::{JointKind, Model, Motion, Role};

use super::rule::{Answers, Property, Quantity, Subject};
use super::thresholds::{KNOWN_SIGMA, MOST_EXCUSED_NOISE, STOP_PLAY};
use super::words;
use crate::adjust::Adjusted;
use crate::modes::trade_off;
use crate::problem::Judgement;
use crate::{MeasuredScene, Prepared};

/// What a fit is judged by, besides its own values.
#[derive(Clone, Copy)]
pub(crate) struct JudgedFit<'a> {
    /// The model.
    pub(crate) prepared: &'a Prepared<'a>,
    /// What was measured.
    pub(crate) scene: &'a MeasuredScene<'a>,
    /// What the beams say of the fitted posture.
    pub(crate) judgement: &'a Judgement,
    /// Standard deviations of the joints by the scatter of the points, radians or metres, where
    /// those of the fit's covariance hold more.
    pub(crate) held: Option<&'a [f64]>,
}

/// All that the rules ask for.
#[derive(Debug, Clone, Default)]
pub(super) struct FitEvidence {
    /// Share explained less 1.5 × share contradicted, of the judged surface.
    score: f64,
    /// Share of the judged surface that beams went through, 0..1.
    violation: f64,
    /// Share of the surface that could be judged, 0..1.
    seen: f64,
    n_points: usize,
    /// RMS distance of the points from the surface, metres.
    rms: f64,
    noise: SceneNoise,
    /// Joints that the scatter of the points leaves known.
    held: JointShare,
    /// Joints that are known with all that may widen their deviations.
    known: JointShare,
    /// Known joints without the last joint.
    known_but_last: JointShare,
    determined: JointShare,
    /// Margin of the best over another posture; infinite where there is no other.
    margin: f64,
    has_scanners: bool,
    /// Whether scanners measured everything, and depth cameras nothing.
    is_only_scanners: bool,
    /// What is said of unknowns that trade off.
    trade_off: Option<String>,
    links: Vec<LinkSeen>,
    joints: Vec<JointKnown>,
}

/// A number of joints, and the number of all that are asked about.
#[derive(Debug, Clone, Copy, Default)]
struct JointShare {
    n: usize,
    of: usize,
}

impl JointShare {
    fn of_all(n: usize, of: usize) -> Self {
        Self { n, of }
    }

    /// 0..1; `of_none` where there are no joints.
    fn share(self, of_none: f64) -> f64 {
        if self.of == 0 { of_none } else { self.n as f64 / self.of as f64 }
    }
}

/// Noise of the scans, metres.
#[derive(Debug, Clone, Copy, Default)]
struct SceneNoise {
    all: f64,
    /// What of it excuses a robot that leaves its joints open: all of a depth camera's.
    excused: f64,
}

impl SceneNoise {
    fn of(scene: &MeasuredScene<'_>) -> Self {
        let all = scene.noise;
        Self { all, excused: if scene.has_camera() { all } else { all.min(MOST_EXCUSED_NOISE) } }
    }
}

/// What is asked of a link.
#[derive(Debug, Clone, Default)]
struct LinkSeen {
    name: String,
    /// Share of its surface that could be judged, 0..1.
    seen: f64,
    /// Share of that which beams went through, 0..1.
    violation: f64,
    is_aside: bool,
    is_held: bool,
}

/// What is asked of a joint; values in radians or metres.
#[derive(Debug, Clone, Default)]
struct JointKnown {
    name: String,
    slides: bool,
    is_last: bool,
    is_determined: bool,
    /// The word for it in `result.json`.
    certainty: &'static str,
    sigma: f64,
    /// Standard deviation by the covariance alone.
    own_sigma: f64,
    /// How far the joint stands beyond its limit and the play of its stop; below 0 within them.
    beyond_limit: f64,
    /// Points on the links that it moves.
    n_points: usize,
    /// Where else it may stand, in words.
    elsewhere: String,
}

impl FitEvidence {
    /// The evidence of a fit whose values are known, and whose verdict is not.
    pub(super) fn of(fit: &Fit, judged: &JudgedFit<'_>) -> Self {
        let JudgedFit { prepared, scene, judgement, held } = judged;
        let n = fit.joints.len();
        let own: Vec<f64> = (0..n).map(|j| own_sigma(fit, j)).collect();
        let held = held.unwrap_or(&own);
        let [known, known_but_last] = n_known(fit);
        let n_determined = fit.joints.iter().filter(|joint| joint.is_determined()).count();
        let turning: Vec<usize> = (0..n).filter(|&j| !prepared.slides(j)).collect();
        let has_scanners = scene.evidence.has_beams();
        Self {
            score: judgement.score,
            violation: judgement.violation,
            seen: judgement.seen,
            n_points: fit.links.iter().map(|link| link.n_points).sum(),
            rms: fit.rms,
            noise: SceneNoise::of(scene),
            held: JointShare::of_all(held.iter().filter(|s| **s < KNOWN_SIGMA).count(), n),
            known: JointShare::of_all(known, n),
            known_but_last: JointShare::of_all(known_but_last, n.saturating_sub(1)),
            determined: JointShare::of_all(n_determined, n),
            margin: fit.runner_up.as_ref().map_or(f64::INFINITY, |rival| rival.margin),
            has_scanners,
            is_only_scanners: has_scanners && !scene.has_camera(),
            trade_off: trade_off(fit, &turning),
            links: (0..fit.links.len()).map(|l| LinkSeen::of(fit, l, prepared, held)).collect(),
            joints: (0..n).map(|j| JointKnown::of(fit, j, prepared)).collect(),
        }
    }

    /// The evidence that an adjustment gives before the fit is reported.
    pub(super) fn before_report(best: &Adjusted, scene: &MeasuredScene<'_>) -> Self {
        let n = best.hypothesis.posture.len();
        let is_known = |j: &usize| best.covariance[(6 + j, 6 + j)] < KNOWN_SIGMA * KNOWN_SIGMA;
        let held = JointShare::of_all((0..n).filter(is_known).count(), n);
        Self { rms: best.rms(), noise: SceneNoise::of(scene), held, ..Self::default() }
    }

    /// The evidence of a reported fit on how well its surface agrees with what was measured.
    pub(super) fn of_surface(fit: &Fit, scene: &MeasuredScene<'_>) -> Self {
        let link = |link: &contract::LinkEvidence| LinkSeen {
            seen: link.seen,
            violation: link.violated,
            ..LinkSeen::default()
        };
        Self {
            score: fit.score,
            rms: fit.rms,
            noise: SceneNoise::of(scene),
            links: fit.links.iter().map(link).collect(),
            ..Self::default()
        }
    }

    /// How many links or joints a rule asks about; one where it asks about the robot.
    pub(super) fn n_subjects(&self, subject: Subject) -> usize {
        match subject {
            Subject::Robot => 1,
            Subject::EachLink => self.links.len(),
            Subject::EachJoint => self.joints.len(),
        }
    }

    /// The answers about one of them.
    pub(super) fn about(&self, at: usize) -> SubjectEvidence<'_> {
        SubjectEvidence { fit: self, at }
    }
}

impl LinkSeen {
    fn of(fit: &Fit, l: usize, prepared: &Prepared<'_>, held: &[f64]) -> Self {
        let link = &fit.links[l];
        Self {
            name: link.name.clone(),
            seen: link.seen,
            violation: link.violated,
            is_aside: is_aside(prepared.model, l),
            is_held: is_held(held, prepared, l),
        }
    }
}

impl JointKnown {
    fn of(fit: &Fit, j: usize, prepared: &Prepared<'_>) -> Self {
        let (joint, slides) = (&fit.joints[j], prepared.slides(j));
        Self {
            name: joint.name.clone(),
            slides,
            is_last: j + 1 == fit.joints.len(),
            is_determined: joint.is_determined(),
            certainty: joint.certainty.word(),
            sigma: joint.sigma,
            own_sigma: own_sigma(fit, j),
            beyond_limit: beyond_limit(prepared, j, joint.value),
            n_points: prepared.carried(j).into_iter().map(|l| fit.links[l].n_points).sum(),
            elsewhere: words::elsewhere(fit, j, slides),
        }
    }

    fn deviation(&self, sigma: f64) -> String {
        Unit::of(self.slides).deviation(sigma)
    }
}

/// The evidence about the robot, or about one of its links or joints.
pub(super) struct SubjectEvidence<'a> {
    fit: &'a FitEvidence,
    at: usize,
}

impl SubjectEvidence<'_> {
    fn link(&self) -> &LinkSeen {
        &self.fit.links[self.at]
    }

    fn joint(&self) -> &JointKnown {
        &self.fit.joints[self.at]
    }
}

impl Answers for SubjectEvidence<'_> {
    fn number(&self, quantity: Quantity) -> f64 {
        let fit = self.fit;
        match quantity {
            Quantity::Score => fit.score,
            Quantity::Violation => fit.violation,
            Quantity::Seen => fit.seen,
            Quantity::Points => fit.n_points as f64,
            Quantity::Rms => fit.rms,
            Quantity::Noise => fit.noise.all,
            Quantity::ExcusedNoise => fit.noise.excused,
            Quantity::HeldJoints => fit.held.share(0.0),
            Quantity::KnownJoints => fit.known.share(0.0),
            // A turntable that looks the same all around is all last joint, and leaves none open.
            Quantity::KnownButLast => fit.known_but_last.share(1.0),
            Quantity::DeterminedJoints => fit.determined.share(0.0),
            Quantity::Margin => fit.margin,
            Quantity::LinkSeen => self.link().seen,
            Quantity::LinkViolation => self.link().violation,
            Quantity::JointPoints => self.joint().n_points as f64,
            Quantity::JointSigma => self.joint().sigma,
            Quantity::JointOwnSigma => self.joint().own_sigma,
            Quantity::BeyondLimit => self.joint().beyond_limit,
            // Of events only.
            Quantity::AgreeingScans | Quantity::OtherExplained => f64::NAN,
        }
    }

    fn is(&self, property: Property) -> bool {
        match property {
            Property::LinkAside => self.link().is_aside,
            Property::LinkHeld => self.link().is_held,
            Property::LastJoint => self.joint().is_last,
            Property::SlidingJoint => self.joint().slides,
            Property::DeterminedJoint => self.joint().is_determined,
            Property::KnownScanners => self.fit.has_scanners,
            Property::OnlyScanners => self.fit.is_only_scanners,
            Property::TradeOff => self.fit.trade_off.is_some(),
        }
    }

    fn word(&self, name: &str) -> Option<String> {
        let fit = self.fit;
        let share = |share: f64| format!("{:.0} %", share * 100.0);
        let length = |metres: f64| format!("{:.0} mm", metres * 1e3);
        Some(match name {
            "score" => format!("{:.2}", fit.score),
            "violation" => share(fit.violation),
            "seen" => share(fit.seen),
            "points" => count(fit.n_points as u64, "point"),
            "rms" => length(fit.rms),
            "noise" => length(fit.noise.all),
            "known_joints" => format!("{} of {}", fit.known.n, count(fit.known.of as u64, "joint")),
            "trade_off" => fit.trade_off.clone()?,
            "link" => self.link().name.clone(),
            "link_violation" => share(self.link().violation),
            "joint" => self.joint().name.clone(),
            "joint_points" => count(self.joint().n_points as u64, "point"),
            "own_sigma" => self.joint().deviation(self.joint().own_sigma),
            "sigma" => self.joint().deviation(self.joint().sigma),
            "certainty" => self.joint().certainty.to_owned(),
            "elsewhere" => self.joint().elsewhere.clone(),
            _ => return None,
        })
    }
}

/// How many joints are known, and how many of those are not the last.
fn n_known(fit: &Fit) -> [usize; 2] {
    let is_known = |joint: &JointFit| joint.sigma < KNOWN_SIGMA;
    let n_last = fit.joints.last().map_or(0, |last| usize::from(is_known(last)));
    let n = fit.joints.iter().filter(|joint| is_known(joint)).count();
    [n, n - n_last]
}

/// Standard deviation of a joint by the covariance alone, radians or metres: a symmetric tool that
/// may stand at several values stands the same at all of them, and only what moves it counts.
fn own_sigma(fit: &Fit, j: usize) -> f64 {
    let n = 6 + fit.joints.len();
    fit.covariance.get((6 + j) * (n + 1)).map_or(fit.joints[j].sigma, |v| v.max(0.0).sqrt())
}

/// Whether the joint that places a link and the one before it are known, the last joint of the
/// robot aside.
fn is_held(sigmas: &[f64], prepared: &Prepared<'_>, link: usize) -> bool {
    let n = sigmas.len();
    let placed = (0..n).find(|&j| prepared.placed_by[j].contains(&link));
    placed.is_none_or(|own| {
        let mut near = (own.saturating_sub(1)..=own).filter(|j| j + 1 < n);
        near.all(|j| sigmas[j] < KNOWN_SIGMA)
    })
}

/// Whether a link hangs beside the chain, fixed or a multiple of a joint: rods and cylinders of
/// closed loops, as models have them that do not describe the loop.
fn is_aside(model: &Model, link: usize) -> bool {
    let Some(j) = model.links[link].parent_joint else { return false };
    let is_simplified = matches!(model.joints[j].motion, Motion::Fixed | Motion::Mimic { .. });
    let carries = |&c: &usize| model.joints[c].child == link;
    is_simplified
        && model.links[link].role != Role::Effector
        && !model.main_chain.iter().any(carries)
}

/// How far a joint stands beyond its limit and the play of its stop, radians or metres.
fn beyond_limit(prepared: &Prepared<'_>, j: usize, value: f64) -> f64 {
    let joint = &prepared.model.joints[prepared.model.free[j]];
    let play = match joint.kind {
        JointKind::Prismatic => STOP_PLAY.sliding,
        JointKind::Continuous => return 0.0,
        _ => STOP_PLAY.turning,
    };
    let [low, high] = prepared.model.limits(j);
    (low - value).max(value - high) - play
}

#[cfg(test)]
mod tests;
