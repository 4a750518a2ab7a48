//! What moves each joint, as far as formats can say it: rules of loops that are lines become
//! followers, and pins of loops that close become joints.

use crate::plant_scene::{PlantRobot, slides};
use geometry::{Point, Pose, Vector};
use nalgebra::Unit;
use robot::{JointKind, Motion};
use std::f64::consts::{PI, TAU};

/// Number of postures at which loops are examined beside the found one.
const N_POSTURES: usize = 64;
/// Gap up to which a loop counts as closed, metres: less than a scanner resolves.
const CLOSED: f64 = 1e-4;
/// Deviation up to which a joint in a loop counts as a line of another, radians or metres: what is
/// left of rounding.
const LINE: f64 = 1e-9;

/// Limit of a slide that follows a joint without end, metres: farther than any plant is wide.
const FAR: f64 = 1e4;

/// What moves a joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum JointRule {
    /// Nothing: it is fixed, or locked by equal limits.
    Fixed,
    /// It moves by itself.
    Free,
    /// `multiplier · value of the joint + offset`.
    Follows { joint: usize, multiplier: f64, offset: f64 },
    /// A closed loop, by no line.
    Loop,
}

/// A pin that holds a loop together: an axis through one point of two links.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ScenePin {
    pub(crate) link_a: usize,
    pub(crate) link_b: usize,
    /// The pin in the frame of the first link, metres.
    pub(crate) point_a: Point,
    /// The same point in the frame of the other one, in the found posture.
    pub(crate) point_b: Point,
    /// The axis in the frame of the first link.
    pub(crate) axis_a: Unit<Vector>,
    /// The axis in the frame of the other one.
    pub(crate) axis_b: Unit<Vector>,
}

/// Rules of a robot's joints, its pins, and the range of each joint.
#[derive(Debug, Clone)]
pub(crate) struct JointRules {
    /// By index of the joint.
    pub(crate) rules: Vec<JointRule>,
    /// Pins that meet in the found posture and in most others. The others are loops of bars that
    /// only point at their pins.
    pub(crate) pins: Vec<ScenePin>,
    /// Number of pins that were left out.
    pub(crate) n_open: usize,
    /// Lower and upper limit of each joint, radians or metres: as the model states it, else of
    /// what the joint that it follows lets it reach; `None` for continuous joints that move by
    /// themselves, and for fixed ones.
    pub(crate) limits: Vec<Option<[f64; 2]>>,
    /// Joints that are moved by others and stand outside of the limits that the library states for
    /// them: a simulator would force them, and all that moves with them, back.
    pub(crate) widened: Vec<usize>,
}

impl JointRules {
    pub(crate) fn of(robot: &PlantRobot) -> Self {
        let postures = postures(robot);
        let values: Vec<Vec<f64>> = (postures.iter())
            .filter(|posture| robot.model.loop_gap(posture) <= CLOSED)
            .map(|posture| robot.model.joint_values(posture))
            .collect();
        let rules: Vec<JointRule> =
            (0..robot.model.joints.len()).map(|j| rule(robot, j, &values)).collect();
        let all: Vec<Option<ScenePin>> = (robot.model.loops.iter())
            .flat_map(|own| own.closures.iter().map(move |pin| (own, pin)))
            .map(|(own, pin)| scene_pin(robot, own.passive.first().copied(), pin, &postures))
            .collect();
        let n_open = all.iter().filter(|pin| pin.is_none()).count();
        let found = robot.values();
        let widened = (0..rules.len()).filter(|j| is_outside(robot, *j, rules[*j], found[*j]));
        let widened: Vec<usize> = widened.collect();
        let range = |j| range(robot, j, &rules, &values, widened.contains(&j));
        let limits = (0..rules.len()).map(range).collect();
        Self { rules, pins: all.into_iter().flatten().collect(), n_open, limits, widened }
    }
}

/// The found posture, and others spread evenly over the limits.
fn postures(robot: &PlantRobot) -> Vec<Vec<f64>> {
    /// Steps of a sequence that fills a cube of any dimension evenly: powers of the root of
    /// `x^(d+1) = x + 1`, here for many dimensions, each by its own power.
    const STEP: f64 = 0.754_877_666_246_692_7;
    let n = robot.posture.len();
    let mut out = vec![robot.posture.clone()];
    for k in 1..=N_POSTURES {
        out.push(
            (0..n)
                .map(|free| {
                    let [low, high] = robot.model.limits(free);
                    let part = (0.5 + k as f64 * STEP.powf(1.0 + free as f64 / 3.0)).fract();
                    low + (high - low) * part
                })
                .collect(),
        );
    }
    out
}

/// The difference of two values of a joint; of angles the smallest.
fn apart(turns: bool, a: f64, b: f64) -> f64 {
    if turns { (a - b + PI).rem_euclid(TAU) - PI } else { a - b }
}

fn rule(robot: &PlantRobot, j: usize, values: &[Vec<f64>]) -> JointRule {
    let joint = &robot.model.joints[j];
    match joint.motion {
        Motion::Fixed => JointRule::Fixed,
        Motion::Free(_) if !robot.moves(j) => JointRule::Fixed,
        Motion::Free(_) => JointRule::Free,
        Motion::Mimic { free, multiplier, offset } => {
            let driver = robot.model.free[free];
            if robot.moves(driver) {
                JointRule::Follows { joint: driver, multiplier, offset }
            } else {
                JointRule::Fixed
            }
        }
        Motion::Loop(_) => line(robot, j, values).unwrap_or(JointRule::Loop),
    }
}

/// The joint as a line of a free one, if it is that at all postures. Only whole multipliers are
/// tried for angles: loops of parallels have ±1, and others are no lines.
fn line(robot: &PlantRobot, j: usize, values: &[Vec<f64>]) -> Option<JointRule> {
    let turns = robot.model.joints[j].kind != JointKind::Prismatic;
    let found = values.first()?;
    let drivers = robot.model.free.iter().copied().filter(|&d| robot.moves(d));
    let mut tried = drivers.flat_map(|d| [1.0, -1.0].map(|m| (d, m)));
    let (joint, multiplier) = tried.find(|&(d, m)| {
        values.iter().all(|v| apart(turns, v[j] - found[j], m * (v[d] - found[d])).abs() <= LINE)
    })?;
    // Few postures prove nothing.
    let offset = found[j] - multiplier * found[joint];
    (values.len() > N_POSTURES / 4).then_some(JointRule::Follows { joint, multiplier, offset })
}

fn scene_pin(
    robot: &PlantRobot,
    passive: Option<usize>,
    pin: &robot::Closure,
    postures: &[Vec<f64>],
) -> Option<ScenePin> {
    let found = robot.model.poses(&robot.posture);
    let joint = &robot.model.joints[passive?];
    let axis = found[joint.child] * joint.axis.into_inner();
    let of = |poses: &[Pose], link: usize, p: &Point| poses[link] * p;
    let apart = of(&found, pin.link_a, &pin.point_a) - of(&found, pin.link_b, &pin.point_b);
    // Along the axis the points of the two links need not meet.
    let along = found[pin.link_b].inverse() * (axis * axis.dot(&apart));
    let point_b = pin.point_b + along;
    let gap = |posture: &Vec<f64>| {
        let poses = robot.model.poses(posture);
        (of(&poses, pin.link_a, &pin.point_a) - of(&poses, pin.link_b, &point_b)).norm()
    };
    let n_closed = postures.iter().filter(|posture| gap(posture) <= CLOSED).count();
    let is_closed = gap(&postures[0]) <= CLOSED && 2 * n_closed >= postures.len();
    let in_link = |link: usize| Unit::new_normalize(found[link].inverse() * axis);
    is_closed.then(|| ScenePin {
        link_a: pin.link_a,
        link_b: pin.link_b,
        point_a: pin.point_a,
        point_b,
        axis_a: in_link(pin.link_a),
        axis_b: in_link(pin.link_b),
    })
}

/// Whether a joint that is moved by others was found outside of its limits.
fn is_outside(robot: &PlantRobot, j: usize, rule: JointRule, found: f64) -> bool {
    let is_led = matches!(rule, JointRule::Follows { .. } | JointRule::Loop);
    let limits = robot.model.joints[j].limits.filter(|[low, high]| low < high);
    let is_beyond = |[low, high]: [f64; 2]| found < low - LINE || found > high + LINE;
    is_led && limits.is_some_and(is_beyond)
}

/// The range of a joint; see [`JointRules::limits`].
fn range(
    robot: &PlantRobot,
    j: usize,
    rules: &[JointRule],
    values: &[Vec<f64>],
    is_widened: bool,
) -> Option<[f64; 2]> {
    let joint = &robot.model.joints[j];
    let own = joint.limits.filter(|[low, high]| low < high && !is_widened);
    match rules[j] {
        JointRule::Fixed => None,
        JointRule::Free => joint.limits,
        JointRule::Follows { joint: driver, multiplier, offset } => own.or_else(|| {
            let Some(ends) = robot.model.joints[driver].limits else {
                // A slide without limits would be locked.
                return slides(joint).then_some([-FAR, FAR]);
            };
            let [a, b] = ends.map(|v| multiplier * v + offset);
            Some([a.min(b), a.max(b)])
        }),
        JointRule::Loop => own.or_else(|| {
            let reached = values.iter().map(|v| v[j]);
            let (low, high) =
                reached.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
            // Between the postures that were examined it may reach a little farther.
            let more = 0.1 * (high - low).max(0.1);
            (low <= high).then_some([low - more, high + more])
        }),
    }
}
