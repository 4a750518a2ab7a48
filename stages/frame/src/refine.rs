//! Refines a rough pose of the new session by shift and yaw, so that its planes lie on those of the
//! earlier session (point to plane), and estimates its uncertainty.

use crate::surfels::{Surfel, Surfels, voxel};
use geometry::{Pose, Vector};
use nalgebra::{Matrix2, Matrix4, SymmetricEigen, Translation3, UnitQuaternion, Vector4};

/// Largest distance of a surfel from a plane in each round, metres, from a pose of the search.
pub(crate) const WIDE: [f64; 12] =
    [0.35, 0.35, 0.3, 0.25, 0.2, 0.15, 0.12, 0.1, 0.08, 0.06, 0.05, 0.05];
/// The same from the stated pose.
pub(crate) const NEAR: [f64; 8] = [0.12, 0.12, 0.1, 0.1, 0.08, 0.06, 0.05, 0.05];
/// Smallest cosine between the normals of one surface in both sessions: 25°.
const ALIKE: f64 = 0.9;
/// Length of a step along the normal in the search for a plane, metres.
const STEP: f64 = 0.1;
/// Smallest number of pairs of surfel and plane.
const MIN_PAIRS: usize = 30;
/// Largest number of surfels of each kind (level and other), chosen evenly; more add nothing.
const MAX_LAID: usize = 2500;
/// Length of a step that ends the rounds of the last gate, metres and radians.
const SETTLED: f64 = 1e-5;
/// Damping of a step, in surfels.
const DAMPING: f64 = 0.5;
/// Smallest standard deviation of a surfel's distance, metres: noise averages out, errors of the
/// session's registration do not.
const MIN_SCALE: f64 = 1e-3;

/// Number of surfels with correlated errors, those of a square metre: waves of a surface, and
/// registration errors within a session.
const ALIKE_SURFELS: f64 = 25.0;

/// A refined pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Laid {
    /// Pose of the new session's world in the earlier one's, each about its own origin, metres.
    pub old_from_new: Pose,
    /// Standard deviations of x, y, z (metres) and yaw (radians) at the place `about`.
    pub sigma: [f64; 4],
    /// Centroid of the surfels used, the earlier session's world about its origin, metres.
    pub about: Vector,
    /// Number of upright surfels that determine it in the horizontal direction in which they are
    /// fewest.
    pub hold: f64,
    /// Number of surfels used.
    pub n_pairs: usize,
    /// RMS distance of the surfels from the planes, metres.
    pub rms: f64,
}

/// The surfels of a new session that are used for refinement.
pub(crate) struct Chosen {
    surfels: Vec<Surfel>,
    middle: Vector,
}

impl Chosen {
    /// Chooses evenly from all flat surfels.
    pub(crate) fn of(new: &Surfels) -> Self {
        let flat =
            |level: bool| new.all.iter().filter(move |s| s.is_flat() && s.is_level() == level);
        let some = |level: bool| {
            let step = flat(level).count().div_ceil(MAX_LAID).max(1);
            flat(level).step_by(step).copied()
        };
        let surfels: Vec<Surfel> = some(false).chain(some(true)).collect();
        let n = surfels.len().max(1) as f64;
        let middle = surfels.iter().map(|s| s.at).sum::<Vector>() / n;
        Self { surfels, middle }
    }

    /// Refines a pose by the planes of an earlier session; `None` where too few surfels lie near
    /// any plane.
    pub(crate) fn lay(&self, old: &Surfels, from: &Pose, gates: &[f64]) -> Option<Laid> {
        let mut pose = *from;
        let mut last = None;
        for gate in gates {
            let sums = self.sums(old, &pose, *gate)?;
            // Damping keeps what no plane determines unchanged.
            let step = (sums.normal + Matrix4::identity() * DAMPING).try_inverse()? * sums.right;
            let about = (pose * nalgebra::Point3::from(self.middle)).coords;
            pose = moved(&step, &about) * pose;
            last = Some(sums);
            if *gate == gates[gates.len() - 1] && step.amax() < SETTLED {
                break;
            }
        }
        let sums = last?;
        let rms = (sums.squares / sums.weight).sqrt();
        let covariance = (sums.normal + Matrix4::identity() * DAMPING).try_inverse()?
            * rms.max(MIN_SCALE).powi(2)
            * ALIKE_SURFELS;
        let sigma = std::array::from_fn(|i| covariance[(i, i)].max(0.0).sqrt());
        let hold = SymmetricEigen::new(sums.in_plan).eigenvalues.min();
        let about = (pose * nalgebra::Point3::from(self.middle)).coords;
        Some(Laid { old_from_new: pose, sigma, about, hold, n_pairs: sums.n, rms })
    }

    fn sums(&self, old: &Surfels, pose: &Pose, gate: f64) -> Option<RefineSums> {
        let mut out = RefineSums::default();
        let about = (pose * nalgebra::Point3::from(self.middle)).coords;
        for surfel in &self.surfels {
            let at = (pose * nalgebra::Point3::from(surfel.at)).coords;
            let normal = pose.rotation * surfel.normal;
            let Some(on) = nearest(old, &at, &normal, surfel.is_signed, gate) else { continue };
            let plane = &old.all[on];
            let distance = plane.normal.dot(&(at - plane.at));
            let u = distance / gate;
            let weight = (1.0 - u * u).powi(2);
            let n = plane.normal;
            let arm = at - about;
            let row = Vector4::new(n.x, n.y, n.z, arm.x * n.y - arm.y * n.x);
            out.normal += weight * row * row.transpose();
            out.right -= weight * distance * row;
            out.squares += weight * distance * distance;
            out.weight += weight;
            out.n += 1;
            out.in_plan += weight * Matrix2::new(n.x * n.x, n.x * n.y, n.x * n.y, n.y * n.y);
        }
        (out.n >= MIN_PAIRS && out.weight > 0.0).then_some(out)
    }
}

#[derive(Default)]
struct RefineSums {
    normal: Matrix4<f64>,
    right: Vector4<f64>,
    in_plan: Matrix2<f64>,
    squares: f64,
    weight: f64,
    n: usize,
}

/// The plane of an earlier session that is nearest to a place along a normal.
fn nearest(
    old: &Surfels,
    at: &Vector,
    normal: &Vector,
    is_signed: bool,
    gate: f64,
) -> Option<usize> {
    let n_steps = (gate / STEP).ceil() as i32;
    let mut best: Option<(f64, usize)> = None;
    let mut last = [i32::MAX; 3];
    for k in -n_steps..=n_steps {
        let here = voxel(&(at + normal * (f64::from(k) * STEP)));
        if here == last {
            continue;
        }
        last = here;
        let Some(i) = old.of(&here) else { continue };
        let plane = &old.all[i];
        if !plane.is_flat() || plane.cosine(normal, is_signed) < ALIKE {
            continue;
        }
        let distance = plane.normal.dot(&(at - plane.at)).abs();
        if distance < gate && best.is_none_or(|(least, _)| distance < least) {
            best = Some((distance, i));
        }
    }
    best.map(|(_, i)| i)
}

/// The motion by a shift and a yaw about a place.
fn moved(step: &Vector4<f64>, about: &Vector) -> Pose {
    let turn = UnitQuaternion::from_axis_angle(&Vector::z_axis(), step[3]);
    let shift = Vector::new(step[0], step[1], step[2]);
    Pose::from_parts(Translation3::from(about + shift - turn * about), turn)
}

/// Distance between the images of a place under two poses (horizontal and vertical together),
/// metres, and difference of the yaws, radians.
pub(crate) fn apart(a: &Pose, b: &Pose, at: &Vector) -> (f64, f64) {
    let at = nalgebra::Point3::from(*at);
    ((a * at - b * at).norm(), a.rotation.angle_to(&b.rotation))
}
