//! Thin curves that leave the surroundings of a robot: the occupied space of hoses and cables up to
//! the body where they end, from the clusters of the whole plant. Hoses reach farther than the
//! surroundings in which points are examined.

use crate::body::{StandingRobot, box_distance};
use contract::{Cluster, LinkAt, Voxel};
use geometry::narrow::floor_i32;
use geometry::{Aabb, Point};
use std::collections::{BTreeMap, HashSet, VecDeque};

/// Half-width of the cube of voxels in which a curve is told from a surface, voxels: 15 cm.
const AROUND: i32 = 3;
/// Largest number of voxels of a curve in that cube: an oblique hose of 50 mm fills seven in each
/// of seven layers.
const MAX_CURVE: usize = 50;
/// Largest standard deviation of a curve's voxels across its direction, voxels.
const MAX_ACROSS: f64 = 0.9;
/// Least standard deviation along it, voxels.
const MIN_ALONG: f64 = 1.2;
/// The same of what is connected within a smaller cube (10 cm), where something else stands beside
/// the curve, as a fence does.
const AROUND_APART: i32 = 2;
const MAX_ACROSS_APART: f64 = 0.75;
const MIN_ALONG_APART: f64 = 1.2;
/// Gaps that a curve is followed across, voxels: black rubber returns few points.
const GAP: i32 = 2;
/// Depth of the layer at the border of the surroundings in which curves are looked for, metres.
const LAYER: f32 = 0.15;

/// The voxels of curves outside of the surroundings of robots.
#[derive(Debug, Clone, Default)]
pub(crate) struct Curves {
    /// Edge of the voxels, metres.
    edge: f64,
    /// For each voxel the link from whose surroundings its curve comes, and whether the curve may
    /// continue in another body there.
    voxels: BTreeMap<Voxel, (LinkAt, bool)>,
    /// Bounds of the voxels of each link's curves, world, metres.
    bounds: Vec<Aabb>,
}

impl Curves {
    /// Follows the curves of the clusters that robots stand in.
    pub(crate) fn follow(bodies: &[StandingRobot], clusters: &[Cluster]) -> Self {
        let edge = clusters.first().map_or(1.0, |cluster| cluster.edge);
        let mut out = Self { edge, ..Self::default() };
        for cluster in clusters {
            let near: Vec<&StandingRobot> =
                bodies.iter().filter(|body| body.region.touches(&cluster.bounds)).collect();
            if !near.is_empty() {
                out.follow_in(&near, cluster);
            }
        }
        let mut bounds: BTreeMap<LinkAt, Aabb> = BTreeMap::new();
        for (voxel, (link, _)) in &out.voxels {
            let bounds = bounds.entry(*link).or_insert(Aabb::EMPTY);
            bounds.add(voxel.map(|v| f64::from(v) * edge));
            bounds.add(voxel.map(|v| f64::from(v + 1) * edge));
        }
        out.bounds = bounds.into_values().collect();
        out
    }

    /// Bounds of the curves, world, metres.
    pub(crate) fn bounds(&self) -> &[Aabb] {
        &self.bounds
    }

    fn follow_in(&mut self, bodies: &[&StandingRobot], cluster: &Cluster) {
        // The set is only looked up and never iterated.
        let occupied: HashSet<Voxel> = cluster.voxels.iter().copied().collect();
        let middle = |v: &Voxel| v.map(|k| (f64::from(k) + 0.5) * cluster.edge);
        let mut queue: VecDeque<(Voxel, LinkAt)> = VecDeque::new();
        for voxel in &cluster.voxels {
            let inset = inset(bodies, middle(voxel));
            let in_layer = inset.filter(|(inset, _)| (0.0..LAYER).contains(inset));
            if let Some((_, link)) = in_layer
                && is_curve(&occupied, *voxel)
            {
                // The curve goes on across the border of the surroundings.
                self.voxels.insert(*voxel, (link, false));
                queue.push_back((*voxel, link));
            }
        }
        while let Some((voxel, link)) = queue.pop_front() {
            for other in cube(voxel, AROUND).filter(|v| occupied.contains(v)) {
                let is_outside =
                    inset(bodies, middle(&other)).is_none_or(|(inset, _)| inset <= 0.0);
                if !is_outside || self.voxels.get(&other).is_some_and(|(_, ends)| !ends) {
                    continue;
                }
                let is_near = (0..3).all(|i| (other[i] - voxel[i]).abs() <= GAP);
                let goes_on = is_near && is_curve(&occupied, other);
                if goes_on {
                    queue.push_back((other, link));
                }
                self.voxels.insert(other, (link, !goes_on));
            }
        }
    }

    /// The link from whose surroundings the curve at a place (world, metres) comes, and whether
    /// another body may begin there; `None` where no curve is.
    #[inline]
    pub(crate) fn at(&self, world: [f64; 3]) -> Option<(LinkAt, bool)> {
        if !self.bounds.iter().any(|bounds| bounds.contains(world)) {
            return None;
        }
        self.voxels.get(&world.map(|v| floor_i32(v / self.edge))).copied()
    }
}

/// Largest depth of a place within the surroundings of a link, metres, and that link; negative
/// outside. `None` away from all regions.
fn inset(bodies: &[&StandingRobot], world: [f64; 3]) -> Option<(f32, LinkAt)> {
    let mut best: Option<(f32, LinkAt)> = None;
    for body in bodies.iter().filter(|body| body.region.contains(world)) {
        for link in &body.links {
            let p = link.world_from_link.inverse() * Point::from(world);
            let bounds = &link.bounds;
            let (min, max) = (bounds.min.map(|v| v as f32), bounds.max.map(|v| v as f32));
            let inset =
                link.reach as f32 - box_distance(min, max, [p.x as f32, p.y as f32, p.z as f32]);
            if best.is_none_or(|b| inset > b.0) {
                best = Some((inset, LinkAt { robot: body.robot, link: link.index }));
            }
        }
    }
    best
}

/// The voxels of a cube around one.
fn cube(voxel: Voxel, half: i32) -> impl Iterator<Item = Voxel> {
    let side = 2 * half + 1;
    (0..side * side * side).map(move |k| {
        let by = [k / (side * side) - half, k / side % side - half, k % side - half];
        [0, 1, 2].map(|i| voxel[i].saturating_add(by[i]))
    })
}

/// Whether the occupied space around a voxel is a thin curve, or one beside something else.
fn is_curve(occupied: &HashSet<Voxel>, voxel: Voxel) -> bool {
    let all: Vec<Voxel> =
        cube(voxel, AROUND).filter(|v| occupied.contains(v)).take(MAX_CURVE + 1).collect();
    if all.len() > MAX_CURVE {
        return false;
    }
    let [across, along] = spreads(&all, voxel);
    if across <= MAX_ACROSS && along >= MIN_ALONG {
        return true;
    }
    let [across, along] = spreads(&connected(&all, voxel), voxel);
    across <= MAX_ACROSS_APART && along >= MIN_ALONG_APART
}

/// The voxels that are connected to one of them within the smaller cube around it, with it.
fn connected(all: &[Voxel], voxel: Voxel) -> Vec<Voxel> {
    let is_near = |a: &Voxel, b: &Voxel, by: i32| (0..3).all(|i| (a[i] - b[i]).abs() <= by);
    let mut left: Vec<Voxel> =
        all.iter().copied().filter(|v| *v != voxel && is_near(v, &voxel, AROUND_APART)).collect();
    let mut out = vec![voxel];
    let mut next = 0;
    while let Some(&at) = out.get(next) {
        next += 1;
        let (beside, others) = left.into_iter().partition(|v| is_near(v, &at, 1));
        left = others;
        out.extend::<Vec<Voxel>>(beside);
    }
    out
}

/// Standard deviations of voxels, voxels: the second largest, and the largest along one direction.
fn spreads(of: &[Voxel], centre: Voxel) -> [f64; 2] {
    let (mut sum, mut squares) = ([0.0; 3], [[0.0; 3]; 3]);
    for other in of {
        let by = [0, 1, 2].map(|i| f64::from(other[i] - centre[i]));
        for i in 0..3 {
            sum[i] += by[i];
            (0..3).for_each(|j| squares[i][j] += by[i] * by[j]);
        }
    }
    let scale = 1.0 / of.len().max(1) as f64;
    let covariance =
        nalgebra::Matrix3::from_fn(|i, j| scale * squares[i][j] - scale * scale * sum[i] * sum[j]);
    let mut spread = covariance.symmetric_eigenvalues().map(|v| v.max(0.0).sqrt());
    spread.as_mut_slice().sort_unstable_by(f64::total_cmp);
    [spread[1], spread[2]]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hose_is_a_curve_and_a_sheet_is_none() {
        let hose: HashSet<Voxel> = (-9..9).flat_map(|z| [[0, 0, z], [1, 0, z]]).collect();
        assert!(is_curve(&hose, [0, 0, 0]));
        let sheet: HashSet<Voxel> = (-9..9).flat_map(|x| (-9..9).map(move |y| [x, y, 0])).collect();
        assert!(!is_curve(&sheet, [0, 0, 0]));
        assert!(!is_curve(&HashSet::from([[0, 0, 0]]), [0, 0, 0]));
        // A hose 15 cm beside the wires of a fence.
        let mut both = hose;
        both.extend((-9..9).flat_map(|z| [[0, 3, z], [4, 3, z]]));
        assert!(is_curve(&both, [0, 0, 0]));
    }
}
