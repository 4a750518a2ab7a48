//! Evidence of a fit in; verdict and reasons in words out (METHOD.md §15).

use contract::words::{Unit, count};
use contract::{Certainty, Fit, JointFit, Verdict};
use robot::{JointKind, Model, Motion, Role};

use crate::adjust::Adjusted;
use crate::judge::Judgement;
use crate::turns;
use crate::weak::weak;
use crate::{Prepared, Scene};

/// Share of seen-through samples on one link up to which a fit may be trusted, and from which it is
/// refused.
const LINK_VIOLATION: (f64, f64) = (0.06, 0.30);
/// Share of seen-through samples over all links, likewise.
const VIOLATION: (f64, f64) = (0.03, 0.15);
/// Score below which a fit is not trusted, and below which it is refused.
const SCORE: (f64, f64) = (0.60, 0.35);
/// Residual, in multiples of the scans' noise and metres beyond, from which a surface fits too
/// poorly to be trusted.
const POOR_RMS: (f64, f64) = (2.0, 0.0015);
/// Score below which a surface that fits too poorly is refused: furniture has room for a small arm
/// that is nowhere quite right.
const POOR_SCORE: f64 = 0.52;
/// Residual of points that fill the gate of the adjustment evenly, metres: of things that are near
/// the model, not on it.
const ANYTHING_RMS: f64 = 0.0072;
/// Residual, in multiples of the scans' noise and metres beyond, from which a fit that leaves half
/// of its joints open is lost: a post, a bench and a hose have room for a smooth small arm. What it
/// found there had 4.7 mm and more at a noise of 2 mm; of 3648 right fits five left so much open,
/// and had 2.6 mm at most there, 7.6 mm at one of 10 mm.
const OPEN_RMS: (f64, f64) = (1.25, 0.002);
/// Noise of a scanner from which on more of it is no excuse there, metres: in a corridor scanned
/// with 9 mm, walls and cabinets had room for four small arms, 9.5 to 11.6 mm off.
const OPEN_NOISE: f64 = 0.005;
/// Standard deviation up to which a joint counts as known for that, radians or metres.
const KNOWN_SIGMA: f64 = contract::UNDETERMINED_SIGMA;
/// Smallest share of the surface that must have been judged.
const SEEN: f64 = 0.12;
/// Share of the joints that are known at most where so little of a surface was seen that it may be
/// anything: of the suites' right robots none had so little; a corner of a shelf had, of sixty
/// models.
const LITTLE_KNOWN: f64 = 0.25;
/// Share of a link's surface that beams must have judged for what they went through to count.
const MIN_SEEN: f64 = 0.02;
/// Fewest points on a robot: the least of which one was ever right had a thousand.
const ROBOT_POINTS: usize = 100;
/// Fewest points on the links that a joint moves.
const JOINT_POINTS: usize = 30;
/// Play of a stop: a degree for joints that turn, a millimetre for those that slide.
const STOP_PLAY: (f64, f64) = (0.0175, 0.001);
/// Standard deviation from which on the values that are named are but some of those that a joint
/// may have, radians (30°).
const ANYWHERE: f64 = 0.52;
/// Most values of a joint that are named.
const MAX_VALUES: usize = 3;
/// A runner-up that the beams prefer less clearly than this makes the best doubtful.
pub(crate) const RIVAL: f64 = 0.12;

/// What speaks against a fit, in words.
#[derive(Default)]
struct Reasons {
    refusals: Vec<String>,
    doubts: Vec<String>,
    /// Make nobody doubt it.
    notes: Vec<String>,
}

impl Reasons {
    /// Adds one to the refusals, or else to the doubts, where it is one.
    fn grade(&mut self, refuse: bool, doubt: bool, say: impl Fn() -> String) {
        if refuse {
            self.refusals.push(say());
        } else if doubt {
            self.doubts.push(say());
        }
    }
}

/// Sets verdict and reasons from what stands in the fit and the judgement; `held` are standard
/// deviations of the joints as the scatter of the points has them, radians or metres, where those
/// of the fit hold more.
pub(crate) fn pass(
    fit: &mut Fit,
    prepared: &Prepared<'_>,
    scene: &Scene<'_>,
    (judgement, held): (&Judgement, Option<&[f64]>),
) {
    let mut reasons = Reasons::default();
    let own: Vec<f64> = (0..fit.joints.len()).map(|j| own_sigma(fit, j)).collect();
    of_surface(&mut reasons, (fit, held.unwrap_or(&own)), prepared, scene, judgement);
    of_joints(&mut reasons, fit, prepared, scene);
    let rival = fit.runner_up.as_ref().is_some_and(|rival| rival.margin < RIVAL);
    if rival {
        reasons.doubts.push("another posture explains the points nearly as well".into());
    }
    let Reasons { refusals, doubts, notes } = reasons;
    fit.verdict = match (refusals.is_empty(), doubts.is_empty()) {
        (false, _) => Verdict::Refused,
        (true, false) => Verdict::Doubtful,
        (true, true) => Verdict::Trusted,
    };
    fit.reasons = refusals;
    fit.reasons.extend(doubts);
    fit.reasons.extend(notes);
}

/// What score, beams and residual say of the surface.
fn of_surface(
    reasons: &mut Reasons,
    (fit, held): (&Fit, &[f64]),
    prepared: &Prepared<'_>,
    scene: &Scene<'_>,
    judgement: &Judgement,
) {
    reasons.grade(judgement.score < SCORE.1, judgement.score < SCORE.0, || {
        format!("score {:.2}", judgement.score)
    });
    let v = judgement.violation;
    reasons.grade(v > VIOLATION.1, v > VIOLATION.0, || {
        format!("beams went through {:.0} % of the judged surface", v * 100.0)
    });
    for (l, link) in fit.links.iter().enumerate().filter(|(_, link)| link.seen > MIN_SEEN) {
        let (v, is_aside) = (link.violated, is_aside(prepared.model, l));
        let refuses = v > LINK_VIOLATION.1 && is_held(held, prepared, l) && !is_aside;
        reasons.grade(refuses, v > LINK_VIOLATION.0, || {
            let loops = if is_aside { ": a loop that the model lacks may move it" } else { "" };
            format!("beams went through {:.0} % of link '{}'{loops}", v * 100.0, link.name)
        });
    }
    let n_points: usize = fit.links.iter().map(|l| l.n_points).sum();
    reasons.grade(n_points < ROBOT_POINTS, false, || {
        format!("only {} on it", count(n_points as u64, "point"))
    });
    let n_known = held.iter().filter(|sigma| **sigma < KNOWN_SIGMA).count();
    let is_little = judgement.seen < SEEN;
    let is_anything = is_little && n_known as f64 <= LITTLE_KNOWN * fit.joints.len() as f64;
    reasons.grade(is_anything, is_little, || {
        let seen = judgement.seen * 100.0;
        format!("only {seen:.0} % of the surface was seen")
    });
    let off = Off::new((fit.rms, Noise::of(scene)), [n_known, fit.joints.len()]);
    let words = || {
        format!(
            "its points lie {:.0} mm off its surface, where the scans' noise is {:.0} mm",
            fit.rms * 1e3,
            scene.noise * 1e3
        )
    };
    let is_wrong = off.is_anything || off.is_poor && judgement.score < POOR_SCORE;
    reasons.grade(is_wrong, off.is_poor, words);
    if !scene.evidence.has_beams() {
        reasons.doubts.push("no scanner position is known, so nothing proves free space".into());
    }
}

/// Whether the joint that places a link and the one before it are known; else the link may well
/// stand elsewhere, and the rest of the arm where it was found. A last joint does not count: at
/// each of its values a flange is about where it is.
fn is_held(sigmas: &[f64], prepared: &Prepared<'_>, link: usize) -> bool {
    let n = sigmas.len();
    let placed = (0..n).find(|&j| prepared.placed_by[j].contains(&link));
    placed.is_none_or(|own| {
        let mut near = (own.saturating_sub(1)..=own).filter(|j| j + 1 < n);
        near.all(|j| sigmas[j] < KNOWN_SIGMA)
    })
}

/// Whether a link hangs beside the chain, fixed or a multiple of a joint: rods and cylinders of
/// closed loops, as models have them that do not describe the loop. Where such a one stands says
/// nothing against the arm.
fn is_aside(model: &Model, link: usize) -> bool {
    let Some(j) = model.links[link].parent_joint else { return false };
    let is_simplified = matches!(model.joints[j].motion, Motion::Fixed | Motion::Mimic { .. });
    let carries = |&c: &usize| model.joints[c].child == link;
    is_simplified
        && model.links[link].role != Role::Effector
        && !model.main_chain.iter().any(carries)
}

/// What points, limits and the joints' standard deviations say of the posture.
fn of_joints(reasons: &mut Reasons, fit: &Fit, prepared: &Prepared<'_>, scene: &Scene<'_>) {
    let Reasons { doubts, notes, .. } = &mut *reasons;
    for (j, joint) in fit.joints.iter().enumerate() {
        let n: usize = prepared.carried(j).into_iter().map(|l| fit.links[l].n_points).sum();
        if n < JOINT_POINTS && j + 1 < fit.joints.len() {
            let points = count(n as u64, "point");
            doubts.push(format!("only {points} on what joint '{}' moves", joint.name));
        } else if j + 1 < fit.joints.len() && own_sigma(fit, j) > KNOWN_SIGMA {
            let sigma = Unit::of(prepared.slides(j)).deviation(own_sigma(fit, j));
            doubts.push(format!("joint '{}' is undetermined (± {sigma})", joint.name));
        } else if !joint.is_determined() {
            notes.push(not_determined(fit, j, prepared.slides(j)));
        }
    }
    for (j, joint) in fit.joints.iter().enumerate() {
        // A joint that hardly anything but its stop holds may stand far beyond it.
        let is_open = prepared.slides(j) || j + 1 == fit.joints.len();
        let least = match (joint.is_determined(), is_open) {
            (true, _) => 3.0 * joint.sigma,
            (false, false) => 0.0,
            (false, true) => continue,
        };
        if beyond(prepared, j, joint.value) > least {
            doubts.push(format!("joint '{}' stands beyond its limit", joint.name));
        }
    }
    // A robot that is a hundredth smaller than its model leaves all of them open, each by half a
    // degree.
    if !fit.joints.iter().any(JointFit::is_determined) {
        doubts.push("the points determine none of its joints closely".into());
    }
    let [n_known, n_but_last] = n_known(fit);
    reasons.grade(
        is_scanned(scene) && leaves_most_open([n_but_last, fit.joints.len()]),
        2 * n_known <= fit.joints.len(),
        || format!("{n_known} of {} known", count(fit.joints.len() as u64, "joint")),
    );
    let turning: Vec<usize> = (0..fit.joints.len()).filter(|&j| !prepared.slides(j)).collect();
    reasons.notes.extend(weak(fit, &turning));
}

/// How many joints are known, and how many but the last: a flange may stand anyhow.
fn n_known(fit: &Fit) -> [usize; 2] {
    let is_known = |joint: &JointFit| joint.sigma < KNOWN_SIGMA;
    let n_last = fit.joints.last().map_or(0, |last| usize::from(is_known(last)));
    let n = fit.joints.iter().filter(|joint| is_known(joint)).count();
    [n, n - n_last]
}

/// Whether so few joints but the last are known of so many that it may be anything flat: on walls
/// and jigs stood seven smooth small arms, of whose six or seven joints two were known at most; of
/// 5488 right fits none had so few. A camera sees half of an arm, and bends that: of it no more can
/// be asked.
fn leaves_most_open([n_but_last, n_joints]: [usize; 2]) -> bool {
    2 * n_but_last + 1 < n_joints
}

/// Whether what was measured are beams of scanners, which bend nothing.
fn is_scanned(scene: &Scene<'_>) -> bool {
    scene.evidence.has_beams() && !scene.has_camera()
}

/// Standard deviation of a joint by the covariance alone, radians or metres: a symmetric tool that
/// may stand at several values stands the same at all of them, and only what moves it counts.
fn own_sigma(fit: &Fit, j: usize) -> f64 {
    let n = 6 + fit.joints.len();
    fit.covariance.get((6 + j) * (n + 1)).map_or(fit.joints[j].sigma, |v| v.max(0.0).sqrt())
}

/// Noise of the scans, metres.
#[derive(Clone, Copy)]
struct Noise {
    all: f64,
    /// What of it excuses a robot that leaves its joints open.
    least: f64,
}

impl Noise {
    fn of(scene: &Scene<'_>) -> Self {
        let least = if scene.has_camera() { scene.noise } else { scene.noise.min(OPEN_NOISE) };
        Self { all: scene.noise, least }
    }
}

/// How far the points are off a surface.
struct Off {
    /// Too far for it to be trusted.
    is_poor: bool,
    /// So far that it may be anything.
    is_anything: bool,
}

impl Off {
    /// Of an RMS distance, metres, where the scans have so much noise; so many of the joints are
    /// known.
    fn new((rms, noise): (f64, Noise), [n_known, n_joints]: [usize; 2]) -> Self {
        // A surface that fits badly and leaves the posture open may be anything, too.
        let is_open = 2 * n_known <= n_joints && rms > OPEN_RMS.0 * noise.least + OPEN_RMS.1;
        Self {
            is_poor: rms > POOR_RMS.0 * noise.all + POOR_RMS.1,
            is_anything: is_open || rms > ANYTHING_RMS.max(1.5 * noise.all),
        }
    }
}

/// Whether what was adjusted is sure to be refused, whatever its wrist: its points are near the
/// model, not on it.
pub(crate) fn is_lost(best: &Adjusted, scene: &Scene<'_>) -> bool {
    let n_joints = best.hypothesis.posture.len();
    let is_known = |j: &usize| best.covariance[(6 + j, 6 + j)] < KNOWN_SIGMA * KNOWN_SIGMA;
    let n_known = (0..n_joints).filter(is_known).count();
    Off::new((best.rms(), Noise::of(scene)), [n_known, n_joints]).is_anything
}

/// Whether nothing that was measured speaks against a fit: if it is doubtful, then because too
/// little of it was seen.
#[must_use]
pub fn is_uncontradicted(fit: &Fit, scene: &Scene<'_>) -> bool {
    let is_pierced =
        |l: &contract::LinkEvidence| l.seen > MIN_SEEN && l.violated > LINK_VIOLATION.0;
    fit.verdict != Verdict::Refused
        && fit.score >= SCORE.0
        && fit.rms <= POOR_RMS.0 * scene.noise + POOR_RMS.1
        && !fit.links.iter().any(is_pierced)
}

/// How far a joint stands beyond what its limit and the play of its stop allow, radians or metres.
fn beyond(prepared: &Prepared<'_>, j: usize, value: f64) -> f64 {
    let joint = &prepared.model.joints[prepared.model.free[j]];
    let play = match joint.kind {
        JointKind::Prismatic => STOP_PLAY.1,
        JointKind::Continuous => return 0.0,
        _ => STOP_PLAY.0,
    };
    let [low, high] = prepared.model.limits(j);
    (low - value).max(value - high) - play
}

/// What is said of a joint that is not determined: its standard deviation always, and other values
/// that it may have.
fn not_determined(fit: &Fit, j: usize, slides: bool) -> String {
    let (joint, unit) = (&fit.joints[j], Unit::of(slides));
    let apart = |a: f64, b: f64| turns::apart(a, b) > KNOWN_SIGMA;
    let mut values: Vec<f64> = Vec::new();
    for value in fit.equals.iter().map(|e| e.posture[j]).filter(|v| apart(*v, joint.value)) {
        if values.len() < MAX_VALUES && values.iter().all(|v| apart(*v, value)) {
            values.push(value);
        }
    }
    let others: Vec<String> = values.iter().map(|v| unit.say(*v, 1)).collect();
    let others = others.join(", ");
    let why = match joint.certainty {
        _ if !values.is_empty() && !slides && joint.sigma > ANYWHERE => {
            format!(": it may as well stand at {others} or elsewhere")
        }
        _ if !values.is_empty() => format!(": it may as well stand at {others}"),
        // Its standard deviation is that of one of several answers.
        Certainty::Undetermined if joint.sigma < KNOWN_SIGMA => {
            ": another posture explains the points nearly as well".into()
        }
        _ => String::new(),
    };
    let (name, word, sigma) = (&joint.name, joint.certainty.word(), unit.deviation(joint.sigma));
    format!("joint '{name}' is {word} (± {sigma}){why}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rod_that_a_model_has_fixed_beside_its_arm_does_not_speak_against_the_arm() {
        let link = |name: &str| {
            format!(
                "<link name='{name}'><visual><geometry><box size='0.2 0.1 0.1'/></geometry></visual></link>"
            )
        };
        let joint = |name: &str, kind: &str, [parent, child]: [&str; 2]| {
            format!(
                "<joint name='{name}' type='{kind}'><parent link='{parent}'/><child link='{child}'/><axis xyz='0 0 1'/>\
                 <limit lower='-3' upper='3' effort='1' velocity='1'/></joint>"
            )
        };
        let links: String = ["foot", "trunk", "arm", "rod"].map(link).concat();
        let joints = [
            joint("a", "revolute", ["foot", "trunk"]),
            joint("b", "revolute", ["trunk", "arm"]),
            joint("c", "fixed", ["trunk", "rod"]),
        ];
        let urdf = format!("<robot name='rods'>{links}{}</robot>", joints.concat());
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("rods.urdf");
        std::fs::write(&path, urdf).expect("is written");
        let model = Model::load_urdf(&path, "rods", &robot::Settings::default()).expect("loads").0;
        let aside = model.links.iter().enumerate().filter(|(l, _)| is_aside(&model, *l));
        let names: Vec<&str> = aside.map(|(_, link)| link.name.as_str()).collect();
        assert_eq!(names, ["rod"]);
    }

    #[test]
    fn what_leaves_most_joints_but_the_last_open_may_be_anything_flat() {
        let joint = |sigma: f64| JointFit { sigma, ..JointFit::default() };
        let known = |sigmas: &[f64]| {
            n_known(&Fit { joints: sigmas.iter().copied().map(joint).collect(), ..Fit::default() })
        };
        assert_eq!(known(&[0.1, 0.01, 0.01, 0.1, 1.8, 0.001]), [3, 2]);
        assert_eq!(known(&[0.001, 0.01, 1.8]), [2, 2]);
        assert!(leaves_most_open([2, 6]) && !leaves_most_open([3, 6]));
        assert!(leaves_most_open([2, 7]) && !leaves_most_open([3, 7]));
        // A turntable that looks the same all around is all last joint.
        assert!(!leaves_most_open([0, 1]));
    }

    #[test]
    fn what_lies_beside_its_points_and_leaves_half_of_its_joints_open_may_be_anything() {
        let off = |rms: f64, n_known: usize| {
            Off::new((rms, Noise { all: 0.002, least: 0.002 }), [n_known, 6])
        };
        assert!(off(0.0055, 3).is_anything && !off(0.0055, 4).is_anything);
        assert!(!off(0.003, 0).is_anything && !off(0.003, 6).is_poor);
        assert!(off(0.006, 6).is_poor && off(0.008, 6).is_anything);
    }

    #[test]
    fn what_is_said_of_a_joint_has_its_deviation_and_the_word_that_fits_it() {
        let joint = |value: f64, sigma: f64, certainty| JointFit {
            name: "a".into(),
            value: value.to_radians(),
            sigma: sigma.to_radians(),
            certainty,
            ..JointFit::default()
        };
        let said = |joint: JointFit, others: &[f64]| {
            let equal = |v: &f64| contract::Equal { posture: vec![v.to_radians()], margin: 0.0 };
            let equals = others.iter().map(equal).collect();
            not_determined(&Fit { joints: vec![joint], equals, ..Fit::default() }, 0, false)
        };
        let (coarse, open) = (Certainty::Coarse, Certainty::Undetermined);
        assert_eq!(said(joint(57.483, 0.06, coarse), &[]), "joint 'a' is coarse (± 0.060°)");
        assert_eq!(said(joint(5.0, 12.0, open), &[]), "joint 'a' is undetermined (± 12.0°)");
        assert_eq!(
            said(joint(5.0, 104.0, open), &[65.0, 125.0]),
            "joint 'a' is undetermined (± 104.0°): it may as well stand at 65.0°, 125.0° or elsewhere"
        );
        assert_eq!(
            said(joint(5.0, 0.02, open), &[]),
            "joint 'a' is undetermined (± 0.020°): another posture explains the points nearly as well"
        );
    }
}
