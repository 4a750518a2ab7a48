//! Shares out a body that reaches both a robot and something fixed, by two cuts: one that is near
//! the robot and one that is not.

use crate::body_cut::{Body, Preference};
use crate::thin::Shape;
use std::collections::BTreeMap;

/// Way along a body from where it touches a robot up to which nothing of it is called fixed because
/// of a cut alone, hundredths of a voxel's edge (15 cm): there may be a tool.
const DOUBT: u32 = 750;
/// Way along a body up to which it is bolted to the robot whatever follows, hundredths of a voxel's
/// edge (4 cm).
const MOUNT: u32 = 200;
/// Number of layers of voxels behind a cut that are counted: 12 cm.
const N_LAYERS: usize = 6;
/// Number of layers of voxels behind a cut in which the end of a tool is looked for: 20 cm.
const N_FOLLOWED: usize = 10;

/// To whom a voxel belongs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Share {
    Robot,
    Open,
    Fixed,
}

/// Tells for each voxel of a body to whom it belongs. What is on the robot's side of the cut near
/// the robot is the robot's, up to two voxels beside the cut; what only the other cut gives to it
/// is open, as is what is near the hand on the fixed side.
pub(crate) fn share(body: &Body<'_>) -> Vec<Share> {
    let mut near = body.robot_side(Preference::NearRobot);
    let far = body.robot_side(Preference::NearFixed);
    let sides = Sides::new(body);
    let is_hose = |k: usize| body.shape[k] == Shape::Hose;
    let n = body.members.len();
    // A cut that leaves more than a tool on the robot's side has not found where the tool ends, nor
    // has one behind which the body is as wide as at the cut.
    let held = if (0..n).any(|k| near[k] && !is_hose(k) && body.length[k] > body.longest_tool) {
        MOUNT
    } else if let Some(side) = sides.up_to_where_it_widens(&near) {
        near = side;
        body.longest_tool
    } else {
        DOUBT
    };
    // One voxel beside a cut may be on either side of it, and two where it is no hose that is cut.
    let once = sides.inside(&near);
    let twice = sides.inside(&once);
    let share = |k: usize| {
        let is_held = twice[k] && body.length[k] <= held || once[k] && is_hose(k);
        match (near[k], far[k]) {
            (true, true) if is_held => Share::Robot,
            (false, false) if body.length[k] > DOUBT || body.is_fixed[k] => Share::Fixed,
            _ => Share::Open,
        }
    };
    (0..n).map(share).collect()
}

/// Looks at sides of cuts through a body.
struct Sides<'a> {
    body: &'a Body<'a>,
    /// The place of each voxel among the members of the body.
    place: BTreeMap<usize, usize>,
}

impl<'a> Sides<'a> {
    fn new(body: &'a Body<'a>) -> Self {
        let place = body.members.iter().enumerate().map(|(place, &at)| (at, place)).collect();
        Self { body, place }
    }

    /// The places of the voxels beside one.
    fn beside(&self, k: usize) -> impl Iterator<Item = usize> + '_ {
        let neighbours = self.body.graph.neighbours(self.body.members[k]);
        neighbours.filter_map(|(other, _)| self.place.get(&other).copied())
    }

    /// A side without its voxels beside the cut.
    fn inside(&self, side: &[bool]) -> Vec<bool> {
        (0..side.len()).map(|k| side[k] && self.beside(k).all(|other| side[other])).collect()
    }

    /// A side together with what follows behind its cut, up to where the body becomes wider: a
    /// finger is cut anywhere along its length. `None` if that is not found near the cut.
    fn up_to_where_it_widens(&self, side: &[bool]) -> Option<Vec<bool>> {
        let mut side = side.to_vec();
        for _ in 0..N_FOLLOWED {
            if self.widens_behind(&side) {
                return Some(side);
            }
            for k in self.layer_behind(&side) {
                side[k] = true;
            }
        }
        None
    }

    /// Whether the body becomes half as wide again behind a cut, as where a tip touches a part.
    fn widens_behind(&self, side: &[bool]) -> bool {
        let layers = self.layers_behind(side);
        let behind = layers[N_LAYERS - 2] + layers[N_LAYERS - 1];
        behind > 0 && 2 * behind >= 3 * (layers[0] + layers[1])
    }

    /// Numbers of voxels in the layers behind a cut.
    fn layers_behind(&self, side: &[bool]) -> [usize; N_LAYERS] {
        let mut side = side.to_vec();
        [(); N_LAYERS].map(|()| {
            let layer = self.layer_behind(&side);
            layer.iter().for_each(|k| side[*k] = true);
            layer.len()
        })
    }

    /// The voxels beside a side that are not on it.
    fn layer_behind(&self, side: &[bool]) -> Vec<usize> {
        let is_behind = |k: &usize| !side[*k] && self.beside(*k).any(|other| side[other]);
        (0..side.len()).filter(is_behind).collect()
    }
}
