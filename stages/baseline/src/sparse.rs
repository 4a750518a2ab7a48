//! Registers a base with the points that may be its own, from a rough pose on, by sparse iterative
//! closest points: an ℓp norm, p < 1, minimised by alternating directions with multipliers (the
//! source, §3.2; METHOD.md §10).

use geometry::{Point, Pose, Vector};
use nalgebra::{Matrix3, Rotation3, Translation3, UnitQuaternion};

use crate::context::SequentialFit;

/// Most points that take part.
const MAX_POINTS: usize = 2500;
/// Where iterations stop, in unit size.
const STOP: f64 = 1e-5;
/// Largest penalty.
const MAX_MU: f64 = 1e5;
/// Rounds of the inner fixed point of the shrinkage.
const N_SHRINK: usize = 3;

/// Local from base after registration, six degrees of freedom.
pub(crate) fn register(robot: &SequentialFit<'_>, start: &Pose, points: &[Vector]) -> Pose {
    let s = robot.settings;
    let step = points.len().div_ceil(MAX_POINTS).max(1);
    let base = robot.base_pose();
    let mut local_from_base = *start;
    let cloud: Vec<Vector> = points.iter().step_by(step).copied().collect();
    let size = {
        let mean = cloud.iter().sum::<Vector>() / cloud.len().max(1) as f64;
        cloud.iter().map(|p| (p - mean).norm()).fold(1e-3, f64::max)
    };
    let [mu, growth] = s.sparse_mu;
    let norm = SparseNorm { p: s.sparse_p, mu, growth, rounds: s.sparse_rounds[1] };
    let mut multipliers = vec![Vector::zeros(); cloud.len()];
    for _ in 0..s.sparse_rounds[0] {
        let link_from_local = (local_from_base * base).inverse();
        // Scan points in the link's frame, in unit size, and the closest points of its surface.
        let mut x: Vec<Vector> = Vec::with_capacity(cloud.len());
        let mut q: Vec<Vector> = Vec::with_capacity(cloud.len());
        let mut c: Vec<Vector> = Vec::with_capacity(cloud.len());
        for (p, multiplier) in cloud.iter().zip(&multipliers) {
            let at = link_from_local * Point::from(*p);
            let Some((closest, _)) = robot.closest(robot.base, &at) else { continue };
            x.push(at.coords / size);
            q.push(closest.coords / size);
            c.push(*multiplier);
        }
        if x.len() < 10 {
            break;
        }
        let moved = align(&x, &q, &mut c, &norm);
        let shift = Translation3::from(moved.translation.vector * size);
        let motion = Pose::from_parts(shift, moved.rotation);
        // The points move by `motion` in the link's frame: the link moves the other way.
        let link_motion = motion.inverse();
        local_from_base = local_from_base * base * link_motion * base.inverse();
        multipliers.iter_mut().for_each(|m| *m = Vector::zeros());
        if moved.translation.vector.norm() < STOP && moved.rotation.angle() < STOP {
            break;
        }
    }
    local_from_base
}

/// The sparse norm, and how it is minimised.
struct SparseNorm {
    /// Exponent, 0..1.
    p: f64,
    /// First penalty of the multipliers (unit size), and the factor that it grows by in a round.
    mu: f64,
    growth: f64,
    /// Most rounds.
    rounds: usize,
}

/// The motion of `x` that brings it onto `q` in the sparse norm; `c` are the multipliers.
fn align(x: &[Vector], q: &[Vector], c: &mut [Vector], norm: &SparseNorm) -> Pose {
    let &SparseNorm { p, mut mu, growth, rounds } = norm;
    let mut motion = Pose::identity();
    let mut now: Vec<Vector> = x.to_vec();
    let mut z = vec![Vector::zeros(); x.len()];
    for _ in 0..rounds {
        for i in 0..x.len() {
            z[i] = shrink(now[i] - q[i] + c[i] / mu, p, mu);
        }
        let target: Vec<Vector> = (0..x.len()).map(|i| q[i] + z[i] - c[i] / mu).collect();
        let weights = vec![1.0; x.len()];
        let next = rigid(x, &target, &weights);
        let (mut primal, mut dual) = (0.0_f64, 0.0_f64);
        for i in 0..x.len() {
            let p = (next * Point::from(x[i])).coords;
            dual = dual.max((p - now[i]).norm());
            now[i] = p;
            let delta = p - q[i] - z[i];
            primal = primal.max(delta.norm());
            c[i] += delta * mu;
        }
        motion = next;
        mu = (mu * growth).min(MAX_MU);
        if primal < STOP && dual < STOP {
            break;
        }
    }
    motion
}

/// The shrinkage of the ℓp norm.
fn shrink(h: Vector, p: f64, mu: f64) -> Vector {
    let norm = h.norm();
    let alpha = (2.0 / mu * (1.0 - p)).powf(1.0 / (2.0 - p));
    let threshold = alpha + p / mu * alpha.powf(p - 1.0);
    if norm <= threshold || norm == 0.0 {
        return Vector::zeros();
    }
    let mut beta = (alpha / norm + 1.0) / 2.0;
    for _ in 0..N_SHRINK {
        beta = 1.0 - p / mu * norm.powf(p - 2.0) * beta.powf(p - 1.0);
    }
    h * beta
}

/// The rigid motion that brings weighted points onto others, in closed form.
pub(crate) fn rigid(from: &[Vector], to: &[Vector], weights: &[f64]) -> Pose {
    let total: f64 = weights.iter().sum();
    let mean = |v: &[Vector]| {
        v.iter().zip(weights).map(|(p, w)| p * *w).sum::<Vector>() / total.max(1e-300)
    };
    let (a, b) = (mean(from), mean(to));
    let mut m: Matrix3<f64> = Matrix3::zeros();
    for ((p, q), w) in from.iter().zip(to).zip(weights) {
        m += (p - a) * (q - b).transpose() * *w;
    }
    let svd = m.svd(true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else { return Pose::identity() };
    let mut v = v_t.transpose();
    if (v * u.transpose()).determinant() < 0.0 {
        // The smallest singular value comes last.
        let flipped = -v.column(2);
        v.set_column(2, &flipped);
    }
    let rotation = Rotation3::from_matrix_unchecked(v * u.transpose());
    let turn = UnitQuaternion::from_rotation_matrix(&rotation);
    Pose::from_parts(Translation3::from(b - turn * a), turn)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_known_motion_is_found_among_a_third_of_outliers() {
        let mut state = 7_u64;
        let mut random = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as f64 / f64::from(1_u32 << 31) - 0.5
        };
        let x: Vec<Vector> = (0..300).map(|_| Vector::new(random(), random(), random())).collect();
        let truth = Pose::new(Vector::new(0.02, -0.03, 0.01), Vector::new(0.03, -0.02, 0.05));
        let q: Vec<Vector> = x
            .iter()
            .enumerate()
            .map(|(i, p)| {
                let moved = (truth * Point::from(*p)).coords;
                if i % 3 == 0 { moved + Vector::new(random(), random(), random()) } else { moved }
            })
            .collect();
        let mut c = vec![Vector::zeros(); x.len()];
        let found =
            align(&x, &q, &mut c, &SparseNorm { p: 0.4, mu: 10.0, growth: 1.2, rounds: 100 });
        let off = found.inverse() * truth;
        assert!(off.translation.vector.norm() < 1e-3, "{off}");
        assert!(off.rotation.angle() < 1e-3, "{off}");
    }
}
