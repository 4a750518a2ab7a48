//! The least cut through a body between the robot that it touches and what is fixed.
//!
//! Voxels show the surface of a body, so that the edges between voxels that a cut goes through are
//! its length along the surface: around the fingers of a gripper it is shorter than around the part
//! that they touch. A cut through what is bolted to a flange costs more. A hose is cut where
//! another body holds it, and not within, and a bench is not cut off its legs.

use crate::facets::{SurfaceTurn, VoxelFacet};
use crate::max_flow::{FlowNetwork, UNCUT};
use crate::thin::LocalShape;
use crate::voxel_graph::Graph;

/// Cost of an edge between voxels that share a face, an edge or a corner.
const EDGE_COST: [u64; 3] = [4, 2, 1];
/// Cost of letting go of a voxel that is near the robot, and of one that touches it. A flat wall
/// beside an arm is near it with an area, and the cut around that area costs more than letting go.
const NEAR_COST: u64 = 1;
const TOUCH_COST: u64 = 400;
/// Way along the body from the robot up to which a cut costs more, hundredths of a voxel's edge
/// (14 cm), and how many times as much it costs at most: a tool is longer than its flange.
const MOUNT: u32 = 700;
const MOUNT_FACTOR: u64 = 3;
/// Cost of giving a voxel of a wide flat surface to the robot where the cut near it is asked for:
/// of what touches something fixed, such a surface rarely is a tool, but may be a carried part.
const FLAT_COST: u64 = 100;
/// Way along the body from a hand up to which other voxels are most likely a tool, hundredths of a
/// voxel's edge (10 cm), and the cost of taking one from the robot.
const BOLTED: u32 = 500;
const BOLTED_COST: u64 = 4;
/// Way along the body over which the cost grows by its value at the robot where the cut near the
/// robot is asked for, hundredths of a voxel's edge (10 cm), and up to which it grows (40 cm).
const DOUBLE: u32 = 1500;
const GROWS: u32 = 2000;
/// All costs are multiplied by this, so that the factors act on whole numbers.
const SCALE: u64 = 16;
/// By which ratios an inner corner or a step costs less than an edge of which nothing is known, and
/// a surface that runs on or bends outward more: things that touch meet in inner corners.
const INWARD: [u64; 2] = [3, 8];
const OUTWARD: [u64; 2] = [3, 2];
/// How many times more an edge within a thin part costs.
const THIN_FACTOR: u64 = 1000;

/// How a voxel touches a robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum TouchesRobot {
    None,
    Near,
    Touch,
}

/// Which of the cuts that cost about as much is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Preference {
    NearRobot,
    NearFixed,
}

/// A body between a robot and what is fixed.
pub(crate) struct Body<'a> {
    pub(crate) graph: &'a Graph,
    /// For each of its voxels, the way along the body from the robot, hundredths of a voxel's edge.
    pub(crate) length: Vec<u32>,
    /// The way from a hand, which may carry a tool, where no other link is much nearer.
    pub(crate) from_hand: Vec<Option<u32>>,
    /// Way along the longest tool of the robot, hundredths of a voxel's edge.
    pub(crate) longest_tool: u32,
    /// Largest circumference of a thin part, metres.
    pub(crate) thin: f64,
    pub(crate) contact: Vec<TouchesRobot>,
    pub(crate) is_fixed: Vec<bool>,
    pub(crate) shape: Vec<LocalShape>,
    /// The surface in each voxel.
    pub(crate) facet: Vec<VoxelFacet>,
}

impl Body<'_> {
    /// For each voxel, whether it is on the robot's side of the least cut.
    pub(crate) fn robot_side(&self, preference: Preference) -> Vec<bool> {
        self.side(preference, |k| {
            let touch = match self.contact[k] {
                TouchesRobot::None => 0,
                TouchesRobot::Near => NEAR_COST,
                TouchesRobot::Touch => TOUCH_COST,
            };
            let is_flat = self.shape[k] == LocalShape::Flat && preference == Preference::NearRobot;
            let is_bolted = self.from_hand[k].is_some_and(|length| length <= BOLTED);
            let (letting_go, keeping) = match (is_flat, is_bolted) {
                (true, _) => (0, FLAT_COST),
                (false, true) => (BOLTED_COST, 0),
                (false, false) => (0, 0),
            };
            [touch + letting_go, keeping].map(|cost| SCALE * cost)
        })
    }

    /// For each voxel, whether it is on the side of a hand of the least cut behind all that is no
    /// farther from the hand along the body, hundredths of a voxel's edge.
    pub(crate) fn side_beyond(&self, depth: u32) -> Vec<bool> {
        let is_within = |k: usize| self.from_hand[k].is_some_and(|length| length <= depth);
        let is_kept = |k: usize| is_within(k) && !self.is_fixed[k];
        self.side(Preference::NearFixed, |k| [if is_kept(k) { UNCUT } else { 0 }, 0])
    }

    /// The robot's side of the least cut where letting go of a voxel, and keeping it, cost so much.
    fn side(&self, preference: Preference, ends: impl Fn(usize) -> [u64; 2]) -> Vec<bool> {
        let n = self.graph.len();
        let (source, sink) = (n, n + 1);
        let mut network = FlowNetwork::new(n + 2);
        for k in 0..n {
            let [letting_go, keeping] = ends(k);
            let keeping = if self.is_fixed[k] { UNCUT } else { keeping };
            for (from, to, cost) in [(source, k, letting_go), (k, sink, keeping)] {
                if cost > 0 {
                    network.add(from, to, cost);
                }
            }
            for (other, step) in self.graph.neighbours(k).filter(|(other, _)| *other > k) {
                let cost = self.cost(k, other, step, preference);
                network.add_both(k, other, cost);
            }
        }
        network.fill(source, sink);
        let mut before = network.before_last_cut(sink);
        before.truncate(n);
        before
    }

    /// Cost of the edge between two voxels.
    fn cost(&self, a: usize, b: usize, step: u32, preference: Preference) -> u64 {
        let shared = [100, 141].iter().position(|length| step == *length).unwrap_or(2);
        let length = self.length[a].min(self.length[b]);
        let mut factor = SCALE;
        if let (Some(a), Some(b)) = (self.from_hand[a], self.from_hand[b]) {
            let mounted = u64::from(MOUNT.saturating_sub(a.min(b))) * (MOUNT_FACTOR - 1) * SCALE;
            factor += mounted / u64::from(MOUNT);
        }
        // A hose is as long as it is: nothing along it is nearer to the robot.
        let is_hose = [a, b].iter().any(|k| self.shape[*k] == LocalShape::Hose);
        if preference == Preference::NearRobot && !is_hose {
            factor += u64::from(length.min(GROWS)) * SCALE / u64::from(DOUBLE);
        }
        factor = match self.facet[a].bend_to(&self.facet[b]) {
            SurfaceTurn::Inward => factor * INWARD[0] / INWARD[1],
            SurfaceTurn::Outward => factor * OUTWARD[0] / OUTWARD[1],
            SurfaceTurn::Unknown => factor,
        };
        // A hose is cut where another body holds it, and a leg nowhere.
        let enters_hose = |from: usize, to: usize| {
            let is_beyond = self.length[to] >= self.length[from];
            is_beyond && self.shape[to] == LocalShape::Hose
        };
        let is_held = self.is_fixed[a] || self.is_fixed[b];
        let in_hose = !is_held && (enters_hose(a, b) || enters_hose(b, a));
        let in_leg = self.shape[a] == LocalShape::Leg || self.shape[b] == LocalShape::Leg;
        EDGE_COST[shared] * factor * if in_hose || in_leg { THIN_FACTOR } else { 1 }
    }
}
