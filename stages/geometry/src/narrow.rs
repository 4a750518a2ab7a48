//! Conversions from coordinates to narrower types, each with its range and its behaviour outside.

/// The floor of a coordinate as a grid index; saturates at the ends of `i32`, NaN gives 0.
#[inline]
#[must_use]
pub fn floor_i32(value: f64) -> i32 {
    // Without SSE4.1 `f64::floor` is a library call; this takes two instructions.
    let toward_zero = value as i32;
    toward_zero.saturating_sub(i32::from(value < f64::from(toward_zero)))
}

/// A coordinate as `f32`. Its relative error is 2⁻²⁴ (0.02 mm at 200 m), so it is only for
/// coordinates in a local frame.
#[inline]
#[must_use]
pub fn local_f32(value: f64) -> f32 {
    value as f32
}
