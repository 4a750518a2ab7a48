//! What the scans saw of a region: depth images and points about a local origin; what a fit reads.

use crate::{MaskId, ScanId};
use geometry::{Aabb, DepthImage, Point};

/// A piece of the world with a local frame: world axes, shifted to `origin`, so that f32 is exact
/// enough.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Region {
    /// Origin of the local frame in the world, metres.
    pub origin: Point,
    /// Bounds in the local frame, metres.
    pub bounds: Aabb,
}

impl Region {
    /// Bounds in the world, metres.
    #[must_use]
    pub fn world_bounds(&self) -> Aabb {
        let shift = |p: [f64; 3]| std::array::from_fn(|i| p[i] + self.origin[i]);
        Aabb { min: shift(self.bounds.min), max: shift(self.bounds.max) }
    }
}

/// One scan's view of a region.
#[derive(Debug, Clone)]
pub struct View {
    /// Whose view.
    pub scan: ScanId,
    /// The mask of its points.
    pub mask: MaskId,
    /// Where the scanner stands in the local frame; `None` where unknown, and then `images` is
    /// empty.
    pub scanner: Option<Point>,
    /// Angle between neighbouring beams, radians; 0 where unknown.
    pub beam_step: f64,
    /// Whether a camera took it: neighbouring points err alike.
    pub is_camera: bool,
    /// Depth images that together cover the region.
    pub images: Vec<DepthImage>,
    /// The scan's points inside the region's bounds, local frame, metres: neighbours follow one
    /// another.
    pub points: Vec<[f32; 3]>,
}

/// Views that a search looks through: more tell it little, and cost it as much as the first.
const MAX_SCOUTS: usize = 8;
/// Scanners nearer to each other than this, seen from the region's middle, see the same side of it;
/// cosine of 25°.
const SAME_SIDE: f64 = 0.906;

impl View {
    /// The views that a search goes by, where there are many: those with most points, of scanners
    /// on different sides first. In their order.
    #[must_use]
    pub fn scouts<'a>(views: &[&'a Self], region: &Region) -> Vec<&'a Self> {
        if views.len() <= MAX_SCOUTS {
            return views.to_vec();
        }
        let middle = region.bounds.center();
        let side = |view: &Self| view.scanner.map(|s| (s - middle).normalize());
        let mut order: Vec<usize> = (0..views.len()).collect();
        order.sort_by_key(|&i| (std::cmp::Reverse(views[i].points.len()), i));
        let mut chosen: Vec<usize> = Vec::new();
        for apart in [true, false] {
            for &i in &order {
                let alike = |&c: &usize| {
                    let both = side(views[i]).zip(side(views[c]));
                    both.is_some_and(|(a, b)| a.dot(&b) > SAME_SIDE)
                };
                let is_known = chosen.contains(&i) || apart && chosen.iter().any(alike);
                if !is_known && chosen.len() < MAX_SCOUTS {
                    chosen.push(i);
                }
            }
        }
        chosen.sort_unstable();
        chosen.into_iter().map(|i| views[i]).collect()
    }
}
