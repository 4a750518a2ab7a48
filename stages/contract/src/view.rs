//! What the scans saw of a region: depth images and points about a local origin, for a fit.

use crate::{MaskId, ScanId};
use geometry::{Aabb, DepthImage, Point};
use serde::{Deserialize, Serialize};

/// A part of the world with a local frame: world axes, shifted to `origin`, so that the precision
/// of `f32` is sufficient.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Region {
    /// Origin of the local frame in the world, metres.
    pub origin: Point,
    /// Bounds of the region in the local frame, metres.
    pub bounds: Aabb,
}

impl Region {
    /// Bounds of the region in the world, metres.
    #[must_use]
    pub fn world_bounds(&self) -> Aabb {
        let shift = |p: [f64; 3]| std::array::from_fn(|i| p[i] + self.origin[i]);
        Aabb { min: shift(self.bounds.min), max: shift(self.bounds.max) }
    }
}

/// One scan's view of a region.
#[derive(Debug, Clone)]
pub struct View {
    /// The scan.
    pub scan: ScanId,
    /// The mask of its points.
    pub mask: MaskId,
    /// Position of the scanner in the local frame, metres; `None` where unknown. Then `images` is
    /// empty.
    pub scanner: Option<Point>,
    /// Angle between neighbouring beams, radians; 0 where unknown.
    pub beam_step: f64,
    /// Whether a depth camera measured the points, so that neighbouring errors are correlated.
    pub is_camera: bool,
    /// Depth images that together cover the region.
    pub images: Vec<DepthImage>,
    /// The scan's points inside the region's bounds, local frame, metres, in the order of the
    /// lattice, so that neighbours follow one another.
    pub points: Vec<[f32; 3]>,
}

/// Largest number of views that a search uses; more of them add little and cost as much each.
const MAX_SCOUTS: usize = 8;
/// Cosine of 25°: two scanners see the same side of a region if the directions to them from its
/// centre differ by less.
const SAME_SIDE: f64 = 0.906;

impl View {
    /// The views that a search uses where there are many: at most eight, in the order of `views`.
    /// Those of scanners on different sides of `region` go first, then those with most points.
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
