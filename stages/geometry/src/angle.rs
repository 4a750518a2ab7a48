//! Angles that are the same after whole turns: differences of two, and the one within limits.

use std::f64::consts::TAU;

/// The turn from one angle to another, at most half a turn either way, radians.
#[must_use]
pub fn from_to(a: f64, b: f64) -> f64 {
    let d = b - a;
    d - TAU * (d / TAU).round()
}

/// Size of the turn from one angle to another, radians, 0..π.
#[must_use]
pub fn apart(a: f64, b: f64) -> f64 {
    from_to(a, b).abs()
}

/// The same angle within limits (lower, upper), radians: the nearest one, whole turns away;
/// `None` where there is none.
#[must_use]
pub fn within(value: f64, [low, high]: [f64; 2]) -> Option<f64> {
    let turned = match value {
        _ if value < low => low + (value - low).rem_euclid(TAU),
        _ if value > high => high - (high - value).rem_euclid(TAU),
        _ => value,
    };
    (low..=high).contains(&turned).then_some(turned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_beyond_a_stop_are_taken_a_whole_turn_back() {
        let limits = [-6.2, 6.2];
        for (value, is) in [(-8.0, TAU - 8.0), (8.0, 8.0 - TAU), (1.0, 1.0), (-6.1, -6.1)] {
            assert!((within(value, limits).expect("a turn") - is).abs() < 1e-12);
        }
        // Half a turn is all that there is.
        assert!(within(1.6, [-1.5, 1.5]).is_none());
    }

    #[test]
    fn the_shorter_way_round_is_taken() {
        assert!((from_to(3.0, -3.0) - (TAU - 6.0)).abs() < 1e-12);
        assert!((apart(-0.1, TAU + 0.1) - 0.2).abs() < 1e-12);
    }
}
