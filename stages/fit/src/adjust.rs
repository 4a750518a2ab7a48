//! A refined posture and its points in; out come base, joints and the scans' own errors in one
//! robust least-squares adjustment, with a covariance that stays honest when errors of points are
//! alike (METHOD.md §11, §14).
//!
//! Beside base and joints each scan has a shift, a turn about its scanner and a range bias with
//! priors: scans are registered to millimetres only, and a fit that does not know that bends the
//! robot. And each patch of the model's surface has an offset along its normals, `u ~ N(0, σ_u²)`,
//! taken out in closed form, σ_u estimated from the patches themselves: a model is drawn to
//! millimetres only. Both or neither: without the patches scans would be bent to fit a wrong shape.

use contract::{Fan, OneByOne};
use geometry::{Point, Pose, Vector, robust};
use nalgebra::{DMatrix, DVector, Translation3, UnitQuaternion};

use crate::beam::Hypothesis;
use crate::calibrate::Frames;
use crate::normal::{N_SCAN, Normal, Row, Smoothness};
use crate::pairs::{Known, Pairing};
use crate::refine::Refine;
use crate::sampled::Sampled;
use crate::tallies::Tallies;
use crate::{Scene, Settings};

/// How a scan differs from its stated pose, as far as the points near a robot tell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ScanError {
    /// To be added to its points, metres, local axes.
    pub(crate) shift: Vector,
    /// Turn of its points about the scanner, radians, local axes.
    pub(crate) turn: Vector,
    /// Its ranges are too long by this, metres.
    pub(crate) bias: f64,
}

impl ScanError {
    const NONE: Self =
        Self { shift: Vector::new(0.0, 0.0, 0.0), turn: Vector::new(0.0, 0.0, 0.0), bias: 0.0 };

    /// The values in the order of the unknowns.
    pub(crate) fn values(&self) -> [f64; N_SCAN] {
        let (t, w) = (self.shift, self.turn);
        [t.x, t.y, t.z, w.x, w.y, w.z, self.bias]
    }

    fn add(&mut self, step: &[f64]) {
        self.shift += Vector::new(step[0], step[1], step[2]);
        self.turn += Vector::new(step[3], step[4], step[5]);
        self.bias += step[6];
    }
}

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
    /// How smoothly it is.
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
    pub(crate) fn state(&self) -> State {
        let (hypothesis, scans) = (self.hypothesis.clone(), self.scans.clone());
        let smoothness = Some(self.smoothness);
        State { hypothesis, scans, noise: self.noise, patch_sigma: self.patch_sigma, smoothness }
    }
}

/// The adjustment of one robot.
pub(crate) struct Adjust<'a> {
    pub(crate) refine: &'a Refine<'a>,
    /// Joints whose places on their links are unknowns, too, in [`Self::at`].
    pub(crate) frames: &'a [usize],
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

/// Where the adjustment stands.
#[derive(Clone)]
pub(crate) struct State {
    pub(crate) hypothesis: Hypothesis,
    pub(crate) scans: Vec<ScanError>,
    /// What is taken for the noise of the ranges, metres, one sigma.
    pub(crate) noise: f64,
    pub(crate) patch_sigma: f64,
    /// How smoothly the model's surface is off; `None`: as the residuals say.
    pub(crate) smoothness: Option<Smoothness>,
}

impl State {
    /// A posture, before anything is known of the scans' errors. Patches of the surface are off
    /// apart: that is soon reckoned, and enough to choose by.
    pub(crate) fn at(hypothesis: &Hypothesis, scene: &Scene<'_>) -> Self {
        let scans = vec![ScanError::NONE; scene.views.len()];
        let hypothesis = hypothesis.clone();
        let smoothness = Some(Smoothness::Apart);
        Self { hypothesis, scans, noise: scene.noise, patch_sigma: 0.0, smoothness }
    }

    /// The same, with the model's surface off as smoothly as the residuals say.
    pub(crate) fn open(self) -> Self {
        Self { smoothness: None, ..self }
    }
}

impl<'a> Adjust<'a> {
    /// Of base and joints.
    pub(crate) fn new(refine: &'a Refine<'a>) -> Self {
        Self { refine, frames: &[], loose: &[] }
    }

    fn settings(&self) -> &Settings {
        self.refine.settings
    }

    /// Adjusts on some points, from where nothing is known of the scans' errors.
    pub(crate) fn run(&self, start: &Hypothesis, points: &mut Sampled, fan: &dyn Fan) -> Adjusted {
        self.run_from(State::at(start, self.refine.scene), points, fan)
    }

    /// The same from any state.
    pub(crate) fn run_from(&self, start: State, points: &mut Sampled, fan: &dyn Fan) -> Adjusted {
        let mut state = start;
        let (mut round, mut before) = (0, 0.0);
        self.refine.prepared.make_triangles(fan);
        loop {
            let (sums, tallies) = self.sums(&state, points, fan);
            let normal = self.closed(&state, sums, fan);
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
    pub(crate) fn step(&self, mut state: State, sums: Normal) -> State {
        if let Some(step) = self.closed(&state, sums, &OneByOne).solve() {
            self.apply(&mut state, &step);
        }
        state
    }

    /// Normal equations at a state, the places of the joints among the unknowns.
    pub(crate) fn at(&self, state: &State, points: &mut Sampled, fan: &dyn Fan) -> Normal {
        self.closed(state, self.sums(state, points, fan).0, fan)
    }

    /// Sums of the points at a state, and what is said of each link. What triangles the points lie
    /// on is known from a state like this one, and kept.
    pub(crate) fn sums(
        &self,
        state: &State,
        points: &mut Sampled,
        fan: &dyn Fan,
    ) -> (Normal, Tallies) {
        let pairing = Pairing::new(self.refine, state, points.gate);
        let mut sums = fan.fan(points.chunks(), |chunk| self.sums_of(&pairing, chunk));
        // Two by two, all pairs at the same time: the same order for any number of threads.
        while sums.len() > 1 {
            let mut rest = sums.into_iter();
            let pairs = std::iter::from_fn(|| rest.next().map(|own| (own, rest.next())));
            sums = fan.fan(pairs.collect(), |((a, own), other)| match other {
                Some((b, later)) => (a.join(b), own.join(&later)),
                None => (a, own),
            });
        }
        sums.pop().unwrap_or_else(|| self.sums_of(&pairing, (&[], &mut [])))
    }

    /// Half the robust squares of all points over their variance; one that lies on nothing counts
    /// as much as one at the end of the kernel.
    pub(crate) fn cost(&self, state: &State, points: &Sampled) -> f64 {
        let pairing = Pairing::new(self.refine, state, points.gate);
        let slack = state.patch_sigma * state.patch_sigma;
        let of = |point: &u32| match pairing.pair(*point, &mut None) {
            Some(pair) => {
                let variance = pair.variance + slack;
                robust::tukey_cost(pair.r, kernel_scale(variance, points.gate)) / variance
            }
            None => robust::tukey_cost(TUKEY, TUKEY),
        };
        points.points().iter().map(of).sum::<f64>() / self.refine.scene.n_alike
    }

    /// Normal equations of what was summed up at a state, patches taken out, with all priors.
    fn closed(&self, state: &State, mut sums: Normal, fan: &dyn Fan) -> Normal {
        self.add_priors(state, &mut sums);
        sums.close(&self.refine.prepared.patches, state.smoothness, fan);
        sums
    }

    /// The sums of some points.
    fn sums_of(
        &self,
        pairing: &Pairing<'_>,
        (points, known): (&[u32], &mut [Option<Known>]),
    ) -> (Normal, Tallies) {
        let (state, gate) = (pairing.state, pairing.gate);
        let h = &state.hypothesis;
        let prepared = self.refine.prepared;
        let kinematics = prepared.model.kinematics(&h.posture);
        let base_from_local = h.local_from_base.inverse();
        let n_posed = 6 + h.posture.len();
        let n_robot = n_posed + 6 * self.frames.len();
        let frames = Frames::new(prepared.model, &kinematics, self.frames);
        let mut normal =
            Normal::new(n_robot, self.refine.scene.views.len(), prepared.patches.len());
        let mut tallies = Tallies::new(prepared.links.len());
        let slack = state.patch_sigma * state.patch_sigma;
        let n_alike = self.refine.scene.n_alike;
        let mut robot = vec![0.0; n_robot];
        let pairs = points.iter().zip(known).filter_map(|(&i, known)| pairing.pair(i, known));
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
            self.refine.row(&q.coords, &n, &kinematics.twists[pair.link], &mut robot[..n_posed]);
            frames.row(pair.link, &q.coords, &n, &mut robot[n_posed..]);
            let patch = prepared.links[pair.link].patch(pair.patch);
            let shape = prepared.patches.places[patch].shape(&pairing.inside(&pair));
            let lever = pair.beam.cross(&pair.n);
            let scan =
                [pair.n.x, pair.n.y, pair.n.z, lever.x, lever.y, lever.z, -pair.n.dot(&pair.ray)];
            normal.add(&Row {
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

    fn add_priors(&self, state: &State, normal: &mut Normal) {
        let h = &state.hypothesis;
        let n = 6 + h.posture.len();
        let (mut hessian, mut gradient) = (DMatrix::zeros(n, n), DVector::zeros(n));
        self.refine.add_priors(h, &mut hessian, &mut gradient);
        normal.add_robot_prior(&hessian, &gradient);
        let priors = scan_priors(self.settings());
        for (view, error) in state.scans.iter().enumerate() {
            for (i, value) in error.values().into_iter().enumerate() {
                normal.add_scan_prior(view, i, value, priors[i]);
            }
        }
    }

    fn apply(&self, state: &mut State, step: &DVector<f64>) {
        let n = 6 + state.hypothesis.posture.len();
        let h = &mut state.hypothesis;
        let shift = Translation3::new(step[0], step[1], step[2]);
        let turn = UnitQuaternion::from_scaled_axis(Vector::new(step[3], step[4], step[5]));
        h.local_from_base *= Pose::from_parts(shift, turn);
        for (j, q) in h.posture.iter_mut().enumerate() {
            *q += step[6 + j];
        }
        self.refine.keep_slides(h);
        for (view, scan) in state.scans.iter_mut().enumerate() {
            let at = n + view * N_SCAN;
            scan.add(&step.as_slice()[at..at + N_SCAN]);
        }
    }

    fn finish(&self, state: State, tallies: &Tallies, normal: &Normal) -> Adjusted {
        // Where many err alike, their scatter does not tell how far they are off.
        let is_alike = self.refine.scene.n_alike > 1.0;
        let scale = if is_alike { 1.0 } else { tallies.scale().min(1.0) };
        Adjusted {
            noise: state.noise * scale,
            covariance: normal.covariance(&self.refine.prepared.patches),
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

/// Weights of what is known of a scan's errors beforehand, m⁻² and rad⁻².
pub(crate) fn scan_priors(settings: &Settings) -> [f64; N_SCAN] {
    let [shift, turn, bias] = settings.scan_sigma.map(|sigma| 1.0 / (sigma * sigma));
    [shift, shift, shift, turn, turn, turn, bias]
}
