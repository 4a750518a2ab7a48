//! Searches the motion of a thing between two sessions: starts from turns of its upright faces and
//! from the ends of both point sets, aligns each, and judges by what agrees and by what beams of
//! the other session passed.

use super::align::{MotionEquations, ThingSides, moved, step_motion};
use super::surfels::{ThingSurfel, thinned};
use super::votes::steps_by_votes;
use crate::occupancy::SessionEvidence;
use geometry::{Point, Pose, Vector};
use nalgebra::{Cholesky, Matrix6, Translation3, UnitQuaternion};
use std::f64::consts::{FRAC_PI_2, TAU};

/// What the beams of two sessions show about places.
pub trait SessionBeams: Sync {
    /// What the beams of a session (0 the earlier, 1 the later one) show about a place (world
    /// frame, metres). `Occupied` only where a beam ended at the place.
    fn evidence(&self, session: usize, world: [f64; 3]) -> SessionEvidence;

    /// Whether beams of a session went through a place and ended far behind it.
    fn is_passed(&self, session: usize, world: [f64; 3]) -> bool {
        matches!(self.evidence(session, world), SessionEvidence::Empty { .. })
    }
}

/// Surfels of a side for the search and for the result.
const N_COARSE: usize = 300;
const N_FINE: usize = 2500;
/// Points of a side whose places the beams of the other session are asked for.
const N_ASKED: usize = 1500;
/// Distances of partners during the search, one after the other, metres.
const COARSE: [f64; 6] = [0.25, 0.25, 0.15, 0.1, 0.06, 0.06];
/// Distances of partners for the result, metres.
const FINE: [f64; 9] = [0.05, 0.04, 0.03, 0.03, REACH, REACH, REACH, REACH, REACH];
/// The last one: two small voxels, as far as beams lie apart.
pub(super) const REACH: f64 = 0.025;
/// Starts of a turn that are aligned, and motions that are refined.
const N_STARTS: usize = 12;
const N_STARTS_OF_MANY: usize = 3;
const N_REFINED: usize = 12;
/// Greatest change of a thing's height, metres, that is tried: it stands on the floor, or on a
/// pallet or step.
const RAISED: f64 = 0.3;
/// Turns that are tried of a thing whose faces are not at right angles.
const N_TURNS: usize = 24;
/// Share of upright faces at right angles to one another from which on only quarter turns are
/// tried: the length of the mean of their azimuths, four times.
const SQUARE: f64 = 0.5;
/// Ends of point sets that differ by less give one start, metres.
const SAME_END: f64 = 0.03;
/// Motions nearer than this are one: metres at the middle, radians (4°).
const SAME: [f64; 2] = [0.03, 0.07];
/// Standard deviation of a step without evidence: metres, radians. It holds what no partner
/// determines.
const STEP: [f64; 2] = [0.05, 0.1];
/// Weight of points that beams passed beside those that agree: what is not there contradicts more
/// than agreement confirms.
const CONTRADICTION: f64 = 4.0;

/// A thing in both sessions.
pub(super) struct ThingPair<'a> {
    coarse: ThingSides,
    pub(super) fine: ThingSides,
    /// Some of its points, earlier and later.
    points: [Vec<Vector>; 2],
    /// Middle of the earlier surfels.
    pub(super) middle: Vector,
    beams: &'a dyn SessionBeams,
}

/// A motion from the earlier to the later session, and what speaks for it.
#[derive(Debug, Clone, Copy)]
pub(super) struct MotionGuess {
    pub(super) motion: Pose,
    /// Surfels with a partner, by session.
    pub(super) n_on: [usize; 2],
    /// Shares of surfels with a partner, and of points that beams of the other session passed.
    pub(super) on: f64,
    pub(super) through: f64,
}

impl MotionGuess {
    pub(super) fn score(&self) -> f64 {
        self.on - CONTRADICTION * self.through
    }
}

impl<'a> ThingPair<'a> {
    pub(super) fn new(
        sides: [Vec<ThingSurfel>; 2],
        points: [Vec<Vector>; 2],
        beams: &'a dyn SessionBeams,
    ) -> Self {
        let some = |n: usize| sides.each_ref().map(|side| thinned(side, n));
        let middle = mean(&sides[0]);
        Self {
            coarse: ThingSides::new(some(N_COARSE), COARSE[0]),
            fine: ThingSides::new(some(N_FINE), FINE[0]),
            points: points.each_ref().map(|side| thinned(side, N_ASKED)),
            middle,
            beams,
        }
    }

    /// Number of surfels by session.
    pub(super) fn n_surfels(&self) -> [usize; 2] {
        self.fine.sides.each_ref().map(|side| side.all.len())
    }

    /// Numbers of points of each side that lie, after a motion of the earlier side, where beams of
    /// the other session passed.
    pub(super) fn n_through(&self, motion: &Pose) -> [usize; 2] {
        let back = motion.inverse();
        let n = |k: usize, pose: &Pose| {
            let there = self.points[k].iter().map(|p| (pose * Point::from(*p)).coords);
            there.filter(|p| self.beams.is_passed(1 - k, (*p).into())).count()
        };
        [n(0, motion), n(1, &back)]
    }

    /// Number of points that [`Self::n_through`] asks for, of both sides.
    pub(super) fn n_asked(&self) -> usize {
        self.points.iter().map(Vec::len).sum()
    }

    /// RMS distance of the earlier surfels from their middle in the plan, metres.
    pub(super) fn radius(&self) -> f64 {
        let all = &self.fine.sides[0].all;
        let sum: f64 = all.iter().map(|s| (s.at - self.middle).xy().norm_squared()).sum();
        (sum / all.len().max(1) as f64).sqrt().max(0.1)
    }

    fn judged(&self, motion: Pose) -> MotionGuess {
        let (n_on, through) = (self.fine.n_on(&motion, REACH), self.n_through(&motion));
        let share = |n: [usize; 2], of: [usize; 2]| {
            let one = |k: usize| n[k] as f64 / of[k].max(1) as f64;
            0.5 * (one(0) + one(1))
        };
        let asked = self.points.each_ref().map(Vec::len);
        MotionGuess {
            motion,
            n_on,
            on: share(n_on, self.n_surfels()),
            through: share(through, asked),
        }
    }

    /// Motions that were aligned, the best first.
    pub(super) fn guesses(&self) -> Vec<MotionGuess> {
        let aligned =
            self.starts().into_iter().map(|start| self.aligned(&self.coarse, start, &COARSE));
        let mut coarse: Vec<MotionGuess> = Vec::new();
        // Upright faces tell nothing of the height, and most things stand as high as before.
        for motion in aligned.flat_map(|motion| [motion, self.level(motion)]) {
            if !coarse.iter().any(|g| self.is_same(&g.motion, &motion)) {
                coarse.push(self.judged(motion));
            }
        }
        coarse.sort_by(|a, b| b.score().total_cmp(&a.score()));
        let mut out: Vec<MotionGuess> = Vec::new();
        for guess in coarse.into_iter().take(N_REFINED) {
            let motion = self.refined(guess.motion);
            if !out.iter().any(|g| self.is_same(&g.motion, &motion)) {
                out.push(self.judged(motion));
            }
        }
        out.sort_by(|a, b| b.score().total_cmp(&a.score()));
        out
    }

    /// A motion near another one, aligned by all surfels.
    pub(super) fn refined(&self, motion: Pose) -> Pose {
        self.aligned(&self.fine, motion, &FINE)
    }

    /// The equations of the next step of an aligned motion, about a centre at its later place.
    pub(super) fn equations(&self, motion: &Pose, about: &Vector) -> MotionEquations {
        self.fine.equations(motion, about, REACH)
    }

    fn aligned(&self, sides: &ThingSides, start: Pose, reaches: &[f64]) -> Pose {
        let hold = Matrix6::from_diagonal(&nalgebra::Vector6::from_fn(|i, _| STEP[i / 3].powi(-2)));
        let mut motion = start;
        for reach in reaches {
            let about = (motion * Point::from(self.middle)).coords;
            let equations = sides.equations(&motion, &about, *reach);
            let Some(solved) = Cholesky::new(equations.information + hold) else { break };
            motion = step_motion(&solved.solve(&equations.right), &about) * motion;
        }
        motion
    }

    /// A motion whose height is changed so that the middle stays as high as it was.
    fn level(&self, motion: Pose) -> Pose {
        let raised = (motion * Point::from(self.middle)).z - self.middle.z;
        Translation3::new(0.0, 0.0, -raised) * motion
    }

    fn is_same(&self, a: &Pose, b: &Pose) -> bool {
        let at = Point::from(self.middle);
        (a * at - b * at).norm() < SAME[0] && a.rotation.angle_to(&b.rotation) < SAME[1]
    }

    /// For each turn, the starts with most partners.
    fn starts(&self) -> Vec<Pose> {
        let [then, now] = [0, 1].map(|k| &self.coarse.sides[k].all);
        let square = [then, now].map(|side| azimuth(side));
        let (turns, azimuth, n): (Vec<f64>, f64, usize) = match square {
            [Some(then), Some(now)] => {
                let quarter = |k: i32| now - then + f64::from(k) * FRAC_PI_2;
                ((0..4).map(quarter).collect(), now, N_STARTS)
            }
            _ => {
                let one = |k: usize| TAU * k as f64 / N_TURNS as f64;
                ((0..N_TURNS).map(one).collect(), 0.0, N_STARTS_OF_MANY)
            }
        };
        let mut out = Vec::new();
        for turn in turns {
            let start = |start: Pose| {
                let [a, b] = self.coarse.n_on(&start, 2.0 * COARSE[3]);
                (a + b, start)
            };
            let mut own: Vec<_> = self.placed(turn, azimuth).into_iter().map(start).collect();
            own.sort_by_key(|(n, _)| std::cmp::Reverse(*n));
            out.extend(own.into_iter().take(n).map(|(_, start)| start));
        }
        out
    }

    /// Starts with one turn: those for which most pairs of surfels vote, and those at which the
    /// ends or the middles of both sides lie on one another, along an azimuth and across it.
    fn placed(&self, turn: f64, azimuth: f64) -> Vec<Pose> {
        let turn = UnitQuaternion::from_axis_angle(&Vector::z_axis(), turn);
        let about = Pose::from_parts(Translation3::from(self.middle - turn * self.middle), turn);
        let (sin, cos) = azimuth.sin_cos();
        let axes = [Vector::new(cos, sin, 0.0), Vector::new(-sin, cos, 0.0), Vector::z()];
        let then: Vec<ThingSurfel> =
            self.coarse.sides[0].all.iter().map(|s| moved(s, &about)).collect();
        let now = &self.coarse.sides[1].all;
        let mut shifts = steps_by_votes(&then, now, RAISED);
        let [then, now] = [&then, now].map(|side| side.iter().map(|s| s.at).collect::<Vec<_>>());
        let steps = axes.map(|axis| {
            let ([low, high], [to_low, to_high]) = (ends(&then, &axis), ends(&now, &axis));
            let mut steps = vec![to_high - high];
            for step in [to_low - low, 0.5 * (to_low + to_high - low - high)] {
                if steps.iter().all(|s| (s - step).abs() > SAME_END) {
                    steps.push(step);
                }
            }
            steps
        });
        // Tops are seen by most stations; else the thing stands as high as before.
        let heights = [steps[2][0], 0.0];
        let heights = &heights[usize::from(heights[0].abs() > RAISED)..];
        for x in &steps[0] {
            for y in &steps[1] {
                shifts.extend(heights.iter().map(|z| *x * axes[0] + *y * axes[1] + *z * axes[2]));
            }
        }
        shifts.into_iter().map(|shift| Translation3::from(shift) * about).collect()
    }
}

/// The ends of some places along an axis, without the outermost fiftieth on each side.
fn ends(places: &[Vector], axis: &Vector) -> [f64; 2] {
    let mut along: Vec<f64> = places.iter().map(|p| axis.dot(p)).collect();
    along.sort_by(f64::total_cmp);
    let cut = along.len() / 50;
    match along.len() {
        0 => [0.0; 2],
        n => [along[cut], along[n - 1 - cut]],
    }
}

/// Azimuth of upright faces that stand at right angles, between 0 and a quarter turn; `None` where
/// they do not.
fn azimuth(side: &[ThingSurfel]) -> Option<f64> {
    let upright = side.iter().filter(|s| s.normal.z.abs() < 0.3);
    let (mut sin, mut cos, mut n) = (0.0, 0.0, 0.0);
    for surfel in upright {
        let four = 4.0 * surfel.normal.y.atan2(surfel.normal.x);
        (sin, cos, n) = (sin + four.sin(), cos + four.cos(), n + 1.0);
    }
    (n > 0.0 && f64::hypot(sin, cos) > SQUARE * n).then(|| 0.25 * sin.atan2(cos))
}

fn mean(side: &[ThingSurfel]) -> Vector {
    side.iter().map(|s| s.at).sum::<Vector>() / side.len().max(1) as f64
}
