//! A posture near the truth and points in; out come base and all joints at the least robust
//! point-to-plane error (METHOD.md §11).
//!
//! Residual of a point q (base frame) at the facet (x, n) of a link: `r = n·(q − x)`. A joint moves
//! the facet with the twist (v, w), so `∂r/∂θ = −(n·v + w·(q × n))`: exact, since x and n both
//! move. The base moves the point's image the other way. In the rounds with wide gates surface that
//! beams went through gives way along them, too (`pierced`). Sums run in the order of the points:
//! the same bits on any machine with IEEE arithmetic.

use contract::Fan;
use geometry::{Pose, Vector, robust};
use nalgebra::{DMatrix, DVector, Translation3, UnitQuaternion};
use robot::JointKind;

use crate::beam::Hypothesis;
use crate::matching::Matching;
use crate::normal::add_scaled;
use crate::{Prepared, Scene, Settings};

/// One round of the schedule.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Round {
    /// Scale of the robust kernel and gate on the distance, metres.
    pub(crate) gate: f64,
    /// Whether each link weighs the same (square root of its points) or by its points.
    pub(crate) balanced: bool,
}

/// From a beam solution: gates as in METHOD.md §11, ending where the fine field takes over.
pub(crate) const COARSE_ROUNDS: [Round; 9] = [
    Round { gate: 0.120, balanced: true },
    Round { gate: 0.120, balanced: true },
    Round { gate: 0.090, balanced: true },
    Round { gate: 0.065, balanced: true },
    Round { gate: 0.050, balanced: true },
    Round { gate: 0.040, balanced: true },
    Round { gate: 0.030, balanced: true },
    Round { gate: 0.025, balanced: true },
    Round { gate: 0.020, balanced: true },
];

/// Those of them from a posture that is off by no more than a step of a sweep.
pub(crate) const NEAR_ROUNDS: &[Round] = COARSE_ROUNDS.split_at(3).1;

/// The rounds after those, on the fine field; the last ones have the gate that the noise asks for.
pub(crate) const FINE_ROUNDS: [Round; 3] = [
    Round { gate: 0.025, balanced: true },
    Round { gate: 0.018, balanced: true },
    Round { gate: 0.014, balanced: false },
];
/// So many rounds end at a posture.
pub(crate) const N_LAST_ROUNDS: usize = 4;

/// Points that one thread works on at a time, of `n`: few enough that threads end together, as many
/// as make what is joined after them worth it. Sums are taken chunk by chunk, so it does not depend
/// on the threads.
pub(crate) fn chunk(n: usize) -> usize {
    (n / 16).clamp(1024, 8192)
}

/// Distance from which the coarse field answers, metres: just inside the fine field's reach.
pub(crate) const FINE_REACH: f64 = 0.026;

/// A step by less than a tenth of a standard deviation, in every direction, is the last of its kind
/// (squared): steps shrink threefold a round and more.
const SMALL_STEP: f64 = 0.01;

/// A point may lie beside the nearest sample by so many spacings of the samples and so many times
/// the noise.
const BESIDE: (f64, f64) = (1.6, 1.5);

/// Sums of one link's part of the normal equations.
struct Sums {
    /// Its lower triangle until all are joined.
    h: DMatrix<f64>,
    g: DVector<f64>,
    n: usize,
    /// Sums of the weights, and of the kernel's slopes.
    kernel: [f64; 2],
}

impl Sums {
    fn new(n: usize) -> Self {
        Self { h: DMatrix::zeros(n, n), g: DVector::zeros(n), n: 0, kernel: [0.0; 2] }
    }

    /// Adds a residual with its derivatives, by the kernel of a gate.
    fn add(&mut self, row: &[f64], r: f64, gate: f64) {
        let weight = robust::tukey(r, gate);
        self.n += 1;
        self.kernel[0] += weight;
        self.kernel[1] += robust::tukey_slope(r, gate);
        let n = row.len();
        for a in (0..n).filter(|a| row[*a] != 0.0) {
            let wa = weight * row[a];
            self.g[a] += wa * r;
            let column = &mut self.h.as_mut_slice()[a * n + a..(a + 1) * n];
            add_scaled(column, wa, &row[a..]);
        }
    }

    fn join(&mut self, other: &Self) {
        self.h += &other.h;
        self.g += &other.g;
        self.n += other.n;
        (0..2).for_each(|i| self.kernel[i] += other.kernel[i]);
    }
}

/// The refinement of one model in one scene.
pub(crate) struct Refine<'a> {
    pub(crate) prepared: &'a Prepared<'a>,
    pub(crate) scene: &'a Scene<'a>,
    pub(crate) settings: &'a Settings,
    /// What is known of the base beforehand.
    pub(crate) prior: Option<Prior>,
}

/// The base stands upright on a plane.
#[derive(Clone, Copy)]
pub(crate) struct Prior {
    /// Frame on the plane, z = normal, local frame.
    pub(crate) local_from_plane: Pose,
    /// Standard deviations of height, metres, and tilt, radians.
    pub(crate) sigma: [f64; 2],
}

impl Refine<'_> {
    /// Runs the rounds on the points with these indices.
    pub(crate) fn run(
        &self,
        start: &Hypothesis,
        points: &[u32],
        rounds: &[Round],
        fan: &dyn Fan,
    ) -> Hypothesis {
        let mut h = start.clone();
        let mut rounds = rounds.iter().peekable();
        while let Some(round) = rounds.next() {
            let sums = self.sums(&h, points, round.gate, fan);
            let Some((step, deviations)) = self.step(&h, &sums, round) else { break };
            self.apply(&mut h, &step);
            // The same again would change nothing.
            while deviations < SMALL_STEP && rounds.next_if_eq(&round).is_some() {}
        }
        h
    }

    /// How far beside its nearest sample a point of a link may lie, metres.
    pub(crate) fn beside(&self, link: usize) -> f64 {
        let spacing = f64::from(self.prepared.model.links[link].cad.spacing);
        BESIDE.0 * spacing + BESIDE.1 * self.scene.noise
    }

    /// Poses of all links in the local frame.
    pub(crate) fn local_from_links(&self, h: &Hypothesis) -> Vec<Pose> {
        self.prepared.model.poses(&h.posture).iter().map(|p| h.local_from_base * p).collect()
    }

    /// Derivative of a residual at a point with a facet's normal (base frame) by base twist
    /// (translation, rotation about the base's origin; base axes) and by each joint.
    pub(crate) fn row(&self, q: &Vector, n: &Vector, twists: &[[f64; 6]], out: &mut [f64]) {
        let qxn = q.cross(n);
        for i in 0..3 {
            out[i] = -n[i];
            out[3 + i] = -qxn[i];
        }
        for (j, t) in twists.iter().enumerate() {
            let v = n.x * t[0] + n.y * t[1] + n.z * t[2];
            let w = qxn.x * t[3] + qxn.y * t[4] + qxn.z * t[5];
            out[6 + j] = -(v + w);
        }
    }

    /// Normal equations by link.
    fn sums(&self, h: &Hypothesis, points: &[u32], gate: f64, fan: &dyn Fan) -> Vec<Sums> {
        let matching = Matching::new(self, h, gate);
        let kinematics = self.prepared.model.kinematics(&h.posture);
        let n = 6 + h.posture.len();
        let n_links = self.prepared.links.len();
        let chunks = points.chunks(chunk(points.len())).collect();
        let found = fan.fan(chunks, |chunk: &[u32]| {
            let mut sums: Vec<Sums> = (0..n_links).map(|_| Sums::new(n)).collect();
            let mut row = vec![0.0; n];
            matching.each(chunk, |m| {
                self.row(&m.q, &m.n, &kinematics.twists[m.link], &mut row);
                sums[m.link].add(&row, m.r, gate);
            });
            sums
        });
        let mut sums: Vec<Sums> = (0..n_links).map(|_| Sums::new(n)).collect();
        let mut row = vec![0.0; n];
        for m in self.pierced(h, gate) {
            self.row(&m.q, &m.n, &kinematics.twists[m.link], &mut row);
            sums[m.link].add(&row, m.r, gate);
        }
        for own in &found {
            sums.iter_mut().zip(own).for_each(|(sum, own)| sum.join(own));
        }
        for s in &mut sums {
            s.h.fill_upper_triangle_with_lower_triangle();
        }
        sums
    }

    /// Solves for the next step, with its square in standard deviations; `None` where the points
    /// say nothing.
    fn step(&self, h: &Hypothesis, sums: &[Sums], round: &Round) -> Option<(DVector<f64>, f64)> {
        let n = 6 + h.posture.len();
        let (mut hessian, mut gradient) = (DMatrix::zeros(n, n), DVector::zeros(n));
        let total: f64 = sums.iter().map(|s| s.n as f64).sum();
        let mut kernel = [0.0; 2];
        let n_links = sums.iter().filter(|s| s.n > 0).count() as f64;
        if total < 30.0 {
            return None;
        }
        for s in sums.iter().filter(|s| s.n > 0) {
            // Balanced: as if each link had the same √count, the sum over links unchanged in size.
            let factor = if round.balanced { (total / n_links / s.n as f64).sqrt() } else { 1.0 };
            hessian += &s.h * factor;
            gradient += &s.g * factor;
            (0..2).for_each(|i| kernel[i] += s.kernel[i] * factor);
        }
        let sigma = (round.gate / 3.0).max(self.settings.min_noise);
        let variance = self.scene.n_alike * sigma * sigma;
        // Priors are squares: they ask for no longer step.
        hessian /= variance * robust::stretch(kernel[0], kernel[1]);
        gradient /= variance;
        self.add_priors(h, &mut hessian, &mut gradient);
        let delta = hessian.cholesky()?.solve(&-&gradient);
        let deviations = -gradient.dot(&delta);
        // A step beyond half a radian or half a metre has left the linear range: shorten it.
        let longest = delta.amax();
        Some((if longest > 0.5 { delta * (0.5 / longest) } else { delta }, deviations))
    }

    /// Joint limits, installation plane, and a weak pull to stay where the points say nothing.
    pub(crate) fn add_priors(
        &self,
        h: &Hypothesis,
        hessian: &mut DMatrix<f64>,
        gradient: &mut DVector<f64>,
    ) {
        const STAY: f64 = 1.0 / (0.7 * 0.7); // 40° or 0.7 m, one sigma per step
        const LIMIT_SIGMA: f64 = 0.0087; // 0.5°: hard stops have play
        const OFF_PLANE: f64 = 3.0; // deviations off the plane from which on it is likely another's
        for a in 0..hessian.nrows() {
            hessian[(a, a)] += STAY;
        }
        for (j, q) in h.posture.iter().enumerate() {
            let [low, high] = self.prepared.model.limits(j);
            let continuous = self.prepared.model.joints[self.prepared.model.free[j]].kind
                == JointKind::Continuous;
            let over = if continuous { 0.0 } else { (q - high).max(0.0) + (q - low).min(0.0) };
            if over != 0.0 {
                let w = 1.0 / (LIMIT_SIGMA * LIMIT_SIGMA);
                hessian[(6 + j, 6 + j)] += w;
                gradient[6 + j] += w * over;
            }
        }
        if let Some(prior) = &self.prior {
            // Height over the plane and tilt against it, of the base as it stands, in base axes.
            let plane_from_base = prior.local_from_plane.inverse() * h.local_from_base;
            let up = plane_from_base.rotation.inverse() * Vector::z();
            let [ws, wt] = prior.sigma.map(|s| 1.0 / (s * s));
            let height = plane_from_base.translation.z;
            // What points say stands on a plate before the plane is not pulled back to it
            // (METHOD.md §5).
            let far = height / (OFF_PLANE * prior.sigma[0]);
            let ws = ws / (1.0 + far * far).powi(2);
            for a in 0..3 {
                gradient[a] += ws * height * up[a];
                for b in 0..3 {
                    hessian[(a, b)] += ws * up[a] * up[b];
                }
            }
            // Tilt: the plane's normal in base axes is `up`; a small rotation w of the base changes
            // it by −w × up.
            let tilt = Vector::z().cross(&up);
            for a in 0..2 {
                gradient[3 + a] += -wt * tilt[a];
                hessian[(3 + a, 3 + a)] += wt;
            }
        }
    }

    fn apply(&self, h: &mut Hypothesis, step: &DVector<f64>) {
        let shift = Vector::new(step[0], step[1], step[2]);
        let turn = UnitQuaternion::from_scaled_axis(Vector::new(step[3], step[4], step[5]));
        h.local_from_base *= Pose::from_parts(Translation3::from(shift), turn);
        for (j, q) in h.posture.iter_mut().enumerate() {
            *q += step[6 + j];
        }
        self.keep_slides(h);
    }

    /// Whether a free joint slides.
    pub(crate) fn is_prismatic(&self, joint: usize) -> bool {
        self.prepared.slides(joint)
    }

    /// Keeps sliding joints on their way: points along a rod would pull it past its end.
    pub(crate) fn keep_slides(&self, h: &mut Hypothesis) {
        /// What models and stops may be off, metres.
        const PLAY: f64 = 0.004;
        for joint in (0..h.posture.len()).filter(|&j| self.is_prismatic(j)) {
            let [low, high] = self.prepared.model.limits(joint);
            h.posture[joint] = h.posture[joint].clamp(low - PLAY, high + PLAY);
        }
    }

    /// Robust standard deviation of the residuals within a gate, metres.
    pub(crate) fn noise(&self, h: &Hypothesis, points: &[u32], gate: f64) -> f64 {
        let mut residuals = Vec::new();
        Matching::new(self, h, gate).each(points, |m| residuals.push(m.r.abs()));
        robust::median(&mut residuals).map_or(gate, |m| 1.4826 * m)
    }
}
