//! Conditions of the suites: how the cells of each suite are drawn and scanned, and the list of
//! cases for a seed.

use super::request::DrawnCases;

use robot::Model;

/// Mount of a robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Mounting {
    /// The floor, or a stand on it.
    Floor,
    /// A block that is narrower than the foot, so that no scanner sees it.
    Pillar,
    /// A plate overhead.
    Ceiling,
    /// An upright plate.
    Wall,
    /// A plate that leans by half a right angle at most.
    Tilted,
}

/// Method with which a case is solved: that of the product, or a baseline for comparison.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum FitMethod {
    /// The method of the product.
    Whole,
    /// The link-by-link sweep of the paper.
    Sequential,
    /// The link-by-link sweep, followed by the product's adjustment.
    SequentialAdjusted,
    /// The method of the product with scan poses taken as exact.
    ScansHeld,
    /// The product's adjustment alone, from the truth: the best that any search can reach.
    FromTruth,
}

/// Contents of a cell, and how it is scanned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Condition {
    pub(super) n_scanners: usize,
    /// Beams of a whole sphere; fewer are cast, towards the cell only.
    pub(super) n_beams: f64,
    /// Range noise, metres, one sigma.
    pub(super) noise: f64,
    /// Registration error of each scan: metres on each axis, degrees about each; range bias,
    /// metres. One sigma.
    pub(super) registration: [f64; 3],
    /// Whether beams have a width.
    pub(super) mixed: bool,
    /// Smooth error of the model's shape, metres, about the largest.
    pub(super) warp: f64,
    /// Whether the sides of a link are off each by itself.
    pub(super) each_side: bool,
    /// Whether a part of one link's surface, a cover, is off.
    pub(super) uncovered: bool,
    /// Enlargement of one link's surface, as a share of its size.
    pub(super) scaled: f64,
    /// How far joints are from where the model has them, one sigma: shift on each axis, metres,
    /// turn about each but their own, degrees.
    pub(super) frames: [f64; 2],
    /// Whether a tool of the library hangs on the flange.
    pub(super) tool: bool,
    /// Whether the first loop that has two solutions stands on the other one.
    pub(super) other_branch: bool,
    /// Whether the places of joints are estimated, too.
    pub(super) calibrate: bool,
    /// Probability of each kind of clutter: fence, conveyor, cabinet and post, hoses along the
    /// arm.
    pub(super) clutter: f64,
    /// Probability of each item that a robot may carry besides: a gripper with a part, a dress
    /// pack, a rag.
    pub(super) laden: f64,
    /// Share of the foot's height that plates about it hide, in a cell fenced in on three sides;
    /// 0: none of that.
    pub(super) hidden: f64,
    /// Whether the arm of another robot crosses it.
    pub(super) crossed: bool,
    /// Mount of the robot.
    pub(super) mount: Mounting,
    /// How far the plate of such a place stands out from under the foot, metres; 0: a large one.
    pub(super) rim: f64,
    /// Whether a wall, a ceiling or a large leaning plate is behind that plate.
    pub(super) backed: bool,
    /// Method with which the case is solved.
    pub(super) way: FitMethod,
    /// If not 0, only the refinement runs, from starts with errors of all joints up to this,
    /// degrees.
    pub(super) perturbed_deg: f64,
    /// Height of a stand is drawn up to this, metres; 0: on the floor.
    pub(super) stand: f64,
}

/// The protocol of the method's source (§7.2), with 5 M beams instead of 50.
pub(super) const PLAIN: Condition = Condition {
    n_scanners: 6,
    n_beams: 5e6,
    noise: 0.002,
    registration: [0.0; 3],
    mixed: false,
    warp: 0.0,
    each_side: false,
    uncovered: false,
    scaled: 0.0,
    frames: [0.0; 2],
    calibrate: false,
    other_branch: false,
    tool: false,
    clutter: 0.0,
    laden: 0.0,
    hidden: 0.0,
    crossed: false,
    stand: 0.0,
    mount: Mounting::Floor,
    rim: 0.0,
    backed: false,
    way: FitMethod::Whole,
    perturbed_deg: 0.0,
};
/// Perturbations of the basin's curve, degrees (METHOD.md §20).
const PERTURBED_DEG: [f64; 7] = [2.0, 5.0, 8.0, 12.0, 16.0, 20.0, 30.0];
/// Errors of a usual registration (METHOD.md §19, T3).
pub(super) const REGISTRATION: [f64; 3] = [0.002, 0.01, 0.001];

/// Scans as they are usually registered.
const REGISTERED: Condition = Condition { registration: REGISTRATION, n_beams: 2e7, ..PLAIN };

/// A robot that its model fits poorly: shifts of joints, metres, and turns, degrees.
const FRAMES: [f64; 2] = [0.002, 0.1];

/// A plate no larger than it must be to be bolted on, metres.
const RIM: f64 = 0.06;
/// One whose rim is too narrow to be a plane of its own, metres.
const NARROW: f64 = 0.02;

/// One cell to be drawn.
#[derive(Debug, Clone)]
pub(super) struct DrawnCase {
    pub(super) suite: &'static str,
    pub(super) seed: u64,
    /// Index in the library.
    pub(super) model: usize,
    pub(super) condition: Condition,
}

impl DrawnCase {
    /// Whether it belongs to a baseline, whose figures are not those of the product.
    pub(super) fn is_baseline(&self) -> bool {
        self.condition.way != FitMethod::Whole
    }

    /// Number of the robot's errors, equal for all cases of one robot.
    pub(super) fn robot(&self) -> u64 {
        self.seed / CASES_OF_A_ROBOT
    }
}

/// Seeds of one robot.
const CASES_OF_A_ROBOT: u64 = 1000;

/// A suite: name, number of cases for each model, and the condition of its k-th case.
type AccuracySuite = (&'static str, usize, fn(usize) -> Condition);

/// All suites, in the order of METHOD.md §19.
const SUITES: &[AccuracySuite] = &[
    ("paper", 3, |_| Condition { n_beams: 5e7, noise: 0.0, ..PLAIN }),
    ("source", 3, |_| Condition { n_beams: 5e7, noise: 0.0, way: FitMethod::Sequential, ..PLAIN }),
    ("models", 3, |_| PLAIN),
    ("noise-1", 3, |_| Condition { n_beams: 5e7, noise: 0.001, ..PLAIN }),
    ("noise-2", 3, |_| Condition { n_beams: 5e7, ..PLAIN }),
    ("noise-5", 3, |_| Condition { n_beams: 5e7, noise: 0.005, ..PLAIN }),
    ("noise-10", 3, |_| Condition { n_beams: 5e7, noise: 0.010, ..PLAIN }),
    ("registration", 6, |_| REGISTERED),
    // The cells of `registration` again, solved by the baselines.
    ("sequential", 3, |_| Condition { way: FitMethod::Sequential, ..REGISTERED }),
    ("sequential-adjusted", 3, |_| Condition { way: FitMethod::SequentialAdjusted, ..REGISTERED }),
    ("scans-held", 3, |_| Condition { way: FitMethod::ScansHeld, ..REGISTERED }),
    ("from-truth", 3, |_| Condition { way: FitMethod::FromTruth, ..REGISTERED }),
    // Beams as in `noise-2`, since its errors are stated as multiples of those.
    ("mixed", 3, |_| Condition { n_beams: 5e7, mixed: true, ..PLAIN }),
    ("few", 9, |k| Condition { n_scanners: 3 - k % 3, ..PLAIN }),
    ("clutter", 6, |_| Condition { clutter: 1.0, laden: 1.0, mixed: true, ..PLAIN }),
    ("hidden", 6, |k| Condition { hidden: [0.25, 0.5, 0.75][k % 3], mixed: true, ..PLAIN }),
    ("crossed", 3, |_| Condition { crossed: true, mixed: true, ..PLAIN }),
    ("shape-1.5", 6, |_| Condition { warp: 0.0015, ..PLAIN }),
    ("shape-3", 6, |_| Condition { warp: 0.003, ..PLAIN }),
    ("sides-1.5", 6, |_| Condition { warp: 0.0015, each_side: true, ..PLAIN }),
    ("sides-3", 6, |_| Condition { warp: 0.003, each_side: true, ..PLAIN }),
    ("cover", 3, |_| Condition { uncovered: true, ..PLAIN }),
    ("scaled", 3, |_| Condition { scaled: 0.01, ..PLAIN }),
    ("all", 6, |_| Condition {
        n_scanners: 4,
        registration: REGISTRATION,
        mixed: true,
        warp: 0.003,
        clutter: 1.0,
        ..PLAIN
    }),
    ("frames", 4, |_| Condition { frames: FRAMES, ..PLAIN }),
    ("calibration", 4, |_| Condition { frames: FRAMES, calibrate: true, ..PLAIN }),
    ("loops", 6, |_| PLAIN),
    ("branches", 3, |_| Condition { other_branch: true, ..PLAIN }),
    ("tools", 3, |_| Condition { tool: true, ..PLAIN }),
    ("mounts", 6, |k| Condition {
        mount: [Mounting::Ceiling, Mounting::Wall, Mounting::Tilted][k % 3],
        rim: [0.0, RIM][k % 2],
        mixed: true,
        ..PLAIN
    }),
    ("plates", 6, |k| Condition {
        mount: [Mounting::Ceiling, Mounting::Wall, Mounting::Tilted][k % 3],
        rim: NARROW,
        backed: true,
        mixed: true,
        ..PLAIN
    }),
    ("pillars", 6, |_| Condition { mount: Mounting::Pillar, mixed: true, ..PLAIN }),
    ("basin", 7, |k| Condition { perturbed_deg: PERTURBED_DEG[k % 7], ..PLAIN }),
    ("unknown", 20, |k| Condition {
        n_scanners: 6 - k % 5,
        mixed: true,
        clutter: if k % 2 == 0 { 0.0 } else { 0.7 },
        laden: if k % 2 == 0 { 0.0 } else { 0.7 },
        stand: 0.6,
        ..PLAIN
    }),
];

/// Requested suites, and the number of their cases.
pub(super) struct Suites<'a> {
    /// All where empty.
    pub(super) names: &'a [String],
    /// The suite's own number where left out.
    pub(super) n_cases: Option<usize>,
    pub(super) drawn: &'a DrawnCases,
}

/// Names of all suites, in their order.
pub(super) fn suite_names() -> Vec<&'static str> {
    SUITES.iter().map(|suite| suite.0).collect()
}

/// The requested cases, suite by suite, model by model.
pub(super) fn cases(asked: &Suites<'_>, models: &[Model], chosen: &[usize]) -> Vec<DrawnCase> {
    let mut out = Vec::new();
    for (name, n, condition) in SUITES {
        if !asked.names.is_empty() && !asked.names.iter().any(|s| s == name) {
            continue;
        }
        for &model in chosen {
            let own = &models[model];
            let has_branch = |at| own.has_other_branch(at, &own.home());
            if *name == "loops" && own.loops.is_empty()
                || *name == "branches" && !(0..own.loops.len()).any(has_branch)
                || *name == "tools" && !models.iter().any(Model::is_tool)
            {
                continue;
            }
            // A model's cases do not change when others join the library.
            let own =
                models[model].name.bytes().fold(0_u64, |a, b| a.wrapping_mul(31) + u64::from(b));
            for k in asked.drawn.numbers(asked.n_cases.unwrap_or(*n)) {
                let seed = asked.drawn.seed * 1_000_000 + own % 1000 * CASES_OF_A_ROBOT + k as u64;
                out.push(DrawnCase { suite: name, seed, model, condition: condition(k) });
            }
        }
    }
    out
}
