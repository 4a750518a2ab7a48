//! Writes a voxel grid as an OctoMap binary tree (`.bt`), as ROS and MoveIt load it.
//!
//! The format is that of Hornung et al., *OctoMap*, Autonomous Robots 34 (2013), and its reference
//! implementation: a text header, then two bytes for each inner node, depth first. Each child has
//! two bits (`01` free, `10` occupied, `11` inner, `00` unknown), lowest bits first. The tree has
//! 16 levels and is centred at the origin.

use crate::atomic;
use contract::{Error, Kind, Result};
use std::path::Path;

/// Number of levels of the tree below its root.
const DEPTH: u32 = 16;
/// Number of voxels from the tree's corner to its centre.
pub(crate) const HALF: i64 = 1 << (DEPTH - 1);

/// Whether a voxel is occupied; `None` where unknown.
pub(crate) type OctomapState = Option<bool>;

/// A voxel grid: position of the first voxel in edges from the tree's origin, size, and content.
pub(crate) struct OctomapGrid<'a> {
    pub(crate) first: [i64; 3],
    pub(crate) size: [usize; 3],
    /// Edge of a voxel, metres.
    pub(crate) edge: f64,
    /// State of the voxel with this index; z varies fastest, then y.
    pub(crate) known: &'a dyn Fn(usize) -> OctomapState,
}

/// The content of a cube of the tree.
enum OctomapNode {
    Leaf(OctomapState),
    /// An inner node: the bytes of the node and all below, and their number of nodes.
    Inner(Vec<u8>, u64),
}

/// Writes the tree of a grid.
pub(crate) fn write(path: &Path, grid: &OctomapGrid<'_>) -> Result<()> {
    let fits =
        (0..3).all(|i| grid.first[i] >= -HALF && grid.first[i] + grid.size[i] as i64 <= HALF);
    if !fits {
        return Err(Error::new(
            Kind::Bug,
            "voxel lies outside the range of an octree of 16 levels",
        )
        .at(path.display()));
    }
    let (data, n_nodes) = match grid.node([-HALF; 3], DEPTH) {
        OctomapNode::Inner(data, n) => (data, n),
        OctomapNode::Leaf(_) => (vec![0, 0], 1),
    };
    let mut bytes = format!(
        "# Octomap OcTree binary file\nid OcTree\nsize {n_nodes}\nres {}\ndata\n",
        grid.edge
    )
    .into_bytes();
    bytes.extend(data);
    atomic::write(path, &bytes)
}

impl OctomapGrid<'_> {
    /// The node of the cube with this corner, `2^level` voxels wide.
    fn node(&self, corner: [i64; 3], level: u32) -> OctomapNode {
        let width = 1_i64 << level;
        let apart = |i: usize| {
            corner[i] + width <= self.first[i] || corner[i] >= self.first[i] + self.size[i] as i64
        };
        if (0..3).any(apart) {
            return OctomapNode::Leaf(None);
        }
        if level == 0 {
            let at = (0..3).fold(0, |at, i| {
                at * self.size[i] + usize::try_from(corner[i] - self.first[i]).unwrap_or(0)
            });
            return OctomapNode::Leaf((self.known)(at));
        }
        let half = width / 2;
        let children: Vec<OctomapNode> = (0..8)
            .map(|c| {
                self.node(std::array::from_fn(|i| corner[i] + half * ((c >> i) & 1)), level - 1)
            })
            .collect();
        joined(&children)
    }
}

fn joined(children: &[OctomapNode]) -> OctomapNode {
    if let OctomapNode::Leaf(first) = children[0]
        && children.iter().all(|c| matches!(c, OctomapNode::Leaf(known) if *known == first))
    {
        return OctomapNode::Leaf(first);
    }
    let (mut bits, mut n) = (0_u16, 1);
    let mut below = Vec::new();
    for (c, child) in children.iter().enumerate() {
        let code = match child {
            OctomapNode::Leaf(None) => 0b00,
            OctomapNode::Leaf(Some(false)) => 0b01,
            OctomapNode::Leaf(Some(true)) => 0b10,
            OctomapNode::Inner(bytes, nodes) => {
                below.extend_from_slice(bytes);
                n += nodes;
                0b11
            }
        };
        n += u64::from(matches!(child, OctomapNode::Leaf(Some(_))));
        bits |= code << (2 * c);
    }
    let mut bytes = bits.to_le_bytes().to_vec();
    bytes.append(&mut below);
    OctomapNode::Inner(bytes, n)
}
