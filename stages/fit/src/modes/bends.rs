//! Finds other values of the last joints of an adjusted posture that are worth refining (METHOD.md
//! §9). The joint before the last has many of them where little of the wrist is seen, and what
//! hangs on the flange draws it to some. The slides of a tool fit as well where they stand within a
//! part that the tool holds.

use std::f64::consts::TAU;

use super::profile::JointProfile;
use super::settings::{BendLimits, MODES};
use crate::problem::{Problem, judged};
use crate::refine::Refined;
use crate::state::Hypothesis;

const LIMITS: BendLimits = MODES.bend;

/// Postures with other values of the joint before the last, best first.
pub(crate) fn bends(problem: &Problem<'_>, h: &Hypothesis) -> Vec<Hypothesis> {
    let joint = h.posture.len().checked_sub(2);
    let profile = joint.and_then(|joint| Some((joint, JointProfile::new(problem, h, joint)?)));
    let Some((joint, profile)) = profile else { return Vec::new() };
    let [low, high] = problem.prepared.model.limits(joint);
    let span = (high - low).min(TAU);
    let n = profile.n_values(span);
    let value = |k: usize| low + span * k as f64 / n as f64;
    let costs: Vec<f64> = problem.fan.fan((0..=n).collect(), |k| profile.cost_held(value(k)));
    let least = costs.iter().copied().fold(f64::INFINITY, f64::min);
    let cost = |k: usize| costs.get(k).copied().unwrap_or(f64::INFINITY);
    let is_least = |k: &usize| {
        cost(*k) <= cost(k + 1)
            && cost(*k) <= cost(k.wrapping_sub(1))
            && cost(*k) <= (1.0 + LIMITS.short) * least
    };
    let mut found: Vec<usize> = (0..=n).filter(is_least).collect();
    found.sort_by(|a, b| costs[*a].total_cmp(&costs[*b]));
    let mut values = vec![h.posture[joint]];
    for value in found.into_iter().map(value) {
        if values.len() <= LIMITS.n_values
            && values.iter().all(|v| (v - value).abs() > LIMITS.apart)
        {
            values.push(value);
        }
    }
    values[1..].iter().map(|value| profile.at(*value)).collect()
}

/// Postures with other values of each slide that moves nothing but a tool's part.
pub(crate) fn slides(problem: &Problem<'_>, h: &Hypothesis) -> Vec<Refined> {
    let prepared = problem.prepared;
    let slides = (0..h.posture.len()).filter(|&j| prepared.leaf[j] && prepared.slides(j));
    let others = slides.flat_map(|joint| {
        let [low, high] = prepared.model.limits(joint);
        let n = ((high - low) / LIMITS.slide_step).ceil().clamp(1.0, LIMITS.max_slides);
        let values = (0..=n as usize).map(move |k| low + (high - low) * k as f64 / n);
        let is_other = move |value: &f64| (value - h.posture[joint]).abs() > LIMITS.slide_step;
        values.filter(is_other).map(move |value| {
            let mut other = h.clone();
            other.posture[joint] = value;
            other
        })
    });
    let judge = |hypothesis: Hypothesis| {
        let judgement = judged(problem, &hypothesis);
        Refined { hypothesis, judgement }
    };
    problem.fan.fan(others.collect(), judge)
}
