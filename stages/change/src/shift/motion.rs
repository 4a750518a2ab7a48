//! The motion of one thing: the best of those that were found, its uncertainty, and the others that
//! explain the points as well.

use super::search::{MotionGuess, SessionBeams, ThingPair};
use super::slide::{SettledMotion, settled};
use super::surfels::ThingSurfel;
use geometry::{Point, Pose, Vector};
use nalgebra::{Matrix2, Matrix3, Vector2};
use std::f64::consts::PI;

/// Fewest surfels of a side for a motion to be searched, and fewest with a partner.
const MIN_SURFELS: usize = 40;
const MIN_ON: usize = 25;
/// Least share of the surfels of the side with fewer ones that must have a partner.
const MIN_SHARE: f64 = 0.12;
/// Greatest share of the points that beams of the other session may have passed: with right motions
/// it is up to 0.02. With 0.1 a pallet of which the sessions saw opposite sides was laid on itself
/// with half a turn too much.
const MAX_THROUGH: f64 = 0.05;
/// Another turn that beams contradict by less than the best one, by this share of the points,
/// leaves it undecided, however much surface agrees.
const LESS_THROUGH: f64 = 0.03;
/// Scores that are worse by less than a share of the best one explain the points as well, where
/// beams contradict them by less than another share of the points.
const AS_WELL: [f64; 2] = [0.25, 0.03];
/// The same for quarter turns: a wrong one fits the top and one side, and the sides of many things
/// are nearly as long as one another.
const TURN_AS_WELL: [f64; 2] = [0.4, 0.04];
/// Farthest place whose shift is stated because several turns move it alike, as a multiple of the
/// thing's radius: farther off it is no point of the thing.
const AT_MOST: f64 = 1.5;
/// Motions whose turns differ by more than this are other turns, radians: 10°.
const OTHER_TURN: f64 = 0.175;
/// Standard deviations of errors that all points of a session share beside those of the places of
/// its scans, metres and radians: scans turned by 0.01° to 0.02° at 5 to 8 m, and surfaces that
/// beams meet askew.
const SHARED: [f64; 2] = [0.002, 0.001];
/// Standard deviation of a turn beyond which nothing is said of it, radians: 15°.
const OPEN_TURN: f64 = 0.26;
/// With more other turns than this the thing is round: a square one has three.
const MAX_OTHER_TURNS: usize = 3;
/// Standard deviation of a shift beyond which a direction is said to be open, metres.
const OPEN: f64 = 0.05;

/// The motion of a thing from the earlier to the later session.
#[derive(Debug, Clone, PartialEq)]
pub struct ThingMotion {
    /// Place in the earlier session of the point of the thing whose shift is stated, world frame,
    /// metres: the middle of what was seen of it, or, where it looks the same after other turns,
    /// the axis of these turns at that height.
    pub at: [f64; 3],
    /// Displacement of that point, metres.
    pub shift: [f64; 3],
    /// Covariance of the shift, m².
    pub covariance: [[f64; 3]; 3],
    /// Turn about the vertical, counter-clockwise seen from above, and its standard deviation,
    /// radians; `None` where the points do not tell, as of a drum, or of a box after whose quarter
    /// turns they fit about as well.
    pub turn: Option<[f64; 2]>,
    /// Other turns that explain the points as well, radians.
    pub other_turns: Vec<f64>,
    /// Directions in which the shift is hardly determined, unit vectors, the least determined
    /// first.
    pub open: Vec<[f64; 3]>,
    /// Shares of what each session saw of the thing that the other one saw as well, 0..1.
    pub common: [f64; 2],
}

/// Why nothing is known of the motion of a thing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum UnknownMotion {
    /// One session has too few points of it.
    FewPoints,
    /// No motion brings enough of what one session saw onto what the other one saw.
    NothingCommon,
    /// Beams contradict each motion that fits.
    Contradicted,
    /// Old and new place overlap in something larger whose ends are not near.
    PartsOnly,
    /// Other turns fit about as well, and no point of it moves alike with all of them.
    OtherTurns,
}

impl UnknownMotion {
    /// The reason in words: half a sentence.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::FewPoints => "one session has too few points of it",
            Self::NothingCommon => "the sessions saw too little of the same sides of it",
            Self::Contradicted => "beams contradict each motion that fits its surfaces",
            Self::PartsOnly => "only parts of it left their old place",
            Self::OtherTurns => "other turns of it fit as well",
        }
    }
}

/// The motion of a thing from its surfels and points (world frame, metres) in both sessions.
pub(super) fn motion(
    sides: [Vec<ThingSurfel>; 2],
    points: [Vec<Vector>; 2],
    beams: &dyn SessionBeams,
) -> Result<ThingMotion, UnknownMotion> {
    if sides.iter().any(|side| side.len() < MIN_SURFELS) {
        return Err(UnknownMotion::FewPoints);
    }
    let pair = ThingPair::new(sides, points, beams);
    let guesses = pair.guesses();
    let n = pair.n_surfels();
    let of_fewer = if n[0] < n[1] { 0 } else { 1 };
    let is_common = |g: &MotionGuess| {
        g.n_on.iter().all(|on| *on >= MIN_ON)
            && g.n_on[of_fewer] as f64 >= MIN_SHARE * n[of_fewer] as f64
    };
    let best = guesses.first().ok_or(UnknownMotion::NothingCommon)?;
    if best.through > MAX_THROUGH {
        return Err(UnknownMotion::Contradicted);
    }
    if !is_common(best) {
        return Err(UnknownMotion::NothingCommon);
    }
    let is_freer = |g: &MotionGuess| {
        let is_other = wrapped(turn(&g.motion) - turn(&best.motion)).abs() > OTHER_TURN;
        is_other && is_common(g) && g.through + LESS_THROUGH < best.through
    };
    if guesses.iter().any(is_freer) {
        return Err(UnknownMotion::OtherTurns);
    }
    let is_as_good = |g: &MotionGuess, worse: [f64; 2]| {
        let least = (1.0 - worse[0]) * best.score();
        is_common(g) && g.score() >= least && g.through <= best.through + worse[1]
    };
    let equals: Vec<&MotionGuess> = guesses.iter().filter(|g| is_as_good(g, AS_WELL)).collect();
    // Most things are pushed without being turned about.
    let size = |k: &usize| turn(&equals[*k].motion).abs();
    let own = (0..equals.len()).min_by(|a, b| size(a).total_cmp(&size(b)));
    let own = own.ok_or(UnknownMotion::NothingCommon)?;
    let is_rival = |g: &&MotionGuess| {
        let is_other = is_quarter(&g.motion, &best.motion) && !is_as_good(g, AS_WELL);
        is_other && is_as_good(g, TURN_AS_WELL)
    };
    let rivals = guesses.iter().filter(is_rival);
    let all = equals.iter().copied().chain(rivals);
    stated(&pair, &all.map(|g| settled(&pair, g.motion)).collect::<Vec<_>>(), own)
}

/// Whether the turns of two motions differ by neither nothing nor half a turn, after which a box
/// looks the same.
fn is_quarter(a: &Pose, b: &Pose) -> bool {
    (OTHER_TURN..PI - OTHER_TURN).contains(&wrapped(turn(a) - turn(b)).abs())
}

/// The statement about the motion `equals[own]`, beside which the others explain the points as
/// well.
fn stated(
    pair: &ThingPair<'_>,
    equals: &[SettledMotion],
    own: usize,
) -> Result<ThingMotion, UnknownMotion> {
    let settled = &equals[own];
    let motion = settled.motion;
    let others = || equals.iter().enumerate().filter(|(i, _)| *i != own).map(|(_, e)| &e.motion);
    let turn_variance = settled.covariance[(5, 5)] + SHARED[1].powi(2);
    let axes: Vec<Vector2<f64>> = others().filter_map(|other| axis(&motion, other)).collect();
    let is_turn_open = turn_variance.sqrt() > OPEN_TURN || axes.len() > MAX_OTHER_TURNS;
    let at = if !axes.is_empty() {
        let mean = axes.iter().sum::<Vector2<f64>>() / axes.len() as f64;
        if (mean - pair.middle.xy()).norm() > AT_MOST * pair.radius() {
            return Err(UnknownMotion::OtherTurns);
        }
        Vector::new(mean.x, mean.y, pair.middle.z)
    } else if is_turn_open {
        spun_about(settled)
    } else {
        pair.middle
    };
    let at = Point::from(at);
    let shift = motion * at - at;
    let lever = (motion * at).coords - settled.about;
    // The shift of a point is that of the centre and the turn's share: s + w × lever.
    let cross = -lever.cross_matrix();
    let all = &settled.covariance;
    let (s, sw, w) = (
        all.fixed_view::<3, 3>(0, 0).into_owned(),
        all.fixed_view::<3, 3>(0, 3).into_owned(),
        all.fixed_view::<3, 3>(3, 3).into_owned(),
    );
    let mut covariance = s + sw * cross.transpose() + cross * sw.transpose();
    covariance += cross * w * cross.transpose() + Matrix3::identity() * SHARED[0].powi(2);
    covariance += pair.fine.scan_errors(&motion, super::search::REACH);
    for other in others() {
        let off = (other * at - at) - shift;
        covariance += off * off.transpose() / equals.len() as f64;
    }
    // Where quarter turns fit about as well, it is not known which one it was.
    let is_turn_open = is_turn_open || others().any(|other| is_quarter(other, &motion));
    let other_turns = others().map(turn).filter(|t| wrapped(t - turn(&motion)).abs() > OTHER_TURN);
    let n_on = pair.fine.n_on(&motion, super::search::REACH);
    let n = pair.n_surfels();
    Ok(ThingMotion {
        at: at.coords.into(),
        shift: shift.into(),
        covariance: covariance.into(),
        turn: (!is_turn_open).then(|| [turn(&motion), turn_variance.sqrt()]),
        other_turns: if is_turn_open { Vec::new() } else { other_turns.collect() },
        open: open(&covariance),
        common: [0, 1].map(|k| n_on[k] as f64 / n[k].max(1) as f64),
    })
}

/// Directions with a large standard deviation, the largest first.
fn open(covariance: &Matrix3<f64>) -> Vec<[f64; 3]> {
    let eigen = covariance.symmetric_eigen();
    let mut order: Vec<usize> = (0..3).filter(|&i| eigen.eigenvalues[i] > OPEN * OPEN).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let up = |v: Vector| {
        let most = v[v.iamax()];
        v * most.signum()
    };
    order.into_iter().map(|i| up(eigen.eigenvectors.column(i).into_owned()).into()).collect()
}

/// The place in the earlier session whose shift does not depend on the turn: an undetermined turn
/// is one about it.
fn spun_about(settled: &SettledMotion) -> Vector {
    let all = &settled.covariance;
    let (x, y, turn) = (all[(0, 5)], all[(1, 5)], all[(5, 5)].max(1e-12));
    let now = settled.about + Vector::new(-y / turn, x / turn, 0.0);
    settled.motion.inverse_transform_point(&Point::from(now)).coords
}

/// The place in the plan of the earlier session that two motions move alike; `None` if their turns
/// hardly differ.
fn axis(a: &Pose, b: &Pose) -> Option<Vector2<f64>> {
    let between = b.inverse() * a;
    let angle = turn(&between);
    if angle.abs() < OTHER_TURN {
        return None;
    }
    let (sin, cos) = angle.sin_cos();
    let one_less = Matrix2::new(1.0 - cos, sin, -sin, 1.0 - cos);
    Some(one_less.try_inverse()? * between.translation.vector.xy())
}

/// Turn about the vertical, radians.
fn turn(motion: &Pose) -> f64 {
    let x = motion.rotation * Vector::x();
    x.y.atan2(x.x)
}

/// An angle between minus and plus half a turn, radians.
fn wrapped(angle: f64) -> f64 {
    let whole = std::f64::consts::TAU;
    angle - whole * (angle / whole).round()
}
