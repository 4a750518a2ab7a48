//! Finds the step of a file's coordinates, where it is coarse enough to matter.
//!
//! Single precision has 24 bits: a northing of 5,600,000 m is stored in steps of half a metre,
//! whatever precision the file claims.

use contract::{Error, Result};

/// Step from which on it is reported, metres: the noise of a common scanner, compared with which
/// finer steps are negligible.
const COARSE: f64 = 0.003;
/// Step from which on a file is refused, metres: points are then wrong by the thickness of the
/// links of a small arm, so that no posture can be determined.
const USELESS: f64 = 0.1;
/// Number of points below which nothing is concluded, since a common step may be chance.
const MIN_POINTS: usize = 200;
/// Number of differences below which nothing is concluded: a cloud without noise has few heights.
const MIN_GAPS: usize = 12;
/// Largest deviation of a difference from whole steps that is rounding, metres.
const LEFT: f64 = 1e-4;
/// Largest difference of equal values, metres: the rounding of map coordinates in double precision.
const SAME: f64 = 1e-7;

/// The coarsest step of the three coordinates, metres; `None` where none is coarse.
pub(crate) fn coarse(points: &[[f64; 3]]) -> Option<f64> {
    if points.len() < MIN_POINTS {
        return None;
    }
    (0..3).filter_map(|axis| step(points.iter().map(|p| p[axis]).collect())).reduce(f64::max)
}

/// The coarse step of which all differences of the values are multiples, if there is one.
fn step(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let gaps: Vec<f64> = values.windows(2).map(|w| w[1] - w[0]).filter(|g| *g > SAME).collect();
    // Euclid's algorithm; without a common step the divisor soon falls below any coarse one.
    let divides = |step: f64, gap: &f64| {
        let (mut a, mut b) = (*gap, step);
        while b > LEFT {
            let left = a - b * (a / b).round();
            (a, b) = (b, left.abs());
        }
        (a >= COARSE).then_some(a)
    };
    let least = gaps.iter().copied().reduce(f64::min)?;
    let is_told = gaps.len() >= MIN_GAPS && least >= COARSE;
    is_told.then(|| gaps.iter().try_fold(least, divides)).flatten()
}

/// The message about a coarse step.
pub(crate) fn note(step: f64) -> String {
    format!(
        "coordinates come in steps of {}: surfaces and robots are not located more precisely; export them in double \
         precision, or about an origin near the plant",
        length(step)
    )
}

/// Refuses a step that is too coarse to recognise a robot.
///
/// # Errors
/// Names the step and what to do.
pub(crate) fn refuse(step: f64) -> Result<()> {
    if step < USELESS {
        return Ok(());
    }
    let what = format!(
        "coordinates come in steps of {}: no robot can be recognised in such points",
        length(step)
    );
    Err(Error::bad_input(what)
        .hint("export the scan in double precision, or about an origin near the plant"))
}

/// A length in millimetres or metres, for people.
fn length(metres: f64) -> String {
    if metres < 0.1 { format!("{:.1} mm", metres * 1e3) } else { format!("{metres:.2} m") }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points of a bumpy room about a place, stored as `stored` says.
    fn points(about: [f64; 3], stored: impl Fn(f64) -> f64) -> Vec<[f64; 3]> {
        let point = |k: u32| {
            let k = f64::from(k);
            [8.0 * (k * 0.7).sin(), 6.0 * (k * 1.3).cos(), 3.0 * (k * 0.37).sin()]
        };
        (0..2000).map(|k| [0, 1, 2].map(|i| stored(about[i] + point(k)[i]))).collect()
    }

    #[test]
    fn single_precision_at_a_map_offset_shows_its_step() {
        let single = |v: f64| f64::from(v as f32);
        let map = points([412_300.0, 5_653_120.0, 87.0], single);
        assert_eq!(coarse(&map), Some(0.5));
        let words = refuse(0.5).expect_err("useless").to_string();
        assert!(words.contains("steps of 0.50 m"), "{words}");
        // Few values, so that none of them are neighbours.
        let sparse: Vec<_> =
            map.iter().map(|p| [p[0], p[1] * 7.0 - 6.0 * 5_653_120.0, 0.0]).collect();
        assert_eq!(coarse(&sparse), Some(3.5));
        // A local origin 70 km away: steps of 7.8 mm, which are reported and accepted.
        let near = points([70_000.0, 1_000.0, 0.0], single);
        let step = coarse(&near).expect("it is coarse");
        assert!((step - 0.007_812_5).abs() < 1e-9 && refuse(step).is_ok(), "{step}");
        assert!(note(step).contains("7.8 mm"));
    }

    #[test]
    fn what_is_fine_or_chance_is_not_coarse() {
        let map = [412_300.0, 5_653_120.0, 87.0];
        assert_eq!(coarse(&points(map, |v| v)), None);
        assert_eq!(coarse(&points(map, |v| (v * 1e3).round() / 1e3)), None);
        assert_eq!(coarse(&points([0.0; 3], |v| f64::from(v as f32))), None);
        assert_eq!(coarse(&points(map, |v| (v * 4.0).round() / 4.0)[..20]), None);
        // All points on one plane: its axis has no step.
        let flat: Vec<_> = points([0.0; 3], |v| v).iter().map(|p| [p[0], p[1], 2.0]).collect();
        assert_eq!(coarse(&flat), None);
        // A few levels.
        let level = |k: f64| (k * 4.0).round().rem_euclid(5.0) * 0.25;
        let levels: Vec<_> =
            points([0.0; 3], |v| v).iter().map(|p| [p[0], p[1], level(p[2])]).collect();
        assert_eq!(coarse(&levels), None);
    }
}
