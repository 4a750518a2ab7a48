//! Compares two results of one plant: which robots moved, appeared, are gone or were exchanged.
//!
//! A difference within the uncertainty of both results is not a change: a joint has moved where its
//! values differ by more than five of their combined standard deviations, and by more than errors
//! of models and registration. Joints that are undetermined in either session are not compared, but
//! named.

use contract::words::{Unit, triple};
use contract::{Fit, Verdict, quote};
use export::{ResultFile, RobotEntry};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;
use std::fmt::Write as _;

/// Distance below which two bases are at the same place, metres: no two feet stand so close
/// together.
const SAME_PLACE: f64 = 0.5;
/// Number of standard deviations from which on a difference is a change: among a plant's hundreds
/// of joints none exceeds it by chance.
const SURE: f64 = 5.0;
/// Least difference of a joint that counts, radians (0.1°) or metres.
const LEAST_JOINT: f64 = 0.001_75;
/// Largest standard deviation of a roughly known joint of a trusted posture, radians (2°), and the
/// least change of such a joint that counts.
const ROUGH: f64 = 0.035;
/// Least shift of a base that counts, metres: sessions are registered to each other within
/// millimetres.
const LEAST_SHIFT: f64 = 0.010;
/// Least turn of a base that counts, radians (0.15°).
const LEAST_TURN: f64 = 0.002_6;

/// Change of one robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum Change {
    /// Base and joints are the same as far as both results determine them.
    Same,
    /// Joints or base have moved.
    Moved,
    /// Another model stands at its place.
    Exchanged {
        /// Name of the earlier model.
        was: String,
    },
    /// The robot is only in the second result.
    Appeared,
    /// The robot is only in the first result.
    Gone,
}

/// A joint in both results.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JointChange {
    /// Name of the joint in the URDF.
    pub joint: String,
    /// Value and standard deviation in the first result, radians or metres.
    pub then: [f64; 2],
    /// Value and standard deviation in the second result, radians or metres.
    pub now: [f64; 2],
    /// Second value less first one, without whole turns, radians or metres.
    pub change: f64,
    /// Whether the difference is a change, beyond the uncertainty of both results.
    pub is_change: bool,
    /// Whether the joint slides: its values are metres.
    pub slides: bool,
}

/// The comparison of one robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RobotChange {
    /// Its id in the first result.
    pub then: Option<String>,
    /// Whether the first result has missed it, though the scans of that session show it.
    pub was_missed: bool,
    /// Its id in the second result.
    pub now: Option<String>,
    /// Its model in the second result, or in the first one if it is gone.
    pub model: String,
    /// Its change.
    pub change: Change,
    /// Shift of its base along the world axes, metres.
    pub base_shift: Option<[f64; 3]>,
    /// Turn of its base, radians.
    pub base_turn: Option<f64>,
    /// Joints that both results determine, and roughly known joints whose difference far exceeds
    /// their uncertainty.
    pub joints: Vec<JointChange>,
    /// Names of joints that are undetermined in one of the results.
    pub not_compared: Vec<String>,
    /// Verdicts in both results.
    pub verdicts: [Option<String>; 2],
}

/// Compares two results: robots of the first result in its order, followed by those that appeared.
/// Refused robots are left out.
#[must_use]
pub fn changes(then: &ResultFile, now: &ResultFile) -> Vec<RobotChange> {
    let standing = |result| -> Vec<&RobotEntry> {
        let ResultFile { robots, .. }: &ResultFile = result;
        robots.iter().filter(|r| r.verdict != Verdict::Refused.word()).collect()
    };
    let (then, now) = (standing(then), standing(now));
    let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
    for (i, a) in then.iter().enumerate() {
        for (j, b) in now.iter().enumerate() {
            let apart = length(shift(a, b));
            if apart < SAME_PLACE {
                pairs.push((apart, i, j));
            }
        }
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut partner = vec![None; then.len()];
    let mut taken = vec![false; now.len()];
    for (_, i, j) in pairs {
        if partner[i].is_none() && !taken[j] {
            (partner[i], taken[j]) = (Some(j), true);
        }
    }
    let known = then.iter().zip(partner).map(|(a, j)| match j {
        Some(j) => compared(a, now[j]),
        None => alone(a, Change::Gone),
    });
    let new = now.iter().zip(&taken).filter(|(_, taken)| !**taken);
    known.chain(new.map(|(b, _)| alone(b, Change::Appeared))).collect()
}

/// Whether a robot has changed or has a better verdict.
pub(crate) fn stands_otherwise(then: &Fit, now: &Fit) -> bool {
    now.verdict > then.verdict || of_fits("", then, now).change != Change::Same
}

/// The comparison of a robot that the first result missed, though its scans show the posture
/// `then`.
pub(crate) fn of_missed(id: &str, then: &Fit, now: &Fit) -> RobotChange {
    RobotChange { then: None, was_missed: true, ..of_fits(id, then, now) }
}

fn of_fits(id: &str, then: &Fit, now: &Fit) -> RobotChange {
    let entry = |fit: &Fit| RobotEntry::new(id, fit, &[], None);
    compared(&entry(then), &entry(now))
}

impl Change {
    /// The change as a word.
    #[must_use]
    pub fn word(&self) -> &'static str {
        match self {
            Self::Same => "same",
            Self::Moved => "moved",
            Self::Exchanged { .. } => "exchanged",
            Self::Appeared => "appeared",
            Self::Gone => "gone",
        }
    }
}

fn alone(robot: &RobotEntry, change: Change) -> RobotChange {
    let (id, verdict) = (Some(robot.id.clone()), Some(robot.verdict.clone()));
    let is_gone = change == Change::Gone;
    RobotChange {
        then: id.clone().filter(|_| is_gone),
        was_missed: false,
        now: id.filter(|_| !is_gone),
        model: robot.model.clone(),
        change,
        base_shift: None,
        base_turn: None,
        joints: Vec::new(),
        not_compared: Vec::new(),
        verdicts: if is_gone { [verdict, None] } else { [None, verdict] },
    }
}

fn compared(a: &RobotEntry, b: &RobotEntry) -> RobotChange {
    let (base_shift, base_turn) = (shift(a, b), turn(a, b));
    let mut out = RobotChange {
        then: Some(a.id.clone()),
        was_missed: false,
        now: Some(b.id.clone()),
        model: b.model.clone(),
        change: Change::Same,
        base_shift: Some(base_shift),
        base_turn: Some(base_turn),
        joints: Vec::new(),
        not_compared: Vec::new(),
        verdicts: [Some(a.verdict.clone()), Some(b.verdict.clone())],
    };
    let may_be = |x: &RobotEntry, y: &RobotEntry| x.model == y.model || x.alike.contains(&y.model);
    if !may_be(a, b) && !may_be(b, a) {
        out.change = Change::Exchanged { was: a.model.clone() };
        return out;
    }
    for (name, _) in &b.joints.0 {
        let slides = b.slides.contains(name);
        match known(a, name).zip(known(b, name)) {
            Some((then, now)) => out.joints.push(joint(name, then, now, slides)),
            None => match rough(a, b, name).map(|[then, now]| joint(name, then, now, slides)) {
                Some(joint) if joint.is_change && joint.change.abs() > ROUGH => {
                    out.joints.push(joint);
                }
                _ => out.not_compared.push(name.clone()),
            },
        }
    }
    let wide =
        |sigmas: [Option<f64>; 3]| sigmas.iter().map(|s| s.unwrap_or(0.0).powi(2)).sum::<f64>();
    let by_shift = SURE * (wide(a.base_sigma.xyz) + wide(b.base_sigma.xyz)).sqrt();
    let by_turn = SURE * (wide(a.base_sigma.rotation) + wide(b.base_sigma.rotation)).sqrt();
    let base_moved =
        length(base_shift) > by_shift.max(LEAST_SHIFT) || base_turn > by_turn.max(LEAST_TURN);
    if base_moved || out.joints.iter().any(|j| j.is_change) {
        out.change = Change::Moved;
    }
    out
}

/// Value and standard deviation of a joint, if the result determines it.
fn known(robot: &RobotEntry, name: &str) -> Option<[f64; 2]> {
    let determined = robot.determined.0.iter().find(|(n, _)| n == name).is_none_or(|(_, d)| *d);
    value(robot, name).filter(|_| determined)
}

/// Values and standard deviations of a turning joint that both trusted postures know roughly.
fn rough(then: &RobotEntry, now: &RobotEntry, name: &str) -> Option<[[f64; 2]; 2]> {
    let is_one = |r: &RobotEntry| {
        r.verdict == Verdict::Trusted.word()
            && !r.slides.iter().any(|joint| joint == name)
            && r.equivalents.0.iter().all(|(joint, _)| joint != name)
    };
    let of = |r| value(r, name).filter(|[_, sigma]| *sigma <= ROUGH && is_one(r));
    Some([of(then)?, of(now)?])
}

/// Value and standard deviation of a joint.
fn value(robot: &RobotEntry, name: &str) -> Option<[f64; 2]> {
    let of = |places: &[(String, f64)]| places.iter().find(|(n, _)| n == name).map(|(_, v)| *v);
    of(&robot.joints.0).zip(of(&robot.sigma.0)).map(|(v, s)| [v, s])
}

fn joint(name: &str, then: [f64; 2], now: [f64; 2], slides: bool) -> JointChange {
    let mut change = now[0] - then[0];
    if !slides {
        change -= (change / TAU).round() * TAU;
    }
    let is_change = change.abs() > (SURE * then[1].hypot(now[1])).max(LEAST_JOINT);
    JointChange { joint: name.into(), then, now, change, is_change, slides }
}

fn shift(a: &RobotEntry, b: &RobotEntry) -> [f64; 3] {
    std::array::from_fn(|i| b.base_pose.xyz[i] - a.base_pose.xyz[i])
}

/// Angle between two bases, radians.
fn turn(a: &RobotEntry, b: &RobotEntry) -> f64 {
    let (p, q) = (a.base_pose.quat_wxyz, b.base_pose.quat_wxyz);
    let dot: f64 = p.iter().zip(q).map(|(x, y)| x * y).sum();
    2.0 * dot.abs().min(1.0).acos()
}

fn length(v: [f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// The changes as text for people: a paragraph for each changed robot, a line for each unchanged
/// one.
#[must_use]
pub fn words(changes: &[RobotChange]) -> String {
    let mut text = String::new();
    for robot in changes {
        let id = |id: &Option<String>| quote::shown(id.as_deref().unwrap_or("-")).into_owned();
        let what = match &robot.change {
            Change::Same => "stands as it stood".into(),
            Change::Moved => "moved".into(),
            Change::Exchanged { was } => format!("stands where {} stood", quote::shown(was)),
            Change::Appeared => "appeared".into(),
            Change::Gone => "is gone".into(),
        };
        let (then, now) = (id(&robot.then), id(&robot.now));
        let what =
            if robot.was_missed { format!("{what} (the earlier result missed it)") } else { what };
        let _ = writeln!(text, "{then} -> {now} {}: {what}", quote::shown(&robot.model));
        if robot.change == Change::Moved {
            let shift = triple(robot.base_shift.unwrap_or_default().map(|v| v * 1e3), 1);
            let turn = Unit::DEGREES.say(robot.base_turn.unwrap_or_default(), 2);
            let _ = writeln!(text, "     base shifted by {shift} mm, turned {turn}");
            for j in robot.joints.iter().filter(|j| j.is_change) {
                let unit = Unit::of(j.slides);
                let [then, now] = [j.then, j.now].map(|[v, sigma]| unit.say_both(v, sigma));
                let _ = writeln!(text, "     {:<24} {then} -> {now}", quote::shown(&j.joint));
            }
        }
        if !robot.not_compared.is_empty() {
            let _ = writeln!(
                text,
                "     not compared: {}",
                quote::shown(&robot.not_compared.join(", "))
            );
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn robot(id: &str, model: &str, x: f64, joint: f64) -> RobotEntry {
        serde_json::from_value(serde_json::json!({
            "id": id, "model": model, "base_link": "base",
            "base_pose": {"xyz": [x, 0.0, 0.0], "quat_wxyz": [1.0, 0.0, 0.0, 0.0]},
            "base_sigma": {"xyz": [1e-4, 1e-4, 1e-4], "rotation": [1e-4, 1e-4, 1e-4]},
            "joints": {"a": joint, "flange": 0.3}, "sigma": {"a": 0.001, "flange": 1.8},
            "determined": {"a": true, "flange": false},
            "links": ["base"], "verdict": "trusted", "score": 0.9
        }))
        .expect("an entry")
    }

    fn result(robots: Vec<RobotEntry>) -> ResultFile {
        serde_json::from_value(serde_json::json!({
            "schema": export::SCHEMA, "version": "0", "robots": robots,
            "labels": {"table": "t", "scans": []}, "inputs": [], "stages": [], "warnings": []
        }))
        .expect("a result")
    }

    #[test]
    fn what_lies_within_sigma_is_no_change() {
        let then = result(vec![
            robot("R1", "m", 0.0, 0.5),
            robot("R2", "m", 3.0, 0.5),
            robot("R3", "m", 6.0, 0.5),
            robot("R4", "m", 9.0, 0.5),
        ]);
        let now = result(vec![
            robot("R1", "m", 0.002, 0.504 + TAU),
            robot("R2", "m", 3.0 - 1e-5, 0.6),
            robot("R3", "other", 6.0, 0.5),
            robot("R4", "m", 12.0, 0.5),
        ]);
        let found = changes(&then, &now);
        let kinds: Vec<_> = found.iter().map(|r| r.change.clone()).collect();
        let was = Change::Exchanged { was: "m".into() };
        assert_eq!(kinds, [Change::Same, Change::Moved, was, Change::Gone, Change::Appeared]);
        assert_eq!(found[0].not_compared, ["flange"]);
        assert!((found[1].joints[0].change - 0.1).abs() < 1e-12);
        assert_eq!((found[3].then.as_deref(), found[4].now.as_deref()), (Some("R4"), Some("R4")));
        let said = words(&found);
        let moved = "R2 -> R2 m: moved\n     base shifted by (0.0, 0.0, 0.0) mm, turned 0.00°\n     \
                     a                        28.648° ± 0.057° -> 34.377° ± 0.057°\n";
        assert!(said.contains(moved), "{said}");
        assert!(changes(&then, &then).iter().all(|r| r.change == Change::Same));
    }

    #[test]
    fn a_base_beyond_registration_has_moved() {
        let then = result(vec![robot("R1", "m", 0.0, 0.5)]);
        let now = result(vec![robot("R1", "m", 0.05, 0.5)]);
        assert_eq!(changes(&then, &now)[0].change, Change::Moved);
    }
    #[test]
    fn a_joint_that_both_know_roughly_tells_a_change_of_many_degrees() {
        let roughly = |flange: f64, sigma: f64, also: &[f64]| {
            let mut robot = robot("R1", "m", 0.0, 0.5);
            robot.joints.0.iter_mut().filter(|j| j.0 == "flange").for_each(|j| j.1 = flange);
            robot.sigma.0.iter_mut().filter(|j| j.0 == "flange").for_each(|j| j.1 = sigma);
            robot.equivalents.0 =
                if also.is_empty() { Vec::new() } else { vec![("flange".into(), also.to_vec())] };
            result(vec![robot])
        };
        let then = roughly(0.3, 0.01, &[]);
        let far = changes(&then, &roughly(0.5, 0.01, &[])).remove(0);
        assert_eq!((far.change, far.not_compared.len()), (Change::Moved, 0));
        for near_or_unsure in
            [roughly(0.33, 0.01, &[]), roughly(0.5, 0.05, &[]), roughly(0.5, 0.01, &[1.5])]
        {
            let same = changes(&then, &near_or_unsure).remove(0);
            assert_eq!((same.change, same.not_compared), (Change::Same, vec!["flange".to_owned()]));
        }
    }
}
