//! Classifies how well the points determine a joint, from its standard deviation.
//!
//! The thresholds and the three words are defined only here; the terminal, reports, pages and
//! JUnit files all use them.

use serde::{Deserialize, Serialize};

/// Standard deviation below which a joint is determined, radians (0.043°) or metres (0.75 mm):
/// an error of 0.1° is then more than two standard deviations.
pub const DETERMINED_SIGMA: f64 = 0.000_75;
/// Standard deviation from which on a joint is undetermined, radians (1°) or metres (17.5 mm): at
/// a reach of two metres 1° moves the tip by 35 mm, more than a path planner's safety margin.
pub const UNDETERMINED_SIGMA: f64 = 0.0175;

/// How well the points determine the value of a joint.
#[derive(
    Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
#[serde(rename_all = "snake_case")]
pub enum Certainty {
    /// The joint may have another value: its standard deviation is large, or other values explain
    /// the points as well.
    #[default]
    Undetermined,
    /// The value is approximate: its standard deviation is larger than that of most joints, but
    /// below [`UNDETERMINED_SIGMA`], and no other value explains the points.
    Coarse,
    /// The value is known to within [`DETERMINED_SIGMA`], or what the caller set in its place.
    Determined,
}

impl Certainty {
    /// Classifies a standard deviation `sigma`, radians or metres. A joint is determined below
    /// `determined_sigma` (by default [`DETERMINED_SIGMA`]). A joint that may have other values is
    /// undetermined, however small the standard deviation of each of them is.
    #[must_use]
    pub fn of(sigma: f64, has_other_values: bool, determined_sigma: f64) -> Self {
        // NaN means that no standard deviation could be computed, so nothing is known of the joint.
        if has_other_values || sigma.is_nan() || sigma >= UNDETERMINED_SIGMA.max(determined_sigma) {
            Self::Undetermined
        } else if sigma >= determined_sigma {
            Self::Coarse
        } else {
            Self::Determined
        }
    }

    /// The word for this class, as reports use it.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Undetermined => "undetermined",
            Self::Coarse => "coarse",
            Self::Determined => "determined",
        }
    }

    /// The remark after a value and its standard deviation: empty where the joint is determined,
    /// else a space and the word.
    #[must_use]
    pub fn note(self) -> &'static str {
        match self {
            Self::Undetermined => " undetermined",
            Self::Coarse => " coarse",
            Self::Determined => "",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_joint_is_coarse_only_between_the_thresholds_and_where_it_has_no_other_value() {
        let of = |sigma: f64, others: bool| Certainty::of(sigma, others, DETERMINED_SIGMA).word();
        // Standard deviations of 0.04°, 0.06°, 0.99°, 1.01°, and that of a uniform angle (104°).
        let sigmas = [0.04_f64, 0.06, 0.99, 1.01, 104.0].map(f64::to_radians);
        let words = sigmas.map(|sigma| of(sigma, false));
        assert_eq!(words, ["determined", "coarse", "coarse", "undetermined", "undetermined"]);
        assert!(sigmas.iter().all(|&sigma| of(sigma, true) == "undetermined"));
        assert_eq!(of(f64::NAN, false), "undetermined");
        // A caller may allow more than a degree.
        assert_eq!(Certainty::of(0.02, false, 0.03), Certainty::Determined);
        assert_eq!(Certainty::of(0.04, false, 0.03), Certainty::Undetermined);
    }
}
