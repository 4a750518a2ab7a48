//! A refined posture and its points in; out come base, joints and the scans' own errors in one robust least-squares
//! adjustment, with a covariance that stays honest when errors of points are alike (fit.md §4g, §6.6).
//!
//! Beside base and joints each scan has a shift, a turn about its scanner and a range bias with priors: scans are
//! registered to millimetres only, and a fit that does not know that bends the robot. And each patch of the model's
//! surface has an offset along its normals, `u ~ N(0, σ_u²)`, taken out in closed form, σ_u estimated from the patches
//! themselves: a model is drawn to millimetres only. Both or neither: without the patches scans would be bent to fit a
//! wrong shape.

use contract::Fan;
use geometry::{Point, Pose, Vector, robust};
use nalgebra::{DMatrix, DVector, Translation3, UnitQuaternion};

use crate::Settings;
use crate::beam::Hypothesis;
use crate::calibrate::Frames;
use crate::facets::Facet;
use crate::normal::{N_SCAN, Normal, Row};
use crate::placed::{Near, Placed};
use crate::refine::{CHUNK, Refine};

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
    fn values(&self) -> [f64; N_SCAN] {
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
    /// How far the model's surface is off, standard deviation over its patches, metres.
    pub(crate) patch_sigma: f64,
    /// Points within the gate, for each link.
    pub(crate) n_points: Vec<usize>,
    /// RMS distance of those points, metres, for each link.
    pub(crate) link_rms: Vec<f64>,
}

impl Adjusted {
    /// Where it stands, to go on from.
    pub(crate) fn state(&self) -> State {
        let (hypothesis, scans) = (self.hypothesis.clone(), self.scans.clone());
        State { hypothesis, scans, patch_sigma: self.patch_sigma }
    }
}

/// The adjustment of one robot.
pub(crate) struct Adjust<'a> {
    pub(crate) refine: &'a Refine<'a>,
    /// Joints whose places on their links are unknowns, too, in [`Self::at`].
    pub(crate) frames: &'a [usize],
}

/// Rounds of the adjustment; the last ones change nothing but the patches' share.
const N_ROUNDS: usize = 7;
/// A step by less than a fifth of a standard deviation, in every direction, ends the rounds (squared; steps shrink
/// threefold a round): a flange that the points leave open would wander on for ever.
const SMALL_STEP: f64 = 0.04;
/// Tukey's constant: 95 % efficient for normal errors.
const TUKEY: f64 = 4.685;
/// Beam direction noise of a common scanner, radians (19″; fit.md §3.2).
const ANGLE_NOISE: f64 = 9e-5;
/// What sampling of the model and rounding leave at least, metres, one sigma.
const SURFACE_NOISE: f64 = 3e-4;
/// Where no scanner is known a point is as uncertain in every direction.
const NO_BEAM: Vector = Vector::new(0.0, 0.0, 0.0);

/// A point matched with the facet that it most likely lies on, local frame.
struct Pair {
    link: usize,
    facet: usize,
    view: usize,
    /// The point, corrected by its scan's error.
    p: Vector,
    n: Vector,
    /// From the scanner to the point, unit length; zero where unknown.
    ray: Vector,
    /// Variance of the point's distance from the surface, m².
    variance: f64,
    r: f64,
}

/// Where the adjustment stands.
pub(crate) struct State {
    pub(crate) hypothesis: Hypothesis,
    pub(crate) scans: Vec<ScanError>,
    pub(crate) patch_sigma: f64,
}

impl Adjust<'_> {
    fn settings(&self) -> &Settings {
        self.refine.settings
    }

    /// Adjusts on the points with these indices, from where nothing is known of the scans' errors.
    pub(crate) fn run(
        &self,
        start: &Hypothesis,
        points: &[u32],
        gate: f64,
        fan: &impl Fan,
    ) -> Adjusted {
        let n_views = self.refine.scene.views.len();
        let scans = vec![ScanError::NONE; n_views];
        let start = State { hypothesis: start.clone(), scans, patch_sigma: 0.0 };
        self.run_from(start, points, gate, fan)
    }

    /// The same from any state.
    pub(crate) fn run_from(
        &self,
        start: State,
        points: &[u32],
        gate: f64,
        fan: &impl Fan,
    ) -> Adjusted {
        let mut state = start;
        let mut round = 0;
        loop {
            let pairs = self.pairs(&state, points, gate, fan);
            let normal = self.normal(&state, &pairs, gate, fan);
            let solved = (round < N_ROUNDS).then(|| normal.solve()).flatten();
            let Some(step) = solved else {
                return self.finish(state, &pairs, &normal);
            };
            self.apply(&mut state, &step);
            round += 1;
            if normal.deviations(&step) < SMALL_STEP {
                round = round.max(N_ROUNDS);
            }
        }
    }

    /// Normal equations at a state, the places of the joints among the unknowns.
    pub(crate) fn at(&self, state: &State, points: &[u32], gate: f64, fan: &impl Fan) -> Normal {
        self.normal(state, &self.pairs(state, points, gate, fan), gate, fan)
    }

    /// The points with their facets at the state.
    fn pairs(&self, state: &State, points: &[u32], gate: f64, fan: &impl Fan) -> Vec<Pair> {
        let refine = self.refine;
        let scene = refine.scene;
        let poses = refine.local_from_links(&state.hypothesis);
        let placed = Placed::all(refine.prepared, &state.hypothesis, gate);
        let scanners: Vec<Option<Point>> =
            (0..scene.views.len()).map(|v| scene.scanner(v as u16)).collect();
        let turns: Vec<UnitQuaternion<f64>> =
            state.scans.iter().map(|s| UnitQuaternion::from_scaled_axis(s.turn)).collect();
        let sigma2 = scene.noise * scene.noise;
        let pair = |&i: &u32| {
            let m = &scene.points[i as usize];
            let view = usize::from(m.view);
            let raw = Vector::from(m.p.map(f64::from));
            let (p, ray, range) = match &scanners[view] {
                Some(scanner) => {
                    let error = &state.scans[view];
                    let beam = raw - scanner.coords;
                    let ray = beam.normalize();
                    let p = scanner.coords + turns[view] * (beam - ray * error.bias) + error.shift;
                    (p, turns[view] * ray, beam.norm())
                }
                None => (raw, NO_BEAM, 0.0),
            };
            let Near { link, facet, distance } = placed.nearest(p.map(|v| v as f32).into())?;
            if distance > gate {
                return None;
            }
            let Facet { x, n } = refine.prepared.links[link].fields.facets[facet];
            let n = poses[link].rotation * Vector::from(n.map(f64::from));
            let x = poses[link] * Point::from(x.map(f64::from));
            let r = n.dot(&(p - x.coords));
            // Beside the surface's edge its plane means nothing.
            let beside = (distance * distance - r * r).max(0.0).sqrt();
            if beside > refine.beside(link) {
                return None;
            }
            let facing = -n.dot(&ray);
            // A facet that faces away from the scanner cannot have given this point.
            if range > 0.0 && facing <= MIN_FACING {
                return None;
            }
            let variance = if range > 0.0 {
                let across = (range * ANGLE_NOISE).powi(2) * (1.0 - facing * facing);
                sigma2 * facing * facing + across + SURFACE_NOISE * SURFACE_NOISE
            } else {
                sigma2
            };
            Some(Pair { link, facet, view, p, n, ray, variance, r })
        };
        let chunks = points.chunks(CHUNK).collect();
        let found =
            fan.fan(chunks, |chunk: &[u32]| chunk.iter().filter_map(pair).collect::<Vec<_>>());
        found.into_iter().flatten().collect()
    }

    /// Normal equations of the pairs with all priors, patches taken out. Updates nothing.
    fn normal(&self, state: &State, pairs: &[Pair], gate: f64, fan: &impl Fan) -> Normal {
        let chunks = pairs.chunks(2 * CHUNK).collect();
        let sums = fan.fan(chunks, |chunk: &[Pair]| self.sums(state, chunk, gate));
        let empty = || self.sums(state, &[], gate);
        let mut normal = sums.into_iter().reduce(Normal::join).unwrap_or_else(empty);
        normal.close();
        self.add_priors(state, &mut normal);
        normal
    }

    /// The sums of some pairs.
    fn sums(&self, state: &State, pairs: &[Pair], gate: f64) -> Normal {
        let h = &state.hypothesis;
        let prepared = self.refine.prepared;
        let kinematics = prepared.model.kinematics(&h.posture);
        let base_from_local = h.local_from_base.inverse();
        let n_posed = 6 + h.posture.len();
        let n_robot = n_posed + 6 * self.frames.len();
        let frames = Frames::new(prepared.model, &kinematics, self.frames);
        let mut normal = Normal::new(n_robot, self.refine.scene.views.len(), prepared.n_patches);
        let scanners: Vec<Vector> = (0..self.refine.scene.views.len())
            .map(|v| self.refine.scene.scanner(v as u16).map_or_else(Vector::zeros, |s| s.coords))
            .collect();
        let slack = state.patch_sigma * state.patch_sigma;
        let mut robot = vec![0.0; n_robot];
        for pair in pairs {
            let scale = (TUKEY * (pair.variance + slack).sqrt()).min(gate);
            let kernel = robust::tukey(pair.r, scale);
            let weight = kernel / pair.variance;
            if weight <= 0.0 {
                continue;
            }
            let u2 = (pair.r / scale).powi(2);
            let slope = (1.0 - u2) * (1.0 - 5.0 * u2) / pair.variance;
            let influence = [(weight * pair.r).powi(2), slope];
            let q = base_from_local * Point::from(pair.p);
            let n = base_from_local.rotation * pair.n;
            self.refine.row(&q.coords, &n, &kinematics.twists[pair.link], &mut robot[..n_posed]);
            frames.row(pair.link, &q.coords, &n, &mut robot[n_posed..]);
            let lever = (pair.p - scanners[pair.view]).cross(&pair.n);
            let scan =
                [pair.n.x, pair.n.y, pair.n.z, lever.x, lever.y, lever.z, -pair.n.dot(&pair.ray)];
            normal.add(&Row {
                robot: &robot,
                scan,
                view: pair.view,
                patch: prepared.links[pair.link].patch(pair.facet),
                weight,
                influence,
                r: pair.r,
            });
        }
        normal
    }

    fn add_priors(&self, state: &State, normal: &mut Normal) {
        let h = &state.hypothesis;
        let n = 6 + h.posture.len();
        let (mut hessian, mut gradient) = (DMatrix::zeros(n, n), DVector::zeros(n));
        self.refine.add_priors(h, &mut hessian, &mut gradient);
        normal.add_robot_prior(&hessian, &gradient);
        let [shift, turn, bias] = self.settings().scan_sigma;
        for (view, error) in state.scans.iter().enumerate() {
            for (i, value) in error.values().into_iter().enumerate() {
                let sigma = [shift, shift, shift, turn, turn, turn, bias][i];
                normal.add_scan_prior(view, i, value, sigma);
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

    fn finish(&self, state: State, pairs: &[Pair], normal: &Normal) -> Adjusted {
        let n_links = self.refine.prepared.links.len();
        let (mut n_points, mut rr) = (vec![0_usize; n_links], vec![0.0; n_links]);
        for pair in pairs {
            n_points[pair.link] += 1;
            rr[pair.link] += pair.r * pair.r;
        }
        let link_rms = (0..n_links).map(|l| (rr[l] / n_points[l].max(1) as f64).sqrt()).collect();
        Adjusted {
            covariance: normal.covariance(&self.refine.prepared.patch_groups),
            hypothesis: state.hypothesis,
            scans: state.scans,
            patch_sigma: normal.patch_sigma(),
            n_points,
            link_rms,
        }
    }
}

/// Cosine below which a beam cannot have come from a facet's front.
const MIN_FACING: f64 = 0.05;
