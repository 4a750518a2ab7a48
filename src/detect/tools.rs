//! Finds tools on the flanges of fitted arms. A fit with a tool refers to a model of arm and tool,
//! which is added to the models.

use super::search::{PreparedLibrary, Search};
use crate::engine::{AllThreads, Engine, Task};
use contract::{Certainty, Fit, JointFit, Mounted, Result, Verdict};
use fit::{ArmWithTool, MeasuredScene, Prepared, Settings, Tooled};
use robot::Model;
use std::f64::consts::{FRAC_PI_4, FRAC_PI_6, TAU};

/// Steps of the turn of a tool about its flange, radians (30° and 45°): bolt circles have 4, 6, 8
/// or 12 holes.
const MOUNTS: [f64; 2] = [FRAC_PI_6, FRAC_PI_4];
/// Most alternative holes that a message names.
const MAX_NAMED: usize = 3;
/// Fewest points on a tool: fewer could lie on the corner of any part.
const MIN_POINTS: usize = 80;

/// Gives each fit whose loops have another solution than the library's model a model of its own.
pub(crate) fn branch(mut fits: Vec<Fit>, models: &mut Vec<Model>) -> Vec<Fit> {
    for fit in &mut fits {
        if !fit.other_branches.is_empty() {
            models.push(models[fit.model].with_other_branches(&fit.other_branches));
            fit.model = models.len() - 1;
        }
        fit.stays = branch(std::mem::take(&mut fit.stays), models);
    }
    fits
}

/// Replaces fits of arms that have a tool by fits of arm and tool, whose models are appended to
/// `models`.
pub(crate) fn attach_tools(
    fits: Vec<Fit>,
    models: &mut Vec<Model>,
    search: &Search<'_, '_>,
    engine: &Engine,
) -> Result<Vec<Fit>> {
    let fits = branch(fits, models);
    let known: &[Model] = models;
    if !known.iter().any(Model::is_tool) {
        return Ok(fits);
    }
    let attached = engine.fan_out(Task::new("tools").large(), fits, |fit| {
        if !tells_tools(&fit) {
            return Ok((fit, None));
        }
        let arm = &known[fit.model];
        let find = || {
            let attached = search.with_scene(&fit, |scene, settings| {
                attach_one(&fit, arm, known, search.library(), scene, settings)
            })?;
            Ok(attached.flatten())
        };
        let attached = search.get_or_compute(&format!("tool of {fit:?}"), find)?;
        Ok(with_tool_model(fit, arm, attached, known))
    })?;
    Ok(take_models(attached, models))
}

/// Finds the tool of a fit in one scene; returns the fit, and its model where that is not one of
/// `models`.
pub(crate) fn attach_tools_in(
    scene: &MeasuredScene<'_>,
    fit: Fit,
    models: &[Model],
    library: &PreparedLibrary<'_>,
    settings: &Settings,
) -> (Fit, Option<Model>) {
    let has_other = !fit.other_branches.is_empty();
    let branched = has_other.then(|| models[fit.model].with_other_branches(&fit.other_branches));
    let arm = branched.as_ref().unwrap_or(&models[fit.model]);
    let attach = || attach_one(&fit, arm, models, library, scene, settings);
    let attached = tells_tools(&fit).then(attach).flatten();
    let (fit, tooled) = with_tool_model(fit, arm, attached, models);
    (fit, tooled.or(branched))
}

/// Whether tools are searched: for a robot that moved, the scans of one posture may show too little
/// of a tool.
fn tells_tools(fit: &Fit) -> bool {
    fit.verdict != Verdict::Refused && fit.stands_in.is_empty()
}

/// The fit with the tool that was found, and the model of arm and tool.
fn with_tool_model(
    fit: Fit,
    arm: &Model,
    attached: Option<WithTool>,
    models: &[Model],
) -> (Fit, Option<Model>) {
    let Some((together, [tool, flange], mount)) = attached else { return (fit, None) };
    (together, Some(arm.with_tool(&models[tool], flange, mount)))
}

/// A fit of arm and tool; the indices of the tool in the library and of the link that carries it;
/// and the turn of the tool about the flange, radians.
type WithTool = (Fit, [usize; 2], f64);

/// Appends the models that fits bring along to `models`, and returns the fits with indices into it.
pub(crate) fn take_models(fits: Vec<(Fit, Option<Model>)>, models: &mut Vec<Model>) -> Vec<Fit> {
    let own = |(mut fit, model): (Fit, Option<Model>)| {
        if let Some(model) = model {
            fit.model = models.len();
            models.push(model);
        }
        fit
    };
    fits.into_iter().map(own).collect()
}

/// Finds the tool that explains most points on the flanges of one arm, if there is one.
fn attach_one(
    fit: &Fit,
    arm: &Model,
    models: &[Model],
    library: &PreparedLibrary<'_>,
    scene: &MeasuredScene<'_>,
    settings: &Settings,
) -> Option<WithTool> {
    // A model with other loops has the links of the library's model with the same name.
    let bare = models.iter().position(|m| m.name == arm.name).unwrap_or(fit.model);
    let bare = library.prepared(bare);
    let n_arm = arm.free.len();
    let ([tool, flange], mut start) = best_tool(fit, arm, models, library, bare, scene, settings)?;
    let both = arm.with_tool(&models[tool], flange, 0.0);
    let prepared = Prepared::joined(&[bare, library.prepared(tool)], fit.model, &both);
    let holes = holes();
    let way = arm.mount(flange).1;
    let turns: Vec<f64> = holes.iter().map(|mount| way * mount).collect();
    let tooled = with_arm(&prepared, arm);
    let bolts = fit::bolt(&start, tooled, &turns, scene, settings, &AllThreads);
    // Where the points do not tell the hole, the first one is assumed and the last joint absorbs
    // the turn.
    let bolt = bolts.iter().find(|b| b.hole == 0).or(bolts.first());
    let mount = bolt.map_or(0.0, |bolt| {
        start.posture[n_arm - 1] = bolt.value;
        holes[bolt.hole]
    });
    let both = arm.with_tool(&models[tool], flange, mount);
    let prepared = Prepared::joined(&[bare, library.prepared(tool)], fit.model, &both);
    let tooled = with_arm(&prepared, arm);
    let mut together = fit::fit_tool(&start, tooled, scene, settings, &AllThreads);
    let own = together.links.get(arm.links.len()..).unwrap_or_default();
    let n_points: usize = own.iter().map(|link| link.n_points).sum();
    if n_points < MIN_POINTS
        || together.verdict == Verdict::Refused
        || together.verdict < fit.verdict
    {
        return None;
    }
    let others = bolts.iter().filter(|b| holes[b.hole] != mount);
    let alike: Vec<[f64; 2]> = others.map(|b| [holes[b.hole], b.value]).collect();
    fit::verdict::note(&mut together, in_words(&alike));
    widen(&mut together.joints[n_arm - 1], &alike);
    together.tool = Some(Mounted {
        model: models[tool].name.clone(),
        link: arm.links[flange].name.clone(),
        mount,
        alike,
    });
    together.runner_up = fit.runner_up.clone();
    together.other_branches = fit.other_branches.clone();
    together.alike = fit.alike.clone();
    Some((together, [tool, flange], mount))
}

/// The tool that explains most points on one of the arm's flanges, if there is one: its index, the
/// flange's link, and its pose. `bare` is the arm.
fn best_tool(
    fit: &Fit,
    arm: &Model,
    models: &[Model],
    library: &PreparedLibrary<'_>,
    bare: &Prepared<'_>,
    scene: &MeasuredScene<'_>,
    settings: &Settings,
) -> Option<([usize; 2], Tooled)> {
    let mut best: Option<([usize; 2], Tooled)> = None;
    for flange in arm.flanges() {
        for tool in (0..models.len()).filter(|&i| models[i].is_tool()) {
            let both = arm.with_tool(&models[tool], flange, 0.0);
            let prepared = Prepared::joined(&[bare, library.prepared(tool)], fit.model, &both);
            let tooled = with_arm(&prepared, arm);
            let found = fit::try_tool(fit, tooled, scene, settings, &AllThreads);
            let better = |f: &Tooled| best.as_ref().is_none_or(|(_, b)| f.explained > b.explained);
            if let Some(found) = found.filter(better) {
                best = Some(([tool, flange], found));
            }
        }
    }
    best
}

/// An arm with its tool, and how many of its joints and links are the arm's.
fn with_arm<'a>(prepared: &'a Prepared<'a>, arm: &Model) -> ArmWithTool<'a> {
    ArmWithTool { prepared, n_joints: arm.free.len(), n_links: arm.links.len() }
}

/// Widens the last joint by its values at alternative holes, radians: the pose of the tool is
/// known, but not how it divides into hole and joint.
fn widen(last: &mut JointFit, alike: &[[f64; 2]]) {
    let apart = alike.iter().map(|[_, value]| geometry::angle::apart(*value, last.value));
    let spread = apart.fold(0.0, f64::max);
    if !alike.is_empty() {
        last.certainty = Certainty::Undetermined;
    }
    last.sigma = last.sigma.max(spread);
}

/// Message for a tool that fits equally at several holes.
fn in_words(alike: &[[f64; 2]]) -> Option<String> {
    let mut holes: Vec<f64> = alike.iter().map(|a| a[0].to_degrees()).collect();
    holes.sort_by(f64::total_cmp);
    holes.dedup();
    let named: Vec<String> = holes.iter().take(MAX_NAMED).map(|deg| format!("{deg:.0}°")).collect();
    let more = if holes.len() > MAX_NAMED { ", …" } else { "" };
    (!named.is_empty()).then(|| {
        let named = named.join(", ");
        format!("the tool may also be bolted on at {named}{more}, with the last joint turned back")
    })
}

/// All turns of a tool about its flange, 0 first, radians.
fn holes() -> Vec<f64> {
    let all = MOUNTS.iter().flat_map(|step| {
        let n = (TAU / step).round() as usize;
        (0..n).map(move |k| k as f64 * step)
    });
    let mut all: Vec<f64> = all.collect();
    all.sort_by(f64::total_cmp);
    all.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
    all
}
