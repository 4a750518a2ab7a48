//! The thresholds of the verdict, each with its unit and its reason.

use super::rule::{Limit, Quantity, Scale, Threshold};

/// Standard deviation below which a joint counts as known, radians or metres.
pub(super) const KNOWN_SIGMA: f64 = contract::UNDETERMINED_SIGMA;
/// Play of a joint's stop, in which it does not stand beyond its limit: radians of joints that
/// turn, metres of those that slide.
pub(super) const STOP_PLAY: StopPlay = StopPlay { turning: 0.0175, sliding: 0.001 };
/// Most noise that excuses residuals of a fit that leaves half of its joints open, metres. In a
/// corridor that was scanned with 9 mm of noise, walls and cabinets had room for four small arms
/// that were 9.5 to 11.6 mm off.
pub(super) const MOST_EXCUSED_NOISE: f64 = 0.005;
/// Smallest margin of the beams for the best posture over another one that explains the points, by
/// which the other one is ruled out.
pub(crate) const RIVAL: f64 = 0.12;
/// Scans that must agree on a posture for it to be trusted.
pub(crate) const MIN_AGREEING: usize = 2;

/// Play of a stop by the kind of its joint.
pub(super) struct StopPlay {
    /// Radians.
    pub(super) turning: f64,
    /// Metres.
    pub(super) sliding: f64,
}

pub(super) const LOW_SCORE: Threshold = Threshold {
    name: "LOW_SCORE",
    limit: Limit::Fixed(0.60),
    scale: Scale::Plain,
    why: "less than three fifths of the judged surface is explained, net of what is contradicted",
};
pub(super) const LOWEST_SCORE: Threshold = Threshold {
    name: "LOWEST_SCORE",
    limit: Limit::Fixed(0.35),
    scale: Scale::Plain,
    why: "barely a third of the judged surface is explained, net of what is contradicted",
};
pub(super) const LOW_SCORE_OFF_SURFACE: Threshold = Threshold {
    name: "LOW_SCORE_OFF_SURFACE",
    limit: Limit::Fixed(0.52),
    scale: Scale::Plain,
    why: "furniture has room for a small arm that is nowhere quite right",
};
pub(super) const PIERCED: Threshold = Threshold {
    name: "PIERCED",
    limit: Limit::Fixed(0.03),
    scale: Scale::Share,
    why: "beams beside edges go through a little of a right fit",
};
pub(super) const MOST_PIERCED: Threshold = Threshold {
    name: "MOST_PIERCED",
    limit: Limit::Fixed(0.15),
    scale: Scale::Share,
    why: "no solid robot lets so many beams through",
};
pub(super) const LINK_PIERCED: Threshold = Threshold {
    name: "LINK_PIERCED",
    limit: Limit::Fixed(0.06),
    scale: Scale::Share,
    why: "one link has more edge for its surface than the whole robot",
};
pub(super) const LINK_MOST_PIERCED: Threshold = Threshold {
    name: "LINK_MOST_PIERCED",
    limit: Limit::Fixed(0.30),
    scale: Scale::Share,
    why: "the link cannot stand there",
};
pub(super) const LINK_SEEN: Threshold = Threshold {
    name: "LINK_SEEN",
    limit: Limit::Fixed(0.02),
    scale: Scale::Share,
    why: "a share of fewer samples says nothing",
};
pub(super) const FEW_POINTS: Threshold = Threshold {
    name: "FEW_POINTS",
    limit: Limit::Fixed(100.0),
    scale: Scale::Count,
    why: "the smallest cloud in which a robot was found rightly had a thousand points",
};
pub(super) const LITTLE_SEEN: Threshold = Threshold {
    name: "LITTLE_SEEN",
    limit: Limit::Fixed(0.12),
    scale: Scale::Share,
    why: "the score of so little surface does not tell one thing from another",
};
pub(super) const QUARTER: Threshold = Threshold {
    name: "QUARTER",
    limit: Limit::Fixed(0.25),
    scale: Scale::Share,
    why: "no right robot of the suites had so little; a corner of a shelf had, of sixty models",
};
pub(super) const HALF: Threshold = Threshold {
    name: "HALF",
    limit: Limit::Fixed(0.5),
    scale: Scale::Share,
    why: "a posture of which half is open is an answer to half of the question",
};
pub(super) const HALF_BUT_LAST: Threshold = Threshold {
    name: "HALF_BUT_LAST",
    limit: Limit::Fixed(0.5),
    scale: Scale::Share,
    why: "seven smooth small arms on walls and jigs had two of six or seven joints known at most; \
          of 5488 right fits none had less than half but the last",
};
pub(super) const OFF_SURFACE: Threshold = Threshold {
    name: "OFF_SURFACE",
    limit: Limit::Multiple { of: Quantity::Noise, times: 2.0, beyond: 0.0015 },
    scale: Scale::Length,
    why: "points of a right fit scatter as far as the scans' noise and a little error of shape",
};
pub(super) const FAR_OFF_SURFACE: Threshold = Threshold {
    name: "FAR_OFF_SURFACE",
    limit: Limit::Larger { fixed: 0.0072, of: Quantity::Noise, times: 1.5 },
    scale: Scale::Length,
    why: "points that fill the gate of the adjustment evenly are of things near the model, not on \
          it",
};
pub(super) const OFF_SURFACE_AND_OPEN: Threshold = Threshold {
    name: "OFF_SURFACE_AND_OPEN",
    limit: Limit::Multiple { of: Quantity::ExcusedNoise, times: 1.25, beyond: 0.002 },
    scale: Scale::Length,
    why: "a post, a bench and a hose have room for a smooth small arm: 4.7 mm off and more at a \
          noise of 2 mm. Of 3648 right fits five left so many joints open; they were 2.6 mm off \
          at most there, and 7.6 mm at a noise of 10 mm",
};
pub(super) const JOINT_FEW_POINTS: Threshold = Threshold {
    name: "JOINT_FEW_POINTS",
    limit: Limit::Fixed(30.0),
    scale: Scale::Count,
    why: "a joint is measured by the points on what it moves",
};
pub(super) const JOINT_OPEN: Threshold = Threshold {
    name: "JOINT_OPEN",
    limit: Limit::Fixed(KNOWN_SIGMA),
    scale: Scale::Joint,
    why: "at the end of a reach of two metres 1° is 35 mm, which no planner's margin covers",
};
pub(super) const BEYOND_LIMIT: Threshold = Threshold {
    name: "BEYOND_LIMIT",
    limit: Limit::Multiple { of: Quantity::JointSigma, times: 3.0, beyond: 0.0 },
    scale: Scale::Joint,
    why: "a value within three standard deviations of the limit may be within it",
};
pub(super) const AT_ALL: Threshold = Threshold {
    name: "AT_ALL",
    limit: Limit::Fixed(0.0),
    scale: Scale::Joint,
    why: "a joint that hardly anything but its stop holds may stand far beyond it",
};
pub(super) const NONE: Threshold = Threshold {
    name: "NONE",
    limit: Limit::Fixed(0.0),
    scale: Scale::Share,
    why: "a robot that is a hundredth smaller than its model leaves all of its joints open, each \
          by half a degree",
};
pub(super) const RIVAL_MARGIN: Threshold = Threshold {
    name: "RIVAL_MARGIN",
    limit: Limit::Fixed(RIVAL),
    scale: Scale::Plain,
    why: "the beams do not prefer the best posture clearly",
};
pub(super) const AGREEING: Threshold = Threshold {
    name: "AGREEING",
    limit: Limit::Fixed(MIN_AGREEING as f64),
    scale: Scale::Count,
    why: "a posture that one scan shows alone is borne out by nothing else",
};
pub(super) const OTHER_MODEL: Threshold = Threshold {
    name: "OTHER_MODEL",
    limit: Limit::Fixed(0.90),
    scale: Scale::Share,
    why: "the points do not tell the models apart clearly; from 97 % on the other model is listed \
          as alike instead",
};
