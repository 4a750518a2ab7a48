//! Settings of all comparisons with other postures, with units and reasons.

use crate::correspond::CAP;

/// All of them.
pub(crate) const MODES: ModeLimits = ModeLimits {
    same_turn: 3.0_f64.to_radians(),
    other_turn: 2.0_f64.to_radians(),
    other_base: 0.03,
    equal: 0.03,
    nearly_equal: 0.12,
    slide_equal: 0.3,
    as_good: AsGood { share: 0.03, variances: 30.0 },
    any_angle: 1.813_799_364_234_217_8,
    profile: ProfileStep { arc: 0.003, most: 0.0175 },
    leaf: LeafLimits { clearly_worse_sigmas: 2.5 },
    bend: BendLimits {
        apart: 2.0_f64.to_radians(),
        short: 0.3,
        n_values: 4,
        slide_step: 0.005,
        max_slides: 100.0,
    },
    wrist: WristLimits {
        max_points: 3000,
        known: 0.1_f64.to_radians(),
        asked: 400,
        far: ArcLimit { arc: 0.015, angle: 0.21 },
        step: ArcLimit { arc: 0.002, angle: 0.0175 },
        turn_step: 0.006,
        least_turns: 36.0,
        most_turns: 90.0,
        lead: 3.7,
        alike: 2.0,
    },
    coupled: CoupledLimits { n_listed: 8, n_around: 5 },
    foot: FootLimits { span: 0.35, step: 0.0087, valley: 2.0_f64.to_radians() },
    marginal: MarginalLimits { max_points: 2000, n_beside: 6, sigma: SigmaRange::ASKED },
    camera: CameraLimits {
        link_off_sigmas: 0.9,
        link_bent_sigmas: 0.6,
        foot_step: 0.052,
        open_foot: 20.0_f64.to_radians(),
    },
    loops: OtherBranch { squares: 0.1, surface: 0.1 },
    rival: RivalLimits {
        flip_short: 0.03,
        short: 0.01,
        same_steps: 1.0,
        lead: 0.1,
        n_rivals: 3,
        slid: 0.01,
        against: 3.0,
    },
    trade_off: SigmaRange::TRADE_OFF,
};

/// What tells modes apart, how well a mode must explain the points, and how each is looked for.
pub(crate) struct ModeLimits {
    /// Values of one joint that are nearer to each other are one mode, radians.
    pub(crate) same_turn: f64,
    /// Postures with a joint farther apart are different answers, radians or metres.
    pub(crate) other_turn: f64,
    /// Postures with bases farther apart are different answers, metres.
    pub(crate) other_base: f64,
    /// Margin up to which another posture explains the points as well.
    pub(crate) equal: f64,
    /// Margin up to which another value of the last joint is listed.
    pub(crate) nearly_equal: f64,
    /// Margin up to which another value of a slide that closes a tool leaves it open: what the
    /// tool holds looks like it where little of it is seen. Electrodes in plain view led by
    /// 0.6 and more, those in a part by 0.17 to 0.6 where they were right, by 0.18 where not.
    pub(crate) slide_equal: f64,
    /// Squares that a value may have beyond the best one's and be as good.
    pub(crate) as_good: AsGood,
    /// Standard deviation of an angle of which nothing is known, radians: π/√3, any value of a
    /// whole turn.
    pub(crate) any_angle: f64,
    pub(crate) profile: ProfileStep,
    pub(crate) leaf: LeafLimits,
    pub(crate) bend: BendLimits,
    pub(crate) wrist: WristLimits,
    pub(crate) coupled: CoupledLimits,
    pub(crate) foot: FootLimits,
    pub(crate) marginal: MarginalLimits,
    pub(crate) camera: CameraLimits,
    pub(crate) loops: OtherBranch,
    pub(crate) rival: RivalLimits,
    /// A direction of the covariance is put into words if its standard deviation is in this range,
    /// radians; beyond it the direction is open, and its joints are said to be.
    pub(crate) trade_off: SigmaRange,
}

/// Extra squares up to which a value of a joint is as good as the best one; the larger counts.
pub(crate) struct AsGood {
    /// Share of the best one's squares: 3 % is less than what real castings differ by.
    pub(crate) share: f64,
    /// In variances of the scans' noise.
    pub(crate) variances: f64,
}

impl AsGood {
    /// The limit of squares above the least ones; `variance` is that of the noise, in the unit of
    /// the squares.
    pub(crate) fn limit(&self, least: f64, variance: f64) -> f64 {
        least + (self.share * least).max(self.variances * variance)
    }
}

/// Distance of the values of a joint's profile.
pub(crate) struct ProfileStep {
    /// Arc at the joint's lever, metres: finer than the features that tell values apart.
    pub(crate) arc: f64,
    /// Most, radians (1°).
    pub(crate) most: f64,
}

/// Modes of a leaf joint.
pub(crate) struct LeafLimits {
    /// Another local minimum is as good if its excess over the best value is below so many
    /// standard deviations of an excess by chance: of flanges that bolts make look alike the
    /// right one was worse by up to 1.8; what is not alike by 3 and more.
    pub(crate) clearly_worse_sigmas: f64,
}

/// Other values of the joint before the last, and of slides.
pub(crate) struct BendLimits {
    /// Values nearer than this to one another, or to the posture's own, are one, radians.
    pub(crate) apart: f64,
    /// Share of the squares that a value may lack.
    pub(crate) short: f64,
    /// Most values.
    pub(crate) n_values: usize,
    /// Distance of the values of a slide, metres. They are compared as they are: a refinement
    /// would be drawn to what the tool holds.
    pub(crate) slide_step: f64,
    /// Most values of a slide.
    pub(crate) max_slides: f64,
}

/// A limit on an angle: by an arc at the joint's lever, and by the angle itself; the smaller
/// counts.
pub(crate) struct ArcLimit {
    /// Metres.
    pub(crate) arc: f64,
    /// Radians.
    pub(crate) angle: f64,
}

impl ArcLimit {
    /// The angle at a lever, metres.
    pub(crate) fn at(&self, lever: f64) -> f64 {
        (self.arc / lever).min(self.angle)
    }
}

/// Bends of the joint before an open flange.
pub(crate) struct WristLimits {
    /// More points on what the joint moves hold it, however the flange stands.
    pub(crate) max_points: usize,
    /// A joint that is stated better than this has one mode, radians: those that were elsewhere
    /// were stated to 0.25° and more.
    pub(crate) known: f64,
    /// About so many of the points are asked.
    pub(crate) asked: usize,
    /// How far to either side bends are tried: the gate of the adjustment, and 12°.
    pub(crate) far: ArcLimit,
    /// Distance of the bends that are tried: the noise of the points, and 1°.
    pub(crate) step: ArcLimit,
    /// Distance of the turns of the flange that are tried, metres at its lever.
    pub(crate) turn_step: f64,
    /// Least and most turns of the flange.
    pub(crate) least_turns: f64,
    pub(crate) most_turns: f64,
    /// What a bend's cost must be less by than the posture's own to be looked at: the cost of a
    /// point beside all surface.
    pub(crate) lead: f64,
    /// Costs count by so many of their units: points of a wrist lie side by side, and their errors
    /// are correlated.
    pub(crate) alike: f64,
}

/// How joints give way to other values of leaf joints.
pub(crate) struct CoupledLimits {
    /// Most listed values of a joint that are asked.
    pub(crate) n_listed: usize,
    /// Values all around that are asked where fewer are listed.
    pub(crate) n_around: usize,
}

/// Turns of the base under the robot.
pub(crate) struct FootLimits {
    /// How far to either side turns are tried, radians (20°).
    pub(crate) span: f64,
    /// Distance of the turns that are tried, radians (0.5°).
    pub(crate) step: f64,
    /// Within this the covariance tells, radians.
    pub(crate) valley: f64,
}

/// The marginal spread of a joint that few points hold.
pub(crate) struct MarginalLimits {
    /// Joints with more points on what they move are held by so many that the parabola is right.
    pub(crate) max_points: usize,
    /// Values on either side of a joint's own at which the points are asked, one standard
    /// deviation apart.
    pub(crate) n_beside: i32,
    /// Joints that are stated to be known so well are asked, radians: from 0.03° on it may be more
    /// than it should, up to 0.4°; beyond that it is wide enough, and six of it are another
    /// posture.
    pub(crate) sigma: SigmaRange,
}

/// A range of standard deviations.
pub(crate) struct SigmaRange {
    pub(crate) from: f64,
    pub(crate) below: f64,
}

impl SigmaRange {
    const ASKED: Self = Self { from: 0.000_5, below: 0.007 };
    /// 0.1° to 5.2°.
    const TRADE_OFF: Self = Self { from: 0.1_f64.to_radians(), below: 0.09 };

    pub(crate) fn contains(&self, sigma: f64) -> bool {
        (self.from..self.below).contains(&sigma)
    }
}

/// Errors of depth cameras.
pub(crate) struct CameraLimits {
    /// How far a link is off as a whole, one sigma, in standard deviations of the points as flat
    /// things show it.
    pub(crate) link_off_sigmas: f64,
    /// How far its ends are off by more than its middle, the same.
    pub(crate) link_bent_sigmas: f64,
    /// Distance of the turns of the base that are tried, radians (3°).
    pub(crate) foot_step: f64,
    /// Turns as good as the posture's own up to this leave base yaw and first joint open, radians.
    pub(crate) open_foot: f64,
}

/// How much better the other solution of a closed loop must be.
pub(crate) struct OtherBranch {
    /// Share of the squares.
    pub(crate) squares: f64,
    /// Share of the surface judged.
    pub(crate) surface: f64,
}

/// Comparison of whole postures.
pub(crate) struct RivalLimits {
    /// Share of the surface explained that a flipped posture may lack and still be compared.
    pub(crate) flip_short: f64,
    /// The same of any other.
    pub(crate) short: f64,
    /// Sweep steps within which, in all joints but a last one that turns, two postures are one.
    pub(crate) same_steps: f64,
    /// How clearly a posture may be worse before it is adjusted and still be compared.
    pub(crate) lead: f64,
    /// Most postures that are compared.
    pub(crate) n_rivals: usize,
    /// Slides that differ by more stand otherwise, metres.
    pub(crate) slid: f64,
    /// What beams have against the best, where points speak for it, or points where beams do,
    /// counts so many times: a wrist that was 7° off was better by 0.19 for the beams, and worse
    /// by 0.03 for the points.
    pub(crate) against: f64,
}

/// Points in front of everything are no farther than this, m²: of those no value of a joint says
/// anything.
pub(crate) fn unexplained_square() -> f64 {
    0.99 * f64::from(CAP).powi(2)
}
