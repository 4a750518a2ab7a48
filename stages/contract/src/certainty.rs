//! The standard deviation of a joint in; how well the points tell where it stands, in one of three
//! words, out. The thresholds and the words stand here only: terminal, reports, pages and JUnit
//! files use them.

use serde::{Deserialize, Serialize};

/// Standard deviation below which a joint is determined, radians or metres: 0.043°, so that 0.1° is
/// more than two of them.
pub const DETERMINED_SIGMA: f64 = 0.000_75;
/// Standard deviation from which on a joint is undetermined, radians (1°) or metres (17.5 mm): at
/// the end of a reach of two metres 1° is 35 mm, which no planner's margin covers.
pub const UNDETERMINED_SIGMA: f64 = 0.0175;

/// How well the points tell where a joint stands.
#[derive(
    Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
#[serde(rename_all = "snake_case")]
pub enum Certainty {
    /// It may stand elsewhere: its standard deviation is large, or other values explain the points
    /// as well.
    #[default]
    Undetermined,
    /// It stands about there: its standard deviation is larger than that of most joints, but small,
    /// and there is no other value.
    Coarse,
    /// It stands there.
    Determined,
}

impl Certainty {
    /// That of a standard deviation, radians or metres, where a joint is determined below
    /// `determined_sigma` (by default [`DETERMINED_SIGMA`]); a joint that may have other values is
    /// undetermined whatever the width of one of them.
    #[must_use]
    pub fn of(sigma: f64, has_other_values: bool, determined_sigma: f64) -> Self {
        // A standard deviation that is no number is that of nothing.
        if has_other_values || sigma.is_nan() || sigma >= UNDETERMINED_SIGMA.max(determined_sigma) {
            Self::Undetermined
        } else if sigma >= determined_sigma {
            Self::Coarse
        } else {
            Self::Determined
        }
    }

    /// In one word.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Undetermined => "undetermined",
            Self::Coarse => "coarse",
            Self::Determined => "determined",
        }
    }

    /// What stands behind a value and its standard deviation: nothing where it is determined, else
    /// a space and the word.
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
        // 0.04°, 0.06°, 0.99°, 1.01°, any angle.
        let sigmas = [0.04_f64, 0.06, 0.99, 1.01, 104.0].map(f64::to_radians);
        let words = sigmas.map(|sigma| of(sigma, false));
        assert_eq!(words, ["determined", "coarse", "coarse", "undetermined", "undetermined"]);
        assert!(sigmas.iter().all(|&sigma| of(sigma, true) == "undetermined"));
        assert_eq!(of(f64::NAN, false), "undetermined");
        // Whoever asks for less than a degree gets that.
        assert_eq!(Certainty::of(0.02, false, 0.03), Certainty::Determined);
        assert_eq!(Certainty::of(0.04, false, 0.03), Certainty::Undetermined);
    }
}
