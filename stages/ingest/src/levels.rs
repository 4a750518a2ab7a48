//! Chooses the range of intensities that is scaled to 0..65535: the stated one, or that of the
//! values where many lie outside the stated one.

/// Share of intensities outside the limits from which on the limits are wrong; fewer are single
/// bright spots.
const WRONG: f64 = 0.01;
/// Number of values below which nothing is concluded.
const MIN_VALUES: usize = 50;
/// Share of the lowest and of the highest values that is ignored where a range is taken from the
/// values and these lie far from all others: such values mean "none".
const ODD: f64 = 0.001;
/// What counts as far, in ranges of the other values.
const FAR: f64 = 0.5;

/// The values that become 0 and 65535.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Span {
    /// Value that becomes 0.
    pub(crate) min: f64,
    /// Value that becomes 65535.
    pub(crate) max: f64,
}

impl Span {
    /// 65535 divided by the span.
    pub(crate) fn scale(self) -> f64 {
        65_535.0 / (self.max - self.min)
    }

    /// Whether a value is outside and gets clamped. NaN is not counted: it becomes 0.
    #[inline]
    pub(crate) fn cuts(self, value: f64) -> bool {
        // Writers may round limits and values differently.
        let slack = 1e-4 * (self.max - self.min);
        value < self.min - slack || value > self.max + slack
    }

    /// This span where the values keep to it, else the span of the values with a message.
    pub(crate) fn suited(self, values: &[f64], is_stated: bool) -> (Self, Option<String>) {
        let n_outside = values.iter().filter(|v| self.cuts(**v)).count();
        if values.len() < MIN_VALUES || n_outside as f64 <= WRONG * values.len() as f64 {
            return (self, None);
        }
        let mut sorted: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
        sorted.sort_by(f64::total_cmp);
        let (n_odd, last) = ((ODD * sorted.len() as f64).ceil() as usize, sorted.len() - 1);
        let [low, high] = [sorted[n_odd], sorted[last - n_odd]];
        let far = FAR * (high - low);
        let low = if sorted[0] < low - far { low } else { sorted[0] };
        let high = if sorted[last] > high + far { high } else { sorted[last] };
        let seen = Self { min: low.min(self.min), max: high.max(self.max) };
        let whose = if is_stated { "that the file states" } else { "that are usual" };
        let note = format!(
            "{n_outside} of {} intensities looked at lie outside the limits {} to {} {whose}: {} to {} are taken instead",
            values.len(),
            self.min,
            self.max,
            seen.min,
            seen.max
        );
        (seen, Some(note))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNIT: Span = Span { min: 0.0, max: 1.0 };

    #[test]
    fn limits_that_most_values_break_are_not_believed() {
        let counts: Vec<f64> = (0..2048).map(f64::from).collect();
        let (span, note) = UNIT.suited(&counts, true);
        assert_eq!(span, Span { min: 0.0, max: 2047.0 });
        assert!(note.is_some_and(|n| n.starts_with("2046 of 2048")));
        let signed: Vec<f64> = (-2048..2048).map(f64::from).collect();
        assert_eq!(UNIT.suited(&signed, true).0, Span { min: -2048.0, max: 2047.0 });
    }

    #[test]
    fn limits_that_hold_stay_and_a_few_bright_spots_are_cut() {
        let mut values: Vec<f64> = (0..1000).map(|k| f64::from(k) / 999.0).collect();
        assert_eq!(UNIT.suited(&values, true), (UNIT, None));
        values[..5].fill(40.0);
        assert_eq!(UNIT.suited(&values, true), (UNIT, None));
        assert!(UNIT.cuts(40.0) && !UNIT.cuts(1.000_01) && !UNIT.cuts(f64::NAN));
        assert_eq!(UNIT.suited(&[], true), (UNIT, None));
        assert_eq!(UNIT.suited(&[7.0; 20], true), (UNIT, None));
        // Values that mean "none" do not widen the range.
        let mut counts: Vec<f64> = (0..10_000).map(|k| f64::from(k % 256)).collect();
        counts[7] = -1e9;
        assert_eq!(UNIT.suited(&counts, false).0, Span { min: 0.0, max: 255.0 });
    }
}
