//! A number in; what JSON can hold of it out.

/// The number where it is finite, else nothing: JSON has no word for the others.
pub(crate) fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}
