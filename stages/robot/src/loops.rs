//! Solves closed loops: the values of passive joints from those of the other joints. Planar
//! four-bars, cylinders and bars are solved in closed form, all others by Newton's method from the
//! zero posture.

use crate::closed_loop::{ClosedLoop, Closure, Form};

use crate::kinematics::Placing;
use crate::model::Model;
use geometry::{Point, Vector};
use nalgebra::{DMatrix, DVector};

/// Number of steps from the zero posture for a loop without a closed form: small enough steps to
/// stay in the assembly mode.
const N_STEPS: u32 = 8;
/// Largest number of Newton iterations for each step; three are enough from a neighbouring posture.
const N_NEWTON: u32 = 12;
/// Gap below which a loop counts as closed, metres; rounding errors are about 1e-15.
pub(crate) const CLOSED: f64 = 1e-9;

/// The component of `v` perpendicular to the unit vector `n`.
fn across(v: Vector, n: &Vector) -> Vector {
    v - n * n.dot(&v)
}

/// Angle about the unit vector `n` from `from` to `to`, both projected along `n`, radians.
fn turn(from: &Vector, to: &Vector, n: &Vector) -> f64 {
    let (from, to) = (across(*from, n), across(*to, n));
    n.dot(&from.cross(&to)).atan2(from.dot(&to))
}

/// `v` projected along `n`, rotated about `n` by `angle` radians, and normalised.
fn turned(v: &Vector, n: &Vector, angle: f64) -> Vector {
    let v = across(*v, n);
    (v * angle.cos() + n.cross(&v) * angle.sin()).try_normalize(1e-15).unwrap_or_else(Vector::zeros)
}

impl ClosedLoop {
    /// Sets the passive joints; all other joints that the loop depends on must be set already.
    pub(crate) fn solve(&self, placing: &mut Placing) {
        let pin = self.closures[0];
        for &joint in &self.passive {
            placing.values[joint] = 0.0;
        }
        match self.form {
            Form::Rr => self.aim(placing, &pin),
            Form::Rpr { mode } => self.stretch(placing, &pin, mode),
            Form::RrrSerial { mode } => self.fold(placing, &pin, mode),
            Form::RrrBranched { mode } => self.meet(placing, &pin, mode),
            Form::General => self.newton(placing),
        }
    }

    fn aim(&self, placing: &mut Placing, pin: &Closure) {
        let j = self.passive[0];
        let (origin, axis) = placing.axis(j);
        let bar = placing.point(pin.link_a, &pin.point_a) - origin;
        let target = placing.point(pin.link_b, &pin.point_b) - origin;
        placing.values[j] = turn(&bar, &target, &axis);
    }

    fn stretch(&self, placing: &mut Placing, pin: &Closure, mode: f64) {
        let (j, slide) = (self.passive[0], self.passive[1]);
        let (origin, axis) = placing.axis(j);
        let along = across(placing.axis(slide).1, &axis);
        let start = across(placing.point(pin.link_a, &pin.point_a) - origin, &axis);
        let target = across(placing.point(pin.link_b, &pin.point_b) - origin, &axis);
        // Solve |start + s·along| = |target| for s.
        let (a, b) = (along.norm_squared(), start.dot(&along));
        if a < 1e-12 {
            return;
        }
        let root = (b * b - a * (start.norm_squared() - target.norm_squared())).max(0.0).sqrt();
        let s = (mode * root - b) / a;
        placing.values[slide] = s;
        placing.values[j] = turn(&(start + along * s), &target, &axis);
    }

    fn fold(&self, placing: &mut Placing, pin: &Closure, mode: f64) {
        let (j, k) = (self.passive[0], self.passive[1]);
        let (origin, axis) = placing.axis(j);
        let elbow = across(placing.axis(k).0 - origin, &axis);
        let fore = across(placing.point(pin.link_a, &pin.point_a) - origin, &axis) - elbow;
        let end = placing.point(pin.link_b, &pin.point_b);
        let toward = toward_elbow(&(end - origin), elbow.norm(), fore.norm(), &axis, mode);
        placing.values[j] = turn(&elbow, &toward, &axis);
        let (origin, axis) = placing.axis(k);
        let fore = placing.point(pin.link_a, &pin.point_a) - origin;
        placing.values[k] = turn(&fore, &(end - origin), &axis);
    }

    fn meet(&self, placing: &mut Placing, pin: &Closure, mode: f64) {
        let (j, k) = (self.passive[0], self.passive[1]);
        let (origin, axis) = placing.axis(j);
        let (other, other_axis) = placing.axis(k);
        let arm = across(placing.point(pin.link_a, &pin.point_a) - origin, &axis);
        let other_arm = across(placing.point(pin.link_b, &pin.point_b) - other, &axis);
        let toward = toward_elbow(&(other - origin), arm.norm(), other_arm.norm(), &axis, mode);
        placing.values[j] = turn(&arm, &toward, &axis);
        let elbow = origin + toward * arm.norm();
        placing.values[k] = turn(&other_arm, &(elbow - other), &other_axis);
    }

    fn newton(&self, placing: &mut Placing) {
        let whole = placing.posture.clone();
        let mut x = DVector::zeros(self.passive.len());
        for step in 1..=N_STEPS {
            let share = f64::from(step) / f64::from(N_STEPS);
            placing.move_to(whole.iter().map(|q| q * share).collect(), self);
            for _ in 0..N_NEWTON {
                for (&joint, value) in self.passive.iter().zip(&x) {
                    placing.values[joint] = *value;
                }
                let (residual, jacobian) = self.equations(placing);
                if residual.amax() < 1e-13 {
                    break;
                }
                let svd = jacobian.svd(true, true);
                let Ok(down) = svd.solve(&residual, 1e-9) else {
                    break;
                };
                // The linearisation holds for steps of at most about half a radian.
                x -= &down * (0.5 / down.amax()).min(1.0);
            }
        }
        for (&joint, value) in self.passive.iter().zip(&x) {
            placing.values[joint] = *value;
        }
    }

    /// Gap of the pins and its derivatives by the passive joints, in the plane across the axis of
    /// the first revolute one, or in space where all passive joints slide.
    fn equations(&self, placing: &Placing) -> (DVector<f64>, DMatrix<f64>) {
        let rows = self.directions(placing);
        let n = rows.len();
        let mut residual = DVector::zeros(n * self.closures.len());
        let mut jacobian = DMatrix::zeros(n * self.closures.len(), self.passive.len());
        for (c, pin) in self.closures.iter().enumerate() {
            let (a, b) =
                (placing.point(pin.link_a, &pin.point_a), placing.point(pin.link_b, &pin.point_b));
            for (r, row) in rows.iter().enumerate() {
                residual[c * n + r] = row.dot(&(a - b));
                for (column, &joint) in self.passive.iter().enumerate() {
                    let moves =
                        placing.moves(joint, pin.link_a, &a) - placing.moves(joint, pin.link_b, &b);
                    jacobian[(c * n + r, column)] = row.dot(&moves);
                }
            }
        }
        (residual, jacobian)
    }

    /// Directions along which the pins must meet: two across the axes of a planar loop, else three.
    fn directions(&self, placing: &Placing) -> Vec<Vector> {
        let mut axes =
            (self.passive.iter()).filter(|&&j| placing.turns(j)).map(|&j| placing.axis(j).1);
        match axes.next() {
            Some(n) if axes.all(|m| m.cross(&n).norm() < 1e-6) => {
                let helper = if n.x.abs() < 0.7 { Vector::x() } else { Vector::y() };
                let e = n.cross(&helper).normalize();
                vec![e, n.cross(&e)]
            }
            _ => vec![Vector::x(), Vector::y(), Vector::z()],
        }
    }

    /// Distance of the points of the pins, seen along the axes, metres.
    pub(crate) fn gap(&self, placing: &Placing) -> f64 {
        let rows = self.directions(placing);
        let apart = |pin: &Closure| {
            let gap =
                placing.point(pin.link_a, &pin.point_a) - placing.point(pin.link_b, &pin.point_b);
            rows.iter().map(|row| row.dot(&gap).powi(2)).sum::<f64>().sqrt()
        };
        self.closures.iter().map(apart).fold(0.0, f64::max)
    }

    /// Rates of the passive joints at unit rate of free joint `free`, from the rates of all other
    /// joints (in which those of the passive ones are zero).
    pub(crate) fn rates(&self, placing: &Placing, rates: &[f64]) -> Vec<f64> {
        let pin = &self.closures[0];
        let open = self.form != Form::General && self.gap(placing) > CLOSED;
        match self.form {
            Form::Rr => vec![self.aim_rate(placing, rates, 0, pin.link_b, &pin.point_b)],
            // Out of reach the bars lie in line and only point at the other end.
            Form::RrrSerial { .. } | Form::Rpr { .. } if open => {
                vec![self.aim_rate(placing, rates, 0, pin.link_b, &pin.point_b), 0.0]
            }
            Form::RrrBranched { .. } if open => {
                let ends = [self.passive[1], self.passive[0]].map(|j| placing.carrier(j));
                vec![
                    self.aim_rate(placing, rates, 0, ends[0].0, &ends[0].1),
                    self.aim_rate(placing, rates, 1, ends[1].0, &ends[1].1),
                ]
            }
            _ => self.implicit_rates(placing, rates),
        }
    }

    /// Rates by the implicit function theorem, ∂q_p/∂q = −(∂φ/∂q_p)⁻¹ ∂φ/∂q.
    fn implicit_rates(&self, placing: &Placing, rates: &[f64]) -> Vec<f64> {
        let rows = self.directions(placing);
        let (_, jacobian) = self.equations(placing);
        let mut known = DVector::zeros(jacobian.nrows());
        for (c, pin) in self.closures.iter().enumerate() {
            let (a, b) =
                (placing.point(pin.link_a, &pin.point_a), placing.point(pin.link_b, &pin.point_b));
            let moves =
                placing.velocity(pin.link_a, &a, rates) - placing.velocity(pin.link_b, &b, rates);
            for (r, row) in rows.iter().enumerate() {
                known[c * rows.len() + r] = row.dot(&moves);
            }
        }
        match jacobian.svd(true, true).solve(&known, 1e-9) {
            Ok(x) => x.iter().map(|v| -v).collect(),
            Err(_) => vec![0.0; self.passive.len()],
        }
    }

    /// Rate of the passive revolute joint `which` with which it keeps pointing at a point of a
    /// link.
    fn aim_rate(
        &self,
        placing: &Placing,
        rates: &[f64],
        which: usize,
        link: usize,
        point: &Point,
    ) -> f64 {
        let j = self.passive[which];
        let (origin, axis) = placing.axis(j);
        let (carrier, _) = placing.carrier(j);
        let target_at = placing.point(link, point);
        let d = across(target_at - origin, &axis);
        if d.norm_squared() < 1e-18 {
            return 0.0;
        }
        // Relative to the carrier: the target's velocity less the carrier's at the same place.
        let moves = placing.velocity(link, &target_at, rates)
            - placing.velocity(carrier, &target_at, rates);
        axis.dot(&d.cross(&moves)) / d.norm_squared()
    }

    /// The mode of the zero posture, at which the passive joints are zero; `None` where the loop is
    /// stretched out there, so that both solutions coincide.
    pub(crate) fn mode_at_zero(&self, placing: &Placing) -> Option<f64> {
        let pin = &self.closures[0];
        let (origin, axis) = placing.axis(self.passive[0]);
        let a = across(placing.point(pin.link_a, &pin.point_a) - origin, &axis);
        let (value, size) = match self.form {
            Form::Rpr { .. } => {
                let along = across(placing.axis(self.passive[1]).1, &axis);
                (a.dot(&along), a.norm() * along.norm())
            }
            Form::RrrSerial { .. } => {
                let elbow = across(placing.axis(self.passive[1]).0 - origin, &axis);
                let d = placing.point(pin.link_b, &pin.point_b) - origin;
                (axis.dot(&elbow.cross(&d)), elbow.norm() * d.norm())
            }
            Form::RrrBranched { .. } => {
                let d = placing.axis(self.passive[1]).0 - origin;
                (axis.dot(&a.cross(&d)), a.norm() * d.norm())
            }
            Form::Rr | Form::General => return Some(1.0),
        };
        (value.abs() > 1e-6 * size).then_some(value.signum())
    }
}

/// Direction from one end of a two-bar chain to its elbow. `d` is the vector to the other end,
/// `near` and `far` are the lengths of the bars. Out of reach the bars lie in line.
fn toward_elbow(d: &Vector, near: f64, far: f64, axis: &Vector, mode: f64) -> Vector {
    let d = across(*d, axis);
    let length = d.norm();
    let cos = (length * length + near * near - far * far) / (2.0 * length * near).max(1e-300);
    turned(&d, axis, -mode * cos.clamp(-1.0, 1.0).acos())
}

impl Model {
    /// This robot with the loops of these indices on the other of their two solutions.
    #[must_use]
    pub fn with_other_branches(&self, loops: &[usize]) -> Self {
        let mut out = self.clone();
        for &at in loops {
            match &mut out.loops[at].form {
                Form::RrrSerial { mode } | Form::RrrBranched { mode } | Form::Rpr { mode } => {
                    *mode = -*mode;
                }
                Form::Rr | Form::General => {}
            }
        }
        out
    }

    /// Whether loop `at` could stand on the other of its two solutions at a posture: the loop
    /// closes there, its joints stay within their limits, and the solution differs from the first.
    #[must_use]
    pub fn has_other_branch(&self, at: usize, posture: &[f64]) -> bool {
        if matches!(self.loops[at].form, Form::Rr | Form::General) {
            return false;
        }
        let other = self.with_other_branches(&[at]);
        let (own, values) = (self.joint_values(posture), other.joint_values(posture));
        let passive = || self.loops[at].passive.iter().copied();
        let inside = |j: usize| {
            // A cylinder cannot have a negative length, whether its limits say so or not.
            let limits = self.joints[j].limits;
            limits.map_or_else(
                || Placing::open(self, posture).turns(j),
                |[low, high]| (low - LIMIT_PLAY..=high + LIMIT_PLAY).contains(&values[j]),
            )
        };
        let is_other = passive().any(|j| (own[j] - values[j]).abs() > OTHER_BRANCH);
        is_other && other.loop_gap(posture) < CLOSED && passive().all(inside)
    }
}

/// Tolerance on the limits of passive joints, which are often rounded, radians or metres.
const LIMIT_PLAY: f64 = 0.02;
/// Joint values that differ by less belong to the same solution, radians or metres.
const OTHER_BRANCH: f64 = 0.02;
