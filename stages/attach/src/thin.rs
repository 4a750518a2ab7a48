//! Which voxels of a body belong to a thin part of it that runs on in one direction: a hose, a
//! cable, the neck of a torch.

use crate::voxel_graph::Graph;
use contract::{RESIDUAL_EDGE, Voxel};

/// Distance around a voxel within which the shape of the body counts, voxels: 10 cm.
const AROUND: i64 = 5;
/// Least ratio of the spreads along a thin part and across it.
const MIN_RATIO: f64 = 1.5;
/// Way from the robot within which a thin part begins, hundredths of a voxel's edge (8 cm).
const BEGINS: u32 = 400;
/// Least length of a hose, hundredths of a voxel's edge (35 cm): longer than the fingers of a
/// gripper with a slender part between them.
const MIN_HOSE: u32 = 1750;
/// Ways from the robot within which a longer hose begins, and how long it is at least, hundredths
/// of a voxel's edge: 20 cm and 60 cm, or 30 cm and 1.2 m, which legs of benches are not.
const LATE_HOSES: [(u32, u32); 2] = [(1000, 3000), (1500, 6000)];
/// Way along such a part to where its direction is measured, hundredths of a voxel's edge: from its
/// first 4 cm to the first 4 cm that are at least 10 cm on.
const BEGIN: u32 = 200;
const NEXT: u32 = 500;
/// Least distance between these, voxels: half of the least way.
const MIN_ALONG: f64 = 2.5;
/// Least cosine of the angle with the vertical of something upright (18°).
const UPRIGHT: f64 = 0.95;
/// Least cosine of the angle between the sides of something straight (37°).
const STRAIGHT: f64 = 0.8;
/// Least number of voxels within [`AROUND`] of one on a flat surface: two thirds of a disc.
const MIN_FLAT: usize = 35;
/// Largest standard deviation of a flat surface from its plane, voxels: it may cross a layer.
const MAX_BUMP: f64 = 0.6;
/// Least standard deviation of a wide surface in its narrower direction, voxels: half of the
/// radius of a disc would be 2.5.
const MIN_WIDE: f64 = 2.0;
/// Standard deviation that the edges of voxels add, voxels.
const BLUR: f64 = 0.3;

/// What a voxel is part of, by the shape of the body around it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum LocalShape {
    /// Anything that does not run on in one direction.
    Body,
    /// A long thin part that begins at the robot and is thin from there on.
    Hose,
    /// Another thin part, as the leg of a bench.
    Leg,
    /// A surface that is flat and wider than tools are: of a part, a bench, a wall.
    Flat,
}

/// The shape around each voxel of a component. `length` is the way along the body from the robot
/// to each of them (hundredths of a voxel's edge), and `thin` the largest circumference of a thin
/// part, metres.
pub(crate) fn shapes(graph: &Graph, length: &[u32], thin: f64) -> Vec<LocalShape> {
    let n = graph.len();
    let mut ball = Ball { graph, seen_for: vec![usize::MAX; n], members: Vec::new() };
    let around: Vec<([f64; 3], usize)> = (0..n).map(|at| ball.spreads(at)).collect();
    let is_thin: Vec<bool> =
        around.iter().map(|(spread, _)| is_line(spread, thin, MIN_RATIO)).collect();
    let shape = |(spread, n): &([f64; 3], usize)| match is_line(spread, thin, MIN_RATIO) {
        true => LocalShape::Leg,
        false if is_flat(spread, *n) => LocalShape::Flat,
        false => LocalShape::Body,
    };
    let mut shapes: Vec<LocalShape> = around.iter().map(shape).collect();
    let beginnings = (0..n).filter(|k| length[*k] <= BEGINS).collect();
    let mut is_left = is_thin.clone();
    let mut is_hose = vec![false; n];
    for k in reached(graph, beginnings, &mut is_left) {
        is_hose[k] = is_thin[k];
    }
    mark_late_hoses(graph, length, &mut is_left, &mut is_hose);
    for first in 0..n {
        if is_hose[first] {
            let part = reached(graph, vec![first], &mut is_hose);
            let ways = || part.iter().map(|k| length[*k]);
            let span = ways().max().unwrap_or(0) - ways().min().unwrap_or(0);
            let shape = if span >= MIN_HOSE { LocalShape::Hose } else { LocalShape::Body };
            part.into_iter().for_each(|k| shapes[k] = shape);
        }
    }
    shapes
}

/// A long thin part that leads away from the robot.
pub(crate) struct ThinPart {
    voxels: Vec<usize>,
    /// Where it begins, and the way from there along its first stretch, voxels.
    begin: [f64; 3],
    along: [f64; 3],
}

impl ThinPart {
    /// `None` where it leads away to both sides.
    pub(crate) fn of(graph: &Graph, length: &[u32], voxels: Vec<usize>) -> Option<Self> {
        let begins = voxels.iter().map(|k| length[*k]).min()?;
        let mean = |range: std::ops::Range<u32>| {
            mean_of(graph, voxels.iter().filter(|k| range.contains(&(length[**k] - begins))))
        };
        // Behind a gap the next of it is farther on.
        let ways = voxels.iter().map(|k| length[*k] - begins);
        let next = ways.filter(|way| *way >= NEXT).min()?;
        let (begin, next) = (mean(0..BEGIN), mean(next..next + BEGIN));
        let along: [f64; 3] = std::array::from_fn(|i| next[i] - begin[i]);
        // What leads away to both sides is on average where it begins.
        let is_one_way = along.iter().map(|v| v * v).sum::<f64>() >= MIN_ALONG * MIN_ALONG;
        is_one_way.then_some(Self { voxels, begin, along })
    }

    /// Where it begins, and the way from there along its first stretch, voxels.
    pub(crate) fn begin_and_way(&self) -> ([f64; 3], [f64; 3]) {
        (self.begin, self.along)
    }

    /// Whether it begins not far from the robot for its length.
    fn is_late_hose(&self, length: &[u32]) -> bool {
        let ways = || self.voxels.iter().map(|k| length[*k]);
        let (begins, ends) = (ways().min().unwrap_or(0), ways().max().unwrap_or(0));
        LATE_HOSES.iter().any(|(latest, least)| begins <= *latest && ends - begins >= *least)
    }

    /// Whether it stands upright on the floor, as a post does.
    fn is_post(&self, graph: &Graph, length: &[u32], is_grounded: impl Fn(usize) -> bool) -> bool {
        let ends = self.voxels.iter().map(|k| length[*k]).max().unwrap_or(0);
        let end = mean_of(graph, self.voxels.iter().filter(|k| length[**k] + BEGIN >= ends));
        let by: [f64; 3] = std::array::from_fn(|i| end[i] - self.begin[i]);
        let is_upright = -by[2] >= UPRIGHT * by.iter().map(|v| v * v).sum::<f64>().sqrt();
        is_upright && self.voxels.iter().any(|k| is_grounded(*k))
    }

    /// Whether this and another part are the two sides of something straight that passes.
    fn continues(&self, other: &Self) -> bool {
        let apart: [f64; 3] = std::array::from_fn(|i| self.begin[i] - other.begin[i]);
        let cosine = |a: &[f64; 3], b: &[f64; 3]| {
            let dot = |a: &[f64; 3], b: &[f64; 3]| (0..3).map(|i| a[i] * b[i]).sum::<f64>();
            dot(a, b) / (dot(a, a) * dot(b, b)).sqrt()
        };
        cosine(&self.along, &other.along) < -STRAIGHT && cosine(&self.along, &apart) > STRAIGHT
    }
}

/// The middle of some voxels.
fn mean_of<'a>(graph: &Graph, of: impl Iterator<Item = &'a usize>) -> [f64; 3] {
    let (mut sum, mut n) = ([0.0; 3], 0.0);
    for k in of {
        let at = graph.voxel(*k).map(f64::from);
        (0..3).for_each(|i| sum[i] += at[i]);
        n += 1.0;
    }
    sum.map(|v| v / n)
}

/// For each voxel, whether it belongs to a hose that ends at the robot: it leads away to one side
/// only, and is no post that stands beside the robot.
pub(crate) fn ending_hoses(
    graph: &Graph,
    length: &[u32],
    shape: &[LocalShape],
    is_grounded: impl Fn(usize) -> bool,
) -> Vec<bool> {
    let mut is_left: Vec<bool> = shape.iter().map(|shape| *shape == LocalShape::Hose).collect();
    let mut out = vec![false; shape.len()];
    for first in 0..shape.len() {
        if !is_left[first] {
            continue;
        }
        let voxels = reached(graph, vec![first], &mut is_left);
        let part = ThinPart::of(graph, length, voxels);
        if let Some(part) = part.filter(|part| !part.is_post(graph, length, &is_grounded)) {
            part.voxels.iter().for_each(|k| out[*k] = true);
        }
    }
    out
}

/// Marks long thin parts that begin not far from the robot, where several hoses lie side by side.
/// Such a part leads away from the robot; a pipe that passes leads away to both sides.
fn mark_late_hoses(graph: &Graph, length: &[u32], is_left: &mut [bool], is_hose: &mut [bool]) {
    let mut parts = Vec::new();
    for first in 0..is_left.len() {
        if is_left[first] {
            let voxels = reached(graph, vec![first], is_left);
            let part = ThinPart::of(graph, length, voxels);
            parts.extend(part.filter(|part| part.is_late_hose(length)));
        }
    }
    for part in parts.iter().filter(|part| !parts.iter().any(|other| part.continues(other))) {
        let begins = part.voxels.iter().map(|k| length[*k]).min();
        for &k in &part.voxels {
            is_hose[k] = true;
            if Some(length[k]) == begins {
                mark_way_back(graph, length, k, is_hose);
            }
        }
    }
}

/// Marks the shortest way from a voxel back to the robot.
fn mark_way_back(graph: &Graph, length: &[u32], from: usize, is_hose: &mut [bool]) {
    let mut at = from;
    while length[at] > 0 {
        let Some((next, _)) = graph.neighbours(at).min_by_key(|(k, _)| (length[*k], *k)) else {
            return;
        };
        if length[next] >= length[at] {
            return;
        }
        is_hose[next] = true;
        at = next;
    }
}

/// The voxels that are reached from some of them, with these, through those that are left; they are
/// taken away from what is left.
pub(crate) fn reached(graph: &Graph, mut from: Vec<usize>, is_left: &mut [bool]) -> Vec<usize> {
    from.iter().for_each(|k| is_left[*k] = false);
    let mut next = 0;
    while let Some(&k) = from.get(next) {
        next += 1;
        for (other, _) in graph.neighbours(k) {
            if std::mem::replace(&mut is_left[other], false) {
                from.push(other);
            }
        }
    }
    from
}

/// Gathers the connected voxels around one.
struct Ball<'a> {
    graph: &'a Graph,
    /// For each voxel the one for which it was last gathered.
    seen_for: Vec<usize>,
    members: Vec<Voxel>,
}

impl Ball<'_> {
    /// Standard deviations of the body around a voxel along its three main directions, voxels,
    /// ascending, from its connected voxels within [`AROUND`]; and their number.
    fn spreads(&mut self, at: usize) -> ([f64; 3], usize) {
        let centre = self.graph.voxel(at);
        self.members.clear();
        self.members.push(centre);
        self.seen_for[at] = at;
        let mut queue = vec![at];
        while let Some(next) = queue.pop() {
            for (other, _) in self.graph.neighbours(next) {
                let voxel = self.graph.voxel(other);
                let by = |i: usize| (i64::from(voxel[i]) - i64::from(centre[i])).pow(2);
                if by(0) + by(1) + by(2) <= AROUND * AROUND && self.seen_for[other] != at {
                    self.seen_for[other] = at;
                    self.members.push(voxel);
                    queue.push(other);
                }
            }
        }
        (spreads_of(&self.members, centre), self.members.len())
    }
}

/// Standard deviations of voxels along their three main directions, voxels, ascending. `centre` is
/// near them all.
pub(crate) fn spreads_of(near: &[Voxel], centre: Voxel) -> [f64; 3] {
    let n = near.len() as f64;
    let (mut sum, mut squares) = ([0.0; 3], [[0.0; 3]; 3]);
    for other in near {
        let by = [0, 1, 2].map(|i| f64::from(other[i]) - f64::from(centre[i]));
        for i in 0..3 {
            sum[i] += by[i];
            (0..3).for_each(|j| squares[i][j] += by[i] * by[j]);
        }
    }
    let covariance = nalgebra::Matrix3::from_fn(|i, j| squares[i][j] / n - sum[i] * sum[j] / n / n);
    let mut spread = covariance.symmetric_eigenvalues().map(|v| v.max(0.0).sqrt());
    spread.as_mut_slice().sort_unstable_by(f64::total_cmp);
    spread.into()
}

/// Whether voxels with these standard deviations lie along a line, no thicker than a circumference
/// of `thin` metres and so many times longer.
pub(crate) fn is_line(spread: &[f64; 3], thin: f64, ratio: f64) -> bool {
    // A ring has 1/√2 of its radius as standard deviation.
    let radius = thin / std::f64::consts::TAU / RESIDUAL_EDGE;
    let across = radius * std::f64::consts::FRAC_1_SQRT_2 + BLUR;
    spread[1] <= across && spread[2] >= ratio * spread[1].max(BLUR)
}

/// Whether it is flat all around.
fn is_flat(spread: &[f64; 3], n: usize) -> bool {
    n >= MIN_FLAT && spread[0] <= MAX_BUMP && spread[1] >= MIN_WIDE
}
