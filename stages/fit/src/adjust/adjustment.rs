//! The rounds of the adjustment, and what it ends with.

use geometry::{Point, robust};
use nalgebra::{DMatrix, DVector};

use super::normal::{Normal, ResidualRow};
use super::tallies::Tallies;
use crate::correspond::{AdjustPoints, MetTriangle, Pairing};
use crate::model::Smoothness;
use crate::problem::{
    AdjustState, JointPlaces, Problem, add_priors, keep_slides, residual_row, scan_priors,
};
use crate::state::{Hypothesis, N_SCAN, ScanError};

/// What an adjustment ends with.
#[derive(Debug, Clone)]
pub(crate) struct Adjusted {
    pub(crate) hypothesis: Hypothesis,
    /// Covariance of base twist (base axes at the base: translation, rotation) and joints.
    pub(crate) covariance: DMatrix<f64>,
    /// One for each view.
    pub(crate) scans: Vec<ScanError>,
    /// Noise of the ranges as the residuals show it, metres, one sigma; at most what it started
    /// with.
    pub(crate) noise: f64,
    /// How the robot gives way to those, and what its points say of them (see [`Normal::shared`]).
    pub(crate) shared: Option<[DMatrix<f64>; 2]>,
    /// How far the model's surface is off, standard deviation over its patches, metres.
    pub(crate) patch_sigma: f64,
    /// How smoothly the offset varies over a link.
    pub(crate) smoothness: Smoothness,
    /// Points within the gate, for each link.
    pub(crate) n_points: Vec<usize>,
    /// RMS distance of those points, metres, for each link.
    pub(crate) link_rms: Vec<f64>,
}

impl Adjusted {
    /// RMS distance of all points from the surface, metres.
    pub(crate) fn rms(&self) -> f64 {
        let total: usize = self.n_points.iter().sum();
        let squares = self.n_points.iter().zip(&self.link_rms).map(|(n, r)| *n as f64 * r * r);
        (squares.sum::<f64>() / total.max(1) as f64).sqrt()
    }

    /// Where it stands, to go on from.
    pub(crate) fn state(&self) -> AdjustState {
        let (hypothesis, scans) = (self.hypothesis.clone(), self.scans.clone());
        let smoothness = Some(self.smoothness);
        let Self { noise, patch_sigma, .. } = *self;
        AdjustState { hypothesis, scans, noise, patch_sigma, smoothness }
    }
}

/// The adjustment of one robot.
#[derive(Clone, Copy)]
pub(crate) struct Adjust<'a> {
    pub(crate) problem: Problem<'a>,
    /// Joints whose places on their links are unknowns, too, in [`Self::at`].
    pub(crate) places: &'a [usize],
    /// Joints that need not have come to rest at the end: their values are looked for by
    /// themselves.
    pub(crate) loose: &'a [usize],
}

/// Most rounds of the adjustment: a flange that the points leave open would wander on for ever.
const N_ROUNDS: usize = 7;
/// The last step is one by less than a third of a standard deviation, in all directions together,
/// or one after which steps that go on to shrink as they did, mostly sixfold a round, come to less
/// than that.
const SMALL_STEP: f64 = 0.3;
/// Tukey's constant: 95 % efficient for normal errors.
const TUKEY: f64 = 4.685;

impl<'a> Adjust<'a> {
    /// An adjustment of base and joints.
    pub(crate) fn new(problem: &Problem<'a>) -> Self {
        Self { problem: *problem, places: &[], loose: &[] }
    }

    /// Adjusts on some points, from where nothing is known of the scans' errors.
    pub(crate) fn run(&self, start: &Hypothesis, points: &mut AdjustPoints) -> Adjusted {
        self.run_from(AdjustState::at(start, self.problem.scene), points)
    }

    /// Adjusts from any state.
    pub(crate) fn run_from(&self, start: AdjustState, points: &mut AdjustPoints) -> Adjusted {
        let mut state = start;
        let (mut round, mut before) = (0, 0.0);
        self.problem.prepared.make_triangles(self.problem.fan);
        loop {
            let (sums, tallies) = self.sums(&state, points);
            let normal = self.closed(&state, sums);
            state.smoothness = Some(normal.smoothness());
            let solved = (round < N_ROUNDS).then(|| normal.solve()).flatten();
            let Some(step) = solved else {
                return self.finish(state, &tallies, &normal);
            };
            self.apply(&mut state, &step);
            round += 1;
            let length = normal.deviations(&self.without_loose(step)).sqrt();
            let left = if length < before { length * length / (before - length) } else { length };
            before = length;
            if length.min(left) < SMALL_STEP {
                return self.finish(state, &tallies, &normal);
            }
        }
    }

    fn without_loose(&self, mut step: DVector<f64>) -> DVector<f64> {
        self.loose.iter().for_each(|j| step[6 + j] = 0.0);
        step
    }

    /// One step from a state, by what was summed up at it.
    pub(crate) fn step(&self, mut state: AdjustState, sums: Normal) -> AdjustState {
        if let Some(step) = self.closed(&state, sums).solve() {
            self.apply(&mut state, &step);
        }
        state
    }

    /// Normal equations at a state, the places of the joints among the unknowns.
    pub(crate) fn at(&self, state: &AdjustState, points: &mut AdjustPoints) -> Normal {
        self.closed(state, self.sums(state, points).0)
    }

    /// Sums of the points at a state, and what is said of each link. What triangles the points lie
    /// on is known from a state like this one, and kept.
    pub(crate) fn sums(&self, state: &AdjustState, points: &mut AdjustPoints) -> (Normal, Tallies) {
        let Problem { fan, .. } = self.problem;
        let pairing = Pairing::new(&self.problem, state, points.gate);
        let mut sums =
            fan.fan(points.chunks(), |(points, met)| self.sums_of(&pairing, points, met));
        // Two by two, all pairs at the same time: the same order for any number of threads.
        while sums.len() > 1 {
            let mut rest = sums.into_iter();
            let pairs = std::iter::from_fn(|| rest.next().map(|own| (own, rest.next())));
            sums = fan.fan(pairs.collect(), |((a, own), other)| match other {
                Some((b, later)) => (a.join(b), own.join(&later)),
                None => (a, own),
            });
        }
        sums.pop().unwrap_or_else(|| self.sums_of(&pairing, &[], &mut []))
    }

    /// Half the robust squares of all points over their variance; one that lies on nothing counts
    /// as much as one at the end of the kernel.
    pub(crate) fn cost(&self, state: &AdjustState, points: &AdjustPoints) -> f64 {
        let pairing = Pairing::new(&self.problem, state, points.gate);
        let slack = state.patch_sigma * state.patch_sigma;
        let of = |point: &u32| match pairing.pair(*point, &mut None) {
            Some(pair) => {
                let variance = pair.variance + slack;
                robust::tukey_cost(pair.r, kernel_scale(variance, points.gate)) / variance
            }
            None => robust::tukey_cost(TUKEY, TUKEY),
        };
        points.points().iter().map(of).sum::<f64>() / self.problem.scene.n_alike
    }

    /// Normal equations of what was summed up at a state, patches taken out, with all priors.
    fn closed(&self, state: &AdjustState, mut sums: Normal) -> Normal {
        self.add_priors(state, &mut sums);
        sums.close(&self.problem.prepared.patches, state.smoothness, self.problem.fan);
        sums
    }

    /// The sums of some points.
    fn sums_of(
        &self,
        pairing: &Pairing<'_>,
        points: &[u32],
        met: &mut [Option<MetTriangle>],
    ) -> (Normal, Tallies) {
        let (state, gate) = (pairing.state, pairing.gate);
        let h = &state.hypothesis;
        let prepared = self.problem.prepared;
        let kinematics = prepared.model.kinematics(&h.posture);
        let base_from_local = h.local_from_base.inverse();
        let n_posed = 6 + h.posture.len();
        let n_robot = n_posed + 6 * self.places.len();
        let places = JointPlaces::new(prepared.model, &kinematics, self.places);
        let mut normal =
            Normal::new(n_robot, self.problem.scene.views.len(), prepared.patches.len());
        let mut tallies = Tallies::new(prepared.links.len());
        let slack = state.patch_sigma * state.patch_sigma;
        let n_alike = self.problem.scene.n_alike;
        let mut robot = vec![0.0; n_robot];
        let pairs = points.iter().zip(met).filter_map(|(&i, met)| pairing.pair(i, met));
        for pair in pairs {
            tallies.add(&pair);
            let scale = kernel_scale(pair.variance + slack, gate);
            let kernel = robust::tukey(pair.r, scale);
            let variance = n_alike * pair.variance;
            let weight = kernel / variance;
            if weight <= 0.0 {
                continue;
            }
            let slope = robust::tukey_slope(pair.r, scale) / variance;
            // Where many err alike, their residuals are as large as their own variance.
            let influence = [n_alike * (weight * pair.r).powi(2), slope];
            let q = base_from_local * Point::from(pair.p);
            let n = base_from_local.rotation * pair.n;
            residual_row(&q.coords, &n, &kinematics.twists[pair.link], &mut robot[..n_posed]);
            places.row(pair.link, &q.coords, &n, &mut robot[n_posed..]);
            let patch = prepared.links[pair.link].patch(pair.patch);
            let (at, normal_there) = pairing.inside(&pair);
            let shape = prepared.patches.places[patch].shape(&at, &normal_there);
            let lever = pair.beam.cross(&pair.n);
            let scan =
                [pair.n.x, pair.n.y, pair.n.z, lever.x, lever.y, lever.z, -pair.n.dot(&pair.ray)];
            normal.add(&ResidualRow {
                robot: &robot,
                scan,
                view: pair.view,
                patch,
                shape,
                weight,
                influence,
                r: pair.r,
            });
        }
        (normal, tallies)
    }

    fn add_priors(&self, state: &AdjustState, normal: &mut Normal) {
        let h = &state.hypothesis;
        let n = 6 + h.posture.len();
        let (mut hessian, mut gradient) = (DMatrix::zeros(n, n), DVector::zeros(n));
        add_priors(&self.problem, h, &mut hessian, &mut gradient);
        normal.add_robot_prior(&hessian, &gradient);
        let priors = scan_priors(self.problem.settings);
        for (view, error) in state.scans.iter().enumerate() {
            for (i, value) in error.values().into_iter().enumerate() {
                normal.add_scan_prior(view, i, value, priors[i]);
            }
        }
    }

    fn apply(&self, state: &mut AdjustState, step: &DVector<f64>) {
        let n = 6 + state.hypothesis.posture.len();
        state.hypothesis.take(step.as_slice());
        keep_slides(self.problem.prepared, &mut state.hypothesis);
        for (view, scan) in state.scans.iter_mut().enumerate() {
            let at = n + view * N_SCAN;
            scan.take(&step.as_slice()[at..at + N_SCAN]);
        }
    }

    fn finish(&self, state: AdjustState, tallies: &Tallies, normal: &Normal) -> Adjusted {
        // Where many err alike, their scatter does not tell how far they are off.
        let is_alike = self.problem.scene.n_alike > 1.0;
        let scale = if is_alike { 1.0 } else { tallies.scale().min(1.0) };
        Adjusted {
            noise: state.noise * scale,
            covariance: normal.covariance(&self.problem.prepared.patches),
            hypothesis: state.hypothesis,
            scans: state.scans,
            shared: normal.shared(),
            patch_sigma: normal.patch_sigma(),
            smoothness: normal.smoothness(),
            n_points: tallies.n_points(),
            link_rms: tallies.rms(),
        }
    }
}

/// From where on the kernel gives no weight to residuals of a variance, m²; metres.
pub(crate) fn kernel_scale(variance: f64, gate: f64) -> f64 {
    (TUKEY * variance.sqrt()).min(gate)
}
