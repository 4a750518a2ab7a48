//! Whether a tool hangs on a fitted arm, how its joints stand, and the fit of both together
//! (METHOD.md §13).

mod bolts;

use contract::{Fan, Fit};
use geometry::{Point, Pose};
use std::f64::consts::TAU;

pub use bolts::Bolt;

use crate::correspond::{MIN_POINTS, distances, worsening};
use crate::judge::{Judgement, judge};
use crate::problem::Problem;
use crate::refine::{Refined, polish};
use crate::scene::Nearby;
use crate::search::BeamSearch;
use crate::solve::{finish, settle};
use crate::state::Hypothesis;
use crate::turns;
use crate::{Prepared, Scene, Settings};

/// Score of the tool's links from which on it is there: tools that are there have 0.69 and more,
/// others that are taken for them up to 0.67.
const MIN_SCORE: f64 = 0.62;
/// Share of the tool's surface that must have been judged: of tools that are there it was 0.4 and
/// more.
const MIN_SEEN: f64 = 0.20;
/// Tolerance of the judgement, metres: an arm's flange is known to a millimetre.
const FLANGE_TOLERANCE: f64 = 0.012;
/// Share that points on nothing may have of those about the tool that are not the arm's: with tools
/// that are there it is a few hundredths, more where they hold something; with other grippers that
/// are taken for them, half and more.
const MAX_STRANGE: f64 = 0.3;
/// How far about the tool points are looked at for that, metres.
const ABOUT: f64 = 0.02;
/// A point farther than this from a surface is not on it, metres; where the scans are noisy, than
/// so many standard deviations of their noise.
const STRANGE: f32 = 0.008;
const STRANGE_SIGMAS: f32 = 4.0;
/// Hypotheses of the tool's joints that are judged.
const N_JUDGED: usize = 5;

/// A tool that explains what hangs on a flange.
#[derive(Debug, Clone, PartialEq)]
pub struct Tooled {
    /// World from base.
    pub world_from_base: Pose,
    /// Posture of arm and tool.
    pub posture: Vec<f64>,
    /// Surface of the tool explained less 1.5 × contradicted, m²: compares tools.
    pub explained: f64,
}

/// Where the tool stands if it is there. `tooled` is the arm with it, of which the first so many
/// joints and links are the arm's; the arm stays as it was fitted, but for its last joint, which a
/// bare flange may not tell.
#[must_use]
pub fn try_tool(
    fit: &Fit,
    (tooled, [n_joints, n_links]): (&Prepared<'_>, [usize; 2]),
    scene: &Scene<'_>,
    settings: &Settings,
    fan: &dyn Fan,
) -> Option<Tooled> {
    let start = start(fit, tooled, scene);
    let first = n_joints.checked_sub(1)?;
    let nearby = nearby(&start, tooled, scene);
    let problem = Problem::new(tooled, scene, settings, fan).with_points(&nearby);
    let search = BeamSearch::new(&problem).fitted();
    // A round flange and the gripper's round body do not tell how it is turned: its fingers do.
    let has_joints = tooled.placed_by.len() > n_joints;
    let found = match has_joints {
        true => search.resume(search.every(&start, first), n_joints),
        false => search.resume(vec![start], first),
    };
    let judged = found.into_iter().take(N_JUDGED).filter_map(|h| {
        let judgement = judge(tooled, scene, settings, &h, FLANGE_TOLERANCE);
        let [explained, judged, whole] = of_tool(tooled, n_links, &judgement);
        let is_there = judged > MIN_SEEN * whole && explained > MIN_SCORE * judged;
        (is_there && has_own_points(&problem, &h, n_links)).then_some((explained, h))
    });
    let (explained, best) = judged.max_by(|a, b| a.0.total_cmp(&b.0))?;
    let world_from_base = scene.world_from_local() * best.local_from_base;
    Some(Tooled { world_from_base, posture: best.posture, explained })
}

/// Which holes the tool may be bolted to, given as turns about the arm's last joint `flange`,
/// radians: all that explain the points as well as the best, best first.
#[must_use]
pub fn bolt(
    start: &Tooled,
    (tooled, flange): (&Prepared<'_>, usize),
    holes: &[f64],
    scene: &Scene<'_>,
    settings: &Settings,
    fan: &dyn Fan,
) -> Vec<Bolt> {
    let start = scene.hypothesis(&start.world_from_base, start.posture.clone());
    let nearby = nearby(&start, tooled, scene);
    let problem = Problem::new(tooled, scene, settings, fan).with_points(&nearby);
    let Refined { hypothesis, .. } = polish(&problem, &start);
    bolts::bolts(&problem, &hypothesis, flange, holes)
}

/// The fit of arm and tool together from such a start; `flange` is the arm's last joint.
#[must_use]
pub fn fit_tool(
    start: &Tooled,
    (tooled, flange): (&Prepared<'_>, usize),
    scene: &Scene<'_>,
    settings: &Settings,
    fan: &dyn Fan,
) -> Fit {
    let start = scene.hypothesis(&start.world_from_base, start.posture.clone());
    let nearby = nearby(&start, tooled, scene);
    let problem = Problem::new(tooled, scene, settings, fan).with_points(&nearby);
    let mut settled = settle(&problem, &start);
    // A tool may look the same from several sides.
    let turned = (1..N_TURNS).filter_map(|k| {
        let mut h = settled.adjusted.hypothesis.clone();
        let value = h.posture.get_mut(flange)?;
        let turned = *value + TAU * f64::from(k) / f64::from(N_TURNS);
        *value = turns::within(turned, tooled.model.limits(flange))?;
        Some(h)
    });
    let mut others = fan.fan(turned.collect(), |h| polish(&problem, &h));
    // Sides that look alike from afar differ in a bolt or a finger.
    let own = &settled.adjusted.hypothesis;
    let worse = |other: &Refined| worsening(&problem, own, &other.hypothesis);
    let all_worse: Vec<f64> = others.iter().map(worse).collect();
    let best = (0..others.len()).min_by(|a, b| all_worse[*a].total_cmp(&all_worse[*b]));
    if let Some(best) = best.filter(|best| all_worse[*best] < -BETTER) {
        let other = settle(&problem, &others[best].hypothesis);
        let before = std::mem::replace(&mut settled, other);
        others.push(before.refined());
    }
    finish(&problem, settled, &others)
}

/// Points that may be the robot's.
fn nearby(start: &Hypothesis, tooled: &Prepared<'_>, scene: &Scene<'_>) -> Nearby {
    scene.nearby(tooled, &Point::from(start.local_from_base.translation.vector))
}

/// Share of the squares that another side must do without to be taken: twins differ by less.
const BETTER: f64 = 0.01;
/// Turns of the flange that a tool may look alike at: every 30°.
const N_TURNS: i32 = 12;

fn start(fit: &Fit, tooled: &Prepared<'_>, scene: &Scene<'_>) -> Hypothesis {
    let mut posture = tooled.model.home();
    for (own, joint) in posture.iter_mut().zip(&fit.joints) {
        *own = joint.value;
    }
    scene.hypothesis(&fit.world_from_base, posture)
}

/// Whether enough points lie on the links from `first` on and not on those before, and few about
/// them on nothing: a bare flange has no such points, another gripper many that lie on nothing.
fn has_own_points(problem: &Problem<'_>, h: &Hypothesis, first: usize) -> bool {
    let tool: Vec<_> =
        problem.prepared.frames(h).into_iter().filter(|(l, _)| *l >= first).collect();
    let is_about = |i: &u32| {
        let p = problem.scene.points[*i as usize].p;
        tool.iter().any(|(l, frame)| {
            let q = geometry::depth::transform(frame, p).map(f64::from);
            problem.prepared.model.links[*l].bounds.grown(ABOUT).contains(q)
        })
    };
    let about: Vec<u32> = problem.thin.iter().copied().filter(is_about).collect();
    let limit = STRANGE.max(STRANGE_SIGMAS * problem.scene.noise as f32);
    let arm = distances(problem, h, &about, |l| l < first);
    let own = distances(problem, h, &about, |l| l >= first);
    let beside: Vec<f32> =
        own.into_iter().zip(arm).filter(|(_, arm)| *arm > limit).map(|(own, _)| own).collect();
    let n_strange = beside.iter().filter(|d| **d > limit).count();
    beside.len() - n_strange >= MIN_POINTS && (n_strange as f64) < MAX_STRANGE * beside.len() as f64
}

/// Surface of the links from `first` on: explained less contradicted, judged, and the whole of it,
/// m².
fn of_tool(tooled: &Prepared<'_>, first: usize, judgement: &Judgement) -> [f64; 3] {
    (first..tooled.links.len()).fold([0.0; 3], |sum, l| {
        let [net, judged] = judgement.links[l];
        [sum[0] + net, sum[1] + judged, sum[2] + tooled.links[l].area]
    })
}
