//! Coordinates in; grid indices and short floats out, each with its range and what happens outside
//! it.

/// A grid index from a coordinate: floor, saturating at the ends of `i32` (NaN gives 0).
#[inline]
#[must_use]
pub fn floor_i32(value: f64) -> i32 {
    // Without SSE4.1 `f64::floor` is a call; this is two instructions.
    let toward_zero = value as i32;
    toward_zero.saturating_sub(i32::from(value < f64::from(toward_zero)))
}

/// A coordinate as `f32`: exact to 2⁻²⁴ of its size (0.02 mm at 200 m), so only for local frames.
#[inline]
#[must_use]
pub fn local_f32(value: f64) -> f32 {
    value as f32
}
