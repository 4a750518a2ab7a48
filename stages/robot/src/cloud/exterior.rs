//! Finds which side of a link's surface faces the outside, if any. Vendors' meshes contain motors
//! and bolts that no scanner sees, and triangles with reversed orientation.

use super::place::{SurfaceSample, corners as triangle_corners};
use crate::model::Mesh;
use nalgebra::Vector3;
use parry3d::bounding_volume::Aabb;
use parry3d::partitioning::{Bvh, BvhBuildStrategy, BvhNode, TraversalAction};

/// Number of rays over a hemisphere.
const N_RAYS: usize = 24;
/// Number of rays between two tests of whether the case is clear; each such subset is spread over
/// the hemisphere like the whole set.
const N_FIRST: usize = 4;
/// Number of escaping rays that make a place visible. A single ray may slip through a crack between
/// badly joined triangles.
const N_ESCAPES: usize = 2;
/// Distance of a ray's origin from the surface, metres: above rounding, below any real gap.
const LIFT: f32 = 1e-4;

/// A side of a triangle, by the order of its corners.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Side {
    Front,
    Back,
}

/// A mesh with a bounding volume hierarchy for ray casting.
pub(super) struct Shell {
    bvh: Bvh,
    /// For each triangle its first corner and two edges, metres.
    triangles: Vec<[Vector3<f32>; 3]>,
    rays: [Vector3<f32>; N_RAYS],
}

impl Shell {
    pub(super) fn new(mesh: &Mesh) -> Self {
        let corners = |t: &[u32; 3]| triangle_corners(mesh, t);
        let boxes: Vec<Aabb> = (mesh.triangles.iter().map(corners))
            .map(|[a, b, c]| {
                let (low, high) = (a.inf(&b).inf(&c), a.sup(&b).sup(&c));
                Aabb::new(low.into(), high.into())
            })
            .collect();
        Self {
            bvh: Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes),
            triangles: mesh
                .triangles
                .iter()
                .map(corners)
                .map(|[a, b, c]| [a, b - a, c - a])
                .collect(),
            rays: hemisphere(),
        }
    }

    /// The side from which more rays escape, if enough escape on either; stops early where the case
    /// is clear.
    pub(super) fn side(&self, sample: &SurfaceSample, blockers: &mut Blockers) -> Option<Side> {
        let (mut front, mut back) = (0, 0);
        let [ahead, behind] = &mut blockers.0;
        for round in (0..N_RAYS).step_by(N_FIRST) {
            if is_clear(round, front, back) {
                break;
            }
            for n in round..round + N_FIRST {
                let (ray, blocker) = (&self.rays[n], &mut behind[n]);
                back += usize::from(self.escapes(sample.at, -sample.normal, ray, blocker));
            }
            for n in round..round + N_FIRST {
                // Rays that escape take longest, so no more are cast than are needed.
                if back == 0 && front >= N_ESCAPES {
                    return Some(Side::Front);
                }
                let (ray, blocker) = (&self.rays[n], &mut ahead[n]);
                front += usize::from(self.escapes(sample.at, sample.normal, ray, blocker));
            }
        }
        if front.max(back) < N_ESCAPES {
            None
        } else if front >= back {
            Some(Side::Front)
        } else {
            Some(Side::Back)
        }
    }

    /// Whether a ray of the hemisphere about `normal` leaves the mesh. The triangle that stopped
    /// the same ray at the previous place is tested first, since that place is usually a neighbour.
    fn escapes(
        &self,
        at: Vector3<f32>,
        normal: Vector3<f32>,
        ray: &Vector3<f32>,
        blocker: &mut u32,
    ) -> bool {
        let helper = if normal.x.abs() < 0.7 { Vector3::x() } else { Vector3::y() };
        let e = normal.cross(&helper).normalize();
        let f = normal.cross(&e);
        let direction = e * ray.x + f * ray.y + normal * ray.z;
        let origin = at + normal * LIFT;
        let is_hit = |triangle| hits(triangle, &origin, &direction);
        if self.triangles.get(*blocker as usize).is_some_and(is_hit) {
            return false;
        }
        // A component of zero would divide by zero.
        let inverse = direction.map(|v| if v.abs() < 1e-12 { 1e12 } else { 1.0 / v });
        let mut escapes = true;
        self.bvh.traverse(|node: &BvhNode| {
            if !crosses(node, &origin, &inverse) {
                return TraversalAction::Prune;
            }
            match node.leaf_data() {
                Some(leaf) if is_hit(&self.triangles[leaf as usize]) => {
                    (escapes, *blocker) = (false, leaf);
                    TraversalAction::EarlyExit
                }
                _ => TraversalAction::Continue,
            }
        });
        escapes
    }
}

/// For each ray on either side, the triangle that stopped it last.
pub(super) struct Blockers([[u32; N_RAYS]; 2]);

impl Blockers {
    pub(super) fn none() -> Self {
        Self([[u32::MAX; N_RAYS]; 2])
    }
}

/// Whether more rays could not change the answer, or could only do so for a place that hardly any
/// beam reaches.
fn is_clear(n_cast: usize, front: usize, back: usize) -> bool {
    let one_sided = front.max(back) >= N_ESCAPES && front.min(back) == 0;
    let hidden = n_cast >= N_RAYS / 2 && front + back == 0;
    one_sided || hidden || front.abs_diff(back) > N_ESCAPES
}

fn crosses(node: &BvhNode, origin: &Vector3<f32>, inverse: &Vector3<f32>) -> bool {
    let (low, high) = (node.mins(), node.maxs());
    let (low, high) = ([low.x, low.y, low.z], [high.x, high.y, high.z]);
    let (mut enter, mut leave) = (0.0_f32, f32::INFINITY);
    // No value here is NaN, so the slower `f32::min`, which handles NaN, is not needed.
    let (least, most) =
        (|a: f32, b: f32| if a < b { a } else { b }, |a: f32, b: f32| if a > b { a } else { b });
    for k in 0..3 {
        let (a, b) = ((low[k] - origin[k]) * inverse[k], (high[k] - origin[k]) * inverse[k]);
        enter = most(enter, least(a, b));
        leave = least(leave, most(a, b));
    }
    // The margin keeps a flat box from vanishing by rounding.
    enter <= leave * 1.000_001 + 1e-7
}

/// Whether a ray hits a triangle from either side (Möller and Trumbore).
fn hits([a, e, f]: &[Vector3<f32>; 3], origin: &Vector3<f32>, direction: &Vector3<f32>) -> bool {
    let p = direction.cross(f);
    let det = e.dot(&p);
    if det == 0.0 {
        return false;
    }
    let inverse = 1.0 / det;
    let t = origin - a;
    let u = t.dot(&p) * inverse;
    if !(-1e-5..=1.000_01).contains(&u) {
        return false;
    }
    let q = t.cross(e);
    let v = direction.dot(&q) * inverse;
    v >= -1e-5 && u + v <= 1.000_01 && f.dot(&q) * inverse > 0.0
}

/// Directions over the hemisphere about +z without grazing ones, in an order in which each first
/// part is spread evenly, too.
fn hemisphere() -> [Vector3<f32>; N_RAYS] {
    std::array::from_fn(|k| {
        // Every sixth direction of a spiral first, then the others.
        let n_rounds = N_RAYS / N_FIRST;
        let at = (k % N_FIRST) * n_rounds + k / N_FIRST;
        let z = 1.0 - 0.92 * (at as f64 + 0.5) / N_RAYS as f64;
        let angle = 2.399_963_229_728_653 * at as f64 + 0.3; // golden angle
        let flat = (1.0 - z * z).sqrt();
        Vector3::new((flat * angle.cos()) as f32, (flat * angle.sin()) as f32, z as f32)
    })
}
