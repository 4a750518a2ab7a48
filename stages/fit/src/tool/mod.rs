//! Tells whether a tool hangs on a fitted arm and how its joints stand, and fits arm and tool
//! together (METHOD.md §13).

mod bolts;

use contract::{Fan, Fit};
use geometry::{Point, Pose, angle};
use std::f64::consts::TAU;

pub use bolts::Bolt;

use crate::correspond::{MIN_POINTS, distances, worsening};
use crate::problem::{Judgement, Problem, judge};
use crate::refine::{Refined, polish};
use crate::scene::Nearby;
use crate::search::BeamSearch;
use crate::solve::{finish, settle};
use crate::state::Hypothesis;
use crate::{MeasuredScene, Prepared, Settings};

/// What the beams must say of a tool that is there.
struct ToolJudgement {
    /// Least score of its links: tools that are there have 0.69 and more, others that are taken
    /// for them up to 0.67.
    min_score: f64,
    /// Least share of its surface that must have been judged: of tools that are there it was 0.4
    /// and more.
    min_seen: f64,
    /// Tolerance of the judgement, metres: an arm's flange is known to a millimetre.
    tolerance: f64,
}

const IS_THERE: ToolJudgement = ToolJudgement { min_score: 0.62, min_seen: 0.20, tolerance: 0.012 };

/// Points about a tool that are neither on it nor on the arm.
struct StrangePoints {
    /// How far about the tool points are looked at, metres.
    about: f64,
    /// A point farther than this from a surface is not on it, metres; where the scans are noisy,
    /// than so many standard deviations of their noise.
    distance: f32,
    sigmas: f32,
    /// Most of them, as a share of the points that are not the arm's: with tools that are there it
    /// is a few hundredths, more where they hold something; with other grippers that are taken for
    /// them, half and more.
    max_share: f64,
}

const STRANGE: StrangePoints =
    StrangePoints { about: 0.02, distance: 0.008, sigmas: 4.0, max_share: 0.3 };
/// Other sides that a tool may look the same from.
struct OtherSides {
    /// Turns of the flange that are tried: every 30°.
    n_turns: i32,
    /// Share of the squares that another side must do without to be taken: twins differ by less.
    better: f64,
}

const OTHER_SIDES: OtherSides = OtherSides { n_turns: 12, better: 0.01 };
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

/// An arm with a tool on its flange: the first free joints and links of the model are the arm's.
#[derive(Debug, Clone, Copy)]
pub struct ArmWithTool<'a> {
    /// The arm with the tool.
    pub prepared: &'a Prepared<'a>,
    /// Free joints of the arm.
    pub n_joints: usize,
    /// Links of the arm.
    pub n_links: usize,
}

impl ArmWithTool<'_> {
    /// The arm's last joint, which turns the flange; `None` of an arm without joints.
    fn flange(&self) -> Option<usize> {
        self.n_joints.checked_sub(1)
    }
}

/// Where the tool stands if it is there. The arm stays as it was fitted, but for its last joint,
/// which a bare flange may not tell.
#[must_use]
pub fn try_tool(
    fit: &Fit,
    arm: ArmWithTool<'_>,
    scene: &MeasuredScene<'_>,
    settings: &Settings,
    fan: &dyn Fan,
) -> Option<Tooled> {
    let ArmWithTool { prepared: tooled, n_joints, n_links } = arm;
    let start = start(fit, tooled, scene);
    let first = arm.flange()?;
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
        let judgement = judge(tooled, scene, settings, &h, IS_THERE.tolerance);
        let [explained, judged, whole] = of_tool(tooled, n_links, &judgement);
        let is_there =
            judged > IS_THERE.min_seen * whole && explained > IS_THERE.min_score * judged;
        (is_there && has_own_points(&problem, &h, n_links)).then_some((explained, h))
    });
    let (explained, best) = judged.max_by(|a, b| a.0.total_cmp(&b.0))?;
    let world_from_base = scene.world_from_local() * best.local_from_base;
    Some(Tooled { world_from_base, posture: best.posture, explained })
}

/// Which holes the tool may be bolted to, given as turns about the arm's last joint, radians: all
/// that explain the points as well as the best, best first.
#[must_use]
pub fn bolt(
    start: &Tooled,
    arm: ArmWithTool<'_>,
    holes: &[f64],
    scene: &MeasuredScene<'_>,
    settings: &Settings,
    fan: &dyn Fan,
) -> Vec<Bolt> {
    let Some(flange) = arm.flange() else { return Vec::new() };
    let start = scene.hypothesis(&start.world_from_base, start.posture.clone());
    let nearby = nearby(&start, arm.prepared, scene);
    let problem = Problem::new(arm.prepared, scene, settings, fan).with_points(&nearby);
    let Refined { hypothesis, .. } = polish(&problem, &start);
    bolts::bolts(&problem, &hypothesis, flange, holes)
}

/// The fit of arm and tool together from a start.
#[must_use]
pub fn fit_tool(
    start: &Tooled,
    arm: ArmWithTool<'_>,
    scene: &MeasuredScene<'_>,
    settings: &Settings,
    fan: &dyn Fan,
) -> Fit {
    let tooled = arm.prepared;
    let start = scene.hypothesis(&start.world_from_base, start.posture.clone());
    let nearby = nearby(&start, tooled, scene);
    let problem = Problem::new(tooled, scene, settings, fan).with_points(&nearby);
    let mut settled = settle(&problem, &start);
    // A tool may look the same from several sides.
    let turned = (1..OTHER_SIDES.n_turns).filter_map(|k| {
        let mut h = settled.adjusted.hypothesis.clone();
        let flange = arm.flange()?;
        let value = h.posture.get_mut(flange)?;
        let turned = *value + TAU * f64::from(k) / f64::from(OTHER_SIDES.n_turns);
        *value = angle::within(turned, tooled.model.limits(flange))?;
        Some(h)
    });
    let mut others = fan.fan(turned.collect(), |h| polish(&problem, &h));
    // Sides that look alike from afar differ in a bolt or a finger.
    let own = &settled.adjusted.hypothesis;
    let worse = |other: &Refined| worsening(&problem, own, &other.hypothesis);
    let all_worse: Vec<f64> = others.iter().map(worse).collect();
    let best = (0..others.len()).min_by(|a, b| all_worse[*a].total_cmp(&all_worse[*b]));
    if let Some(best) = best.filter(|best| all_worse[*best] < -OTHER_SIDES.better) {
        let other = settle(&problem, &others[best].hypothesis);
        let before = std::mem::replace(&mut settled, other);
        others.push(before.refined());
    }
    finish(&problem, settled, &others)
}

/// Points that may be the robot's.
fn nearby(start: &Hypothesis, tooled: &Prepared<'_>, scene: &MeasuredScene<'_>) -> Nearby {
    scene.nearby(tooled, &Point::from(start.local_from_base.translation.vector))
}

fn start(fit: &Fit, tooled: &Prepared<'_>, scene: &MeasuredScene<'_>) -> Hypothesis {
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
            problem.prepared.model.links[*l].bounds.grown(STRANGE.about).contains(q)
        })
    };
    let about: Vec<u32> = problem.thin.iter().copied().filter(is_about).collect();
    let limit = STRANGE.distance.max(STRANGE.sigmas * problem.scene.noise as f32);
    let arm = distances(problem, h, &about, |l| l < first);
    let own = distances(problem, h, &about, |l| l >= first);
    let beside: Vec<f32> =
        own.into_iter().zip(arm).filter(|(_, arm)| *arm > limit).map(|(own, _)| own).collect();
    let n_strange = beside.iter().filter(|d| **d > limit).count();
    beside.len() - n_strange >= MIN_POINTS
        && (n_strange as f64) < STRANGE.max_share * beside.len() as f64
}

/// Surface of the links from `first` on: explained less contradicted, judged, and the whole of it,
/// m².
fn of_tool(tooled: &Prepared<'_>, first: usize, judgement: &Judgement) -> [f64; 3] {
    (first..tooled.links.len()).fold([0.0; 3], |sum, l| {
        let [net, judged] = judgement.links[l];
        [sum[0] + net, sum[1] + judged, sum[2] + tooled.links[l].area]
    })
}
