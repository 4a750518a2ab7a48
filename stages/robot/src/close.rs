//! Builds the closed loops of a model from the sub chains of `robot.toml`, in order of solution.

use crate::closed_loop::{ClosedLoop, Closure, Form};
use crate::finding::Findings;
use crate::kinematics::Placing;
use crate::model::{JointKind, Model, Motion};
use crate::sheet::{LoopWord, SubChain};
use contract::words::count;
use geometry::Vector;

/// Number of values of each free joint at which a loop is tested.
const N_TRIES: u32 = 9;
/// Smallest gap of a loop that is reported, metres: less than a scanner resolves.
const SEEN_GAP: f64 = 1e-4;

/// Builds the loops of all sub chains and adds them to the model.
pub(crate) fn close(
    model: &mut Model,
    sub_chains: &[SubChain],
    findings: &mut Findings,
) -> Option<()> {
    let mut loops = Vec::new();
    let mut words = Vec::new();
    for (at, sub_chain) in sub_chains.iter().enumerate() {
        let place = place(sub_chain);
        let passive: Vec<usize> = (0..model.joints.len())
            .filter(|&j| model.joints[j].motion == Motion::Loop(at))
            .collect();
        let pins = pins(model, sub_chain, &place, findings)?;
        for (passive, closures) in split(model, &passive, pins, &place, findings)? {
            words.push(sub_chain.kind);
            loops.push(ClosedLoop {
                name: sub_chain.name.clone(),
                passive,
                closures,
                form: Form::General,
            });
        }
    }
    for (closed_loop, word) in loops.iter_mut().zip(words) {
        shape(model, closed_loop, word, findings)?;
    }
    model.loops = ordered(model, loops, findings)?;
    for (at, closed_loop) in model.loops.iter().enumerate() {
        for &joint in &closed_loop.passive {
            model.joints[joint].motion = Motion::Loop(at);
        }
    }
    set_modes(model, findings);
    try_range(model, findings);
    Some(())
}

pub(crate) fn place(sub_chain: &SubChain) -> String {
    format!("robot.toml: sub_chain {}", sub_chain.name)
}

fn pins(
    model: &Model,
    sub_chain: &SubChain,
    place: &str,
    findings: &mut Findings,
) -> Option<Vec<Closure>> {
    let mut pins = Vec::new();
    for pin in &sub_chain.closures {
        let mut link = |name: &str| {
            let at = model.link(name);
            if at.is_none() {
                findings.fail(
                    place,
                    format!("a closure names no link \"{name}\""),
                    "correct the name",
                );
            }
            at
        };
        let (link_a, link_b) = (link(&pin.link_a), link(&pin.link_b));
        if pin.xyz_a.iter().chain(&pin.xyz_b).any(|v| !v.is_finite()) {
            findings.fail(place, "a closure's point is not finite", "write metres");
            return None;
        }
        pins.push(Closure {
            link_a: link_a?,
            point_a: pin.xyz_a.into(),
            link_b: link_b?,
            point_b: pin.xyz_b.into(),
        });
    }
    Some(pins)
}

/// Passive joints that lie above one end of a pin, but not above the other.
fn between(model: &Model, passive: &[usize], pin: &Closure) -> Vec<usize> {
    (passive.iter().copied())
        .filter(|&j| model.hangs_on(pin.link_a, j) != model.hangs_on(pin.link_b, j))
        .collect()
}

/// Groups the pins into loops that share no passive joint.
fn split(
    model: &Model,
    passive: &[usize],
    pins: Vec<Closure>,
    place: &str,
    findings: &mut Findings,
) -> Option<Vec<(Vec<usize>, Vec<Closure>)>> {
    let mut parts: Vec<(Vec<usize>, Vec<Closure>)> = Vec::new();
    for pin in pins {
        let mut joints = between(model, passive, &pin);
        if joints.is_empty() {
            findings.fail(
                place,
                "no passive joint lies between the ends of a closure",
                "name the passive joints",
            );
            return None;
        }
        let mut closures = vec![pin];
        let mut at = 0;
        while at < parts.len() {
            if parts[at].0.iter().any(|j| joints.contains(j)) {
                let (more, earlier) = parts.remove(at);
                joints.extend(more);
                closures.splice(0..0, earlier);
                at = 0;
            } else {
                at += 1;
            }
        }
        joints.sort_unstable();
        joints.dedup();
        parts.push((joints, closures));
    }
    for &joint in passive {
        if !parts.iter().any(|(joints, _)| joints.contains(&joint)) {
            let what =
                format!("no closure determines the passive joint \"{}\"", model.joints[joint].name);
            findings.fail(place, what, "add its closure, or leave the joint out of passive");
            return None;
        }
    }
    parts.sort_by_key(|(joints, _)| joints[0]);
    Some(parts)
}

/// Chooses the form of a loop and orders its pin so that side a is that of the first passive joint.
fn shape(
    model: &Model,
    closed_loop: &mut ClosedLoop,
    word: LoopWord,
    findings: &mut Findings,
) -> Option<()> {
    let place = format!("robot.toml: sub_chain {}", closed_loop.name);
    let (n_passive, n_pins) = (closed_loop.passive.len(), closed_loop.closures.len());
    if n_passive > 2 * n_pins {
        let what = format!(
            "{} determine {} joints, but {n_passive} are passive",
            count(n_pins as u64, "pin"),
            2 * n_pins
        );
        findings.fail(&place, what, "leave out of passive what moves by itself or mimics");
        return None;
    }
    let mut found = Form::General;
    if let [pin] = &mut closed_loop.closures[..] {
        if model.hangs_on(pin.link_b, closed_loop.passive[0]) {
            let turned = Closure {
                link_a: pin.link_b,
                point_a: pin.point_b,
                link_b: pin.link_a,
                point_b: pin.point_a,
            };
            *pin = turned;
        }
        found = single(model, &closed_loop.passive, pin);
    }
    let mode = 1.0;
    let fits = match word {
        LoopWord::Auto | LoopWord::General => true,
        LoopWord::Rr => found == Form::Rr,
        LoopWord::Rpr => found == Form::Rpr { mode },
        LoopWord::Rrr => matches!(found, Form::RrrSerial { .. } | Form::RrrBranched { .. }),
    };
    if !fits {
        let what = format!("the passive joints do not make the kind of loop named \"{word:?}\"");
        findings.fail(&place, what, "see stages/robot/README.md, or write kind = \"auto\"");
        return None;
    }
    closed_loop.form = if word == LoopWord::General { Form::General } else { found };
    Some(())
}

/// The closed form that solves a loop with one pin, or the general form.
fn single(model: &Model, passive: &[usize], pin: &Closure) -> Form {
    let placing = Placing::open(model, &vec![0.0; model.free.len()]);
    let turns = |j: usize| placing.turns(j);
    let axis = |j: usize| -> Vector { placing.axis(j).1 };
    let mode = 1.0;
    match *passive {
        [j] if turns(j) => Form::Rr,
        [j, k] if turns(j) => {
            let serial = model.hangs_on(pin.link_a, k) && model.hangs_on(model.joints[k].parent, j);
            let parallel = axis(j).cross(&axis(k)).norm() < 1e-6;
            let square = axis(j).dot(&axis(k)).abs() < 1e-6;
            match (serial, turns(k)) {
                (true, true) if parallel => Form::RrrSerial { mode },
                (true, false) if square => Form::Rpr { mode },
                (false, true) if parallel && model.hangs_on(pin.link_b, k) => {
                    Form::RrrBranched { mode }
                }
                _ => Form::General,
            }
        }
        _ => Form::General,
    }
}

/// Sorts the loops so that those on which others depend come first.
fn ordered(
    model: &Model,
    loops: Vec<ClosedLoop>,
    findings: &mut Findings,
) -> Option<Vec<ClosedLoop>> {
    let needs = |a: &ClosedLoop, b: &ClosedLoop| {
        (a.closures.iter().flat_map(|pin| [pin.link_a, pin.link_b])).any(|link| {
            b.passive.iter().any(|&j| !a.passive.contains(&j) && model.hangs_on(link, j))
        })
    };
    let mut waiting = loops;
    let mut done: Vec<ClosedLoop> = Vec::new();
    while !waiting.is_empty() {
        let ready = (0..waiting.len()).find(|&at| {
            !(0..waiting.len()).any(|other| other != at && needs(&waiting[at], &waiting[other]))
        });
        let Some(at) = ready else {
            let what = "loops depend on one another in a circle";
            findings.fail("robot.toml: sub_chain", what, "write their closures into one sub_chain");
            return None;
        };
        done.push(waiting.remove(at));
    }
    Some(done)
}

fn set_modes(model: &mut Model, findings: &mut Findings) {
    let zero = vec![0.0; model.free.len()];
    for at in 0..model.loops.len() {
        let mut placing = Placing::open(model, &zero);
        for earlier in &model.loops[..at] {
            earlier.solve(&mut placing);
        }
        for &joint in &model.loops[at].passive {
            placing.values[joint] = 0.0;
        }
        let found = model.loops[at].mode_at_zero(&placing);
        if found.is_none() {
            let place = format!("robot.toml: sub_chain {}", model.loops[at].name);
            findings.warn(
                place,
                "is stretched out at the zero posture, so its assembly mode is a guess",
                "",
            );
        }
        let sign = found.unwrap_or(1.0);
        match &mut model.loops[at].form {
            Form::RrrSerial { mode } | Form::RrrBranched { mode } | Form::Rpr { mode } => {
                *mode = sign
            }
            Form::Rr | Form::General => {}
        }
    }
}

/// Moves each free joint over its range, with the others at home, and reports where loops do not
/// close.
fn try_range(model: &Model, findings: &mut Findings) {
    let mut worst = vec![0.0_f64; model.loops.len()];
    let mut beyond = vec![false; model.joints.len()];
    for free in 0..model.free.len() {
        let [lower, upper] = model.limits(free);
        for step in 0..N_TRIES {
            let mut posture = model.home();
            posture[free] = lower + (upper - lower) * f64::from(step) / f64::from(N_TRIES - 1);
            let placing = Placing::closed(model, &posture);
            for (worst, closed_loop) in worst.iter_mut().zip(&model.loops) {
                *worst = worst.max(closed_loop.gap(&placing));
            }
            for &joint in model.loops.iter().flat_map(|l| &l.passive) {
                let value = placing.values[joint];
                // The limits of the driving joint are often rounded: an excess of 1 % is not
                // reported.
                let outside =
                    |[lower, upper]: [f64; 2]| value < lower - 0.01 || value > upper + 0.01;
                beyond[joint] |= model.joints[joint].limits.is_some_and(outside);
            }
        }
    }
    for (worst, closed_loop) in worst.iter().zip(&model.loops) {
        if *worst > SEEN_GAP {
            let place = format!("robot.toml: sub_chain {}", closed_loop.name);
            let what = format!("stays open within the limits, metres \"{worst:.4}\"");
            findings.warn(place, what, "check its points and the limits of its driver");
        }
    }
    for (joint, _) in
        model.joints.iter().zip(&beyond).filter(|(j, b)| **b && j.kind != JointKind::Continuous)
    {
        let what = "the loop takes this joint beyond its limits";
        findings.note(
            format!("joint {}", joint.name),
            what,
            "check the limits, or leave it: they are not enforced",
        );
    }
}
