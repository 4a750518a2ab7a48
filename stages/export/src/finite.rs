//! Converts numbers to what JSON can hold.

/// The number if it is finite, otherwise `None`: JSON has neither infinity nor NaN.
pub(crate) fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}
